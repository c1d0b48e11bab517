"""Engine: a pure step function from one machine state to the next. External actions are returned as data."""

"""Engine: a pure step function from one machine state to the next. A step returns external actions as data."""

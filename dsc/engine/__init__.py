"""How a plot runs: a pure step from one state of the machine to the next, actions handed out as data."""

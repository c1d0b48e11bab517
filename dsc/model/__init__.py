"""Model of action plots: frozen values without behaviour. It imports no store, clock, skill or file access."""

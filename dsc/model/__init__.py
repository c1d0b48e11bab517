"""Model of action plots: immutable values without behaviour. The model must import no store, clock, skill or file."""

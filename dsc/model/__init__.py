"""What an action plot is: frozen values, no behaviour. Nothing here knows a store, a clock, a skill or a file."""

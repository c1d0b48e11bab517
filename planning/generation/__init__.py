"""From a plan to an action plot."""

"""Analysis: the simulation that validates a plan, and the reasons for 'no plan'."""

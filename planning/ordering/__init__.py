"""What the steps of a plan do for each other, and which of them wait for which."""

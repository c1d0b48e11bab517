"""Which plot a dynamic state becomes, and why; what a plot's rules make of outcomes."""

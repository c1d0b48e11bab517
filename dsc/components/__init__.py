"""What components are made of: ports, life cycle, dependencies, activation, and how they are reached from afar."""

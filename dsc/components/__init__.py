"""Components: skills and ports, parameters, life cycle, streams, and their use over a transport."""

"""Deployment models: hosts, devices, components, real-time tasks and resources, checked before a robot starts."""

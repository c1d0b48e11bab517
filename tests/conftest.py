"""What holds for every test."""

from hypothesis import HealthCheck, settings

# The same examples every time, and none judged by how busy the machine is; longer searches have targets of their own.
settings.register_profile("same", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("same")

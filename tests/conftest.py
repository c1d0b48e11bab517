"""What holds for every test."""

from functools import cache

import typer.main
import typer.testing
from hypothesis import HealthCheck, Phase, settings

# The same examples every time, and none judged by how busy the machine is; longer searches have targets of their own.
settings.register_profile("same", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("same")
# For `make mutation`: whether a test fails counts, so that the example needs not be made smaller.
settings.register_profile("mutation", settings.get_profile("same"), phases=(Phase.explicit, Phase.generate))

# Typer makes the commands of an app anew at each call, which took a fifth of the time of all tests.
typer.main.get_command = typer.testing._get_command = cache(typer.main.get_command)  # type: ignore[attr-defined]

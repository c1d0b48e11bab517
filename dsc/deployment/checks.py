"""All checks of a deployment model together."""

from __future__ import annotations

from dsc.deployment.capacities import check_resources
from dsc.deployment.deadlines import check_deadlines
from dsc.deployment.hardware import check_hardware
from dsc.deployment.model import Deployment
from dsc.deployment.placement import check_placement
from dsc.errors import Finding


def check_deployment(deployment: Deployment) -> list[Finding]:
    """Return the mistakes of a deployment model; the other checks need a placement without mistakes."""
    if placement := list(check_placement(deployment)):
        return placement
    return [*check_hardware(deployment), *check_resources(deployment), *check_deadlines(deployment)]

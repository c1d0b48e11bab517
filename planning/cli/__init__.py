"""Commands `dsc plan`, `dsc doctor` and `dsc bundles`: find a plan, and list engines and bundles.

The commands import their modules inside the function, so that `dsc --help` stays light.
"""

from __future__ import annotations

from planning.cli.commands import bundles_command as bundles_command
from planning.cli.commands import doctor_command as doctor_command
from planning.cli.commands import plan_command as plan_command

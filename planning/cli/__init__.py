"""`dsc plan`, `dsc doctor` and `dsc bundles`: ask for a plan, and see what there is to plan and to build with.

The commands import what they run, so that `dsc --help` stays light.
"""

from __future__ import annotations

from planning.cli.commands import bundles_command as bundles_command
from planning.cli.commands import doctor_command as doctor_command
from planning.cli.commands import plan_command as plan_command

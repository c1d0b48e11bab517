"""`dsc plan` and `dsc doctor`: ask for a plan on the command line, and see what there is to plan with.

The commands import what they run, so that `dsc --help` stays light.
"""

from __future__ import annotations

from planning.cli.doctor import doctor_command as doctor_command
from planning.cli.plan import plan_command as plan_command

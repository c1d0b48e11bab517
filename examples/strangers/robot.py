"""A robot of three bundles by strangers: the integrator joins them, and chooses the laser of the map.

dsc wiring examples/strangers/robot.py --profile examples/strangers/backwards.yaml
dsc deployment check examples/strangers/lab.yaml
"""

from itertools import chain
from pathlib import Path

import laser_maker
import map_maker
import power_maker

from dsc import load_profile
from planning import Bundle, Robot

PARTS = (laser_maker.bundle, map_maker.bundle, power_maker.bundle)
robot = Bundle(
    "surveyor",
    plots=tuple(chain.from_iterable(part.plots for part in PARTS)),
    components=lambda: chain.from_iterable(part.components() for part in PARTS),
    main="survey",
    wiring={"cartographer.scan": "front.echo"},
)

if __name__ == "__main__":
    with Robot.of_bundles([robot], clock="simulated") as forwards:
        print(forwards.run("survey").outputs)
    profile = load_profile(Path(__file__).with_name("backwards.yaml"))
    with Robot.of_bundles([robot], clock="simulated", profile=profile) as backwards:
        print(backwards.run("survey").outputs)

# Expected output:
# {'metres': 1.0, 'hours': 1.5}
# {'metres': 2.0, 'hours': 1.5}

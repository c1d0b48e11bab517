"""The robot: all parts together. `dsc run .` finds it by the entry point in pyproject.toml."""

from pathlib import Path

from planning import Bundle

from .simulation import House

robot = Bundle.in_folder(
    Path(__file__).parent,  # plots/*.yaml, domain.pddl, profiles/*.yaml
    name="my_robot",
    about="deliver parcels in a house",
    main="deliver_all",
    simulation=House,
)

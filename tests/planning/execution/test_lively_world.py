"""Steps continue, and goals are reached, in a world that others change every half second."""

import pytest
from lively_world import LivelyWorld


@pytest.mark.parametrize("robots", [("x",), ("x", "y")], ids=["one robot", "two robots"])
@pytest.mark.parametrize("moving", [0.0, 0.5], ids=["lamps", "things"])
def test_a_step_that_stays_in_the_plan_is_not_interrupted(robots, moving):
    world = LivelyWorld(robots, seconds=60, seed=7, moving=moving)
    assert world.changes == 120
    assert world.count("done") >= 10
    assert not world.interrupted()
    assert set(world.ended) <= {"reached"}


def test_changes_that_no_step_needs_interrupt_nothing():
    world = LivelyWorld(("x",), seconds=60, seed=3, moving=0.0, coming=0.0)
    assert (world.ended["reached"], world.count("cancelled")) == (1, 0)
    assert [str(step) for how, step, _ in world.crew[0].log if how == "done"] == [
        "(take x t0 a)",
        "(go x a d)",
        "(put x t0 d)",
    ]

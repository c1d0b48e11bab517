"""Promises that random robots keep, whole and killed; `make soak-robots` tries thousands."""

import pytest
from random_robots import Trial

from dsc.errors import PlotError


@pytest.mark.parametrize("seed", range(20))
def test_a_random_robot_keeps_every_promise(seed):
    try:
        trial = Trial(seed)
    except PlotError:
        pytest.skip("the plot has a rule that no state can follow")
    assert trial.wrong == []

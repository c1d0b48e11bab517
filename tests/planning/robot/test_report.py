"""The report of a run calls no run a success whose main plot ended in a failure."""

from __future__ import annotations

import pytest

from dsc import Component, parse_plot
from planning import Bundle, deploy
from planning.robot.simulation import Left, Simulation

MAIN = """
plot: tidy_up
emits: {tidied: , stuck: }
states:
  wait: {after: {seconds: 1, to: over, emit: END}}
  over: {final: true}
"""


class Tidy(Simulation):
    """A world in which nothing is left to do."""

    def components(self) -> list[Component]:
        return []

    def left(self) -> list[Left]:
        return []


@pytest.mark.parametrize(
    ("end", "headline"),
    [
        ("tidied", "Goal reached (judge: world)"),
        ("stuck", "Goal not reached: the plot ended with 'stuck' (judge: world)"),
    ],
)
def test_a_failure_of_the_main_plot_is_no_success_even_if_nothing_is_left(end: str, headline: str) -> None:
    main = parse_plot(MAIN.replace("END", end))
    with deploy(Bundle("r", plots=(main,), main="tidy_up", simulation=Tidy, failures={"stuck"})) as deployed:
        report = deployed.report()
    assert (report.headline, report.goal_reached, report.left) == (headline, end == "tidied", ())

"""Robots whose plots watch conditions over several components and the knowledge (S2.4, S2.18)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from dsc import Component, Outcome, Push, SkillCall, has_run, is_unfinished, parse_plot, skill
from dsc.errors import PlotError
from dsc.testing import Crashes, one_history, replays, violations
from knowledge_base.errors import SchemaError
from planning import Robot

DOMAIN = "(define (domain d) (:predicates (wanted)))"
PLOT = """
plot: main
states:
  approach:
    entry:
      - {trigger: hand.approach, as: {arrived: end_of_way}}
      - {trigger: conditions.watch_truth, with: {condition: '"(and (wanted) (< hand.way.left 3) (> wrist.force.n 1))"'}}
    regions:
      order: {states: {rest: {after: {seconds: 2, to: ordered, tell: "(wanted)"}}, ordered: {}}}
    on: {became_true: over, became_false: {}, end_of_way: missed}
  over: {final: true}
  missed: {final: true}
"""


class Arrived(Outcome): ...


class Hand(Component):
    name = "hand"
    way = Push({"left": "number"})

    @skill(after_crash="repeat")
    async def approach(self, call: SkillCall) -> Arrived:
        for left in range(9, 0, -1):
            self.way.put(left=left)
            await call.clock.sleep(0.5)
        return Arrived()


class Wrist(Component):
    name = "wrist"
    force = Push({"n": "number"})

    async def start(self) -> None:
        self.force.put(n=2)


def robot(**how: Any) -> Robot:
    return Robot(DOMAIN, [parse_plot(PLOT)], [Hand(), Wrist()], clock="simulated", **how)


def test_a_robot_that_watches_three_sources_ends_when_all_agree():
    with robot() as it:
        end = it.run("main")
    assert end.reached


@pytest.mark.parametrize("seed", range(10))
def test_a_resumed_run_watches_again(seed, tmp_path):
    crashes: Crashes[Any] = Crashes(tmp_path, seed, chance=0.1, most=3)

    def live(folder: Path) -> Any:
        store = folder / "run.kb"
        with robot(store=store) as it:
            if not has_run(store):
                return it.run("main", prepare=crashes.watch).reached
            return it.resume(prepare=crashes.watch).reached if is_unfinished(store) else True

    assert crashes.survive(live)
    assert violations(crashes.folder / "run.kb", [one_history, replays()]) == []


def test_the_name_of_the_handler_is_taken():
    class Conditions(Component):
        name = "conditions"

    with pytest.raises(SchemaError, match="two components are named 'conditions'"):
        Robot(DOMAIN, [], [Conditions()])


def test_a_misspelt_skill_of_the_handler_is_a_finding():
    with pytest.raises(PlotError, match=r"did you mean 'conditions\.watch_truth'"):
        Robot(DOMAIN, [parse_plot(PLOT.replace("watch_truth", "watch_thruth"))], [Hand(), Wrist()])

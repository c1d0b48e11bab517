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


class Thermometer(Component):
    name = "thermometer"
    air = Push({"celsius": "number"})

    async def start(self) -> None:
        self.air.put(celsius=24)


class WarmingThermometer(Component):
    name = "thermometer"
    air = Push({"celsius": "number"})
    period = 1.0
    celsius = 24

    async def step(self) -> None:
        self.celsius += 1
        self.air.put(celsius=self.celsius)


ALONE = """
plot: p
states:
  w: {entry: {trigger: %s, with: %s}, on: {became_true: over, became_false: {}}}
  over: {final: true}
"""


@pytest.mark.parametrize("source", [Thermometer, WarmingThermometer])
@pytest.mark.parametrize("more", ["", ", hold: 3"])
@pytest.mark.parametrize(
    ("skill_name", "condition"),
    [
        ("conditions.watch_truth", "(> thermometer.air.celsius 20)"),
        ("conditions.watch_truth", "(or (wanted) (silent thermometer.air 0.5))"),
        ("thermometer.watch_values", "(> air.celsius 20)"),
        ("thermometer.watch_values", "(silent air 0.5)"),
    ],
)
def test_a_run_with_nothing_but_a_watched_condition(skill_name, condition, more, source):
    if "silent" in condition and more and source is WarmingThermometer:
        pytest.skip("this thermometer is never silent for three seconds")
    text = ALONE % (skill_name, "{condition: '\"" + condition + "\"'" + more + "}")
    with Robot(DOMAIN, [parse_plot(text)], [source()], clock="simulated") as it:
        end = it.run("p", until=100)
    assert end.reached, end


def test_a_run_with_a_periodic_source_that_becomes_true_later():
    text = ALONE % ("conditions.watch_truth", "{condition: '\"(> thermometer.air.celsius 30)\"'}")
    with Robot(DOMAIN, [parse_plot(text)], [WarmingThermometer()], clock="simulated") as it:
        assert it.run("p", until=100).reached


def test_the_message_of_a_condition_that_nothing_can_make_true():
    text = ALONE % ("conditions.watch_truth", "{condition: '\"(> thermometer.air.celsius 30)\"'}")
    with Robot(DOMAIN, [parse_plot(text)], [Thermometer()], clock="simulated") as it:
        end = it.run("p")
    assert end.problem == (
        "deadlock: no skill, timer or event is pending; "
        "conditions.watch_truth of state 'w' waits for the outside (open_ended)"
    )

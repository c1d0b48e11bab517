"""Choice among candidates: by order, by priority, learned, and by an oracle; see docs/plots.md.

`python benchmarks/choice.py [--runs N] [--json]`: a robot grips ten items, half of them wet. Its hand is quick and
mostly slips from wet items; its suction is slow and holds. It puts each item to the left or to the right, which does
not matter. Each run has other slips; the runs of learning are not among those of the comparison.
"""

import argparse
import json
import math
from statistics import mean, stdev

from dsc import ActionPlot, Component, Outcome, SkillCall, parse_plot, skill
from dsc.chance import uniform
from dsc.dynamic.experience import Experience
from dsc.runs.learning import tries_in
from dsc.trace import Record
from knowledge_base import Delta, fact
from planning import Robot

ITEMS = tuple(f"item{number}" for number in range(10))
WET = ITEMS[::2]
DOMAIN = "(define (domain grip) (:types item) (:predicates (wet ?i - item)))"
MAIN = """
plot: main
variables: {{item: {{type: item, initial: item0}}}}
outputs: {{slips: {{type: number, initial: 0}}}}
states:
  next: {{entry: {{trigger: tray.next}}, on: {{found: {{to: grip, assign: {{item: ?event.item}}}}, empty: over}}}}
  grip:
    dynamic: [hand, suction]
    with: {{item: ?item}}
    choose: {choose}
    situation: [(wet ?item)]
    explore: {explore}
    on: {{done: put, slipped: {{to: grip, assign: {{slips: (+ ?slips 1)}}}}, no_candidate: over}}
  put:
    dynamic: [left, right]
    with: {{item: ?item}}
    choose: {choose}
    explore: {explore}
    on: {{done: next, no_candidate: over}}
  over: {{final: true}}
"""
CANDIDATE = """
plot: {name}
parameters: {{item: {{type: item}}}}
{more}
states:
  act: {{entry: {{trigger: arm.{name}, with: {{item: ?item}}}}, on: {{held: end{on}}}}}
  end: {{final: true}}{slip}
"""


class Found(Outcome):
    """The next item."""

    item: str


class Empty(Outcome):
    """No item is left."""


class Held(Outcome):
    """The item is in the gripper, or in its place."""


class Slipped(Outcome):
    """The item has slipped."""


class Tray(Component):
    """A tray with all items."""

    name = "tray"

    def __init__(self) -> None:
        super().__init__()
        self.left = [*ITEMS]

    @skill
    async def next(self, call: SkillCall) -> Found | Empty:  # noqa: ARG002  a skill has it
        return Found(item=self.left.pop(0)) if self.left else Empty()


class Arm(Component):
    """An arm whose hand slips from four of five wet items, and from one of twenty dry ones."""

    name = "arm"

    def __init__(self, seed: int) -> None:
        super().__init__()
        self.seed = seed

    @skill
    async def hand(self, call: SkillCall, item: str) -> Held | Slipped:
        await call.clock.sleep(2)
        chance = 0.8 if item in WET else 0.05
        return Slipped() if uniform(self.seed, call.action_id, "slip") < chance else Held()

    @skill
    async def suction(self, call: SkillCall, item: str) -> Held:  # noqa: ARG002  it holds every item
        await call.clock.sleep(5)
        return Held()

    @skill
    async def left(self, call: SkillCall, item: str) -> Held:  # noqa: ARG002  it holds every item
        await call.clock.sleep(1)
        return Held()

    @skill
    async def right(self, call: SkillCall, item: str) -> Held:  # noqa: ARG002  it holds every item
        await call.clock.sleep(1)
        return Held()


def plots_for(choose: str, explore: float, *, oracle: bool) -> list[ActionPlot]:
    """Return the plots; with the oracle, the hand grips only dry items."""
    hand = "when: (not (wet ?item))" if oracle else ""
    return [
        parse_plot(MAIN.format(choose=choose, explore=explore)),
        parse_plot(CANDIDATE.format(
            name="hand", more=f"{hand}\npriority: 1\nemits: {{slipped: }}", on=", slipped: slip",
            slip="\n  slip: {final: true, emit: slipped}",
        )),
        *(parse_plot(CANDIDATE.format(name=name, more=f"priority: {priority}", on="", slip=""))
          for name, priority in (("suction", 2), ("left", 1), ("right", 1))),
    ]  # fmt: skip


def ran(seed: int, choose: str, explore: float = 0.0, experience: Experience | None = None, *, oracle: bool = False):
    """Return the seconds, the slips and the records of a run."""
    robot = Robot(
        DOMAIN, plots_for(choose, explore, oracle=oracle), [Tray(), Arm(seed)], clock="simulated", experience=experience
    )
    robot.knowledge.apply(Delta(dict.fromkeys(ITEMS, "item"), added=tuple(fact("wet", one) for one in WET)), "bench")
    records: list[Record] = []
    robot.listen(records.append)
    with robot:
        end = robot.run("main")
    assert end.reached, end
    return records[-1].t, end.outputs["slips"], records


def figures(values: list[float]) -> dict[str, float]:
    """Return the mean with the half width of its 95 % confidence interval."""
    return {"mean": mean(values), "within": 1.96 * stdev(values) / math.sqrt(len(values))}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=200, help="number of runs of each choice")
    parser.add_argument("--json", action="store_true", help="plain data")
    options = parser.parse_args()
    experience = Experience()
    for seed in range(10_000, 10_000 + max(10, options.runs // 10)):
        experience = experience.plus(tries_in(ran(seed, "learned", 0.3)[2]))
    ways = {
        "order": ("order", None, False), "priority": ("priority", None, False),
        "learned": ("learned", experience, False), "oracle": ("order", None, True),
    }  # fmt: skip
    found = {}
    for name, (choose, known, oracle) in ways.items():
        runs = [ran(seed, choose, 0.0, known, oracle=oracle)[:2] for seed in range(options.runs)]
        found[name] = {"seconds": figures([one for one, _ in runs]), "slips": figures([one for _, one in runs])}
    if options.json:
        print(json.dumps({"runs": options.runs, "choices": found, "experience": experience.to_form()}))
        return
    print("| choice | seconds | slips |\n| --- | --- | --- |")
    for name, one in found.items():
        cells = ["{mean:.1f} ± {within:.1f}".format(**one[what]) for what in ("seconds", "slips")]
        print(f"| {name} | {' | '.join(cells)} |")
    print("\n" + "\n".join(f"{key}: {tries}" for key, tries in sorted(experience.tries.items())))


if __name__ == "__main__":
    main()

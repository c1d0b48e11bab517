"""Plans by experience on the clean-up table: falls, trips and simulated time with and without learned costs.

`python benchmarks/learned_costs.py [--runs N] [--learned N] [--items N] [--engine NAME] [--patience S] [--json]`: each
plan is the best that the engine finds in some seconds of real time, since only improved plans regard costs. The runs of
learning are not among those of the comparison. Each run has other faults, with probability 0.2 for each skill call.
The figures of each run go to standard error, pair by pair, so that a run cut short leaves them.
"""

import argparse
import itertools
import json
import sys
import time
from collections.abc import Sequence
from contextlib import aclosing, suppress

from choice import figures

from domains.clean_up_table.bringup import MAIN_PLOT, deploy
from domains.clean_up_table.scenario import Scenario, Table
from dsc.dynamic.experience import Experience
from dsc.runs.learning import tries_in
from dsc.trace import Record
from planning import PlannerProcess
from planning.execution.planner_call import LateError, bounded
from planning.model.plan import PlanningOutcome
from planning.model.problem import Problem

FAULTS = 0.2


class BestInTime:
    """A planner that returns the best plan that an engine finds within `patience` seconds after the first one."""

    def __init__(self, engine: str, patience: float) -> None:
        self._planner, self._patience = PlannerProcess(engine), patience

    async def solve(self, problem: Problem, seconds: float) -> PlanningOutcome:
        async with aclosing(self._planner.plans(problem, seconds)) as plans:
            best = await anext(plans)
            until = time.monotonic() + self._patience
            with suppress(LateError, StopAsyncIteration):
                while (left := until - time.monotonic()) > 0:  # the event loop has simulated time
                    best = await bounded(anext(plans), left, self._planner.engine)
        return best

    async def close(self) -> None:
        await self._planner.close()

    def kill(self) -> None:
        self._planner.kill()


def table(items: int) -> Scenario:
    """Return a scenario with this number of items: 4 cups to 3 cans to 2 crisp cans."""
    crisps, cans = items * 2 // 9, items * 3 // 9
    sizes = [("small", "large")[number % 2] for number in range(crisps)]
    return Scenario(table=Table(cups=items - cans - crisps, cans=cans, crisp_cans=tuple(sizes)))


def ran(scenario: Scenario, seed: int, engine: str, patience: float, experience: Experience) -> list[Record]:
    """Return the records of a run."""
    records: list[Record] = []
    with deploy(scenario, seed, FAULTS, BestInTime(engine, patience), records.append) as robot:
        robot.experience = experience
        robot.run(MAIN_PLOT)
    return records


def counted(records: Sequence[Record]) -> dict[str, float]:
    """Return the falls, the trips and the seconds of a run."""
    events = [one.data["name"] for one in records if one.type == "event"]
    return {"falls": events.count("stack_fell"), "trips": events.count("arrived"), "seconds": records[-1].t}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=40, help="number of runs of each kind")
    parser.add_argument("--learned", type=int, default=20, help="number of runs of learning")
    parser.add_argument("--items", type=int, default=32, help="number of items on the table")
    parser.add_argument("--engine", default="fast-downward", help="an engine that has costs")
    parser.add_argument("--patience", type=float, default=1.0, help="seconds of real time for better plans")
    parser.add_argument("--json", action="store_true", help="plain data")
    options = parser.parse_args()
    scenario, how = table(options.items), (options.engine, options.patience)
    experience = Experience()
    for seed in range(10_000, 10_000 + options.learned):
        experience = experience.plus(tries_in(ran(scenario, seed, *how, Experience()), steps=True))
        print(f"learned from seed {seed}", file=sys.stderr, flush=True)
    costs = {"each step costs 1": Experience(), "learned costs": experience}
    runs: dict[str, list[dict[str, float]]] = {name: [] for name in costs}
    for seed, (name, known) in itertools.product(range(options.runs), costs.items()):
        runs[name].append(counted(ran(scenario, seed, *how, known)))
        print(f"seed {seed}, {name}: {runs[name][-1]}", file=sys.stderr, flush=True)
    found = {name: {what: figures([one[what] for one in some]) for what in some[0]} for name, some in runs.items()}
    if options.json:
        print(json.dumps({"runs": options.runs, "costs": found}))
        return
    print("| costs | falls | trips | simulated seconds |\n| --- | --- | --- | --- |")
    for name, one in found.items():
        cells = ["{mean:.1f} ± {within:.1f}".format(**one[what]) for what in ("falls", "trips", "seconds")]
        print(f"| {name} | {' | '.join(cells)} |")
    actions = sorted({action for action, _, _ in experience.tries})
    print("\n" + "\n".join(f"{action}: {experience.seconds_for(action, ''):.1f} s" for action in actions))


if __name__ == "__main__":
    main()

"""A robot that lives for days with a store: one goal a minute, and many suspensions with resumes.

`python tests/support/days_soak.py --days 3` serves goals in simulated time, and measures memory, file and duration.
`--suspensions 200` suspends runs at random moments, and requires that each action is executed once.
"""

from __future__ import annotations

import argparse
import asyncio
import gc
import json
import sys
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import NamedTuple, NewType

from dsc import Component, Outcome, SkillCall, primitive_plot, run_simulated, skill
from knowledge_base import Delta, fact
from planning import PlanningDomain, Robot

DOMAIN = PlanningDomain.parse("""
(define (domain rounds)
  (:types place thing)
  (:predicates (at ?p - place) (in ?t - thing ?p - place) (holding ?t - thing) (free))
  (:action go :parameters (?a ?b - place) :precondition (at ?a) :effect (and (not (at ?a)) (at ?b)))
  (:action take :parameters (?t - thing ?p - place) :precondition (and (at ?p) (in ?t ?p) (free))
    :effect (and (not (in ?t ?p)) (not (free)) (holding ?t)))
  (:action put :parameters (?t - thing ?p - place) :precondition (and (at ?p) (holding ?t))
    :effect (and (not (holding ?t)) (in ?t ?p) (free))))
""")
PLACES, THINGS = "abcd", ("cup", "book")
WORLD = Delta(
    nodes={**dict.fromkeys(PLACES, "place"), **dict.fromkeys(THINGS, "thing")},
    added=(fact("at", "a"), fact("free"), fact("in", "cup", "b"), fact("in", "book", "c")),
)
DAY, MINUTE, ACT = 86_400.0, 60.0, 4.0
Place = NewType("Place", str)
Thing = NewType("Thing", str)


class Acted(Outcome): ...


class Body(Component):
    """The robot's body.

    Attributes:
        executed: the number of executions by key of the call, as an idempotent service would count them.
    """

    name = "body"

    def __init__(self) -> None:
        super().__init__()
        self.executed: Counter[str] = Counter()

    @skill(after_crash="repeat")
    async def go(self, call: SkillCall, a: Place, b: Place) -> Acted:
        return await self._act(call, Delta(added=(fact("at", b),), removed=(fact("at", a),)))

    @skill(after_crash="repeat")
    async def take(self, call: SkillCall, t: Thing, p: Place) -> Acted:
        return await self._act(call, Delta(added=(fact("holding", t),), removed=(fact("in", t, p), fact("free"))))

    @skill(after_crash="repeat")
    async def put(self, call: SkillCall, t: Thing, p: Place) -> Acted:
        return await self._act(call, Delta(added=(fact("in", t, p), fact("free")), removed=(fact("holding", t),)))

    async def _act(self, call: SkillCall, observed: Delta) -> Acted:
        await call.clock.sleep(ACT)
        self.executed[call.key] += 1
        return Acted(observed=observed)


def robot(store: Path, body: Body) -> Robot:
    """Return the robot, with its world in the store."""
    plots = [primitive_plot(one, done="acted", implements=name) for name, one in body.skills().items()]
    made = Robot(DOMAIN, plots, [body], store=store, clock="simulated")
    if not made.knowledge.nodes():
        made.knowledge.apply(WORLD, "start")
    return made


def goal(chance: Random) -> str:
    """Return a goal: a thing at a place."""
    return f"(in {chance.choice(THINGS)} {chance.choice(PLACES)})"


class Sample(NamedTuple):
    """Figures after a number of goals: resident bytes, blocks in use, bytes of the store and its log, real seconds."""

    goals: int
    rss: int
    blocks: int
    file: int
    log: int
    seconds: float


def sampled(goals: int, store: Path, began: float) -> Sample:
    """Return the figures now."""
    gc.collect()
    rss = int(Path("/proc/self/statm").read_text("ascii").split()[1]) * 4096
    log = store.with_name(store.name + "-wal").stat().st_size
    return Sample(goals, rss, sys.getallocatedblocks(), store.stat().st_size, log, time.perf_counter() - began)


async def days(store: Path, goals: int, seed: int, keep: int | None) -> list[Sample]:
    """Serve one goal a minute, and return a sample at each tenth; with `keep`, prune the store every simulated day."""
    chance, began, samples = Random(seed), time.perf_counter(), list[Sample]()
    async with robot(store, Body()) as one:
        served = asyncio.create_task(one.serve())
        for number in range(1, goals + 1):
            one.goals.put(goal(chance))
            await asyncio.sleep(MINUTE)
            if keep is not None and number % int(DAY / MINUTE) == 0:
                one.prune(keep)
            if number % (goals // 10) == 0:
                samples.append(sampled(number, store, began))
        served.cancel()
        with suppress(asyncio.CancelledError):
            await served
        failed = one.goals.list("failed", "waiting", "running")
        assert not failed, failed[:3]
    return samples


def slopes(samples: list[Sample]) -> dict[str, float]:
    """Return the growth per goal after the first tenth, and how much slower the last tenth of the goals was."""
    (first, second), (before, last) = samples[:2], samples[-2:]
    goals = last.goals - first.goals
    return {
        "memory_bytes_per_goal": round((last.rss - first.rss) / goals),
        "store_bytes_per_goal": round((last.file + last.log - first.file - first.log) / goals),
        "last_tenth_slower": round((last.seconds - before.seconds) / (second.seconds - first.seconds), 2),
    }


def suspensions(store: Path, cycles: int, seed: int) -> Counter[str]:
    """Suspend runs at random moments and resume them; return the executions of each action."""
    chance, executed = Random(seed), Counter[str]()

    async def life() -> None:
        body = Body()
        async with robot(store, body) as one:
            while True:
                run = one.resume_or_start(goal(chance))
                moment = chance.uniform(0.0, 4 * ACT)
                done, _ = await asyncio.wait([run.task], timeout=moment)
                if not done:
                    break
                assert (await run).reached, (await run).reason
        executed.update(body.executed)

    for _ in range(cycles):
        run_simulated(life())
    return executed


def main() -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--days", type=float, default=0.0)
    parser.add_argument("--keep", type=int)
    parser.add_argument("--suspensions", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    with TemporaryDirectory() as folder:
        store = Path(folder) / "robot.kb"
        if given.days:
            goals = int(given.days * DAY / MINUTE)
            samples = run_simulated(days(store, goals, given.seed, given.keep))
            for one in samples:
                print(json.dumps(one._asdict()))
            print(json.dumps(slopes(samples)))
        if given.suspensions:
            executed = suspensions(Path(folder) / "suspended.kb", given.suspensions, given.seed)
            repeated = [key for key, times in executed.items() if times > 1]
            print(json.dumps({"suspensions": given.suspensions, "actions": len(executed), "repeated": repeated}))
            return int(bool(repeated))
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Longest time for which the event loop of a program stands still while a robot in it plans and acts.

A rollout: each server leaves its pool, gets a release, and enters the pool again; a step is one skill, which answers
immediately. The time is the processor time of one turn of the loop, so that other load hardly counts. The program's
garbage collection has the interpreter's thresholds, or is off.
"""

from __future__ import annotations

import argparse
import asyncio
import gc
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NewType

from dsc import Component, Outcome, SkillCall, primitive_plot, skill
from knowledge_base import Delta, fact
from planning import PlanningDomain, Robot

DOMAIN = PlanningDomain.parse("""
(define (domain rollout)
  (:types server release)
  (:predicates (in-pool ?s - server) (runs ?s - server ?r - release) (approved ?r - release))
  (:action drain :parameters (?s - server) :precondition (in-pool ?s) :effect (not (in-pool ?s)))
  (:action install :parameters (?s - server ?r - release)
     :precondition (and (not (in-pool ?s)) (approved ?r)) :effect (runs ?s ?r))
  (:action admit :parameters (?s - server) :precondition (not (in-pool ?s)) :effect (in-pool ?s)))
""")
GOAL = "(forall (?s - server) (and (in-pool ?s) (runs ?s v2)))"
SERVERS = (20, 60, 120)

Server = NewType("Server", str)
Release = NewType("Release", str)


class Changed(Outcome):
    """The event `changed`."""


class _Pool(Component):
    name = "pool"

    @skill
    async def drain(self, call: SkillCall, s: Server) -> Changed:  # noqa: ARG002
        return Changed(observed=Delta(removed=(fact("in-pool", s),)))

    @skill
    async def install(self, call: SkillCall, s: Server, r: Release) -> Changed:  # noqa: ARG002
        return Changed(observed=Delta(added=(fact("runs", s, r),)))

    @skill
    async def admit(self, call: SkillCall, s: Server) -> Changed:  # noqa: ARG002
        return Changed(observed=Delta(added=(fact("in-pool", s),)))


def rollout(servers: int) -> Robot:
    """Return a robot that rolls out a release on a number of servers, in real time."""
    pool = _Pool()
    plots = [primitive_plot(one, done="changed", implements=name) for name, one in pool.skills().items()]
    robot = Robot(DOMAIN, plots, [pool], parallel=True, clock="real")
    names = [f"web{number}" for number in range(servers)]
    nodes = {**dict.fromkeys(names, "server"), "v2": "release"}
    begin = (fact("approved", "v2"), *(fact("in-pool", name) for name in names))
    robot.knowledge.apply(Delta(nodes=nodes, added=begin), author="inventory")
    return robot


def longest_turn(servers: int) -> float:
    """Return the processor time of the longest turn of the loop during one rollout, in milliseconds."""

    async def run(robot: Robot) -> float:
        with _turns() as spent:
            assert await robot.achieving(GOAL, seconds=300)
        return 1000 * max(spent)

    with rollout(servers) as robot:
        return asyncio.run(run(robot))


@contextmanager
def _turns() -> Iterator[list[float]]:
    """Measure each call of the loop."""
    spent: list[float] = []
    call = asyncio.events.Handle._run  # noqa: SLF001

    def clocked(handle: asyncio.Handle) -> None:
        started = time.thread_time()
        call(handle)  # type: ignore[arg-type]
        spent.append(time.thread_time() - started)

    asyncio.events.Handle._run = clocked  # type: ignore[method-assign]  # noqa: SLF001
    try:
        yield spent
    finally:
        asyncio.events.Handle._run = call  # type: ignore[method-assign]  # noqa: SLF001


def main() -> None:
    """Print the longest turn for each number of servers, each in its own process."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--servers", type=int, help="measure one number of servers in this process")
    parser.add_argument("--uncollected", action="store_true", help="switch the garbage collection off")
    said = parser.parse_args()
    if said.servers is not None:
        if said.uncollected:
            gc.disable()
        print(f"{longest_turn(said.servers):.0f}")
        return
    print("servers  steps  longest turn  without garbage collection")
    for servers in SERVERS:
        command = [sys.executable, __file__, "--servers", str(servers)]
        found = [
            subprocess.run([*command, *option], capture_output=True, text=True, check=True).stdout.strip()
            for option in ((), ("--uncollected",))
        ]
        print(f"{servers:7}  {3 * servers:5}  {found[0]:>9} ms  {found[1]:>23} ms", flush=True)


if __name__ == "__main__":
    main()

"""Robots that carry things to a room, in a world that others change every half second, and what must be true of it.

Somebody moves things, brings new ones and switches lamps. Each call takes as long as a robot takes. With `--hours` as a
command.
"""

from __future__ import annotations

import argparse
import asyncio
from collections import Counter
from dataclasses import dataclass, field
from random import Random

from dsc import ActionPlot, Component, Outcome, SkillCall, parse_plot, skill
from dsc.trace import Record
from knowledge_base import Delta, KnowledgeBase, fact
from planning import PlanningDomain, PlanStep, Robot

DOMAIN = PlanningDomain.parse("""
(define (domain crew)
  (:types room thing robot)
  (:predicates (at ?x - robot ?r - room) (in ?t - thing ?r - room) (holding ?x - robot ?t - thing) (free ?x - robot)
    (lit ?r - room))
  (:action go :parameters (?x - robot ?from ?to - room)
    :precondition (at ?x ?from) :effect (and (not (at ?x ?from)) (at ?x ?to)))
  (:action take :parameters (?x - robot ?t - thing ?r - room)
    :precondition (and (at ?x ?r) (in ?t ?r) (free ?x))
    :effect (and (not (in ?t ?r)) (holding ?x ?t) (not (free ?x))))
  (:action put :parameters (?x - robot ?t - thing ?r - room)
    :precondition (and (at ?x ?r) (holding ?x ?t))
    :effect (and (not (holding ?x ?t)) (in ?t ?r) (free ?x))))
""")
SECONDS = {"go": 5.0, "take": 2.0, "put": 2.0}
EVERY = 0.5
"""Seconds between two changes by others."""
ROOMS = "abcd"
MOST_THINGS = 6
TIDY = """
plot: tidy
emits: {ended: {how: text}}
states:
  all:
    after: {seconds: LIMIT, to: over}
    states:
      wait:
        always: {when: (exists (?t - thing) (not (in ?t d))), to: work}
      work:
        goal: (forall (?t - thing) (in ?t d))
        on:
          done: {to: wait, emit: ended, with: {how: reached}}
          no_plan: {to: wait, emit: ended, with: {how: ?event.reason}}
          gave_up: {to: wait, emit: ended, with: {how: ?event.reason}}
  over: {final: true}
"""


class Did(Outcome): ...


class Arm(Component):
    """Carries out the steps that name it, and keeps a log of when each began, and how it ended."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self.name = name
        self.log: list[tuple[str, PlanStep, float]] = []
        self.knowledge = KnowledgeBase(DOMAIN.schema)

    @skill
    async def act(self, call: SkillCall, action: str, one: str, two: str, three: str = "") -> Did:
        """One planning action, which takes its time."""
        step = PlanStep(action, tuple(filter(None, (one, two, three))))
        how = "cancelled"
        self.log.append(("begun", step, call.clock.now()))
        try:
            await call.clock.sleep(SECONDS[action])
            how = "done"
        finally:
            self.log.append((how, step, call.clock.now()))
        return Did(observed=DOMAIN.effects(step, self.knowledge))


def plots(robots):
    """A plot for each planning action and each robot."""
    for action in DOMAIN.actions.values():
        given = dict(zip(("one", "two", "three"), [f"?{one.name}" for one in action.parameters], strict=False))
        for robot in robots:
            trigger = {"trigger": f"{robot}.act", "with": {"action": action.name, **given}}
            yield ActionPlot.model_validate(
                {
                    "plot": f"{action.name}_{robot}",
                    "implements": action.name,
                    "when": f"(= ?x {robot})",
                    "parameters": {one.name: one.types[0] for one in action.parameters},
                    "emits": {},
                    "states": {"act": {"entry": trigger, "on": {"did": "acted"}}, "acted": {"final": True}},
                }
            )


@dataclass
class LivelyWorld:
    """One run in a world that others change.

    Args:
        robots: the names of the robots.
        seconds: simulated seconds that the run takes.
        seed: of the changes.
        moving, coming: the probability that a change moves a thing, and that it brings a new one. Others switch a lamp.

    Attributes:
        ended: how often the goal was reached, and each other end of a search for it.
        records: the trace of the run.
        changes: the number of changes by others.
    """

    robots: tuple[str, ...]
    seconds: float
    seed: int
    moving: float = 0.5
    coming: float = 0.05
    ended: Counter[str] = field(default_factory=Counter)
    records: list[Record] = field(default_factory=list)
    changes: int = 0

    def __post_init__(self) -> None:
        self._random = Random(self.seed)
        self.crew = [Arm(name) for name in self.robots]
        tidy = parse_plot(TIDY.replace("LIMIT", f"{self.seconds}"))
        program = Robot(DOMAIN, [tidy, *plots(self.robots)], self.crew, clock="simulated")
        self.kb = program.knowledge
        for robot in self.crew:
            robot.knowledge = self.kb
        here = [one for name in self.robots for one in (fact("at", name, "a"), fact("free", name))]
        nodes = {**dict.fromkeys(ROOMS, "room"), **dict.fromkeys(self.robots, "robot"), "t0": "thing"}
        self.kb.apply(Delta(nodes=nodes, added=(*here, fact("in", "t0", "a"))), "test")
        program.listen(self._keep)
        tasks = []
        end = program.run("tidy", prepare=lambda sequencer: tasks.append(asyncio.ensure_future(self._live(sequencer))))
        assert not tasks[0].done() or tasks[0].cancelled(), tasks[0].exception()
        tasks[0].cancel()
        assert end.finished, end
        self.ended.update(event.attributes["how"] for event in end.emitted)

    def _keep(self, record: Record) -> None:
        if record.type in ("plan.found", "plan.skipped", "plan.replaced"):
            self.records.append(record)

    async def _live(self, sequencer) -> None:
        while True:
            await asyncio.sleep(EVERY)
            self.changes += 1
            sequencer.change(self._change(), "somebody")

    def _change(self) -> Delta:
        what = self._random.random()
        lying = sorted((one for one in self.kb.facts() if one.predicate == "in"), key=str)
        things = sum(one == "thing" for one in self.kb.nodes().values())
        if what < self.moving and lying:
            moved = self._random.choice(lying)
            where = self._random.choice([room for room in ROOMS if room != moved.args[1]])
            return Delta(removed=(moved,), added=(fact("in", moved.args[0], where),))
        if what > 1 - self.coming and things < MOST_THINGS:
            return Delta(nodes={f"t{things}": "thing"}, added=(fact("in", f"t{things}", self._random.choice("abc")),))
        lamp = fact("lit", self._random.choice(ROOMS))
        return Delta(removed=(lamp,)) if lamp in self.kb.facts() else Delta(added=(lamp,))

    def interrupted(self) -> list[str]:
        """Return the steps that were interrupted and begun again, although all plans between began with them."""
        found = []
        for robot in self.crew:
            for (how, step, ended), (_, then, begun) in zip(robot.log, robot.log[1:], strict=False):
                if how == "cancelled" and then == step and not self._abandoned(step, ended, begun):
                    found.append(f"{step}: interrupted at {ended:g} s, begun again at {begun:g} s")
        return found

    def _abandoned(self, step: PlanStep, since: float, until: float) -> bool:
        """Return whether a plan between the two times did without the step, as the next of its robot."""
        between = [one for one in self.records if since <= one.t <= until]
        if any(one.type == "plan.skipped" for one in between):
            return True
        plans = [one.data["steps"] for one in between if one.type == "plan.found"]
        return any(next((one for one in steps if f" {step.args[0]} " in one), None) != str(step) for steps in plans)

    def count(self, how: str) -> int:
        """Return how often steps began, or ended that way."""
        return sum(one == how for robot in self.crew for one, _, _ in robot.log)


def main() -> None:
    """Run worlds of one and of two robots for the hours given, and end with an error if a promise is broken."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    broken = []
    for robots in (("x",), ("x", "y")):
        for moving, coming in ((0.5, 0.05), (0.01, 0.05)):
            world = LivelyWorld(robots, 3600 * options.hours, options.seed, moving, coming)
            print(
                f"{len(robots)} robot(s), {world.changes} changes, {world.count('begun')} steps begun,"
                f" {world.count('done')} done, {world.count('cancelled')} no longer needed; ended: {dict(world.ended)};"
                f" interrupted and begun again: {len(world.interrupted())}",
                flush=True,
            )
            broken += world.interrupted()
            broken += [how for how in world.ended if how != "reached"]
            broken += [] if world.ended["reached"] else ["the goal was never reached"]
    if broken:
        raise SystemExit("\n".join(broken))


if __name__ == "__main__":
    main()

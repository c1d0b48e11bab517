"""The robot's components over a world, with all that they reported as a plain set of facts."""

from __future__ import annotations

import asyncio
import json
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING

from domains.clean_up_table.components import Arm, Base, Camera, Voice
from domains.clean_up_table.observations import initial_knowledge
from dsc.calls import SkillCall
from dsc.outcomes import Outcome
from knowledge_base.facts import Content, Delta, Fact, fact

if TYPE_CHECKING:
    from collections.abc import Awaitable

    from domains.clean_up_table.table_world import TableWorld


class Clock:
    def __init__(self) -> None:
        self.time = 0.0

    def now(self) -> float:
        return self.time

    async def sleep(self, seconds: float) -> None:
        assert seconds > 0
        self.time += seconds
        await asyncio.sleep(0)

    def hold(self) -> AbstractContextManager[None]:
        return nullcontext()


class Robot:
    """Components over a world, and the facts they reported; the belief is a plain set of facts."""

    def __init__(self, world: TableWorld) -> None:
        self.world = world
        self.clock = Clock()
        self.facts: set[Fact] = set()
        self.values: dict[Fact, Content] = {}
        self.types: dict[str, str] = dict.fromkeys(("none", "one", "two"), "room")
        self.components = [Base(world), Arm(world), Camera(world), Voice(world)]
        self.calls = 0
        self.learn(initial_knowledge(world.robot_at))

    def learn(self, delta: Delta) -> None:
        self.types |= delta.nodes
        self.facts = changed(self.facts, delta)
        self.values |= delta.values

    def lying(self, surface: str) -> list[str]:
        return sorted(str(f.args[0]) for f in self.facts if f.predicate == "lies-at" and f.args[1] == surface)

    def all(self, predicate: str, *last: str) -> list[str]:
        found = (f.args for f in self.facts if f.predicate == predicate)
        return sorted(str(args[0]) for args in found if args[1:] == last)

    def do(self, skill: str, **arguments: str) -> Outcome:
        self.calls += 1
        (component,) = [one for one in self.components if skill in one.skills()]
        call = SkillCall(f"a{self.calls}", self.clock, lambda _outcome: None)
        outcome = finish(component.execute(skill, call, arguments))
        declared = component.skills()[skill].outcomes
        assert set(outcome.attributes) == set(declared[outcome.event])
        json.dumps(outcome.attributes)
        self.learn(outcome.observed)
        if outcome.event == "recognised":
            self.miss(
                *set(self.lying(arguments["surface"]))
                - {f.args[0] for f in outcome.observed.added if f.predicate == "in-view"}
            )
        return outcome

    def miss(self, *items: str) -> None:
        """What the plot of a look makes of items that it did not show."""
        nowhere = [f for f in self.facts if f.predicate == "lies-at" and f.args[0] in items]
        self.learn(Delta(removed=tuple(nowhere), added=tuple(fact("missing", item) for item in items)))


def finish(skill: Awaitable[Outcome]) -> Outcome:
    """Run a skill that waits for nothing but the clock; much faster than an event loop of its own."""
    steps = skill.__await__()
    while True:
        try:
            steps.send(None)
        except StopIteration as done:
            outcome: Outcome = done.value
            return outcome


def changed(facts: set[Fact], delta: Delta) -> set[Fact]:
    return (facts - set(delta.removed)) | set(delta.added)


def believes_the_truth(robot: Robot) -> None:
    """The robot's belief of what it handled or saw last is what is so, but for what nobody told it."""
    world = robot.world
    assert robot.all("robot-at") == [world.robot_at]
    held = world.items.held
    assert robot.all("holding") == ([held.name] if held else [])
    assert (fact("hand-free") in robot.facts) == (held is None)
    for item in world.items:
        if item.name in robot.types and not item.disposed:
            carriers = [f.args[1] for f in robot.facts if f.predicate == "inside" and f.args[0] == item.name]
            assert carriers == ([item.where] if world.items.get(item.where) else [])
            rooms = [f.args[1] for f in robot.facts if f.predicate == "free-room" and f.args[0] == item.name]
            assert rooms == [world.items.room(item)]
        assert (fact("disposed", item.name) in robot.facts) == item.disposed

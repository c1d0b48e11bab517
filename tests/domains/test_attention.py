"""Attention by arcs: who is looked at when, and how often."""

from __future__ import annotations

import asyncio
from collections import Counter

import pytest

from domains.attention import Attention
from dsc import run_simulated
from dsc.errors import SkillError
from dsc.text.plot_files import parse_plot
from knowledge_base.facts import Delta, fact
from planning import Robot

WATCHING = parse_plot("""
plot: watching
receives: {enough: {}}
states:
  serve: {use: serve_attention, with: {me: robot, dwell: 1}, on: {enough: over}}
  over: {final: true}
""")


class Head:
    """A head that cannot see what is hidden."""

    def __init__(self, *hidden):
        self.hidden, self.looks, self.cancelled = hidden, [], []

    async def turn_to(self, call, what):
        try:
            await call.clock.sleep(1.0)
        except asyncio.CancelledError:
            self.cancelled.append(what)
            raise
        if what == "wall":
            raise SkillError("the neck is stuck")
        self.looks.append(what)
        return "something is in the way" if what in self.hidden else None


def looks(head, seconds, *parts, later=()):
    """Return the objects of each look in these seconds; `later` has changes with the seconds between them."""
    seen: list[object] = []

    async def main():
        async with Robot.of_bundles(["attention"], plots=[WATCHING], components=[Attention(head)]) as robot:
            robot.knowledge.apply(
                Delta(nodes=dict.fromkeys(["robot", "anna", "bert", "cup", "wall"], "object")), author="me"
            )
            robot.knowledge.apply(" ".join(parts), author="me")
            robot.knowledge.subscribe(
                lambda change: seen.extend(one.args[1] for one in change.delta.values if one.predicate == "looked-at")
            )
            run = robot.start("watching", open_ended=True)
            for pause, change in later:
                await asyncio.sleep(pause)
                run.change(change, "perception")
            await asyncio.sleep(seconds)
            run.post("enough")
            assert await run

    run_simulated(main())
    return seen


def test_equal_objects_come_in_turn():
    seen = looks(Head(), 60, "(want-see robot anna) (want-see robot bert) (want-see robot cup)")
    assert seen[:6] == ["anna", "bert", "cup"] * 2
    assert len(seen) >= 29


def test_the_only_object_stays_in_view():
    head = Head()
    assert looks(head, 20, "(want-see robot anna)") == []  # a look ends with the next one
    assert head.looks == ["anna"]


def test_interest_lets_an_object_come_more_often_and_starves_none():
    seen = Counter(looks(Head(), 200, "(want-see robot anna) (want-see robot bert) (= (interest anna) 4)"))
    assert seen["anna"] > 3 * seen["bert"] > 0


def test_an_arc_that_is_removed_ends_the_turn_and_a_new_one_comes_next():
    gone = Delta(removed=(fact("want-see", "robot", "anna"),), added=(fact("want-see", "robot", "cup"),))
    head = Head()
    looks(head, 9, "(want-see robot anna)", later=[(0.5, gone)])
    assert (head.cancelled, head.looks) == (["anna"], ["cup"])


@pytest.mark.parametrize("hidden", ["anna", "wall"])
def test_an_object_that_cannot_be_seen_takes_only_its_own_turn(hidden):
    seen = looks(Head("anna"), 60, f"(want-see robot {hidden}) (want-see robot bert)")
    assert seen.count("bert") > 12

"""A small robot program, as a user would have it: what the tests of the testing kit are about."""

from __future__ import annotations

from typing import Annotated

from dsc_charts import plot

from dsc import Component, Outcome, skill
from knowledge_base.world.schema import Schema

SCHEMA = Schema.parse("""
    (define (domain kitchen)
      (:types item place - object)
      (:constants shelf - place)
      (:predicates (holding ?i - item) (lost ?i - item) (open) (near ?p - place))
      (:functions (failures ?i - item)))
""")

FETCH = plot(
    """
    plot: fetch
    parameters: {item: item}
    receives: {stop: , hello: }
    emits: {fetched: {item: item}, stopped: }
    states:
      work:
        on: {stop: {to: ended, emit: stopped}, done: {to: ended, emit: fetched, with: {item: ?item}}}
        states:
          go: {use: drive, with: {to: shelf}, on: {done: take}}
          take:
            use: pick
            with: {item: ?item}
            on: {done: held}
          held: {final: true}
          without: {final: true}
      ended: {final: true}
    rules:
      - on: no_path
        do: {use: wait, then: retry, limit: 2}
      - on: no_path
        do: {then: without}
      - on: slipped
        when: (< (failures ?event.item) 2)
        do: {tell: (increase (failures ?event.item) 1), then: retry}
      - on: slipped
        do: {tell: (lost ?event.item), use: wait, then: without}
    """,
    "fetch.yaml",
)
DRIVE = plot(
    """
    plot: drive
    parameters: {to: place}
    emits: {no_path: }
    states:
      driving:
        entry: [{set: base.speed, to: 2}, {trigger: base.drive, with: {to: ?to}, within: 60}]
        exit: {switch: base, to: neutral}
        on: {arrived: there, no_path: {to: blocked, emit: no_path}}
        after: {seconds: 30, to: blocked, emit: no_path}
      there: {final: true}
      blocked: {final: true}
    """,
    "drive.yaml",
)
PICK = plot(
    """
    plot: pick
    parameters: {item: item, force: {type: number, default: 1}}
    emits: {slipped: {item: item}}
    states:
      grasp:
        entry: {trigger: arm.grasp, with: {item: ?item}}
        on:
          grasped: {to: taken, tell: (and (holding ?item) (not (lost ?item)) (assign (failures ?item) 0))}
          felt: {}
          slipped: {to: dropped, emit: slipped, with: {item: ?item}}
      taken: {final: true}
      dropped: {final: true}
    """,
    "pick.yaml",
)
WAIT = plot("{plot: wait, states: {pause: {after: {seconds: 10, to: over}}, over: {final: true}}}", "wait.yaml")
PLOTS = (FETCH, DRIVE, PICK, WAIT)


Place = Annotated[str, "place"]
Item = Annotated[str, "item"]


class Arrived(Outcome): ...


class NoPath(Outcome): ...


class Grasped(Outcome): ...


class Slipped(Outcome):
    item: Item


class Felt(Outcome):
    force: float


class Base(Component):
    name = "base"

    @skill
    async def drive(self, call, to: Place) -> Arrived | NoPath:
        await call.clock.sleep(5)
        return Arrived()


class Arm(Component):
    name = "arm"

    @skill
    async def grasp(self, call, item: Item) -> Grasped | Slipped | Felt:
        await call.clock.sleep(2)
        return Grasped()

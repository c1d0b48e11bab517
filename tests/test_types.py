"""`mypy --strict` over users' programs: planted mistakes in types are found, and the tutorial has none (S2.11)."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from mypy import api

from dsc import parse_plot
from dsc.text.typed_plots import typed_plots
from knowledge_base.world.schema import Schema

ROOT = Path(__file__).parents[1]

ROBOT = """
from __future__ import annotations

from typing import Literal, NewType

from dsc import Component, Outcome, Parameters, SkillCall, event, parameter, query, skill
from knowledge_base import Delta, fact

Room = NewType("Room", str)
Parcel = NewType("Parcel", str)


class Arrived(Outcome):
    room: Room


class DoorClosed(Outcome):
    seconds: float = 0.0


class Grasped(Outcome):
    parcel: Parcel
    force: float


class Moving(Outcome):
    metres: float


class Level(Outcome):
    percent: float


class BaseParameters(Parameters):
    speed: float = parameter(1.0, least=0.1, most=2.0)
    gear: Literal["low", "high"] = "low"
    cycles: int = parameter(3, changed_by="operator")


class Base(Component):
    parameters: BaseParameters

    @skill(after_crash="same_id")
    async def drive(self, call: SkillCall[Moving], to: Room) -> Arrived | DoorClosed:
        await call.clock.sleep(10.0 / self.parameters.speed)
        call.report(Moving(metres=3.0))
        if self.parameters.gear == "high":
            return DoorClosed(seconds=2.0)
        return Arrived(room=to, observed=Delta(added=(fact("robot-in", to),)))

    @skill
    async def grasp(self, call: SkillCall, parcel: Parcel) -> Grasped:
        force = self.measured(parcel)
        return Grasped(parcel=parcel, force=force)

    def measured(self, parcel: Parcel) -> float:
        return 2.0 * self.parameters.cycles

    @query
    async def battery(self) -> Level:
        return Level(percent=80.0)


def told(end: Grasped) -> str:
    return f"{end.parcel} with {end.force:.1f} N"
"""

MISTAKES = (
    ("a misspelt outcome", "return Level(percent=80.0)", "return Levle(percent=80.0)"),
    ("a misspelt attribute", "Moving(metres=3.0)", "Moving(meters=3.0)"),
    ("a missing attribute", "Grasped(parcel=parcel, force=force)", "Grasped(parcel=parcel)"),
    ("an attribute of another type", "DoorClosed(seconds=2.0)", 'DoorClosed(seconds="two")'),
    ("an object of another type", "Arrived(room=to, ", 'Arrived(room=Parcel("p1"), '),
    ("an undeclared outcome", "-> Arrived | DoorClosed:", "-> Arrived:"),
    ("an undeclared report", "SkillCall[Moving]", "SkillCall"),
    ("a misspelt parameter", "/ self.parameters.speed", "/ self.parameters.sped"),
    ("a value that is not permitted", '.gear == "high"', '.gear == "hgih"'),
    ("a default of another type", 'Literal["low", "high"] = "low"', 'Literal["low", "high"] = "slow"'),
    ("a misspelt declaration", "changed_by=", "chnged_by="),
    ("a misspelt role", '"operator"', '"oprator"'),
    ("a misspelt reaction to a crash", '"same_id"', '"same-id"'),
    ("an argument of another type", "self.measured(parcel)", "self.measured(call)"),
    ("a misspelt attribute of an outcome that is read", "{end.force:.1f}", "{end.forse:.1f}"),
    ("a skill that returns no outcome", "-> Grasped:\n        force", "-> float:\n        force"),
    ("a query that is no coroutine", "    async def battery(self)", "    def battery(self)"),
    ("a skill that is no coroutine", "    async def grasp(self", "    def grasp(self"),
    ("a changed parameter", "force = self.measured", "self.parameters.speed = force = self.measured"),
)


@pytest.fixture(scope="module")
def errors(tmp_path_factory):
    """Return a function that lists the errors of `mypy --strict` over files, each as text with file and line."""
    cache = tmp_path_factory.mktemp("cache")

    def listed(*files: Path) -> list[str]:
        found, _, _ = api.run(["--strict", "--cache-dir", str(cache), *map(str, files)])
        return [line for line in found.splitlines() if ": error: " in line]

    return listed


def test_each_planted_mistake_is_found_where_it_is(tmp_path, errors):
    (tmp_path / "correct.py").write_text(ROBOT)
    for number, (what, correct, mistaken) in enumerate(MISTAKES):
        assert ROBOT.count(correct) == 1, what
        (tmp_path / f"mistake{number}.py").write_text(ROBOT.replace(correct, mistaken))
    found: dict[str, list[str]] = {}
    for error in errors(*tmp_path.glob("*.py")):
        found.setdefault(Path(error.partition(":")[0]).stem, []).append(error)
    missed = [what for number, (what, _, _) in enumerate(MISTAKES) if f"mistake{number}" not in found]
    assert (missed, found.get("correct")) == ([], None)
    for number, (what, correct, _) in enumerate(MISTAKES):
        line = ROBOT[: ROBOT.index(correct)].count("\n") + 1
        lines = [int(re.search(r":(\d+)", error)[1]) for error in found[f"mistake{number}"]]  # type: ignore[index]
        assert min(abs(one - line) for one in lines) <= 6, (what, found[f"mistake{number}"])


PLOT = """
plot: count
parameters:
  mug: mug
  room: room
  floor: {type: number, default: 1}
outputs: {mugs: number}
states: {e: {final: true}}
"""

CALLS = """
from dsc import RunEnd
from planning import Robot
from plots import Mug, Room, count


def counted(robot: Robot) -> float:
    end = robot.run(count(mug=Mug("m1"), room=Room("hall"), floor=2.0))
    return end.outputs["mugs"]


def any_run(robot: Robot) -> RunEnd:
    return robot.run("count", {"mug": "m1"})
"""

MISTAKEN_CALLS = (
    ("a misspelt plot", "run(count(", "run(cuont("),
    ("a misspelt parameter of a plot", "floor=2.0", "flor=2.0"),
    ("a missing parameter of a plot", 'room=Room("hall"), ', ""),
    ("an object of another type in a plot", 'room=Room("hall")', 'room=Mug("hall")'),
    ("a value of another type in a plot", "floor=2.0", 'floor="second"'),
    ("a misspelt output", '["mugs"]', '["mgus"]'),
    ("an output of another type", "-> float", "-> str"),
)


def test_mistakes_in_calls_of_plots_are_found(tmp_path, errors, monkeypatch):
    schema = Schema.parse("(define (domain d) (:types mug room))")
    (tmp_path / "plots.py").write_text(typed_plots([parse_plot(PLOT)], schema))
    (tmp_path / "correct.py").write_text(CALLS)
    for number, (what, correct, mistaken) in enumerate(MISTAKEN_CALLS):
        assert CALLS.count(correct) == 1, what
        (tmp_path / f"mistake{number}.py").write_text(CALLS.replace(correct, mistaken))
    monkeypatch.setenv("MYPYPATH", str(tmp_path))
    found = {Path(error.partition(":")[0]).stem for error in errors(*tmp_path.glob("*.py"))}
    assert found == {f"mistake{number}" for number in range(len(MISTAKEN_CALLS))}


def test_the_tutorial_has_no_mistake_in_types(errors):
    assert errors(ROOT / "examples" / "tutorial") == []

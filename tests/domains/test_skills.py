"""The robot's skills: what they take, and what the robot learns from them in the planning domain's terms."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reporting_robot import Robot, believes_the_truth

import domains.clean_up_table
from domains.clean_up_table.items import new_item
from domains.clean_up_table.scenario import Scenario
from domains.clean_up_table.table_world import TableWorld
from dsc.calls import SkillCall
from knowledge_base.facts import Fact, fact
from knowledge_base.language.syntax.effect import Add, AllOf, Delete
from knowledge_base.language.syntax.expression import And, Atom, Variable
from knowledge_base.pddl.action_text import ActionText
from knowledge_base.pddl.domain_text import parse_domain

if TYPE_CHECKING:
    from collections.abc import Iterator

DOMAIN_FILE = Path(domains.clean_up_table.__file__).with_name("domain.pddl")
DOMAIN = parse_domain(DOMAIN_FILE.read_text(encoding="utf-8"))
ACTIONS = {action.name: action for action in DOMAIN.actions}
SKILL_OF = {"check-room": "look_into"}
SUCCESS = {
    "drive": "arrived",
    "pick-up": "picked_up",
    "put-down": "put_down",
    "stack": "stacked",
    "take-out": "taken_out",
    "check-room": "looked",
    "throw-away": "thrown_away",
}
SURFACES = ("table", "shelf", "floor")


def changed_by(facts: set[Fact], step: ActionText, bindings: dict[str, str]) -> set[Fact]:
    """The planning action's effect on a set of facts."""
    assert isinstance(step.effect, AllOf)
    removed = {ground(part.atom, bindings) for part in step.effect.parts if isinstance(part, Delete)}
    added = {ground(part.atom, bindings) for part in step.effect.parts if isinstance(part, Add)}
    assert len(removed) + len(added) == len(step.effect.parts)
    return (facts - removed) | added


def ground(atom: Atom, bindings: dict[str, str]) -> Fact:
    values = (bindings[arg.name] if isinstance(arg, Variable) else arg.value for arg in atom.args)
    return fact(atom.predicate, *values)


def applicable(robot: Robot, action: ActionText) -> Iterator[dict[str, str]]:
    """Every binding for which the action's precondition holds in the robot's knowledge."""
    assert isinstance(action.precondition, And)
    open_bindings: list[dict[str, str]] = [{}]
    for atom in action.precondition.parts:
        assert isinstance(atom, Atom)
        rows = sorted((f.args for f in robot.facts if f.predicate == atom.predicate), key=str)
        open_bindings = [m for b in open_bindings for row in rows if (m := match(atom, row, b)) is not None]
    wanted = {p.name: p.types for p in action.parameters}
    for binding in open_bindings:
        for surface in SURFACES if "surface" in wanted and "surface" not in binding else (None,):
            full = binding if surface is None else {**binding, "surface": surface}
            if all(is_a(robot.types[full[name]], types) for name, types in wanted.items()):
                yield full


def match(atom: Atom, row: tuple[Any, ...], binding: dict[str, str]) -> dict[str, str] | None:
    found = dict(binding)
    for arg, value in zip(atom.args, row, strict=True):
        wanted = found.setdefault(arg.name, value) if isinstance(arg, Variable) else arg.value
        if wanted != value:
            return None
    return found


def is_a(kind: str, types: tuple[str, ...]) -> bool:
    above = {"cup": "item", "can": "item", "crisp-can": "item", "surface": "place", "destination": "place"}
    return not types or kind in types or above.get(kind) in types


def arguments(robot: Robot, action: ActionText, bindings: dict[str, str]) -> dict[str, str]:
    skill = SKILL_OF.get(action.name, action.name.replace("-", "_"))
    (component,) = [one for one in robot.components if skill in one.skills()]
    return {name: bindings[name] for name in component.skills()[skill].parameters}


def looked_round(world: TableWorld) -> Robot:
    robot = Robot(world)
    robot.do("drive", to="table")
    robot.do("recognise", surface="table")
    return robot


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_every_step_the_domain_allows_succeeds_and_has_the_domains_effect(data):
    robot = looked_round(Scenario.parse("table: {cups: 3, cans: 2, crisp_cans: [small, large]}").world())
    for _ in range(14):
        steps = [(action, b) for action in ACTIONS.values() for b in applicable(robot, action)]
        action, bindings = data.draw(st.sampled_from(steps))
        check_step(robot, action, bindings)


def check_step(robot: Robot, action: ActionText, bindings: dict[str, str]) -> None:
    expected = changed_by(robot.facts, action, bindings)
    skill = SKILL_OF.get(action.name, action.name.replace("-", "_"))
    thrown = set()
    if action.name == "throw-away":
        thrown = {item.name for item in robot.world.items.stack(robot.world.items[bindings["item"]])}
    outcome = robot.do(skill, **arguments(robot, action, bindings))
    assert outcome.event == SUCCESS[action.name]
    # Beyond the planning action's effect: what was thrown away is disposed of and in nothing any more.
    expected = {f for f in expected if not (f.predicate == "inside" and f.args[0] in thrown)}
    assert robot.facts == expected | {fact("disposed", item) for item in thrown}


def test_the_first_knowledge_is_of_the_places_and_of_how_room_is_counted():
    robot = Robot(TableWorld(robot_at="shelf"))
    assert fact("robot-at", "shelf") in robot.facts
    assert robot.all("passable") == sorted(("table", "shelf", "floor", "sink", "bin", "operator"))
    assert {fact("one-less", "two", "one"), fact("one-less", "one", "none"), fact("hand-free")} <= robot.facts
    assert robot.types["table"] == "surface"
    assert robot.types["sink"] == "destination"
    assert robot.types["operator"] == "place"


def test_a_look_reports_what_is_there_once_as_graspable():
    robot = looked_round(TableWorld([new_item("cup", "cup1"), new_item("can", "can1")]))
    assert robot.all("goes-to", "sink") == ["cup1"]
    assert robot.all("goes-to", "bin") == ["can1"]
    assert robot.all("free-room", "one") == ["cup1"]
    assert robot.all("free-room", "none") == ["can1"]
    assert robot.all("graspable") == ["can1", "cup1"]
    robot.facts.discard(fact("graspable", "can1"))  # as the robot's rules do after too many failures
    outcome = robot.do("recognise", surface="table")
    assert outcome.attributes == {"surface": "table", "count": 2}
    assert robot.all("graspable") == ["cup1"]


def test_a_look_misses_what_it_does_not_see_and_finds_it_elsewhere():
    robot = looked_round(TableWorld([new_item("cup", "cup1"), new_item("cup", "cup2")]))
    robot.world.move_item("cup1", "shelf")
    robot.do("recognise", surface="table")
    assert (robot.all("missing"), robot.lying("table")) == (["cup1"], ["cup2"])
    robot.do("drive", to="shelf")
    robot.do("recognise", surface="shelf")
    assert (robot.all("missing"), robot.lying("shelf")) == ([], ["cup1"])


def test_a_moved_item_found_before_it_was_missed_lies_in_one_place():
    robot = looked_round(TableWorld([new_item("cup", "cup1")]))
    robot.world.move_item("cup1", "shelf")
    robot.do("drive", to="shelf")
    robot.do("recognise", surface="shelf")
    assert (robot.lying("table"), robot.lying("shelf")) == ([], ["cup1"])


def test_an_empty_surface_is_recognised_as_empty():
    robot = looked_round(TableWorld())
    assert robot.do("recognise", surface="table").attributes["count"] == 0


def test_a_grasp_for_nothing_misses_the_item():
    robot = looked_round(TableWorld([new_item("cup", "cup1")]))
    robot.world.move_item("cup1", "shelf")
    assert robot.do("pick_up", item="cup1", surface="table").event == "gone"
    assert (robot.all("missing"), robot.lying("table")) == (["cup1"], [])


def with_a_missing_item_in_a_cup() -> Robot:
    """cup1 is in cup2, which the robot did not find, and has been told of since; of cup1 nobody said anything."""
    robot = looked_round(TableWorld([new_item("cup", "cup1"), new_item("cup", "cup2")]))
    robot.do("pick_up", item="cup1", surface="table")
    robot.do("stack", item="cup1", carrier="cup2", surface="table")
    robot.facts.add(fact("missing", "cup1"))
    return robot


def test_a_missing_item_in_a_discarded_carrier_counts_as_disposed():
    robot = with_a_missing_item_in_a_cup()
    robot.do("look_into", carrier="cup2", surface="table")
    robot.do("pick_up", item="cup2", surface="table")
    robot.do("drive", to="sink")
    robot.do("throw_away", item="cup2", destination="sink")
    assert (robot.all("disposed"), robot.all("missing")) == (["cup1", "cup2"], [])


def test_a_missing_item_that_the_robot_takes_out_is_no_longer_missing():
    robot = with_a_missing_item_in_a_cup()
    robot.do("take_out", item="cup1", carrier="cup2", surface="table")
    assert robot.all("missing") == []


def test_failures_in_a_row_are_counted_and_forgotten_on_success():
    robot = looked_round(TableWorld([new_item("can", "can1")]))
    robot.world.faults.ungraspable["can1"] = "grasp_failed"
    counted = []
    for _ in range(4):
        robot.do("pick_up", item="can1", surface="table")
        counted.append(robot.values[fact("failures", "can1")])
    assert counted == [1, 2, 3, 4]
    robot.world.faults.ungraspable.clear()
    robot.do("pick_up", item="can1", surface="table")
    assert robot.values[fact("failures", "can1")] == 0


def test_detours_in_a_row_are_counted_and_forgotten_on_arrival():
    robot = looked_round(TableWorld())
    robot.world.faults.unreachable.append("sink")
    outcomes = [robot.do("drive", to="sink") for _ in range(2)]
    assert [outcome.event for outcome in outcomes] == ["no_path"] * 2
    assert robot.values[fact("detours", "sink")] == 2
    robot.world.faults.unreachable.clear()
    robot.do("drive", to="sink")
    assert robot.values[fact("detours", "sink")] == 0


def test_a_fall_leaves_the_belief_as_things_lie():
    robot = looked_round(TableWorld([new_item("cup", f"cup{n}") for n in (1, 2, 3)], faults=0.0))
    robot.do("pick_up", item="cup1", surface="table")
    robot.do("stack", item="cup1", carrier="cup2", surface="table")
    robot.do("pick_up", item="cup2", surface="table")
    robot.world.faults.chance = 1.0
    while robot.do("stack", item="cup2", carrier="cup3", surface="table").event != "stack_fell":
        robot.world.faults.chance = 0.0
        robot.do("take_out", item="cup2", carrier="cup3", surface="table")
        robot.world.faults.chance = 1.0
    believes_the_truth(robot)
    assert robot.all("tidy") == []


@pytest.mark.parametrize("skill", ["pick_up", "drive"])
def test_a_call_cancelled_on_the_way_changes_nothing(skill):
    robot = looked_round(TableWorld([new_item("cup", "cup1")]))
    before = robot.world.state()
    component = {"pick_up": robot.components[1], "drive": robot.components[0]}[skill]
    given_arguments = {"pick_up": {"item": "cup1", "surface": "table"}, "drive": {"to": "sink"}}[skill]

    async def cancel() -> None:
        call = SkillCall("cancelled", robot.clock, lambda _outcome: None)
        task = asyncio.ensure_future(component.execute(skill, call, given_arguments))
        await asyncio.sleep(0)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    asyncio.run(cancel())
    assert robot.world.state() == before


def test_driving_takes_as_long_as_the_way_is():
    robot = Robot(TableWorld())
    times = []
    for place in ("table", "sink", "bin"):
        start = robot.clock.time
        robot.do("drive", to=place)
        times.append(robot.clock.time - start)
    assert len(set(times)) == 3
    assert all(2 < seconds < 20 for seconds in times)


def test_the_voice_speaks():
    robot = Robot(TableWorld())
    assert robot.do("say", text="done").attributes == {"text": "done"}
    assert robot.world.said == ["done"]

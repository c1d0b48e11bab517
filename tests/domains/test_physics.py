"""What holds in the clean-up-table world whatever the robot does, with faults and without."""

from __future__ import annotations

import json
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
from small_table import NAMES, make_world

from domains.clean_up_table.items import DESTINATIONS, HAND, PLACES, SURFACES
from domains.clean_up_table.table_world import TableWorld

items = st.sampled_from([*NAMES, "cup4", "can3", "ghost"])
surfaces = st.sampled_from(SURFACES)
verbs = st.one_of(
    st.tuples(st.just("drive"), st.sampled_from(PLACES)),
    st.tuples(st.just("pick_up"), items, surfaces),
    st.tuples(st.just("put_down"), items, surfaces),
    st.tuples(st.just("stack"), items, items, surfaces),
    st.tuples(st.just("take_out"), items, items, surfaces),
    st.tuples(st.just("look_into"), items, surfaces),
    st.tuples(st.just("throw_away"), items, st.sampled_from(DESTINATIONS)),
    st.tuples(st.just("recognise"), surfaces),
)
# A random call is rarely possible; mostly the robot is where it acts and acts on what it holds.
scripts = st.lists(verbs, max_size=30)
worlds = st.builds(make_world, st.sampled_from([0.0, 0.3, 1.0]), st.integers(0, 1000))


def sensible(world: TableWorld, call: tuple[str, ...]) -> list[tuple[str, ...]]:
    """The call, with what makes it likely to be possible before it."""
    verb, *args = call
    held = world.items.held
    if verb in {"put_down", "stack", "throw_away"} and held:
        args[0] = held.name
    if verb in {"pick_up", "take_out"} and held:
        return []
    return [("drive", args[-1]), (verb, *args)]


def check_physics(world: TableWorld) -> None:
    held = [item for item in world.items if item.where == HAND]
    assert len(held) <= 1
    assert world.robot_at in PLACES
    for item in world.items:
        carrier = world.items.get(item.where)
        assert carrier is not None or item.where in {*SURFACES, *DESTINATIONS, HAND}
        if carrier is not None:
            assert item.fits(carrier)
        assert 0 <= item.closed <= world.items.free_room(item) <= item.capacity
        assert item.where not in DESTINATIONS or item.disposed
        assert world.items.outermost(item).where in {*PLACES, HAND}
    assert {left.item for left in world.left()} >= {item.name for item in world.items.lying("table")}


@settings(max_examples=150, deadline=None)
@given(world=worlds, script=scripts)
def test_physics_holds_after_every_call(world, script):
    number = 0
    for call in script:
        for verb, *args in sensible(world, call):
            number += 1
            getattr(world, verb)(f"a{number}", *args)
            check_physics(world)


@settings(max_examples=60, deadline=None)
@given(world=worlds, script=scripts)
def test_the_state_goes_to_json_and_back_and_the_same_run_goes_on(world, script):
    half = len(script) // 2
    run(world, script[:half], "a")
    twin = TableWorld.from_state(json.loads(json.dumps(world.state())))
    assert twin.state() == world.state()
    assert run(world, script[half:], "b") == run(twin, script[half:], "b")
    assert twin.state() == world.state()


@settings(max_examples=60, deadline=None)
@given(world=worlds, script=scripts)
def test_an_action_id_is_executed_once(world, script):
    first = run(world, script, "a")
    before = world.state()
    assert run(world, script, "a") == first
    assert world.state() == before


def run(world: TableWorld, script: list[tuple[str, ...]], prefix: str) -> list[Any]:
    return [getattr(world, verb)(f"{prefix}{n}", *args) for n, (verb, *args) in enumerate(script)]

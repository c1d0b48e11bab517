"""Scenario files: what they mean, and what is said about mistakes in them."""

from __future__ import annotations

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from domains.clean_up_table.items import RESERVED
from domains.clean_up_table.scenario import MAX_ITEMS, NamedItem, Scenario, Table
from knowledge_base.errors import InputError


def test_items_by_number():
    world = Scenario.parse("table: {cups: 2, cans: 1, crisp_cans: [small, large]}").world()
    assert [(item.name, item.kind, item.capacity, item.where) for item in world.items] == [
        ("cup1", "cup", 1, "table"),
        ("cup2", "cup", 1, "table"),
        ("can1", "can", 0, "table"),
        ("crisp_can1", "crisp-can", 1, "table"),
        ("crisp_can2", "crisp-can", 2, "table"),
    ]


NAMED = """
table:
  cups: 2
  items:
    cup1: cup                # the numbered ones go on after it
    pringles: {kind: crisp_can, size: large}
    coke:
      kind: can
      behind: pringles
    small_one: crisp_can
seed: 7
faults: 0.25
robot_at: shelf
"""


def test_items_by_name_beside_numbered_ones():
    world = Scenario.parse(NAMED).world()
    assert [item.name for item in world.items] == ["cup1", "pringles", "coke", "small_one", "cup2", "cup3"]
    assert (world.items["pringles"].capacity, world.items["small_one"].capacity) == (2, 1)
    assert world.items["coke"].behind == "pringles"
    assert (world.faults.seed, world.faults.chance, world.robot_at) == (7, 0.25, "shelf")


def test_the_seed_and_faults_of_a_call_override_those_of_the_scenario():
    scenario = Scenario.parse(NAMED)
    world = scenario.world(seed=0, faults=0.0)
    assert (world.faults.seed, world.faults.chance) == (0, 0.0)
    assert scenario.world(3).faults.seed == 3


def test_a_named_item_may_stand_behind_a_numbered_one():
    world = Scenario.parse("table: {cups: 1, items: {coke: {kind: can, behind: cup1}}}").world()
    assert world.items["coke"].behind == "cup1"


def test_the_default_is_the_table_of_the_readme():
    world = Scenario.default().world()
    assert [item.name for item in world.items] == [
        *("cup1", "cup2", "cup3", "cup4"),
        *("can1", "can2", "can3"),
        *("crisp_can1", "crisp_can2"),
    ]
    assert (world.faults.seed, world.faults.chance, world.robot_at) == (0, 0.0, "operator")


def test_an_empty_table_is_clean():
    assert Scenario.parse("table: {}").world().goal_reached


def test_every_world_is_a_new_one():
    scenario = Scenario.default()
    scenario.world().move_item("cup1", "shelf")
    assert scenario.world().items["cup1"].where == "table"


def test_from_a_file(tmp_path):
    file = tmp_path / "breakfast.yaml"
    file.write_text("table: {cups: 3}\n", encoding="utf-8")
    assert len(Scenario.load(file).world().items) == 3
    file.write_text("table:\n  cups: 3\n  canz: 2\n", encoding="utf-8")
    with pytest.raises(InputError) as caught:
        Scenario.load(file)
    assert str(caught.value) == f"{file}:3:3: unknown key 'canz'; did you mean 'cans'?"


def test_a_file_that_is_not_there_or_not_text(tmp_path):
    (tmp_path / "breakfast.yaml").write_bytes(b"table: \xff\xfe")
    with pytest.raises(InputError) as caught:
        Scenario.load(tmp_path / "breakfst.yaml")
    assert caught.value.nearest == "breakfast.yaml"
    with pytest.raises(InputError, match="breakfast"):
        Scenario.load(tmp_path / "breakfast.yaml")
    with pytest.raises(InputError):
        Scenario.load(tmp_path)


MISTAKES = [
    # text, line, nearest valid name
    ("table:\n  cupz: 4", 2, "cups"),
    ("tabel: {cups: 4}", 1, "table"),
    ("table: {cups: 4}\nsed: 4", 2, "seed"),
    ("table:\n  crisp_can: [small]", 2, "crisp_cans"),
    ("table:\n  cups: four", 2, None),
    ("table:\n  cups: '4'", 2, None),
    ("table:\n  cups: 1.5", 2, None),
    ("table:\n  cups: true", 2, None),
    ("table:\n  cups: -1", 2, None),
    ("table:\n  cups: 201", 2, None),
    ("table:\n  cups: 150\n  cans: 51", 1, None),
    ("table:\n  crisp_cans: small", 2, None),
    ("table:\n  crisp_cans:\n    - large\n    - smal", 4, "small"),
    ("table:\n  items:\n    a: cpu", 3, "cup"),
    ("table:\n  items:\n    a:\n      kind: crisp-can", 4, "crisp_can"),
    ("table:\n  items:\n    a:\n      knd: can", 4, "kind"),
    ("table:\n  items:\n    a: {kind: crisp_can, size: larg}", 3, "large"),
    ("table:\n  items:\n    a: {kind: cup, size: large}", 3, None),
    ("table:\n  items:\n    a: {size: large}", 3, None),
    ("table:\n  items:\n    b: cup\n    a:", 4, None),
    ("table:\n  items:\n    Red Cup: cup", 3, "red_cup"),
    ("table:\n  items:\n    7: cup", 3, None),
    ("table:\n  items:\n    shelf: cup", 3, None),
    ("table:\n  items: [cup, can]", 2, None),
    ("table:\n  items:\n    red_cup: cup\n    coke: {kind: can, behind: redcup}", 4, "red_cup"),
    ("table:\n  items:\n    a: {kind: can, behind: a}", 3, None),
    ("table:\n  items:\n    a: {kind: can, behind: b}\n    b: {kind: cup, behind: a}", 3, None),
    ("table:\n  cups: 4\n  cups: 5", 3, None),
    ("table: &t\n  cups: 4\nseed: *t", 1, None),
    ("table: !!python/object:os.system {cups: 4}", 1, None),
    ("table: {cups: 4\n", 2, None),
    ("table:\n\tcups: 4", 2, None),
    ("table:", 1, None),
    ("seed: 4", 1, None),
    ("", 1, None),
    ("- table", 1, None),
    ("table: {}\n---\ntable: {}", 2, None),
    ("table: {}\nfaults: 1.5", 2, None),
    ("table: {}\nfaults: .nan", 2, None),
    ("table: {}\nfaults: 20%", 2, None),
    ("table: {}\nseed: soon", 2, None),
    ("table: {}\nrobot_at: tabel", 2, "table"),
    ("[" * 5000, 1, None),
]


@pytest.mark.parametrize(("text", "line", "nearest"), MISTAKES)
def test_a_mistake_is_told_with_its_line_and_the_nearest_name(text, line, nearest):
    with pytest.raises(InputError) as caught:
        Scenario.parse(text, "table.yaml")
    error = caught.value
    assert error.place is not None
    assert (error.place.source, error.place.line) == ("table.yaml", line)
    assert error.nearest == nearest
    assert "\n" not in str(error)


@pytest.mark.parametrize(
    "table",
    [
        Table(crisp_cans=("smal",)),
        Table(items={"Cup": NamedItem(kind="cup")}),
        Table(items={"a": NamedItem(kind="can", behind="b")}),
        Table(cups=MAX_ITEMS, cans=1),
    ],
)
def test_a_mistake_made_in_python_is_found_when_the_world_is_made(table):
    with pytest.raises(InputError):
        Scenario(table=table).world()


@given(st.text(max_size=60))
def test_no_text_breaks_the_reader(text):
    with contextlib.suppress(InputError):
        Scenario.parse(f"table: {text}").world()


names = st.from_regex(r"[a-z][a-z0-9_-]{0,9}", fullmatch=True).filter(lambda name: name not in RESERVED)


@given(
    kinds=st.dictionaries(names, st.sampled_from(["cup", "can", "crisp_can"]), max_size=5),
    cups=st.integers(0, 4),
)
def test_every_item_described_is_there(kinds, cups):
    items = {name: NamedItem(kind=kind) for name, kind in kinds.items()}
    world = Scenario(table=Table(cups=cups, items=items)).world()
    assert len(world.items) == len(kinds) + cups
    assert all(world.items[name].kind == kind.replace("_", "-") for name, kind in kinds.items())

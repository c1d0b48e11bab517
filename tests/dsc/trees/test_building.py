"""The bounds of running trees, and the types of arguments."""

from __future__ import annotations

import enum
from itertools import pairwise
from typing import Any

import pytest

from dsc.trees import Condition, bind_tree, parse_trees
from dsc.trees.blackboard import Board
from dsc.trees.building import MAX_LEVELS, MAX_NODES, build_tree, constant_of
from dsc.trees.running.node import Run, Status
from dsc.trees.skill import RunningTree
from knowledge_base.errors import InputError


class Color(enum.Enum):
    RED = "red"


class Box:
    """A class that data cannot be converted to."""


def chain(names, body):
    """A file in which each tree wraps the next one."""
    trees = [f'<BehaviorTree ID="{name}">{body(after)}</BehaviorTree>' for name, after in pairwise(names)]
    last = f'<BehaviorTree ID="{names[-1]}"><AlwaysSuccess/></BehaviorTree>'
    return parse_trees(f'<root BTCPP_format="4" main_tree_to_execute="{names[0]}">{"".join(trees)}{last}</root>')


def build(file):
    return build_tree(file, file.main, Run(lambda: 0.0), lambda *_: pytest.fail("no leaves"), Board())


def test_subtrees_that_double_the_nodes_are_refused_before_they_fill_the_memory():
    file = chain(
        [f"T{number}" for number in range(40)],
        lambda after: f'<Sequence><SubTree ID="{after}"/><SubTree ID="{after}"/></Sequence>',
    )
    with pytest.raises(InputError, match=f"more than {MAX_NODES} nodes"):
        build(file)


def test_the_deepest_tree_is_executed_and_a_deeper_one_is_refused():
    names = [f"T{number}" for number in range(MAX_LEVELS // 2)]
    root = build(chain(names, lambda after: f'<Inverter><SubTree ID="{after}"/></Inverter>'))
    assert root.execute() in {Status.SUCCESS, Status.FAILURE}
    names = [f"T{number}" for number in range(MAX_LEVELS)]
    with pytest.raises(InputError, match=f"deeper than {MAX_LEVELS} levels"):
        build(chain(names, lambda after: f'<Inverter><SubTree ID="{after}"/></Inverter>'))


@pytest.mark.parametrize(
    ("text", "value"), [("3", 3), ("-3", -3), ("2.5", 2.5), ("1e2", 100.0), ("1;2", "1;2"), ("nan", "nan"), ("", "")]
)
def test_a_constant_of_a_subtree_is_a_number_if_it_is_written_as_one(text, value):
    assert constant_of(text) == value


def arguments(ports, function, **entries):
    """The arguments that a condition receives."""
    found: list[Any] = []

    def holds(*values):
        found.extend(values)
        return True

    file = parse_trees(f'<root BTCPP_format="4"><BehaviorTree ID="M"><Open {ports}/></BehaviorTree></root>', "m.xml")
    tree = RunningTree(bind_tree(file, {"Open": Condition(function(holds))}, entries=entries), lambda: 0.0, print)
    assert tree.tick() is Status.SUCCESS
    return found


def test_ports_are_converted_by_annotations():
    def of_data(holds):
        def condition(a: int, b: float, c: bool, d: list[float], e: Color, f: str, g="default"):
            return holds(a, b, c, d, e, f, g)

        return condition

    ports = 'a="{n}" b="2" c="true" d="1;2.5" e="red" f="{n}"'
    assert arguments(ports, of_data, n=3.0) == [3, 2.0, True, [1.0, 2.5], Color.RED, "3.000000", "default"]


def test_values_of_a_class_without_conversion_are_passed_unchanged():
    def of_box(holds):
        def condition(box: Box, *more: int, **others: int):
            return holds(box)

        return condition

    box = Box()
    assert arguments('box="{b}"', of_box, b=box) == [box]


def test_an_entry_without_value_is_an_error_with_the_nearest_key():
    with pytest.raises(
        InputError, match=r"m\.xml:1:45: <Open>: the port 'a' reads the entry 'itm' .* did you mean 'item'"
    ):
        arguments('a="{itm}"', lambda holds: lambda a: holds(a) or True, item=1)

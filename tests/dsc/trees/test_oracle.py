"""The interpreter of behaviour trees beside BehaviorTree.CPP, whose results `make oracle-trees` records."""

import json
from collections import Counter
from pathlib import Path

import pytest
from tree_replays import replay

from dsc.trees.kinds import KINDS, OF_NAV2, SCRIPTS
from dsc.trees.reading.reader import parse_trees

CASES = json.loads((Path(__file__).parents[2] / "conformance" / "trees.json").read_text("utf-8"))
BY_HAND = [case for case in CASES if not case["name"].startswith("random ")]


@pytest.mark.parametrize("case", CASES, ids=[case["name"] for case in CASES])
def test_each_tick_equals_that_of_behaviortree_cpp(case):
    assert replay(case) == case["ticks"]


def test_the_trees_by_hand_have_each_kind_of_node_at_least_twice():
    assert len(BY_HAND) >= 40
    used: Counter[str] = Counter()
    for case in BY_HAND:
        file = parse_trees(case["xml"])
        nodes = [node for tree in file.trees.values() for node in tree.root.walk()]
        used.update({node.kind for node in nodes} | {name for node in nodes for name in node.scripts})
    often = {name for name, times in used.items() if times >= 2}
    assert {*KINDS, *SCRIPTS} - {*OF_NAV2} - often == set()

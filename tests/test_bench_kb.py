"""`make bench-kb` works without the peers: the floor and the knowledge base do every case, and targets are judged."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

COMMAND: list[str | Path] = [sys.executable, Path(__file__).parent.parent / "benchmarks" / "kb.py", "--quick", "--json"]
OF_ITS_OWN = ("memory", "install", "half of", "99 of 100", "recovery")


@pytest.fixture(scope="module")
def rows():
    done = subprocess.run(COMMAND, capture_output=True, text=True, check=True)
    return {row["case"]: row for row in json.loads(done.stdout)["rows"]}


def test_the_everyday_case_comes_first(rows):
    assert list(rows)[:2] == ["update, 200 facts, no conditions", "update, 200 facts, 30 conditions"]


def test_every_case_has_a_figure_and_all_but_a_few_a_floor(rows):
    for case, row in rows.items():
        doers = {"this engine"} if case.startswith(OF_ITS_OWN) else {"floor", "this engine"}
        assert doers <= set(row["cells"]), case
        least = 0 if case.startswith("memory") else 1e-12  # a small world may fit into what the process had already
        assert all(cell["value"] >= least for cell in row["cells"].values()), case


def test_conditions_are_updated_in_three_kinds_of_store(rows):
    watched = [row for case, row in rows.items() if case.startswith("update") and "shapes" in case]
    assert len(watched) == 4
    assert all(set(row["cells"]) == {"floor", "this engine", "journaled", "fsynced"} for row in watched)


def test_a_change_of_a_live_relation_is_compared_with_the_same_change_of_facts(rows):
    changed = [case.partition(",")[0] for case in rows if case.startswith("change of")]
    assert changed == ["change of facts", "change of a live relation"]


def test_targets_are_judged_by_their_figures(rows):
    targets = [target for row in rows.values() for target in row["targets"]]
    assert len(targets) == 22
    assert all(one["met"] is (one["value"] <= one["bound"]) for one in targets)

"""The results of BehaviorTree.CPP for the trees of `tree_cases`, written to `trees.json`: `make oracle-trees`.

It runs in an environment of its own with `behaviortreepy`, the library BehaviorTree.CPP 4.8.2 as a wheel. Each tick is
recorded as the status of the root, the calls of leaves, and the entries of the blackboard that a script can read.
"""

from __future__ import annotations

import json
import os
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import behaviortreepy as bt
from random_trees import random_cases
from tree_cases import OWN, Case

RECORD = Path(__file__).with_name("trees.json")
RANDOM = 200
ALIVE: list[Any] = []
"""The trees, which are never destroyed: their destructor executes `_onHalted` on destroyed blackboards, and aborts."""
STATUS = {"running": bt.NodeStatus.RUNNING, "success": bt.NodeStatus.SUCCESS, "failure": bt.NodeStatus.FAILURE}


def record(case: Case) -> dict[str, Any]:
    """Return the case with the results of the other program."""
    calls: list[str] = []
    used: dict[str, int] = {}

    def follow(word: str):
        def call(node: Any) -> Any:
            name = node.name()
            calls.append(f"{word} {name}")
            results = case.results.get(name, ["success"])
            used[name] = used.get(name, -1) + 1
            return STATUS[results[used[name] % len(results)]]

        return call

    factory = bt.BehaviorTreeFactory()
    halt = lambda node: calls.append(f"stop {node.name()}")  # noqa: E731
    factory.register_simple_stateful_action("Act", follow("start"), follow("resume"), halt)
    factory.register_simple_condition("Test", follow("start"))
    factory.register_behavior_tree_from_text(case.xml)
    tree = factory.create_tree("Main")
    ALIVE.append(tree)
    ticks: list[list[Any]] = []
    for tick in range(case.ticks):
        if tick:
            time.sleep(case.pause / 1000)
        try:
            status = tree.tick_exactly_once().name.lower()
        except Exception:  # noqa: BLE001  # the wheel raises plain exceptions
            ticks.append(["error", [*calls], {}])
            break
        ticks.append([status, [*calls], entries(tree.root_blackboard())])
        calls.clear()
    return {"name": case.name, "xml": case.xml, "results": case.results, "pause": case.pause, "ticks": ticks}


def entries(board: Any) -> dict[str, Any]:
    """Return the numbers and texts of a blackboard by key."""
    found: dict[str, Any] = {}
    for key in sorted(board.get_keys()):
        for read in (board.get_string, board.get_double):
            with suppress(Exception):  # another type, or no value yet
                found[key] = read(key)
    return found


def main() -> None:
    """Write the record."""
    only = sys.argv[1:]
    cases = [case for case in [*OWN, *random_cases(RANDOM)] if not only or case.name in only]
    lines = [json.dumps(record(case), separators=(",", ":")) for case in cases]
    RECORD.write_text("[\n" + ",\n".join(lines) + "\n]\n", "utf-8")
    print(f"{len(lines)} trees recorded, {len(OWN)} of them written by hand", flush=True)
    os._exit(0)


if __name__ == "__main__":
    main()

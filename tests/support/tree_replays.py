"""Trees whose leaves repeat recorded results: the status of each tick, the calls of the leaves and the blackboard."""

from typing import Any

from dsc.trees.blackboard import EMPTY, Board
from dsc.trees.building import build_tree
from dsc.trees.main_tree import main_tree
from dsc.trees.reading.reader import parse_trees
from dsc.trees.running.leaves import ActionLeaf, ConditionLeaf
from dsc.trees.running.node import Run, Status
from knowledge_base.errors import InputError


class RecordedLeaf:
    """A leaf that repeats its recorded results and notes its calls."""

    def __init__(self, name, results, calls):
        self.name, self.results, self.calls, self.used = name, results, calls, 0

    def start(self):
        return self._next("start")

    def resume(self):
        return self._next("resume")

    def stop(self):
        self.calls.append(f"stop {self.name}")

    def _next(self, word):
        self.calls.append(f"{word} {self.name}")
        self.used += 1
        return Status[self.results[(self.used - 1) % len(self.results)].upper()]


def replay(case):
    """Return the ticks of a case, as `trees.json` has them."""
    calls: list[str] = []
    found: list[Any] = []
    seconds = 0.0

    def make_leaf(node, board, run):
        body = RecordedLeaf(node.title, case["results"].get(node.title, ["success"]), calls)
        return (ActionLeaf if node.kind == "Act" else ConditionLeaf)(node, board, run, body)

    file, board = parse_trees(case["xml"], "case.xml"), Board()
    run = Run(lambda: seconds)
    root = build_tree(file, main_tree(file), run, make_leaf, board)
    for tick in range(len(case["ticks"])):
        seconds = tick * case["pause"] / 1000
        try:
            status = root.execute()
        except InputError as error:
            return [*found, ["error" if "case.xml:1:" in str(error) else str(error), [*calls], {}]]
        if status in {Status.SUCCESS, Status.FAILURE}:
            root.status = Status.IDLE
        found.append([status.value, [*calls], readable(board)])
        calls.clear()
    return found


def readable(board):
    return {key: entry.value for key, entry in sorted(board.entries.items()) if entry.value is not EMPTY}

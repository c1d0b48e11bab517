"""Driver of Fast Downward that replaces its translator, and writes the search input from the ground problem.

The translator is a Python program that grounds PDDL. It starts for each problem and takes most of the time, but the
problem is already ground. The text is SAS+ as in Helmert 2006, *The Fast Downward Planning System*, format version 3
(https://www.fast-downward.org/latest/documentation/translator-output-format/), with one binary variable for each fact.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
from fractions import Fraction
from importlib.util import find_spec
from math import lcm
from pathlib import Path

from planning.engines.registry import Engine
from planning.engines.worker import Answers, Request, Search

# The first search is lazy greedy with h_FF alone. For clean-up-table, preferred operators and landmarks are not faster
# with up to 50 items, and their plans have up to twice as many trips. Later searches only improve the plan.
_FIRST = "lazy_greedy([h],cost_type=one)"
_BETTER = ["lazy_greedy([h],reopen_closed=false)"] + [f"lazy_wastar([h],preferred=[h],w={w})" for w in (5, 3, 2, 1)]

_SEARCHES = {
    "first, then better": f"let(h,ff(),iterated([{','.join([_FIRST, *_BETTER])}],repeat_last=true))",
    "optimal": "astar(lmcut())",
}

_PROVEN = (11, 12)
"""Exit codes of an exhausted search, which is a proof of unsolvability with the safe heuristics used here."""

_OUT_OF_MEMORY = (22, 24)
_FINEST_COST = 1000  # fractions of a cost unit; SAS+ costs are integers, so costs are rounded to these fractions


def searching(engine: Engine) -> Search:
    """Return the search function with the engine's configuration, for `planning.engines.worker`.

    Raises:
        ModuleNotFoundError: Fast Downward is not installed.
    """
    program, options = str(_program()), _SEARCHES[engine.made_by]

    def search(request: Request) -> Answers:
        return _plans(program, options, sas(request))

    return search


def _program() -> Path:
    package = find_spec("up_fast_downward")
    if package is None or package.origin is None:
        raise ModuleNotFoundError("Fast Downward is not installed: pip install up-fast-downward")
    return Path(package.origin).parent / "downward" / "builds" / "release" / "bin" / "downward"


def _plans(program: str, options: str, text: str) -> Answers:
    """Yield each plan when the program finds it; the program writes a file for each plan before it reports the cost."""
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryFile("w+") as task:
        task.write(text)
        task.seek(0)
        file = Path(folder) / "plan"
        command = [program, "--search", options, "--internal-plan-file", str(file)]
        running = subprocess.Popen(  # noqa: S603  the program is the package's own
            command, stdin=task, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=_bare()
        )
        with running:
            found = 0
            for line in running.stdout or ():
                if "Plan cost:" in line:
                    found += 1
                    yield _read(file if found == 1 and file.exists() else file.with_name(f"plan.{found}"))
        if found:
            return
        if running.returncode in _PROVEN:
            yield None
            return
        raise _failure(running.returncode)


def _bare() -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if name in {"PATH", "TMPDIR"}}


def _failure(status: int) -> Exception:
    if status in _OUT_OF_MEMORY:
        return MemoryError()
    return RuntimeError(f"Fast Downward ended with status {status}")


def _read(file: Path) -> list[int]:
    """Return the indices of the actions; a line of a plan is e.g. `(a17 )`, and `;` begins a comment."""
    lines = file.read_text(encoding="utf-8").splitlines()
    return [int(line.strip("() ").removeprefix("a")) for line in lines if line.startswith("(")]


def sas(request: Request) -> str:
    """Return the problem in the output format of the translator; action i has the name `ai`."""
    number, init, goal, actions = len(request["facts"]), set(request["init"]), request["goal"], request["actions"]
    prices = {cost: Fraction(cost).limit_denominator(_FINEST_COST) for cost in {action[4] for action in actions}}
    unit = lcm(*(price.denominator for price in prices.values()))
    variables = [f"begin_variable\nvar{n}\n-1\n2\nNegatedAtom f{n}()\nAtom f{n}()\nend_variable" for n in range(number)]
    lines = ["begin_version", "3", "end_version", "begin_metric", "1", "end_metric", str(number), *variables]
    lines += ["0", "begin_state", *("1" if n in init else "0" for n in range(number)), "end_state"]
    lines += ["begin_goal", str(len(goal)), *(f"{n} 1" for n in goal), "end_goal", str(len(actions))]
    words = _Words(number)
    lines += [
        words.operator(f"a{n}", needs, adds, deletes, int(prices[cost] * unit))
        for n, (_, needs, adds, deletes, cost, *_) in enumerate(actions)
    ]
    return "\n".join([*lines, "0", ""])


class _Words:
    """Cached texts of conditions and effects by fact number, shared by all operators."""

    def __init__(self, number: int) -> None:
        self._holds = [f"{n} 1" for n in range(number)]
        self._added = [f"0 {n} -1 1" for n in range(number)]
        self._deleted = [f"0 {n} -1 0" for n in range(number)]
        self._moved = [(f"0 {n} 1 0", f"0 {n} 1 1") for n in range(number)]  # for facts in the precondition

    def operator(self, name: str, needs: list[int], adds: list[int], deletes: list[int], cost: int) -> str:
        moved = self._moved
        prevail = [self._holds[n] for n in needs if n not in adds and n not in deletes]
        effects = [moved[n][1] if n in needs else self._added[n] for n in adds]
        effects += [moved[n][0] if n in needs else self._deleted[n] for n in deletes]
        return "\n".join([
            "begin_operator", name, str(len(prevail)), *prevail, str(len(effects)), *effects, str(cost), "end_operator",
        ])  # fmt: skip

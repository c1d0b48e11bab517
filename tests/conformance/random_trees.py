"""Random behaviour trees, for the comparison with BehaviorTree.CPP; only the standard library is used, as in `tree_cases`."""

from __future__ import annotations

import random
from itertools import count
from xml.sax.saxutils import quoteattr

from tree_cases import Case, F, R, S, xml

LEAF_RESULTS = ([R, S], [R, F], [S], [F], [R, R, S], [S, F], [R, S, R, R, F], [F, R, R, S], [R, R, R, S])
TEST_RESULTS = ([S], [F], [S, F], [S, S, F], [F, F, S], [S, S, S, S, F])
CONDITIONS = (
    "x &lt; 3",
    "x == y",
    "y != 2",
    "x + y &gt; 3",
    "x &gt;= 1 &amp;&amp; y &lt; 4",
    "!(x == 2)",
    "s == 'on'",
    "x * y == 2 || s != 'on'",
)
EFFECTS = ("x += 1", "x = 0", "y = x", "y -= 1", "s = 'off'", "s = x > 1 ? 'on' : 'off'", "x = y + 1; y = 2")
SEQUENCES = (
    "Sequence",
    "Fallback",
    "ReactiveSequence",
    "ReactiveFallback",
    "SequenceWithMemory",
    "AsyncSequence",
    "AsyncFallback",
)


class RandomTree:
    """A random tree, made by a seed."""

    def __init__(self, seed: int) -> None:
        self._draw = random.Random(seed)
        self._numbers = count(1)
        self.results: dict[str, list[str]] = {}
        self.more = ""
        start = "x := 0; y := 1; s := 'on'"
        self.body = f"<Sequence><Script code={quoteattr(start)}/>{self._node(4)}</Sequence>"

    def case(self, seed: int) -> Case:
        """Return the tree as a case."""
        return Case(f"random {seed}", xml(self.body, self.more), self.results, 10)

    def _node(self, depth: int) -> str:
        draw = self._draw
        if depth == 0 or draw.random() < 0.15:
            return self._leaf()
        kind = draw.random()
        if kind < 0.45:
            return self._element(draw.choice(SEQUENCES), "", depth, draw.randint(1, 3))
        if kind < 0.65:
            return self._decorator(depth)
        if kind < 0.9:
            return self._branch(depth)
        return self._subtree(depth)

    def _element(self, kind: str, ports: str, depth: int, children: int) -> str:
        inner = "".join(self._node(depth - 1) for _ in range(children))
        return f"<{kind}{ports}{self._scripts()}>{inner}</{kind}>"

    def _scripts(self) -> str:
        draw, texts = self._draw, ""
        if draw.random() < 0.15:
            name = draw.choice(("_skipIf", "_successIf", "_failureIf", "_while"))
            texts += f' {name}="{draw.choice(CONDITIONS)}"'
        if draw.random() < 0.2:
            name = draw.choice(("_onSuccess", "_onFailure", "_onHalted", "_post"))
            texts += f" {name}={quoteattr(draw.choice(EFFECTS))}"
        return texts

    def _leaf(self) -> str:
        draw, kind = self._draw, self._draw.random()
        if kind < 0.12:
            return f"<Script code={quoteattr(draw.choice(EFFECTS))}/>"
        if kind < 0.24:
            return f'<ScriptCondition code="{draw.choice(CONDITIONS)}"/>'
        if kind < 0.3:
            return f"<{draw.choice(('AlwaysSuccess', 'AlwaysFailure'))}{self._scripts()}/>"
        action = kind < 0.8
        name = f"{'a' if action else 't'}{next(self._numbers)}"
        self.results[name] = list(draw.choice(LEAF_RESULTS if action else TEST_RESULTS))
        return f'<{"Act" if action else "Test"} name="{name}"{self._scripts()}/>'

    def _decorator(self, depth: int) -> str:
        draw = self._draw
        kind, ports = draw.choice((
            ("Inverter", ""), ("ForceSuccess", ""), ("ForceFailure", ""), ("KeepRunningUntilFailure", ""),
            ("Repeat", f' num_cycles="{draw.choice((1, 2, 3, -1))}"'),
            ("RetryUntilSuccessful", f' num_attempts="{draw.choice((1, 2, 3, -1))}"'),
            ("RunOnce", f' then_skip="{draw.choice(("true", "false"))}"'),
            ("Precondition", f' if="{draw.choice(CONDITIONS)}" else="{draw.choice(("SUCCESS", "FAILURE", "SKIPPED", "RUNNING"))}"'),
        ))  # fmt: skip
        return self._element(kind, ports, depth, 1)

    def _branch(self, depth: int) -> str:
        draw = self._draw
        kind = draw.choice(("Parallel", "ParallelAll", "IfThenElse", "WhileDoElse", "Switch2", "Switch3"))
        children = draw.choice((2, 3))
        if kind == "Parallel":
            ports = f' success_count="{draw.choice((1, 2, -1, -2))}" failure_count="{draw.choice((1, 2, -1))}"'
            return self._element(kind, ports, depth, children)
        if kind == "ParallelAll":
            return self._element(kind, f' max_failures="{draw.choice((1, 2, -1))}"', depth, children)
        if kind.startswith("Switch"):
            cases = int(kind[-1])
            ports = ' variable="{x}"' + "".join(f' case_{number}="{number - 1}"' for number in range(1, cases + 1))
            return self._element(kind, ports, depth, cases + 1)
        return self._element(kind, "", depth, children)

    def _subtree(self, depth: int) -> str:
        name = f"Sub{next(self._numbers)}"
        inner = self._node(depth - 1)
        self.more += f'<BehaviorTree ID="{name}">{inner}</BehaviorTree>'
        return f'<SubTree ID="{name}" _autoremap="true"{self._scripts()}/>'


def random_cases(number: int) -> list[Case]:
    """Return random trees with the seeds from 0."""
    return [RandomTree(seed).case(seed) for seed in range(number)]

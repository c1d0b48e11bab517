"""What worlds say, in forms that tests can compare; and how properties are tested."""

from __future__ import annotations

from typing import Any

import networkx as nx
from hypothesis import settings
from kb_strategies import SCHEMA

from knowledge_base import Fact

PROPERTY = settings(deadline=None, derandomize=True)
"""The same examples on every machine, however slow it is."""


class Ticks:
    """A clock that is one second later each time."""

    def __init__(self, start: float = 0.0) -> None:
        self.now = start

    def __call__(self) -> float:
        self.now += 1
        return self.now


def everything(view) -> tuple[Any, ...]:
    """All that a view or knowledge base says, with its version; the order counts, and 1 is not 1.0 nor True."""
    return view.version, repr(view.nodes()), repr(view.facts()), repr(view.values())


def unordered(view) -> tuple[Any, ...]:
    """All that it says, whatever the order."""
    return view.version, view.nodes(), set(view.facts()), view.values()


def graph_content(graph: nx.MultiDiGraph[Any]) -> tuple[dict[str, Any], set[Fact], dict[Fact, float]]:
    """Things, facts and numbers as the documented form of the graph says them."""
    said = [(node, data.get("value")) for node, data in graph.nodes(data=True) if isinstance(node, Fact)]
    for start, end, key, data in graph.edges(keys=True, data=True):
        if isinstance(key, str):
            signature = SCHEMA.predicates.get(key) or SCHEMA.functions[key]
            said.append((Fact(key, (start, end)[: signature.arity]), data.get("value")))
    things = {n: data["type"] for n, data in graph.nodes(data=True) if not isinstance(n, Fact)}
    return things, {f for f, v in said if v is None}, {f: v for f, v in said if v is not None}

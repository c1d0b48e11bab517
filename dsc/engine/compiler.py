"""A plot as tables: nodes in document order, edges by event. Done once for a plot, shared by all its instances."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from dsc.model.actions import Assign, Emit, ExternalAction, Tell
from dsc.model.language import TermField
from dsc.model.plot import ActionPlot, initial_of
from dsc.model.states import (
    AnyState,
    CompositeState,
    FinalState,
    OrthogonalState,
    Region,
    State,
    Transition,
)
from knowledge_base.errors import UnknownNameError
from knowledge_base.language.expression import Expression


@dataclass(frozen=True, slots=True)
class Edge:
    """A transition between nodes, by their indices; no target means that nothing is left or entered."""

    source: int
    trigger: str
    target: int | None
    guard: Expression | None
    effect: tuple[Assign | Tell | Emit, ...]
    rule: str | None = None


@dataclass(slots=True)
class Node:
    """A state, a region or (index 0) the plot itself.

    Attributes:
        index: position in document order.
        parent: index of the node around it; -1 for the plot.
        children: indices of the nodes directly inside.
        initial: the child entered by default; -1 where none or all are.
        state: the model value; `None` for the plot and for regions.
        edges: event name -> transitions in order.
        timeouts: delay and transition of each timeout.
        always: transitions without trigger.
    """

    index: int
    name: str
    parent: int
    state: AnyState | None
    children: list[int] = field(default_factory=list)
    initial: int = -1
    entry: tuple[ExternalAction, ...] = ()
    exit: tuple[ExternalAction, ...] = ()
    edges: dict[str, tuple[Edge, ...]] = field(default_factory=dict)
    timeouts: tuple[tuple[TermField, Edge], ...] = ()
    always: tuple[Edge, ...] = ()

    @property
    def final(self) -> bool:
        """Whether it is a final state."""
        return isinstance(self.state, FinalState)

    @property
    def orthogonal(self) -> bool:
        """Whether all its children are active together."""
        return isinstance(self.state, OrthogonalState)


@dataclass(frozen=True, slots=True)
class CompiledPlot:
    """A plot with its tables.

    Attributes:
        plot: the model.
        nodes: all nodes in document order; a node comes after the one around it.
        index: state name -> node index.
        form: the plot as data if it was bound as a value, else `None`.
    """

    plot: ActionPlot
    nodes: tuple[Node, ...]
    index: Mapping[str, int]
    form: Mapping[str, Any] | None = None

    def ancestors(self, index: int) -> list[int]:
        """The nodes around a node, innermost first, the plot last."""
        found = []
        while (index := self.nodes[index].parent) >= 0:
            found.append(index)
        return found

    def way(self, around: int, index: int) -> list[int]:
        """The nodes from one around it, which is not part of the way, down to a node."""
        ancestors = self.ancestors(index)
        return [*reversed(ancestors[: ancestors.index(around)]), index]

    def inside(self, index: int, around: int) -> bool:
        """Whether a node is (properly) inside another."""
        return around in self.ancestors(index)


class Chart(Protocol):
    """Where the engine finds plots: by name, or bound as a value."""

    def compiled(self, name: str) -> CompiledPlot:
        """The plot of that name; raises `UnknownNameError`."""
        ...

    def bind(self, form: Mapping[str, Any]) -> CompiledPlot:
        """A plot given as data, e.g. one made from a plan; raises `InputError`."""
        ...


def compile_plot(plot: ActionPlot, form: Mapping[str, Any] | None = None) -> CompiledPlot:
    """Lay out the plot's states as nodes and its transitions as edges.

    Raises:
        UnknownNameError: a transition or a scope names a state that is not there.
    """
    nodes = [Node(0, plot.name, -1, None)]
    _add_states(nodes, 0, plot)
    index = {node.name: node.index for node in nodes if node.state is not None}
    for node in nodes:
        if isinstance(node.state, State):
            _add_edges(node, node.state, index)
    return CompiledPlot(plot, tuple(nodes), index, form)


def _add_states(nodes: list[Node], parent: int, scope: ActionPlot | CompositeState | Region) -> None:
    first = initial_of(scope)
    if first not in scope.states:
        raise UnknownNameError(f"there is no state '{first}' to begin with", found=first, valid=scope.states)
    for name, state in scope.states.items():
        node = _append(nodes, name, parent, state)
        if name == first:
            nodes[parent].initial = node.index
        if isinstance(state, CompositeState):
            _add_states(nodes, node.index, state)
        elif isinstance(state, OrthogonalState):
            for region_name, region in state.regions.items():
                inner = _append(nodes, region_name, node.index, None)
                _add_states(nodes, inner.index, region)


def _append(nodes: list[Node], name: str, parent: int, state: AnyState | None) -> Node:
    node = Node(len(nodes), name, parent, state)
    if isinstance(state, State):
        node.entry, node.exit = state.entry, state.exit
    nodes.append(node)
    nodes[parent].children.append(node.index)
    return node


def _add_edges(node: Node, state: State, index: Mapping[str, int]) -> None:
    def edge(trigger: str, transition: Transition) -> Edge:
        target = None if transition.target is None else _target(node, transition.target, index)
        return Edge(node.index, trigger, target, transition.guard, transition.effect, transition.rule)

    node.edges = {event: tuple(edge(event, t) for t in many) for event, many in state.on.items()}
    node.timeouts = tuple((t.seconds, edge("after", t)) for t in state.after)
    node.always = tuple(edge("always", t) for t in state.always)


def _target(source: Node, name: str, index: Mapping[str, int]) -> int:
    if name not in index:
        raise UnknownNameError(
            f"there is no state '{name}' for a transition of '{source.name}'", found=name, valid=index
        )
    return index[name]

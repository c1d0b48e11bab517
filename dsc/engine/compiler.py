"""A plot as tables: nodes in document order, edges by event. Done once for a plot, shared by all its instances."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any, Protocol

from dsc.model.actions import ExternalAction, Internal
from dsc.model.language import TermField
from dsc.model.plot import ActionPlot, initial_of
from dsc.model.states import (
    AnyState,
    CompositeState,
    FinalState,
    HistoryState,
    OrthogonalState,
    Region,
    State,
)
from dsc.model.transitions import Transition
from knowledge_base.errors import SchemaError, UnknownNameError
from knowledge_base.language.expression import Expression


@dataclass(frozen=True, slots=True)
class Edge:
    """A transition between nodes, by their indices; no target means that nothing is left or entered.

    `internal` is only true where it makes a difference: a composite source with all targets inside it.
    `place` is where it stands in its source, e.g. `("on", "grasped", 0)`.
    """

    source: int
    trigger: str
    target: int | None
    guard: Expression | None
    effect: tuple[Internal, ...]
    rule: str | None = None
    also: tuple[int, ...] = ()
    internal: bool = False
    place: tuple[str | int, ...] = ()

    @property
    def targets(self) -> tuple[int, ...]:
        """All nodes to enter."""
        return () if self.target is None else (self.target, *self.also)


@dataclass(frozen=True, slots=True)
class Default:
    """Where a history leads that remembers nothing, and what happens on the way."""

    target: int
    effect: tuple[Internal, ...]


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
        histories: indices of the history nodes that remember what is inside.
        transparent: a region that stands for its only state (profile `scxml`), no scope for transitions.
    """

    index: int
    name: str
    parent: int
    state: AnyState | None
    children: list[int] = field(default_factory=list)
    initial: int = -1
    entry: tuple[ExternalAction | Internal, ...] = ()
    exit: tuple[ExternalAction | Internal, ...] = ()
    edges: dict[str, tuple[Edge, ...]] = field(default_factory=dict)
    timeouts: tuple[tuple[TermField, Edge], ...] = ()
    always: tuple[Edge, ...] = ()
    histories: list[int] = field(default_factory=list)
    transparent: bool = False

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
        defaults: history node -> what it stands for at first.
        entries: what is entered, by domain and targets, as far as it was worked out; at most one for each edge.
    """

    plot: ActionPlot
    nodes: tuple[Node, ...]
    index: Mapping[str, int]
    form: Mapping[str, Any] | None = None
    defaults: Mapping[int, Default] = field(default_factory=dict)
    entries: dict[tuple[int, tuple[int, ...]], Any] = field(default_factory=dict, compare=False, repr=False)

    @property
    def scxml(self) -> bool:
        """Whether the plot is in profile `scxml`: events match by prefix and keep SCXML's names."""
        return self.plot.profile == "scxml"

    def ancestors(self, index: int) -> list[int]:
        """The nodes around a node, innermost first, the plot last."""
        return _ancestors(self.nodes, index)

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
        SchemaError: targets that cannot be active together, or a history that does not lead to a state beside it.
    """
    nodes = [Node(0, plot.name, -1, None)]
    initials: list[tuple[int, str]] = []
    _add_states(nodes, 0, plot, initials)
    index = {node.name: node.index for node in nodes if node.state is not None}
    for parent, first in initials:
        nodes[parent].initial = _initial(nodes, parent, first, index, deep=plot.profile == "scxml")
    for node in nodes:
        if isinstance(node.state, State):
            _add_edges(node, node.state, index, nodes)
        node.transparent = plot.profile == "scxml" and _stands_for_its_state(nodes, node)
    defaults = {
        node.index: _default(nodes, node, node.state, index)
        for node in nodes
        if isinstance(node.state, HistoryState)
    }
    return CompiledPlot(plot, tuple(nodes), index, form, defaults)


def _default(nodes: list[Node], node: Node, history: HistoryState, index: Mapping[str, int]) -> Default:
    target = _target(node, history.target, index)
    if isinstance(nodes[target].state, HistoryState) or node.parent not in _ancestors(nodes, target):
        raise SchemaError(f"the history '{node.name}' does not lead to a state beside it", found=node.name)
    return Default(target, history.do)


def _together(nodes: Sequence[Node], targets: Sequence[int]) -> bool:
    """Whether all targets can be active at once: any two are in different regions (SCXML 3.11)."""
    ways = [[*reversed(_ancestors(nodes, target)), target] for target in targets]
    for first, second in combinations(ways, 2):
        split = sum(1 for one, other in zip(first, second, strict=False) if one == other)
        if split in {len(first), len(second)} or not nodes[first[split - 1]].orthogonal:
            return False
    return True


def _initial(nodes: list[Node], parent: int, first: str, index: Mapping[str, int], *, deep: bool) -> int:
    found = index.get(first, -1)
    around = [] if found < 0 else _ancestors(nodes, found)
    if parent not in (around if deep else around[:1]):
        valid = [name for name, at in index.items() if nodes[at].parent == parent]
        raise UnknownNameError(f"there is no state '{first}' to begin with", found=first, valid=valid)
    return found


def _ancestors(nodes: Sequence[Node], index: int) -> list[int]:
    found = []
    while (index := nodes[index].parent) >= 0:
        found.append(index)
    return found


def _stands_for_its_state(nodes: list[Node], node: Node) -> bool:
    is_region = node.state is None and node.index > 0
    return is_region and [nodes[child].name for child in node.children] == [node.name]


def _add_states(
    nodes: list[Node],
    parent: int,
    scope: ActionPlot | CompositeState | Region,
    initials: list[tuple[int, str]],
) -> None:
    initials.append((parent, initial_of(scope)))
    for name, state in scope.states.items():
        node = _append(nodes, name, parent, state)
        if isinstance(state, CompositeState):
            _add_states(nodes, node.index, state, initials)
        elif isinstance(state, OrthogonalState):
            for region_name, region in state.regions.items():
                inner = _append(nodes, region_name, node.index, None)
                _add_states(nodes, inner.index, region, initials)
            for history_name, history in state.connectors.items():
                _append(nodes, history_name, node.index, history)


def _append(nodes: list[Node], name: str, parent: int, state: AnyState | None) -> Node:
    node = Node(len(nodes), name, parent, state)
    if isinstance(state, State):
        node.entry, node.exit = state.entry, state.exit
    elif isinstance(state, FinalState):
        node.entry = state.entry
    nodes.append(node)
    inside = nodes[parent].histories if isinstance(state, HistoryState) else nodes[parent].children
    inside.append(node.index)
    return node


def _add_edges(node: Node, state: State, index: Mapping[str, int], nodes: Sequence[Node]) -> None:
    def edge(place: tuple[str | int, ...], trigger: str, transition: Transition) -> Edge:
        targets = [_target(node, name, index) for name in transition.targets]
        if not _together(nodes, targets):
            raise SchemaError(f"targets of a transition of '{node.name}' exclude each other", found=node.name)
        within = isinstance(state, CompositeState) and all(node.index in _ancestors(nodes, at) for at in targets)
        return Edge(
            node.index, trigger, targets[0] if targets else None, transition.guard, transition.effect,
            transition.rule, tuple(targets[1:]), transition.internal and within, place,
        )  # fmt: skip

    edges = {place: edge(place, trigger, transition) for place, trigger, transition in state.placed_transitions()}
    node.edges = {event: tuple(edges["on", event, n] for n in range(len(many))) for event, many in state.on.items()}
    node.timeouts = tuple((timed.seconds, edges["after", n]) for n, timed in enumerate(state.after))
    node.always = tuple(edges["always", n] for n in range(len(state.always)))


def _target(source: Node, name: str, index: Mapping[str, int]) -> int:
    if name not in index:
        raise UnknownNameError(
            f"there is no state '{name}' for a transition of '{source.name}'", found=name, valid=index
        )
    return index[name]

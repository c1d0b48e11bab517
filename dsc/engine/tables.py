"""Tables of a plot: nodes in document order, edges by event. All instances of a plot share its compiled tables."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, combinations, islice
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

from dsc.conversions import Conversions
from dsc.data_types import NO_RECORDS, Records, data_type
from dsc.engine.binding_types import with_types
from dsc.engine.membership import asked_states
from dsc.events import DONE
from dsc.model import states
from dsc.model.actions import Bind, ExternalAction, Internal
from dsc.model.language import TermField
from dsc.model.plot import ActionPlot, initial_of
from dsc.model.transitions import Connector, Transition
from knowledge_base.errors import SchemaError, UnknownNameError
from knowledge_base.language.syntax.expression import Expression


@dataclass(slots=True, eq=False)  # never changed; a frozen dataclass takes five times as long to create
class TransitionEdge:
    """A transition between nodes, which are given by index; without targets no state is exited or entered.

    Attributes:
        source, targets: indices of the source node and of the target nodes.
        trigger, guard, effect, rule: see `dsc.model.transitions.Transition`; with `bind`, the guard is its condition.
        internal: whether a composite source stays active if all targets are inside it (SCXML 3.5).
        place: keys of the transition in its source state, e.g. `("on", "grasped", 0)`.
        passed: arguments for the plot inside the target, by name.
        cleared: indices of the history nodes whose memory the transition clears.
        keeps: whether the plot inside the source continues in the plot that replaces it.
        interrupts: whether the source is exited as by another state's transition, with `on_break`.
        asks: whether the guard tests active states.
        bind: the action that binds variables to values, without which the transition is not taken; it is also the
            first action of `effect`.
    """

    source: int
    trigger: str
    targets: tuple[int, ...]
    guard: Expression | None
    effect: tuple[Internal, ...]
    rule: str | None = None
    internal: bool = False
    place: tuple[str | int, ...] = ()
    passed: Mapping[str, TermField] = field(default_factory=dict)
    cleared: tuple[int, ...] = ()
    keeps: bool = False
    interrupts: bool = False
    bind: Bind | None = None
    asks: bool = False


class Addressed(NamedTuple):
    """A trigger for one state.

    Attributes:
        event: name of the event.
        node: index of the addressed state.
        exact: whether only transitions of this state are considered, and not those of outer states.
        number: position of the timer among the state's timers of this event; `None` for any other event.
        inside: whether transitions of the states inside are considered, too.
    """

    event: str
    node: int
    exact: bool
    number: int | None
    inside: bool = False


Trigger = str | Addressed | None
"""Trigger of a plot's transitions.

A string is an event for all states, and `Addressed` is an event for one state. `None` selects transitions without
trigger.
"""


@dataclass(frozen=True, slots=True)
class Default:
    """Default target and effect of a history node, used before the first exit from the history's scope."""

    target: int
    effect: tuple[Internal, ...]


@dataclass(frozen=True, slots=True)
class TimedEdge:
    """A transition that a timer triggers after `seconds`."""

    seconds: TermField
    edge: TransitionEdge


def _nothing(_node: StateNode) -> None:
    """Build no tables; used for nodes without transitions."""


_TABLES = frozenset({"edges", "timeouts", "cycles", "always"})


@dataclass(slots=True, eq=False)
class StateNode:
    """Node of a compiled plot: a state, a region or, at index 0, the plot itself.

    The tables of transitions are built on first use, because a run may reach only the beginning of a long plot. Plots
    made from plans are often long.

    Attributes:
        index: position of the node in document order.
        name: name of the state; `#STATE:REGION` for a region.
        around: indices of the outer nodes, innermost first, with the plot last.
        last: index of the last node inside this node; `index` if there is none.
        children: indices of the nodes directly inside.
        initial: index of the node entered by default; -1 without children, or if all children are entered.
        state: the state in the model; `None` for the plot and for regions.
        entry, exit, broken: actions on entry, on exit by its own transition, and on exit by any other transition.
        edges: transitions in order, by event name.
        timeouts, cycles: transitions that a single timer triggers, and those that a periodic timer triggers.
        at_least: least time in seconds after entry before the transitions are enabled; `None` without such a time.
        lay_out: function that builds the four tables of transitions.
        always: transitions without trigger.
        histories: indices of the history nodes that remember the active nodes inside this node.
        transparent: whether the node is a region that stands for its only state (dialect `scxml`), without a scope.
        parent: index of the next outer node; -1 for the plot.
        final: whether the node is a final state.
        orthogonal: whether all children are active together.
        holds_plot: whether the node is a submachine or dynamic state, which contains another plot.
        timed: whether the entry starts a timer.
        addressed: whether events are sent to single activations of the node, which therefore need serial numbers.
        priority, preempts, handles: as in `Rank`, for the skills of the node; `priority` is `None` where no state of
            the plot around the node declares one.
        again: the transition by which the state is interrupted and entered again, once it was needed.
    """

    index: int
    name: str
    around: tuple[int, ...]
    state: states.AnyState | None
    last: int = 0
    children: list[int] = field(default_factory=list)
    initial: int = -1
    entry: tuple[ExternalAction | Internal, ...] = ()
    exit: tuple[ExternalAction | Internal, ...] = ()
    broken: tuple[ExternalAction | Internal, ...] = ()
    at_least: TermField | None = None
    histories: list[int] = field(default_factory=list)
    transparent: bool = False
    priority: float | None = None
    preempts: bool = False
    handles: bool = False
    again: TransitionEdge | None = None

    lay_out: Callable[[StateNode], None] = field(default=_nothing, repr=False)
    edges: dict[str, tuple[TransitionEdge, ...]] = field(init=False, repr=False)
    timeouts: tuple[TimedEdge, ...] = field(init=False, repr=False)
    cycles: tuple[TimedEdge, ...] = field(init=False, repr=False)
    always: tuple[TransitionEdge, ...] = field(init=False, repr=False)
    parent: int = field(init=False)
    final: bool = field(init=False)
    orthogonal: bool = field(init=False)
    holds_plot: bool = field(init=False)
    timed: bool = False
    addressed: bool = False

    def __post_init__(self) -> None:
        # Each step reads these attributes, so the node computes them once.
        self.parent = self.around[0] if self.around else -1
        kind = type(self.state)
        self.final = kind is states.FinalState
        self.orthogonal = kind is states.OrthogonalState
        self.holds_plot = kind is states.SubmachineState or kind is states.DynamicState

    def settle(self) -> None:
        """Compute `timed` and `addressed` from the transitions and actions."""
        state = self.state if isinstance(self.state, states.State) else None
        self.timed = state is not None and (bool(state.after or state.every) or self.at_least is not None)
        actions = (*self.entry, *self.exit, *self.broken)
        starts = bool(actions) and any(isinstance(action, ExternalAction) for action in actions)
        ends = state is not None and DONE in state.on
        self.addressed = starts or self.timed or self.holds_plot or ends

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> object:
            """Build the tables of transitions on first access; later accesses find the attribute."""
            if name not in _TABLES:
                raise AttributeError(name)
            self.edges, self.timeouts, self.cycles, self.always = {}, (), (), ()
            self.lay_out(self)
            return object.__getattribute__(self, name)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class CompiledPlot:
    """Compiled plot: the model with its tables.

    Attributes:
        plot: the plot's model.
        nodes: all nodes in document order; each node follows its parent.
        index: node indices by state name.
        form: the data of a plot that was bound as data; `None` for any other plot.
        defaults: default of each history, by node index.
        scxml: whether the plot is in dialect `scxml`, where events match by prefix and have the names of SCXML.
        types: types of parameters, variables and outputs by name; empty in dialect `scxml`.
        exact: by name, the classes of which each value has the type.
        records: the records of the plot's library, which later plots may extend.
        conversions: the functions that terms may call.
        cache: cached configurations and the initial reaction (see `automaton`).
    """

    plot: ActionPlot
    nodes: tuple[StateNode, ...]
    index: Mapping[str, int]
    form: Mapping[str, Any] | None = None
    defaults: Mapping[int, Default] = field(default_factory=dict)
    scxml: bool = False
    types: Mapping[str, str] = field(default_factory=dict)
    exact: Mapping[str, frozenset[type]] = field(default_factory=dict)
    records: Records = field(default_factory=dict)
    conversions: Conversions = field(default_factory=dict)
    cache: dict[Any, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"CompiledPlot({self.plot.name})"

    def __eq__(self, other: object) -> bool:
        """Compare the models and the data of bound plots."""
        if self is other:
            return True
        return isinstance(other, CompiledPlot) and self.form == other.form and self.plot == other.plot

    def __hash__(self) -> int:
        return hash(self.plot.name)

    def way(self, around: int, index: int) -> list[int]:
        """Return the indices on the path from the ancestor `around`, exclusive, to the node `index`, inclusive."""
        ancestors = self.nodes[index].around
        return [*reversed(ancestors[: ancestors.index(around)]), index]

    def inside(self, index: int, around: int) -> bool:
        """Return whether the node `index` is inside the node `around`."""
        return around < index <= self.nodes[around].last


def compile_plot(
    plot: ActionPlot,
    form: Mapping[str, Any] | None = None,
    records: Records = NO_RECORDS,
    conversions: Conversions = MappingProxyType({}),
) -> CompiledPlot:
    """Return the tables of a plot.

    Args:
        plot: the plot, without rules and handlers.
        form: the plot's data if it was bound as data.
        records: the records that types of the plot may name.
        conversions: the functions that terms of the plot may call.

    Raises:
        UnknownNameError: a transition or the initial state of a scope refers to a missing state.
        SchemaError: targets of a transition cannot be active together, or a history's default is outside its scope.
    """
    scxml = plot.dialect == "scxml"
    variables = plot.variables if plot.robot is None else plot.all_variables  # most plots have no robot section
    declared = {} if scxml else {**plot.parameters, **variables, **plot.outputs}
    types = {name: one.type for name, one in declared.items()}
    layout = _Layout(plot, types, records)
    for node in layout.nodes:
        layout.prepare(node)
    exact = {name: data_type(text).exact for name, text in types.items()}
    return CompiledPlot(
        plot, tuple(layout.nodes), layout.index, form, layout.defaults(), scxml, types, exact, records, conversions
    )


class _Layout:
    """Builder of the nodes of a plot and of the edges between them."""

    def __init__(self, plot: ActionPlot, types: Mapping[str, str], records: Records) -> None:
        self._scxml = plot.dialect == "scxml"
        self._types, self._records = types, records
        self._initials: list[tuple[StateNode, str]] = []
        self.nodes = [StateNode(0, plot.name, (), None)]
        self._add_states(self.nodes[0], plot)
        self.index = {node.name: node.index for node in self.nodes[1:] if node.state is not None}
        for node, first in self._initials:
            node.initial = self._initial(node, first)

    def _add_states(self, parent: StateNode, scope: ActionPlot | states.CompositeState | states.Region) -> None:
        self._initials.append((parent, initial_of(scope)))
        for name, state in scope.states.items():
            node = self._append(name, parent, state)
            if isinstance(state, states.CompositeState):
                self._add_states(node, state)
            elif isinstance(state, states.OrthogonalState):
                self._add_regions(node, state)
            node.last = len(self.nodes) - 1
        parent.last = len(self.nodes) - 1

    def _add_regions(self, node: StateNode, state: states.OrthogonalState) -> None:
        for name, region in state.regions.items():
            inner = self._append(f"#{node.name}:{name}", node, None)
            # SCXML has no element for regions: a region with the name of its only state stands for this state.
            inner.transparent = self._scxml and [*region.states] == [name]
            self._add_states(inner, region)
        for name, history in state.connectors.items():
            self._append(name, node, history)

    def _append(self, name: str, parent: StateNode, state: states.AnyState | None) -> StateNode:
        index = len(self.nodes)
        node = StateNode(index, name, (parent.index, *parent.around), state, last=index)
        node.priority, node.preempts, node.handles = parent.priority, parent.preempts, parent.handles
        if isinstance(state, states.State):
            if state.priority is not None:
                node.priority, node.preempts, node.handles = state.priority, False, False
            node.preempts = node.preempts or state.preempt
            node.handles = node.handles or (state.handles and state.priority is None)
            node.entry, node.exit, node.broken = state.entry, state.exit, state.on_break or state.exit
            node.at_least = state.at_least
        elif isinstance(state, states.FinalState):
            node.entry = state.entry
        self.nodes.append(node)
        (parent.histories if isinstance(state, states.HistoryState) else parent.children).append(index)
        return node

    def _initial(self, parent: StateNode, first: str) -> int:
        found = self.index.get(first, -1)
        around = () if found < 0 else self.nodes[found].around
        if parent.index not in (around if self._scxml else around[:1]):
            valid = [name for name, at in self.index.items() if self.nodes[at].parent == parent.index]
            raise UnknownNameError(f"there is no state '{first}' to begin with", found=first, valid=valid)
        return found

    def defaults(self) -> dict[int, Default]:
        """Return the default target and effect of each history, by node index."""
        histories = [(node, node.state) for node in self.nodes if isinstance(node.state, states.HistoryState)]
        return {node.index: self._default(node, history) for node, history in histories}

    def _default(self, node: StateNode, history: states.HistoryState) -> Default:
        target = self._target(node, history.target)
        if isinstance(self.nodes[target].state, states.HistoryState) or node.parent not in self.nodes[target].around:
            raise SchemaError(f"the history '{node.name}' does not lead to a state in its scope", found=node.name)
        return Default(target, history.do)

    def prepare(self, node: StateNode) -> None:
        """Build the edges of a node immediately if they may contain errors; else schedule them for first use."""
        if isinstance(node.state, states.State | Connector):
            node.lay_out = self._lay_out
            if isinstance(node.state, Connector) or not self._is_plain(node.state):
                self._lay_out(node)
        node.settle()

    def _is_plain(self, state: states.State) -> bool:
        """Return whether the transitions of a state need no check: at most one target, which exists, and no `clear`."""
        for one in chain(chain.from_iterable(state.on.values()), state.after, state.every, state.always):
            if one.also or one.clear or (one.target is not None and one.target not in self.index):
                return False
        return True

    def _lay_out(self, node: StateNode) -> None:
        """Build all tables of transitions of one node."""
        state = node.state
        if not isinstance(state, states.State | Connector):
            return
        # `placed_transitions` yields in the order of the tables. A search by place would be slow in large plots.
        edges = (self._edge(node, place, trigger, one) for place, trigger, one in state.placed_transitions())
        if isinstance(state, states.State):
            node.edges = {event: tuple(islice(edges, len(many))) for event, many in state.on.items()}
            node.timeouts = tuple([TimedEdge(timed.seconds, next(edges)) for timed in state.after])
            node.cycles = tuple([TimedEdge(timed.seconds, next(edges)) for timed in state.every])
        else:
            node.edges, node.timeouts, node.cycles = {}, (), ()
        node.always = tuple(edges)

    def _edge(
        self, node: StateNode, place: tuple[str | int, ...], trigger: str, transition: Transition
    ) -> TransitionEdge:
        targets = tuple([self._target(node, name) for name in transition.targets])
        if len(targets) > 1 and not self._together(targets):
            raise SchemaError(f"targets of a transition of '{node.name}' exclude each other", found=node.name)
        guard, effect, bind = transition.guard, transition.effect, None
        if transition.bind or transition.bind_all:
            effect = tuple([self._with_types(action) for action in effect])
            first = effect[0]
            if isinstance(first, Bind) and not first.every:
                guard, bind = first.condition, first
        return TransitionEdge(
            node.index, trigger, targets, guard, effect, transition.rule,
            transition.internal and isinstance(node.state, states.CompositeState), place, transition.passed,
            tuple(self._find_cleared(node, transition)) if transition.clear else (),
            transition.keep and node.holds_plot and targets == (node.index,), bind=bind,
            asks=guard is not None and bool(asked_states(guard)),
        )  # fmt: skip

    def _with_types(self, action: Internal) -> Internal:
        return with_types(action, self._types, self._records) if isinstance(action, Bind) else action

    def _together(self, targets: Sequence[int]) -> bool:
        """Return whether all targets can be active together, because each pair is in different regions (SCXML 3.11)."""
        ways = [[*reversed(self.nodes[target].around), target] for target in targets]
        for first, second in combinations(ways, 2):
            split = sum(1 for one, other in zip(first, second, strict=False) if one == other)
            if split in {len(first), len(second)} or not self.nodes[first[split - 1]].orthogonal:
                return False
        return True

    def _target(self, source: StateNode, name: str) -> int:
        found = self.index.get(name)
        if found is None:
            raise UnknownNameError(
                f"there is no state '{name}' for a transition of '{source.name}'", found=name, valid=self.index
            )
        return found

    def _find_cleared(self, source: StateNode, transition: Transition) -> Iterator[int]:
        """Yield the indices of histories that a transition clears; `*` includes those of all inner states."""
        for name in transition.clear:
            node = self.nodes[self._target(source, name.removesuffix("*"))]
            regions = [self.nodes[child] for child in node.children] if node.orthogonal else []
            everything = self.nodes[node.index : node.last + 1]
            for one in everything if name.endswith("*") else [node, *regions]:
                yield from one.histories

"""Tables of a plot: nodes in document order, edges by event. Compiled once, shared by all instances."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

from dsc.events import DONE
from dsc.model.actions import ExternalAction, Internal, Trigger
from dsc.model.language import TermField
from dsc.model.plot import ActionPlot
from dsc.model.states import AnyState, DynamicState, FinalState, OrthogonalState, State, SubmachineState
from knowledge_base.language.syntax.expression import Expression


@dataclass(slots=True, eq=False)  # never changed; a frozen one takes five times as long to create
class TransitionEdge:
    """A transition between nodes, by their indices; without targets no state is exited or entered.

    Attributes:
        source, targets: the nodes that it leads from and to.
        trigger, guard, effect, rule: as in the model.
        internal: whether a composite source stays active if all targets are inside it (SCXML 3.5).
        place: its place in its source, e.g. `("on", "grasped", 0)`.
        passed: arguments for the plot inside the target.
        cleared: history nodes that forget.
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


@dataclass(frozen=True, slots=True)
class Default:
    """The default target of a history that remembers nothing, with its effect."""

    target: int
    effect: tuple[Internal, ...]


@dataclass(frozen=True, slots=True)
class TimedEdge:
    """A transition triggered by time."""

    seconds: TermField
    edge: TransitionEdge


def _nothing(_node: StateNode) -> None:
    """Build no tables: the node has no transitions."""


_TABLES = frozenset({"edges", "timeouts", "cycles", "always"})


@dataclass(slots=True, eq=False)
class StateNode:
    """A state, a region or (index 0) the plot itself.

    The tables of its transitions are built on first use. A run may reach only the beginning of a long plot, as of one
    made from a plan.

    Attributes:
        index: position in document order.
        name: the state's name; of a region, its place, `#index`.
        around: indices of the nodes around it, innermost first, the plot last.
        last: index of the last node inside it; its own if there is none.
        children: indices of the nodes directly inside.
        initial: the child entered by default; -1 if there is none or all are entered.
        state: the model value; `None` for the plot and for regions.
        entry, exit, broken: actions at entry, at exit, and at an exit by a transition of another state.
        edges: event name -> transitions in order.
        timeouts, cycles: transitions after a time, and each time it has passed again.
        at_least: the least time before its transitions are enabled.
        lay_out: builds these tables.
        always: transitions without trigger.
        histories: indices of the history nodes that remember its content.
        transparent: a region that stands for its only state (dialect `scxml`), not a scope for transitions.
        parent: index of the node around it; -1 for the plot.
        final: whether it is a final state.
        orthogonal: whether all its children are active together.
        holds_plot: whether its content is another plot.
        timed: whether its entry starts a timer.
        addressed: whether events are sent to one of its activations, so that they need numbers.
    """

    index: int
    name: str
    around: tuple[int, ...]
    state: AnyState | None
    last: int = 0
    children: list[int] = field(default_factory=list)
    initial: int = -1
    entry: tuple[ExternalAction | Internal, ...] = ()
    exit: tuple[ExternalAction | Internal, ...] = ()
    broken: tuple[ExternalAction | Internal, ...] = ()
    at_least: TermField | None = None
    histories: list[int] = field(default_factory=list)
    transparent: bool = False

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
        # Each step reads these, so they are computed once.
        self.parent = self.around[0] if self.around else -1
        kind = type(self.state)
        self.final = kind is FinalState
        self.orthogonal = kind is OrthogonalState
        self.holds_plot = kind is SubmachineState or kind is DynamicState

    def settle(self) -> None:
        """Derive `timed` and `addressed` from the transitions and actions."""
        state = self.state if isinstance(self.state, State) else None
        self.timed = state is not None and (bool(state.after or state.every) or self.at_least is not None)
        actions = (*self.entry, *self.exit, *self.broken)
        starts = bool(actions) and any(isinstance(action, Trigger) for action in actions)
        ends = state is not None and DONE in state.on
        self.addressed = starts or self.timed or self.holds_plot or ends

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> object:
            """Build a missing table on first access; later accesses find the attribute."""
            if name not in _TABLES:
                raise AttributeError(name)
            self.edges, self.timeouts, self.cycles, self.always = {}, (), (), ()
            self.lay_out(self)
            return object.__getattribute__(self, name)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class CompiledPlot:
    """A plot with its tables.

    Attributes:
        plot: the model.
        nodes: all nodes in document order; a node comes after the one around it.
        index: state name -> node index.
        form: the plot as data if it was bound as a value, else `None`.
        defaults: history node -> its default.
        scxml: whether the plot is in dialect `scxml`: events match by prefix and keep SCXML's names.
        cache: the kept configurations and the initial reaction (see `configuration`).
    """

    plot: ActionPlot
    nodes: tuple[StateNode, ...]
    index: Mapping[str, int]
    form: Mapping[str, Any] | None = None
    defaults: Mapping[int, Default] = field(default_factory=dict)
    scxml: bool = False
    cache: dict[Any, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"CompiledPlot({self.plot.name})"

    def __eq__(self, other: object) -> bool:
        """Compare the plots and their forms."""
        if self is other:
            return True
        return isinstance(other, CompiledPlot) and self.form == other.form and self.plot == other.plot

    def __hash__(self) -> int:
        return hash(self.plot.name)

    def way(self, around: int, index: int) -> list[int]:
        """Return the nodes from an ancestor, exclusive, down to a node, inclusive."""
        ancestors = self.nodes[index].around
        return [*reversed(ancestors[: ancestors.index(around)]), index]

    def inside(self, index: int, around: int) -> bool:
        """Return whether a node is inside another, which it follows in document order."""
        return around < index <= self.nodes[around].last


class Chart(Protocol):
    """Provider of plots: by name, or bound as a value."""

    def compiled(self, name: str) -> CompiledPlot:
        """Return the plot of that name; raise `UnknownNameError`."""
        ...

    def bind(self, form: Mapping[str, Any]) -> CompiledPlot:
        """Compile a plot given as data, e.g. one made from a plan; raise `InputError`."""
        ...

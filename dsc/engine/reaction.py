"""Reactions: exits, actions, entries and the next configuration after a set of transitions of one plot.

A submachine or dynamic state is one node here; the plot inside it has separate reactions.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from dsc.engine.configuration import Configuration
from dsc.engine.steps import Taken
from dsc.engine.tables import CompiledPlot, StateNode, TransitionEdge
from dsc.model.actions import Emit, ExternalAction, Internal

Action = ExternalAction | Internal
MOST_REPORTS = 64
"""Upper bound of host paths with a kept report of a reaction."""


@dataclass(frozen=True, slots=True, eq=False)
class Exit:
    """A node to exit, with its exit actions.

    Attributes:
        cancels: whether it started skills or timers that the exit cancels.
    """

    node: StateNode
    actions: tuple[Action, ...]
    cancels: bool

    @property
    def quiet(self) -> bool:
        """Whether the exit has no actions."""
        return not self.actions and not self.node.addressed


@dataclass(frozen=True, slots=True, eq=False)
class StateEntry:
    """A node to enter, with its entry actions.

    Attributes:
        actions: its entry actions.
        after: the effect of a history's default that leads to it, as a separate block (appendix D).
        completes: indices of the nodes that it completes; 0 for the plot itself.
        emits: the outcome of a final state.
    """

    node: StateNode
    actions: tuple[Action, ...]
    after: tuple[Action, ...]
    completes: tuple[int, ...]
    emits: Emit | None = None

    @property
    def quiet(self) -> bool:
        """Whether the entry has no actions or further effects."""
        acts = self.actions or self.after or self.emits
        return not acts and not self.completes and not self.node.addressed


@dataclass(frozen=True, slots=True, eq=False)
class ReactionPart:
    """One transition's internal actions and entries, in order.

    Attributes:
        acts: whether it has actions, or arguments to pass.
    """

    edge: TransitionEdge | None
    effect: tuple[Action, ...]
    entrances: tuple[StateEntry, ...]
    acts: bool

    @property
    def quiet(self) -> bool:
        """Whether the part only enters nodes."""
        return not self.acts and all(entrance.quiet for entrance in self.entrances)


@dataclass(frozen=True, slots=True, eq=False)
class CompiledReaction:
    """The effect of one microstep on one plot.

    Attributes:
        parts: one for each transition, in the order in which they are taken.
        exits: all exits, in order.
        following: the configuration after it.
        keeps: names of states that keep the event until their least time has passed.
        taken, exited, entered: its report for the outermost plot.
        silent: whether it only exits states.
        still: whether it only changes the configuration.
        reports: transitions taken, for plots inside, by the path of their host state.
    """

    parts: tuple[ReactionPart, ...]
    exits: tuple[Exit, ...]
    following: Configuration
    keeps: tuple[str, ...] = ()
    taken: tuple[Taken, ...] = ()
    exited: tuple[str, ...] = ()
    entered: tuple[str, ...] = ()
    silent: bool = False
    still: bool = False
    reports: dict[str, tuple[Taken, ...]] = field(default_factory=dict)

    def taken_in(self, compiled: CompiledPlot, prefix: str) -> tuple[Taken, ...]:
        """Return the report of the transitions in a plot whose states' paths begin with the prefix."""
        if not prefix:
            return self.taken
        found = self.reports.get(prefix)
        if found is None:
            if len(self.reports) >= MOST_REPORTS:
                self.reports.clear()
            found = self.reports[prefix] = tuple([report(p.edge, compiled, prefix) for p in self.parts if p.edge])
        return found


def report(edge: TransitionEdge, compiled: CompiledPlot, prefix: str = "") -> Taken:
    """Return the report of a taken transition."""
    nodes = compiled.nodes
    target = prefix + nodes[edge.targets[0]].name if edge.targets else None
    return Taken(prefix + nodes[edge.source].name, edge.trigger, target, edge.rule, compiled.plot.name, edge.place)

"""What transitions taken together do to a plot: exits, actions, entries, the next configuration.

A submachine or dynamic state is one node here; what runs inside it has reactions of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from dsc.engine.configuration import Configuration
from dsc.engine.steps import Taken
from dsc.engine.tables import CompiledPlot, StateNode, TransitionEdge
from dsc.model.actions import Emit, ExternalAction, Internal

Action = ExternalAction | Internal
MOST_REPORTS = 64
"""Places kept for which a reaction is reported."""


@dataclass(frozen=True, slots=True, eq=False)
class Exit:
    """A node to be left, and what it does then.

    Attributes:
        cancels: whether it started what has to be stopped.
    """

    node: StateNode
    actions: tuple[Action, ...]
    cancels: bool

    @property
    def quiet(self) -> bool:
        """Whether the node is only left."""
        return not self.actions and not self.node.addressed


@dataclass(frozen=True, slots=True, eq=False)
class StateEntry:
    """A node to be entered, and what it does then.

    Attributes:
        actions: those of its entry.
        after: those of a history's default that leads to it (a block of its own, appendix D).
        completes: indices of the nodes whose content is complete with it; 0 for the plot itself.
        emits: the outcome of a final state.
    """

    node: StateNode
    actions: tuple[Action, ...]
    after: tuple[Action, ...]
    completes: tuple[int, ...]
    emits: Emit | None = None

    @property
    def quiet(self) -> bool:
        """Whether the node is only entered."""
        acts = self.actions or self.after or self.emits
        return not acts and not self.completes and not self.node.addressed


@dataclass(frozen=True, slots=True, eq=False)
class ReactionPart:
    """What one transition contributes: its internal actions, and what is entered because of it, in order.

    Attributes:
        acts: whether it has actions, or arguments to pass.
    """

    edge: TransitionEdge | None
    effect: tuple[Action, ...]
    entrances: tuple[StateEntry, ...]
    acts: bool

    @property
    def quiet(self) -> bool:
        """Whether nodes are entered and that is all."""
        return not self.acts and all(entrance.quiet for entrance in self.entrances)


@dataclass(frozen=True, slots=True, eq=False)
class CompiledReaction:
    """What happens in one plot.

    Attributes:
        parts: of each transition, in the order in which they are taken.
        exits: everything that is left, in order.
        following: the configuration after it.
        keeps: names of states that keep the event until their least time has passed.
        taken, exited, entered: how it is reported for the outermost plot.
        silent: whether nothing happens but that states are left.
        still: whether nothing but the configuration changes.
        reports: what was taken, for plots inside, by the path of the state that holds them.
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
        """How the transitions are reported in a plot whose states' paths begin with the prefix."""
        if not prefix:
            return self.taken
        found = self.reports.get(prefix)
        if found is None:
            if len(self.reports) >= MOST_REPORTS:
                self.reports.clear()
            found = self.reports[prefix] = tuple([report(p.edge, compiled, prefix) for p in self.parts if p.edge])
        return found


def report(edge: TransitionEdge, compiled: CompiledPlot, prefix: str = "") -> Taken:
    """How a transition that is taken is reported."""
    nodes = compiled.nodes
    target = prefix + nodes[edge.targets[0]].name if edge.targets else None
    return Taken(prefix + nodes[edge.source].name, edge.trigger, target, edge.rule, compiled.plot.name, edge.place)

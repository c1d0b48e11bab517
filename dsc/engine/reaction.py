"""What transitions taken together do to a plot, worked out once: exits, actions, entries, the next configuration.

SCXML 1.0, appendix D: microstep, computeExitSet, exitStates, enterStates. A submachine or dynamic state is one
node here; what runs inside it has reactions of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import TypeVar

from dsc.engine.configuration import Configuration, configuration_of
from dsc.engine.entering import entry_set
from dsc.engine.membership import settle
from dsc.engine.selection import domain, left_by
from dsc.engine.steps import Taken
from dsc.engine.tables import CompiledPlot, Edge, Node
from dsc.events import DONE
from dsc.model.actions import Choose, Emit, ExternalAction, Internal, Trigger
from dsc.model.states import FinalState, HistoryState, State

Action = ExternalAction | Internal
_AnyAction = TypeVar("_AnyAction", bound=Action)


@dataclass(frozen=True, slots=True, eq=False)
class Exit:
    """A node to be left, and what it does then.

    Attributes:
        cancels: whether it started what has to be stopped.
    """

    node: Node
    actions: tuple[Action, ...]
    cancels: bool


@dataclass(frozen=True, slots=True, eq=False)
class Entrance:
    """A node to be entered, and what it does then.

    Attributes:
        actions: those of its entry.
        after: those of a history's default that leads to it (a block of its own, appendix D).
        completes: index of the node whose content is complete with it; 0 for the plot itself.
        emits: the outcome of a final state.
    """

    node: Node
    actions: tuple[Action, ...]
    after: tuple[Action, ...]
    completes: int | None
    emits: Emit | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """What one transition contributes: its internal actions, and what is entered because of it, in order.

    Attributes:
        acts: whether it has actions, or arguments to pass.
    """

    edge: Edge | None
    effect: tuple[Action, ...]
    entrances: tuple[Entrance, ...]
    acts: bool


@dataclass(frozen=True, slots=True, eq=False)
class Reaction:
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

    parts: tuple[Part, ...]
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


MOST_REPORTS = 64
"""Places kept for which a reaction is reported."""


def reaction_of(configuration: Configuration, edges: tuple[Edge, ...], keeps: tuple[str, ...] = ()) -> Reaction:
    """The reaction of a configuration in which these transitions are taken."""
    found: Reaction | None = configuration.reactions.get((edges, keeps))
    if found is None:
        found = configuration.reactions[edges, keeps] = _Work(configuration).taking(edges, keeps)
    return found


def initial_reaction(compiled: CompiledPlot) -> Reaction:
    """How a plot is entered."""
    found: Reaction | None = compiled.cache.get(None)
    if found is None:
        found = _Work(configuration_of(compiled, ())).entering()
        compiled.cache[None] = found
    return found


def leaving_reaction(configuration: Configuration) -> Reaction:
    """How a plot is left because the state around it is, or because the run ends: all its states are interrupted."""
    found: Reaction | None = configuration.reactions.get(None)
    if found is None:
        found = configuration.reactions[None] = _Work(configuration).leaving()
    return found


def report(edge: Edge, compiled: CompiledPlot, prefix: str = "") -> Taken:
    """How a transition that is taken is reported."""
    nodes = compiled.nodes
    target = prefix + nodes[edge.targets[0]].name if edge.targets else None
    return Taken(prefix + nodes[edge.source].name, edge.trigger, target, edge.rule, compiled.plot.name, edge.place)


def _names(nodes: Iterable[Node]) -> Iterator[str]:
    return (node.name for node in nodes if node.state is not None)


def _leaves_quietly(one: Exit) -> bool:
    return not one.actions and not one.node.addressed


def _moves_quietly(part: Part) -> bool:
    return not part.acts and all(map(_is_entered_quietly, part.entrances))


def _is_entered_quietly(one: Entrance) -> bool:
    acts = one.actions or one.after or one.emits
    return not acts and one.completes is None and not one.node.addressed


def _outcome(node: Node) -> Emit | None:
    final = node.state
    if not isinstance(final, FinalState) or final.emit is None:
        return None
    return Emit(emit=final.emit, arguments=final.arguments)


@dataclass(slots=True)
class _Work:
    """The configuration as it changes on the way."""

    configuration: Configuration
    present: set[int] = field(init=False)
    waiting: set[int] = field(init=False)
    remembered: dict[int, tuple[int, ...]] = field(init=False)

    def __post_init__(self) -> None:
        self.present = set(self.configuration.active)
        self.waiting = set(self.configuration.waiting)
        self.remembered = dict(self.configuration.history)

    @property
    def compiled(self) -> CompiledPlot:
        return self.configuration.compiled

    def taking(self, edges: tuple[Edge, ...], keeps: tuple[str, ...]) -> Reaction:
        left = {i for edge in edges for i in left_by(self.compiled, edge, self.present, self.remembered)}
        exits = self._exits(left, {edge.source for edge in edges})
        effects = [tuple(self._settled(edge.effect)) for edge in edges]
        for edge in edges:
            for history in edge.cleared:
                self.remembered.pop(history, None)
        parts = [
            Part(edge, effect, self._reached(edge), bool(effect or edge.passed))
            for edge, effect in zip(edges, effects, strict=True)
        ]
        return self._reaction(tuple(parts), exits, keeps, tuple([report(edge, self.compiled) for edge in edges]))

    def entering(self) -> Reaction:
        entrances = self._entrances(0, (self.compiled.nodes[0].initial,))
        return self._reaction((Part(None, (), entrances, acts=False),), (), (), ())

    def leaving(self) -> Reaction:
        return self._reaction((), self._exits(self.present, set()), (), ())

    def _reaction(
        self, parts: tuple[Part, ...], exits: tuple[Exit, ...], keeps: tuple[str, ...], taken: tuple[Taken, ...]
    ) -> Reaction:
        entrances = [entrance for part in parts for entrance in part.entrances]
        following = configuration_of(
            self.compiled,
            tuple(sorted(self.present)),
            frozenset(self.waiting),
            tuple(sorted(self.remembered.items())),
        )
        quiet = not keeps and not self.waiting and not following.spontaneous
        silent = not parts and all(map(_leaves_quietly, exits))
        still = quiet and bool(parts) and all(map(_leaves_quietly, exits)) and all(map(_moves_quietly, parts))
        return Reaction(
            parts, exits, following, keeps, taken,
            exited=tuple(_names(one.node for one in exits)),
            entered=tuple(_names(one.node for one in entrances)),
            silent=silent,
            still=still,
        )  # fmt: skip

    def _exits(self, left: set[int], sources: set[int]) -> tuple[Exit, ...]:
        """Inner before outer, later before earlier: the reverse of document order."""
        ordered = sorted(left, reverse=True)
        for index in ordered:
            self._remember(index)
        exits = []
        for index in ordered:
            node = self.compiled.nodes[index]
            actions = node.exit if index in sources else node.broken
            cancels = node.timed or any(isinstance(action, Trigger) for action in node.entry)
            exits.append(Exit(node, tuple(self._settled(actions)), cancels))
            self.present.discard(index)
            self.waiting.discard(index)
        return tuple(exits)

    def _remember(self, index: int) -> None:
        """Record what is active inside a node that is about to be left, for its histories (SCXML 3.10)."""
        nodes, configuration = self.compiled.nodes, self.configuration
        for history in nodes[index].histories:
            state = nodes[history].state
            if isinstance(state, HistoryState) and state.history == "deep":
                kept = tuple([leaf for leaf in configuration.leaves if self.compiled.inside(leaf, index)])
            else:
                kept = tuple([child for child in nodes[index].children if child in configuration.members])
            self.remembered[history] = kept

    def _reached(self, edge: Edge) -> tuple[Entrance, ...]:
        if not edge.targets:
            return ()
        return self._entrances(domain(self.compiled, edge, self.remembered), edge.targets)

    def _entrances(self, around: int, targets: tuple[int, ...]) -> tuple[Entrance, ...]:
        entry = entry_set(self.compiled, around, targets, self.remembered)
        entrances = []
        for index in sorted(entry.nodes):
            node = self.compiled.nodes[index]
            self.present.add(index)
            if node.at_least is not None:
                self.waiting.add(index)
            actions, after = self._settled(node.entry), self._settled(entry.after.get(index, ()))
            completes = self._completed(node)
            entrances.append(Entrance(node, tuple(actions), tuple(after), completes, _outcome(node)))
        return tuple(entrances)

    def _settled(self, actions: Iterable[_AnyAction]) -> Iterator[_AnyAction]:
        """The actions; what they ask about active states is answered as of now."""
        for action in actions:
            if isinstance(action, Choose):
                yield self._settled_choose(action)  # type: ignore[misc]  # a Choose for a Choose
            else:
                yield action

    def _settled_choose(self, action: Choose) -> Choose:
        condition = settle(action.condition, self._is_present)
        then, otherwise = tuple(self._settled(action.then)), tuple(self._settled(action.otherwise))
        return Choose(condition=condition, then=then, otherwise=otherwise)

    def _is_present(self, state: str) -> bool:
        return self.compiled.index.get(state) in self.present

    def _completed(self, node: Node) -> int | None:
        """The node whose content is complete now that this one is entered, if anybody wants to know."""
        around = self._around_complete(node)
        if around and not self.compiled.scxml and DONE not in self.compiled.nodes[around].edges:
            return None
        return around

    def _around_complete(self, node: Node) -> int | None:
        nodes = self.compiled.nodes
        if not node.final:
            at_once = type(node.state) is State and not self.compiled.scxml
            return node.index if at_once else None
        around = nodes[node.parent]
        if around.index == 0 or around.state is not None:
            return around.index
        regions = nodes[around.parent].children
        return around.parent if all(map(self._is_finished, regions)) else None

    def _is_finished(self, region: int) -> bool:
        nodes = self.compiled.nodes
        return any(child in self.present and nodes[child].final for child in nodes[region].children)

"""Reactions, computed once for each configuration and set of transitions (lazy determinisation).

SCXML 1.0, appendix D: microstep, computeExitSet, exitStates, enterStates.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import TypeVar

from dsc.engine.configuration import Configuration, configuration_of
from dsc.engine.entry_set import entry_set
from dsc.engine.membership import settle
from dsc.engine.reaction import Action, CompiledReaction, Exit, ReactionPart, StateEntry, report
from dsc.engine.steps import Taken
from dsc.engine.tables import CompiledPlot, StateNode, TransitionEdge
from dsc.engine.transition_selection import domain, left_by
from dsc.events import DONE
from dsc.model.actions import Block, Choose, Emit, Trigger
from dsc.model.states import FinalState, HistoryState, State

_AnyAction = TypeVar("_AnyAction", bound=Action)


def reaction_of(
    configuration: Configuration, edges: tuple[TransitionEdge, ...], keeps: tuple[str, ...] = ()
) -> CompiledReaction:
    """Return the reaction of a configuration when these transitions are taken."""
    found: CompiledReaction | None = configuration.reactions.get((edges, keeps))
    if found is None:
        found = configuration.reactions[edges, keeps] = _Work(configuration).taking(edges, keeps)
    return found


def initial_reaction(compiled: CompiledPlot) -> CompiledReaction:
    """Return the reaction that enters a plot by default."""
    found: CompiledReaction | None = compiled.cache.get(None)
    if found is None:
        found = _Work(configuration_of(compiled, ())).entering()
        compiled.cache[None] = found
    return found


def leaving_reaction(configuration: Configuration) -> CompiledReaction:
    """Return the reaction that exits all states of a plot, as interrupted: its host was exited or the run ends."""
    found: CompiledReaction | None = configuration.reactions.get(None)
    if found is None:
        found = configuration.reactions[None] = _Work(configuration).leaving()
    return found


@dataclass(slots=True)
class _Work:
    """Working copy of a configuration that changes during a microstep."""

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

    def taking(self, edges: tuple[TransitionEdge, ...], keeps: tuple[str, ...]) -> CompiledReaction:
        left_of = [left_by(self.compiled, edge, self.present, self.remembered) for edge in edges]
        own = {edge.source for edge, left in zip(edges, left_of, strict=True) if edge.source in left}
        exits = self._exits(set().union(*left_of), own)
        effects = [tuple(self._settled(edge.effect)) for edge in edges]
        for edge in edges:
            for history in edge.cleared:
                self.remembered.pop(history, None)
        parts = [
            ReactionPart(edge, effect, self._reached(edge), bool(effect or edge.passed))
            for edge, effect in zip(edges, effects, strict=True)
        ]
        return self._reaction(tuple(parts), exits, keeps, tuple([report(edge, self.compiled) for edge in edges]))

    def entering(self) -> CompiledReaction:
        entrances = self._entrances(0, (self.compiled.nodes[0].initial,))
        return self._reaction((ReactionPart(None, (), entrances, acts=False),), (), (), ())

    def leaving(self) -> CompiledReaction:
        return self._reaction((), self._exits(self.present, set()), (), ())

    def _reaction(
        self, parts: tuple[ReactionPart, ...], exits: tuple[Exit, ...], keeps: tuple[str, ...], taken: tuple[Taken, ...]
    ) -> CompiledReaction:
        entrances = [entrance for part in parts for entrance in part.entrances]
        following = configuration_of(
            self.compiled,
            tuple(sorted(self.present)),
            frozenset(self.waiting),
            tuple(sorted(self.remembered.items())),
        )
        quiet = not keeps and not self.waiting and not following.spontaneous
        silent = not parts and all(one.quiet for one in exits)
        still = quiet and bool(parts) and all(one.quiet for one in exits) and all(part.quiet for part in parts)
        return CompiledReaction(
            parts, exits, following, keeps, taken,
            exited=tuple(_names(one.node for one in exits)),
            entered=tuple(_names(one.node for one in entrances)),
            silent=silent,
            still=still,
        )  # fmt: skip

    def _exits(self, left: set[int], own: set[int]) -> tuple[Exit, ...]:
        """Order exits inner before outer, later before earlier; nodes outside `own` are interrupted."""
        ordered = sorted(left, reverse=True)
        for index in ordered:
            self._remember(index)
        exits = []
        for index in ordered:
            node = self.compiled.nodes[index]
            actions = node.exit if index in own else node.broken
            cancels = node.timed or any(isinstance(action, Trigger) for action in node.entry)
            exits.append(Exit(node, tuple(self._settled(actions)), cancels))
            self.present.discard(index)
            self.waiting.discard(index)
        return tuple(exits)

    def _remember(self, index: int) -> None:
        """Record the active nodes inside a node before its exit, for its histories (SCXML 3.10)."""
        nodes, configuration = self.compiled.nodes, self.configuration
        for history in nodes[index].histories:
            state = nodes[history].state
            if isinstance(state, HistoryState) and state.history == "deep":
                kept = tuple([leaf for leaf in configuration.leaves if self.compiled.inside(leaf, index)])
            else:
                kept = tuple([child for child in nodes[index].children if child in configuration.members])
            self.remembered[history] = kept

    def _reached(self, edge: TransitionEdge) -> tuple[StateEntry, ...]:
        if not edge.targets:
            return ()
        return self._entrances(domain(self.compiled, edge, self.remembered), edge.targets)

    def _entrances(self, around: int, targets: tuple[int, ...]) -> tuple[StateEntry, ...]:
        entry = entry_set(self.compiled, around, targets, self.remembered)
        entrances = []
        for index in sorted(entry.nodes):
            node = self.compiled.nodes[index]
            self.present.add(index)
            if node.at_least is not None:
                self.waiting.add(index)
            actions, after = self._settled(node.entry), self._settled(entry.after.get(index, ()))
            completes = tuple(self._completed(node))
            entrances.append(StateEntry(node, tuple(actions), tuple(after), completes, _outcome(node)))
        return tuple(entrances)

    def _settled(self, actions: Iterable[_AnyAction]) -> Iterator[_AnyAction]:
        """Replace each `in-state` question in the actions by its present answer."""
        for action in actions:
            if isinstance(action, Choose):
                yield self._settled_choose(action)  # type: ignore[misc]  # a Choose for a Choose
            elif isinstance(action, Block):
                yield Block(block=tuple(self._settled(action.block)))  # type: ignore[misc]
            else:
                yield action

    def _settled_choose(self, action: Choose) -> Choose:
        condition = settle(action.condition, self._is_present)
        then, otherwise = tuple(self._settled(action.then)), tuple(self._settled(action.otherwise))
        return Choose(condition=condition, then=then, otherwise=otherwise)

    def _is_present(self, state: str) -> bool:
        return self.compiled.index.get(state) in self.present

    def _completed(self, node: StateNode) -> Iterator[int]:
        """Yield the nodes whose content is complete after this entry, if a transition or a parent depends on it."""
        nodes, scxml = self.compiled.nodes, self.compiled.scxml
        return (one for one in self._around_complete(node) if not one or scxml or DONE in nodes[one].edges)

    def _around_complete(self, node: StateNode) -> Iterator[int]:
        nodes = self.compiled.nodes
        if not node.final:
            if type(node.state) is State and not self.compiled.scxml:
                yield node.index
            return
        around = nodes[node.parent]
        if around.index == 0 or around.state is not None:
            yield around.index
        region = around if around.state is None else nodes[around.parent]
        ends = around.index > 0 and (region is around or region.transparent)
        while ends and all(map(self._is_finished, nodes[region.parent].children)):
            yield region.parent
            # A parallel state is complete when all its children are in final states (SCXML 3.4).
            region = nodes[nodes[region.parent].parent]
            ends = region.transparent

    def _is_finished(self, region: int) -> bool:
        """Return whether a final state is active in the region; a transparent region delegates to its only state.

        SCXML appendix D: isInFinalState.
        """
        nodes = self.compiled.nodes
        inside = nodes[region].children
        if nodes[region].transparent:
            within = nodes[inside[0]]
            if within.orthogonal:
                return all(map(self._is_finished, within.children))
            inside = [*inside, *within.children]
        return any(child in self.present and nodes[child].final for child in inside)


def _names(nodes: Iterable[StateNode]) -> Iterator[str]:
    return (node.name for node in nodes if node.state is not None)


def _outcome(node: StateNode) -> Emit | None:
    final = node.state
    if not isinstance(final, FinalState) or final.emit is None:
        return None
    return Emit(emit=final.emit, arguments=final.arguments)

"""Reactions: computed on first use for each configuration and set of transitions, then cached (lazy determinisation).

A reaction consists of the exits, actions, entries and next configuration for a set of transitions of one plot. A
submachine or dynamic state is one node of this plot; its inner plot has separate reactions. SCXML 1.0, appendix D:
microstep, computeExitSet, exitStates, enterStates.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import TypeVar

from dsc.engine.automaton import (
    CompiledReaction,
    Configuration,
    Exit,
    ReactionPart,
    StateEntry,
    configuration_of,
)
from dsc.engine.membership import settle
from dsc.engine.tables import CompiledPlot, StateNode, TransitionEdge
from dsc.engine.taken import Taken, report
from dsc.engine.transition_selection import EntrySet, domain, left_by
from dsc.events import DONE
from dsc.model.actions import (
    Block,
    Choose,
    Emit,
    ExternalAction,
    Internal,
    Trigger,
    Unwire,
    Wire,
)
from dsc.model.states import DynamicState, FinalState, HistoryState, State

_AnyAction = TypeVar("_AnyAction", bound=ExternalAction | Internal)


def reaction_of(
    configuration: Configuration, edges: tuple[TransitionEdge, ...], keeps: tuple[str, ...] = ()
) -> CompiledReaction:
    """Return the reaction that takes `edges` in a configuration; the states in `keeps` keep the event."""
    known = configuration.reactions.taking
    found = known.get((edges, keeps))
    if found is None:
        found = known[edges, keeps] = _Work(configuration).taking(edges, keeps)
    return found


def initial_reaction(compiled: CompiledPlot) -> CompiledReaction:
    """Return the reaction that enters a plot in its initial state."""
    found: CompiledReaction | None = compiled.cache.get(None)
    if found is None:
        found = _Work(configuration_of(compiled, ())).entering()
        compiled.cache[None] = found
    return found


def continuing_reaction(compiled: CompiledPlot, targets: Collection[int]) -> CompiledReaction:
    """Return the reaction that enters a plot in the nodes `targets`, and in the initial states of all other scopes."""
    return _Work(configuration_of(compiled, ())).entering(targets)


def leaving_reaction(configuration: Configuration) -> CompiledReaction:
    """Return the reaction that interrupts a plot: it exits all states with their actions for interruption."""
    found = configuration.reactions.leaving
    if found is None:
        found = configuration.reactions.leaving = _Work(configuration).leaving()
    return found


class _Work:
    """Working copy of a configuration, changed while a reaction is computed."""

    def __init__(self, configuration: Configuration) -> None:
        self.configuration = configuration
        self.compiled = configuration.compiled
        self.present = set(configuration.active)
        self.waiting = set(configuration.waiting)
        self.remembered = dict(configuration.history)

    def taking(self, edges: tuple[TransitionEdge, ...], keeps: tuple[str, ...]) -> CompiledReaction:
        left_of = [left_by(self.compiled, edge, self.present, self.remembered) for edge in edges]
        own = {
            edge.source
            for edge, left in zip(edges, left_of, strict=True)
            if edge.source in left and not edge.interrupts
        }
        exits = self._exits(set().union(*left_of), own)
        effects = [self._settle_actions(edge.effect) for edge in edges]
        for edge in edges:
            for history in edge.cleared:
                self.remembered.pop(history, None)
        parts = [
            ReactionPart(edge, effect, self._enter_targets(edge), bool(effect or edge.passed))
            for edge, effect in zip(edges, effects, strict=True)
        ]
        return self._reaction(tuple(parts), exits, keeps, tuple([report(edge, self.compiled) for edge in edges]))

    def entering(self, targets: Collection[int] = ()) -> CompiledReaction:
        entrances = self._entrances(0, tuple(targets) or (self.compiled.nodes[0].initial,))
        return self._reaction((ReactionPart(None, (), entrances, acts=False),))

    def leaving(self) -> CompiledReaction:
        return self._reaction((), self._exits(self.present, set()))

    def _reaction(
        self,
        parts: tuple[ReactionPart, ...],
        exits: tuple[Exit, ...] = (),
        keeps: tuple[str, ...] = (),
        taken: tuple[Taken, ...] = (),
    ) -> CompiledReaction:
        entrances = [entrance for part in parts for entrance in part.entrances]
        history = tuple(sorted(self.remembered.items()))
        following = configuration_of(
            self.compiled, tuple(sorted(self.present)), frozenset(self.waiting), history
        )  # fmt: skip
        continues, ends = [], []
        for part in parts:
            if part.edge is not None:
                state = self.compiled.nodes[part.edge.source].state
                if part.edge.keeps:
                    continues.append(part.edge.source)
                if isinstance(state, DynamicState) and state.exclude is not None:
                    ends.append(part.edge)
        silent = all(one.quiet for one in exits)
        stays = not keeps and not following.spontaneous
        return CompiledReaction(
            parts, exits, following, keeps, taken,
            exited=tuple([one.node.name for one in exits if one.node.state is not None]),
            entered=tuple([one.node.name for one in entrances if one.node.state is not None]),
            silent=silent and not parts,
            still=silent and stays and bool(parts) and all(part.quiet for part in parts),
            continues=tuple(continues),
            candidate_ends=tuple(ends),
        )  # fmt: skip

    def _exits(self, left: set[int], own: set[int]) -> tuple[Exit, ...]:
        """Return the exits, inner nodes first and later nodes before earlier nodes; interrupt nodes outside `own`."""
        ordered = [self.compiled.nodes[index] for index in sorted(left, reverse=True)]
        for node in ordered:
            self._remember(node)
        exits = []
        for node in ordered:
            actions = node.exit if node.index in own else node.broken
            cancels = node.timed or any(isinstance(action, Trigger | Wire | Unwire) for action in node.entry)
            exits.append(Exit(node, self._settle_actions(actions), cancels))
            self.present.discard(node.index)
            self.waiting.discard(node.index)
        return tuple(exits)

    def _remember(self, node: StateNode) -> None:
        """Record the active nodes inside a node for the node's histories, before its exit (SCXML 3.10)."""
        for history in node.histories:
            state = self.compiled.nodes[history].state
            if isinstance(state, HistoryState) and state.history == "deep":
                kept = [leaf for leaf in self.configuration.leaves if self.compiled.inside(leaf, node.index)]
            else:
                kept = [child for child in node.children if child in self.configuration.members]
            self.remembered[history] = tuple(kept)

    def _enter_targets(self, edge: TransitionEdge) -> tuple[StateEntry, ...]:
        if not edge.targets:
            return ()
        return self._entrances(domain(self.compiled, edge, self.remembered), edge.targets)

    def _entrances(self, around: int, targets: tuple[int, ...]) -> tuple[StateEntry, ...]:
        entry = EntrySet(self.compiled, self.remembered)
        entry.reach(around, targets)
        entrances = []
        for index in sorted(entry.nodes):
            node = self.compiled.nodes[index]
            self.present.add(index)
            if node.at_least is not None:
                self.waiting.add(index)
            actions, after = self._settle_actions(node.entry), self._settle_actions(entry.after.get(index, ()))
            entrances.append(StateEntry(node, actions, after, tuple(self._find_completed(node)), _outcome(node)))
        return tuple(entrances)

    def _settle_actions(self, actions: tuple[_AnyAction, ...]) -> tuple[_AnyAction, ...]:
        """Return the actions with each `in-state` replaced by its current truth value."""
        return tuple(map(self._settle_action, actions)) if self.compiled.scxml else actions

    def _settle_action(self, action: _AnyAction) -> _AnyAction:
        match action:
            case Choose(condition=condition, then=then, otherwise=otherwise):
                settled = settle(condition, lambda state: self.compiled.index.get(state) in self.present)
                branches = {"then": self._settle_actions(then), "otherwise": self._settle_actions(otherwise)}
                return action.model_copy(update={"condition": settled, **branches})
            case Block(block=inside):
                return action.model_copy(update={"block": self._settle_actions(inside)})
            case _:
                return action

    def _find_completed(self, node: StateNode) -> Iterator[int]:
        """Yield indices of nodes whose content this entry completes, if a transition or a parent depends on this."""
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
        """Return whether a region has an active final state; for a transparent region its only state decides.

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


def _outcome(node: StateNode) -> Emit | None:
    final = node.state
    if not isinstance(final, FinalState) or final.emit is None:
        return None
    return Emit(emit=final.emit, arguments=final.arguments)

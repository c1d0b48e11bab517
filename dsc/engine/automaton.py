"""Automaton of a plot: its configurations, and the reactions that lead from one to another.

All instances of a plot share its configurations. A configuration computes each reaction on first use and caches it
(lazy determinisation), so that a later step only looks up the reaction. The number of cached reactions is bounded.
The modules `reaction` and `reaction_choice` compute the reactions.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from dsc.engine.tables import CompiledPlot, StateNode, TransitionEdge, Trigger
from dsc.engine.taken import Taken, report
from dsc.model.actions import Emit, ExternalAction, Internal
from knowledge_base.language.syntax.expression import Expression

Remembered = tuple[tuple[int, tuple[int, ...]], ...]
"""Pairs of a history node and the nodes that were active at the last exit of the history's parent, in order."""

MOST_CONFIGURATIONS = 4096
"""Upper bound of cached configurations of one plot: those of four regions with eight states each.

A configuration occupies a few KiB.
"""
MOST_REPORTS = 64
"""Upper bound of the host paths for which a reaction caches its report."""
MOST_TRIGGERS = 256
"""Upper bound of triggers with a cached choice in one configuration; events from outside may have any name."""
MOST_QUESTIONS = 1024
"""Upper bound of `Question` objects for one configuration: n independent guards have 2**n outcomes."""

Action = ExternalAction | Internal


@dataclass(frozen=True, slots=True, eq=False)
class Exit:
    """A node to exit, with its exit actions.

    Attributes:
        node: the node to exit.
        actions: the exit actions of the node.
        cancels: whether the node may have skills, timers or wires, which the exit ends.
    """

    node: StateNode
    actions: tuple[Action, ...]
    cancels: bool

    @property
    def quiet(self) -> bool:
        """Whether the exit has no exit actions and no activation to end."""
        return not self.actions and not self.node.addressed


@dataclass(frozen=True, slots=True, eq=False)
class StateEntry:
    """A node to enter, with its entry actions.

    Attributes:
        node: the node to enter.
        actions: the entry actions of the node.
        after: effect of the history default that leads to the node, executed as a separate block (appendix D).
        completes: indices of the nodes whose content this entry completes; 0 for the plot itself.
        emits: action that fires the outcome event of a final state; `None` without outcome.
    """

    node: StateNode
    actions: tuple[Action, ...]
    after: tuple[Action, ...]
    completes: tuple[int, ...]
    emits: Emit | None = None

    @property
    def quiet(self) -> bool:
        """Whether the entry has no actions, completes no node and starts no activation."""
        acts = self.actions or self.after or self.emits
        return not acts and not self.completes and not self.node.addressed


@dataclass(frozen=True, slots=True, eq=False)
class ReactionPart:
    """Internal actions and entries of one transition.

    Attributes:
        edge: the transition; `None` for the initial entry of a plot.
        effect: the internal actions, in order.
        entrances: the nodes to enter, in order.
        acts: whether the transition has internal actions or passes arguments to its target.
    """

    edge: TransitionEdge | None
    effect: tuple[Action, ...]
    entrances: tuple[StateEntry, ...]
    acts: bool

    @property
    def quiet(self) -> bool:
        """Whether the part only enters nodes, without any action."""
        return not self.acts and all(entrance.quiet for entrance in self.entrances)


@dataclass(frozen=True, slots=True, eq=False)
class CompiledReaction:
    """The effect of one microstep on one plot.

    Attributes:
        parts: a part for each transition, in order of execution.
        exits: all exits, in order.
        following: the configuration after the microstep.
        continues: indices of the nodes whose plots continue in the plots that replace them.
        candidate_ends: transitions from dynamic states that exclude failed candidates.
        keeps: names of states that keep the event until their least time has passed.
        taken, exited, entered: the reaction's report if the plot is the outermost one: transitions and state names.
        silent: whether the reaction only exits states, without any action.
        still: whether the reaction only changes the configuration and enables no transition without trigger.
        reports: cached reports of the taken transitions for inner plots, by the path of the host state.
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
    continues: tuple[int, ...] = ()
    candidate_ends: tuple[TransitionEdge, ...] = ()
    reports: dict[str, tuple[Taken, ...]] = field(default_factory=dict)

    def taken_in(self, compiled: CompiledPlot, prefix: str) -> tuple[Taken, ...]:
        """Return the report of the taken transitions; `prefix` is the beginning of the paths of the plot's states."""
        found = self.reports.get(prefix)
        if found is None:
            if len(self.reports) >= MOST_REPORTS:
                self.reports.clear()
            found = self.reports[prefix] = tuple([report(p.edge, compiled, prefix) for p in self.parts if p.edge])
        return found


@dataclass(slots=True, eq=False)
class Question:
    """A guard to evaluate next; each result leads to another `Question` or to a reaction.

    Attributes:
        configuration: the configuration in which the guard is evaluated.
        trigger: the trigger of the transitions to choose from.
        edge: the guarded transition.
        condition: the guard, without tests of active states.
        answers: results of the guards before this one.
        branches: the known next choices, by the result of this guard.
    """

    configuration: Configuration
    trigger: Trigger
    edge: TransitionEdge
    condition: Expression
    answers: Mapping[TransitionEdge, bool]
    branches: dict[bool, Choice] = field(default_factory=dict)


Choice = CompiledReaction | Question
"""The reaction to a trigger, or the guard to evaluate next."""


class ReactionCache:
    """The reactions of one configuration that have been computed; full, it drops them all.

    Attributes:
        choices: by trigger, the reaction or the first guard to evaluate; `None` if no active state has a transition.
        taking: the reactions that take transitions, by these transitions and the states that keep the event.
        leaving: the reaction that interrupts the plot; `None` until it is computed.
    """

    __slots__ = ("_questions", "choices", "leaving", "taking")

    def __init__(self) -> None:
        self.choices: dict[Trigger, Choice | None] = {}
        self.taking: dict[tuple[tuple[TransitionEdge, ...], tuple[str, ...]], CompiledReaction] = {}
        self.leaving: CompiledReaction | None = None
        self._questions = 0

    def make_room(self) -> None:
        """Drop all results if there is no room for another trigger."""
        if len(self.choices) >= MOST_TRIGGERS:
            self._forget()

    def count_question(self) -> None:
        """Note a new `Question`; drop all results if there are too many."""
        self._questions += 1
        if self._questions > MOST_QUESTIONS:
            self._forget()

    def _forget(self) -> None:
        self.choices.clear()
        self.taking.clear()
        self.leaving = None
        self._questions = 0


class Configuration:
    """The active nodes of a plot, and all other state that determines which transitions are enabled.

    Attributes:
        active: indices of the active nodes, in document order, without the plot itself.
        waiting: active nodes whose `at_least` time has not passed; their transitions are disabled.
        history: the nodes that each history node remembers.
        reactions: the known reactions to triggers.
        idle: the `IdleState` of all machines that have only this configuration; `None` until a machine reaches it.
    """

    def __init__(
        self, compiled: CompiledPlot, active: tuple[int, ...], waiting: frozenset[int], history: Remembered
    ) -> None:
        self.compiled = compiled
        self.active = active
        self.waiting = waiting
        self.history = history
        self.reactions = ReactionCache()
        self.idle: object = None

    def __eq__(self, other: object) -> bool:
        """Compare the active nodes, waiting nodes and history; `FrameState` compares the plots."""
        return self is other or (isinstance(other, Configuration) and self._key == other._key)

    def __hash__(self) -> int:
        return hash(self._key)

    def __repr__(self) -> str:
        return f"Configuration({', '.join(self.names)})"

    @property
    def _key(self) -> tuple[tuple[int, ...], frozenset[int], Remembered]:
        return self.active, self.waiting, self.history

    @cached_property
    def members(self) -> frozenset[int]:
        """Indices of the active nodes, as a set."""
        return frozenset(self.active)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the active states, in document order; active regions have no name here."""
        nodes = self.compiled.nodes
        return tuple([nodes[index].name for index in self.active if nodes[index].state is not None])

    @cached_property
    def form(self) -> Mapping[str, Any]:
        """The configuration as plain data: names instead of indices. The caller must not change the result."""
        names = [node.name for node in self.compiled.nodes]
        return {
            "active": [names[index] for index in self.active],
            "waiting": [names[index] for index in sorted(self.waiting)],
            "history": {names[at]: [names[index] for index in kept] for at, kept in self.history},
        }

    @cached_property
    def leaves(self) -> tuple[int, ...]:
        """Indices of the innermost active nodes, in document order."""
        inner = {self.compiled.nodes[index].parent for index in self.active}
        return tuple([index for index in self.active if index not in inner])

    @cached_property
    def spontaneous(self) -> bool:
        """Whether an active node has a transition without trigger."""
        return any(self.compiled.nodes[index].always for index in self.active)

    def is_active(self, state: str) -> bool:
        """Return whether the state of that name is active; `False` for an unknown name."""
        return self.compiled.index.get(state) in self.members


def configuration_of(
    compiled: CompiledPlot, active: tuple[int, ...], waiting: frozenset[int] = frozenset(), history: Remembered = ()
) -> Configuration:
    """Return the plot's configuration with these contents; one object is shared while the plot caches it."""
    key = (active, waiting, history)
    found: Configuration | None = compiled.cache.get(key)
    if found is None:
        if len(compiled.cache) >= MOST_CONFIGURATIONS:
            compiled.cache.clear()
        found = compiled.cache[key] = Configuration(compiled, active, waiting, history)
    return found

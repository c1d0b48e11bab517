"""Configurations of one plot; all instances share them and the reactions computed for them.

A configuration computes a reaction on first use and keeps it (lazy determinisation): from then on a step is a look-up.
The number of kept reactions is bounded. A dropped reaction is computed again.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

from dsc.engine.tables import CompiledPlot

Remembered = tuple[tuple[int, tuple[int, ...]], ...]
"""Pairs of a history node and the nodes that were active when the node around it was last exited, in order."""

MOST_CONFIGURATIONS = 4096
"""Upper bound for one plot, enough for four regions of eight states each; a configuration takes a few KiB."""
MOST_TRIGGERS = 256
"""Upper bound for one configuration: event names come from outside and are unlimited."""


class Configuration:
    """The active nodes of a plot, with the rest of the state that determines its enabled transitions.

    The modules `reaction_choice`, `determinisation` and `machine` store their computed results here.

    Attributes:
        active: the active nodes, in document order, without the plot itself.
        waiting: active nodes whose `at_least` has not passed; their transitions wait.
        history: the nodes that each history state remembers.
        choices: trigger -> reaction or next question (see `reaction_choice`).
        reactions: transitions taken together -> their reaction (see `determinisation`).
        questions: the number of guards that `choices` evaluates.
        bare: the `MachineState` that holds this configuration and nothing else, once one was reached.
        steps: event -> the last `Step` from `bare`, for events that only change the configuration.
    """

    def __init__(
        self, compiled: CompiledPlot, active: tuple[int, ...], waiting: frozenset[int], history: Remembered
    ) -> None:
        self.compiled = compiled
        self.active = active
        self.waiting = waiting
        self.history = history
        self.choices: dict[Any, Any] = {}
        self.reactions: dict[Any, Any] = {}
        self.questions = 0
        self.bare: Any = None
        self.steps: dict[str, Any] = {}

    def __eq__(self, other: object) -> bool:
        """Compare the active nodes, waiting nodes and history; the frames compare the plots."""
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
        """The active nodes as a set."""
        return frozenset(self.active)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the active states; regions have none."""
        nodes = self.compiled.nodes
        return tuple([nodes[index].name for index in self.active if nodes[index].state is not None])

    @cached_property
    def form(self) -> Mapping[str, Any]:
        """The configuration as plain data, read-only."""
        names = [node.name for node in self.compiled.nodes]
        return {
            "active": [names[index] for index in self.active],
            "waiting": [names[index] for index in sorted(self.waiting)],
            "history": {names[at]: [names[index] for index in kept] for at, kept in self.history},
        }

    @cached_property
    def leaves(self) -> tuple[int, ...]:
        """The active nodes without an active node inside, in document order."""
        inner = {self.compiled.nodes[index].parent for index in self.active}
        return tuple([index for index in self.active if index not in inner])

    @cached_property
    def spontaneous(self) -> bool:
        """Return whether an active node has a transition without trigger."""
        return any(self.compiled.nodes[index].always for index in self.active)

    def forget(self) -> None:
        """Drop all computed reactions; later steps compute them again."""
        self.choices.clear()
        self.reactions.clear()
        self.steps.clear()
        self.questions = 0

    def is_active(self, state: str) -> bool:
        """Return whether the state of that name is active."""
        return self.compiled.index.get(state) in self.members


def configuration_of(
    compiled: CompiledPlot, active: tuple[int, ...], waiting: frozenset[int] = frozenset(), history: Remembered = ()
) -> Configuration:
    """Return the plot's configuration with these contents: the same object while it is kept."""
    key = (active, waiting, history)
    found: Configuration | None = compiled.cache.get(key)
    if found is None:
        if len(compiled.cache) >= MOST_CONFIGURATIONS:
            compiled.cache.clear()
        found = compiled.cache[key] = Configuration(compiled, active, waiting, history)
    return found

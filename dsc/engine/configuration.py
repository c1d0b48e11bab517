"""Configurations of one plot, each made once and shared by all instances, with what was worked out about it.

A configuration's reactions are found when they are first needed and kept (lazy determinisation): from then on
a step is a look-up. What is kept is bounded, and forgetting it changes nothing but the time that a step takes.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

from dsc.engine.tables import CompiledPlot

Remembered = tuple[tuple[int, tuple[int, ...]], ...]
"""History node and the nodes that were active when the node around it was last left, in order."""

MOST_CONFIGURATIONS = 4096
"""Kept for one plot: four regions of eight states each; a few KiB each."""
MOST_TRIGGERS = 256
"""Kept for one configuration: names of events come from outside, and there is no end to them."""


class Configuration:
    """The active nodes of a plot and all else that decides which transitions can be taken.

    What the modules above work out about it they keep here: it is the one thing that all of them share.

    Attributes:
        active: the active nodes, in document order, without the plot itself.
        waiting: those of them whose transitions have to wait, because their least time has not passed.
        history: what the plot's history states remember.
        choices: trigger -> what is decided there (see `choice`).
        reactions: transitions taken together -> what follows (see `determinisation`).
        questions: how many guards `choices` ask.
        bare: the `MachineState` in which this is all there is, if it was ever reached.
        steps: the last `Step` from there for each event that only moves on.
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
        """Whether the same is active, waiting and remembered; of which plot, the frame says."""
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
        """As plain data, which nobody may change."""
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
        """Whether a transition without trigger may be enabled."""
        return any(self.compiled.nodes[index].always for index in self.active)

    def forget(self) -> None:
        """Drop what was worked out; it is worked out again when it is needed."""
        self.choices.clear()
        self.reactions.clear()
        self.steps.clear()
        self.questions = 0

    def is_active(self, state: str) -> bool:
        """Whether the state of that name is active."""
        return self.compiled.index.get(state) in self.members


def configuration_of(
    compiled: CompiledPlot, active: tuple[int, ...], waiting: frozenset[int] = frozenset(), history: Remembered = ()
) -> Configuration:
    """The plot's configuration with these contents: always the same one, as long as it is kept."""
    key = (active, waiting, history)
    found: Configuration | None = compiled.cache.get(key)
    if found is None:
        if len(compiled.cache) >= MOST_CONFIGURATIONS:
            compiled.cache.clear()
        found = compiled.cache[key] = Configuration(compiled, active, waiting, history)
    return found

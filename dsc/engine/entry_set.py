"""Entry set of target states, as a pure function of the tables and of the remembered histories.

SCXML 1.0, appendix D: computeEntrySet, addDescendantStatesToEnter, addAncestorStatesToEnter.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from dsc.engine.tables import CompiledPlot
from dsc.model.actions import Internal

Remembered = Mapping[int, tuple[int, ...]]
"""History node -> the nodes that were active when the node around it was last exited."""


@dataclass(slots=True)
class Entry:
    """The nodes to enter.

    Attributes:
        nodes: indices; document order is the order of entry.
        after: internal actions that follow the entry of a node: the effect of a history's default (appendix D).
    """

    nodes: set[int] = field(default_factory=set)
    after: dict[int, tuple[Internal, ...]] = field(default_factory=dict)


def entry_set(compiled: CompiledPlot, domain: int, targets: tuple[int, ...], remembered: Remembered) -> Entry:
    """Return all nodes to enter inside `domain` to reach all targets."""
    work = _Work(compiled, remembered)
    reached = [real for target in targets for real in work.resolved(target)]
    for target in reached:
        work.way(domain, target)
    for target in reached:
        work.inside(target)
    for index in sorted(work.entry.nodes):  # the content of a default already includes its regions
        work.regions(index)
    return work.entry


def effective_targets(compiled: CompiledPlot, targets: Iterable[int], remembered: Remembered) -> list[int]:
    """Replace each history by the nodes it remembers, or by its default (getEffectiveTargetStates)."""
    if not compiled.defaults:
        return list(targets)
    work = _Work(compiled, remembered)
    return [real for target in targets for real in work.resolved(target)]


class _Work:
    def __init__(self, compiled: CompiledPlot, remembered: Remembered) -> None:
        self._compiled = compiled
        self._remembered = remembered
        self.entry = Entry()

    def resolved(self, target: int) -> list[int]:
        """Return the nodes that a target leads to; a history's default may name further histories."""
        default = self._compiled.defaults.get(target)
        if default is None:
            return [target]
        if target in self._remembered:
            return list(self._remembered[target])
        self.entry.after[self._compiled.nodes[target].parent] = default.effect
        return self.resolved(default.target)

    def way(self, around: int, index: int) -> None:
        self.entry.nodes.update(self._compiled.way(around, index))

    def inside(self, index: int) -> None:
        """Add the default content of a target, unless another target is inside it."""
        node = self._compiled.nodes[index]
        if node.orthogonal or any(child in self.entry.nodes for child in node.children):
            return
        if node.initial >= 0:
            reached = self.resolved(node.initial)
            for target in reached:
                self.way(index, target)
            for target in reached:
                self.inside(target)
            for inner in {inner for target in reached for inner in self._compiled.way(index, target)}:
                self.regions(inner)

    def regions(self, index: int) -> None:
        """Add the regions of an orthogonal state that no target has reached."""
        node = self._compiled.nodes[index]
        if node.orthogonal:
            for child in node.children:
                if child not in self.entry.nodes:
                    self._default(child)

    def _default(self, index: int) -> None:
        self.entry.nodes.add(index)
        node = self._compiled.nodes[index]
        if node.orthogonal:
            self.regions(index)
        self.inside(index)

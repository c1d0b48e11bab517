"""Selection of transitions, with their exit and entry sets: inner before outer, across nested plots.

SCXML 1.0, section 3.13 and appendix D (selectTransitions, removeConflictingTransitions, computeExitSet,
computeEntrySet). Nested plots form one tree; events have scopes (S0.6, S2.5).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from dsc.engine.frames import Frame
from dsc.engine.tables import CompiledPlot, StateNode, TransitionEdge
from dsc.events import AFTER, EVERY
from dsc.model.actions import Internal

Guard = Callable[[Frame, TransitionEdge], bool]
"""Returns whether an edge's guard holds in its frame."""
Remembered = Mapping[int, tuple[int, ...]]
"""History node -> the nodes that were active when the node around it was last exited."""


class Addressed(NamedTuple):
    """A trigger for one state: an event that only this state may take, or also the states around it."""

    event: str
    node: int
    exact: bool
    number: int | None


Trigger = str | Addressed | None
"""The trigger of a plot's transitions: an event for all its states, one for a state, or `None` for a change of the
world.
"""


@dataclass(frozen=True, slots=True)
class Enabled:
    """A selected transition of a running plot."""

    frame: Frame
    edge: TransitionEdge

    def left(self) -> set[tuple[Frame, int]]:
        """Return the exit set: active states inside the domain, and all plots inside those."""
        compiled, configuration = self.frame.compiled, self.frame.configuration
        indices = left_by(compiled, self.edge, configuration.active, dict(configuration.history))
        found = {(self.frame, index) for index in indices}
        for child in self.frame.inner():
            if compiled.index[child.host] in indices:
                found.update((inner, index) for inner in child.frames() for index in inner.configuration.active)
        return found

    def is_inside(self, other: Enabled) -> bool:
        """Return whether the source is inside the other's source, maybe in a plot inside it."""
        for frame, index in _outwards(self.frame, self.edge.source):
            if frame is other.frame:
                within = frame.compiled.inside(index, other.edge.source)
                return within or (frame is not self.frame and index == other.edge.source)
        return False

    def preempts(self, other: Enabled) -> bool:
        """Return whether it is inside the other, and both exit the same state."""
        return self.is_inside(other) and bool(self.left() & other.left())

    def has_to_wait(self) -> bool:
        """Return whether its source waits for its least time."""
        return self.edge.source in self.frame.configuration.waiting and bool(self.edge.targets)


def select(root: Frame, trigger: Trigger, guard: Guard) -> tuple[list[Enabled], list[Enabled]]:
    """Select the transitions that a trigger enables in a frame and all frames inside it.

    Returns:
        The transitions to take, free of conflicts; and those whose states wait for their least time.
    """
    found = (_first_enabled(frame, leaf, trigger, guard) for frame, leaf in _leaves(root))
    enabled = dict.fromkeys(one for one in found if one is not None)
    taken = _without_conflicts([one for one in enabled if not one.has_to_wait()])
    late = [one for one in enabled if one.has_to_wait()]
    return taken, [one for one in late if not any(other.preempts(one) for other in taken)]


def _leaves(frame: Frame) -> Iterator[tuple[Frame, int]]:
    """Yield all active states without an active state inside, through all plots, in document order."""
    for index in frame.configuration.leaves:
        inner = frame.child(frame.compiled.nodes[index].name)
        if inner is None:
            yield frame, index
        else:
            yield from _leaves(inner)


def _first_enabled(frame: Frame, leaf: int, trigger: Trigger, guard: Guard) -> Enabled | None:
    for at, index in _outwards(frame, leaf):
        for around in (index, *at.compiled.nodes[index].around[:-1]):
            for edge in edges_of(at.compiled, around, trigger):
                if guard(at, edge):
                    return Enabled(at, edge)
    return None


def _outwards(frame: Frame, index: int) -> Iterator[tuple[Frame, int]]:
    """Yield the node, then the host state of its plot, and so on to the outermost plot."""
    yield frame, index
    while frame.parent is not None:
        index, frame = frame.parent.compiled.index[frame.host], frame.parent
        yield frame, index


def _without_conflicts(enabled: list[Enabled]) -> list[Enabled]:
    kept: list[Enabled] = []
    for candidate in enabled:
        left = candidate.left()
        rivals = [other for other in kept if left & other.left()]
        if all(candidate.is_inside(other) for other in rivals):
            kept = [other for other in kept if other not in rivals]
            kept.append(candidate)
    return kept


# -- transitions of a trigger ------------------------------------------------------------------------------


def edges_of(compiled: CompiledPlot, index: int, trigger: Trigger) -> tuple[TransitionEdge, ...]:
    """Return the transitions of a node that have the trigger, in order."""
    node = compiled.nodes[index]
    if trigger is None:
        return node.always
    if isinstance(trigger, Addressed):
        return _addressed_edges(compiled, index, trigger)
    if compiled.scxml:
        return tuple([edge for name, edges in node.edges.items() if matches(name, trigger) for edge in edges])
    return node.edges.get(trigger, ())


def _addressed_edges(compiled: CompiledPlot, index: int, trigger: Addressed) -> tuple[TransitionEdge, ...]:
    is_seen = index == trigger.node if trigger.exact else index in (trigger.node, *compiled.nodes[trigger.node].around)
    if not is_seen:
        return ()
    if trigger.number is None:
        return edges_of(compiled, index, trigger.event)
    timed = {AFTER: compiled.nodes[index].timeouts, EVERY: compiled.nodes[index].cycles}[trigger.event]
    return (timed[trigger.number].edge,)


def matches(descriptors: str, event: str) -> bool:
    """Return whether one of the descriptors is the event's name or a prefix of its tokens (SCXML 3.12.1)."""
    for descriptor in descriptors.split():
        prefix = descriptor.removesuffix(".*").removesuffix(".")
        if prefix in {"*", event} or event.startswith(prefix + "."):
            return True
    return False


# -- exit set and entry set --------------------------------------------------------------------------------


def left_by(compiled: CompiledPlot, edge: TransitionEdge, active: Iterable[int], remembered: Remembered) -> set[int]:
    """Return the active nodes of the edge's own plot that it exits."""
    if not edge.targets:
        return set()
    around = domain(compiled, edge, remembered)
    return {index for index in active if compiled.inside(index, around)}


def domain(compiled: CompiledPlot, edge: TransitionEdge, remembered: Remembered) -> int:
    """Return the index of the innermost composite (or plot) around source and targets.

    SCXML appendix D: getTransitionDomain, findLCCA. The source of an internal transition is its own domain.
    """
    known = {history: kept for history, kept in remembered.items() if history not in edge.cleared}
    real = EntrySet(compiled, known).effective(edge.targets)
    if edge.internal and all(compiled.inside(target, edge.source) for target in real):
        return edge.source
    around = set.intersection(*(set(compiled.nodes[target].around) for target in real))
    return next(
        index for index in compiled.nodes[edge.source].around if index in around and _is_scope(compiled.nodes[index])
    )


def _is_scope(node: StateNode) -> bool:
    return not node.orthogonal and not node.transparent


class EntrySet:
    """The nodes to enter to reach targets.

    SCXML appendix D: computeEntrySet, addDescendantStatesToEnter, addAncestorStatesToEnter.

    Attributes:
        nodes: indices; document order is the order of entry.
        after: internal actions that follow the entry of a node: the effect of a history's default.
    """

    def __init__(self, compiled: CompiledPlot, remembered: Remembered) -> None:
        self._compiled = compiled
        self._remembered = remembered
        self.nodes: set[int] = set()
        self.after: dict[int, tuple[Internal, ...]] = {}

    def reach(self, around: int, targets: Iterable[int]) -> None:
        """Add all nodes to enter inside `around` to reach all targets."""
        self._add_ways(around, self.effective(targets))
        for index in sorted(self.nodes):  # the content of a default already includes its regions
            self._add_regions(index)

    def effective(self, targets: Iterable[int]) -> list[int]:
        """Replace each history by the nodes it remembers, or by its default (getEffectiveTargetStates)."""
        return [real for target in targets for real in self._resolved(target)]

    def _resolved(self, target: int) -> Iterable[int]:
        """Return the nodes that a target leads to; a history's default may name further histories."""
        default = self._compiled.defaults.get(target)
        if default is None:
            return (target,)
        if target in self._remembered:
            return self._remembered[target]
        self.after[self._compiled.nodes[target].parent] = default.effect
        return self._resolved(default.target)

    def _add_ways(self, around: int, targets: Sequence[int]) -> set[int]:
        """Add the ways to the targets, then their default content; return the nodes on the ways."""
        ways = {index for target in targets for index in self._compiled.way(around, target)}
        self.nodes |= ways
        for target in targets:
            self._add_content(target)
        return ways

    def _add_content(self, index: int) -> None:
        """Add the default content of a target, unless another target is inside it."""
        node = self._compiled.nodes[index]
        if node.initial >= 0 and not any(child in self.nodes for child in node.children):
            for inner in self._add_ways(index, self.effective((node.initial,))):
                self._add_regions(inner)

    def _add_regions(self, index: int) -> None:
        """Add the regions of an orthogonal state that no target has reached."""
        node = self._compiled.nodes[index]
        for child in node.children if node.orthogonal else ():
            if child not in self.nodes:
                self.nodes.add(child)
                self._add_regions(child)
                self._add_content(child)

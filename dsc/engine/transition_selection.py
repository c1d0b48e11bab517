"""Selection of transitions: inner before outer, document order, across all nested running plots together.

SCXML 1.0, section 3.13 (selectTransitions, removeConflictingTransitions). Nested plots form one tree; events have
scopes (S0.6, S2.5).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from dsc.engine.entry_set import effective_targets
from dsc.engine.frames import Frame
from dsc.engine.tables import CompiledPlot, StateNode, TransitionEdge
from dsc.events import AFTER, EVERY

Guard = Callable[[Frame, TransitionEdge], bool]
"""Returns whether an edge's guard holds in its frame."""


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
                found.update(everything(child))
        return found


def left_by(
    compiled: CompiledPlot, edge: TransitionEdge, active: Iterable[int], remembered: dict[int, tuple[int, ...]]
) -> set[int]:
    """Return the active nodes of the edge's own plot that it exits."""
    if not edge.targets:
        return set()
    around = domain(compiled, edge, remembered)
    return {index for index in active if compiled.inside(index, around)}


def domain(compiled: CompiledPlot, edge: TransitionEdge, remembered: dict[int, tuple[int, ...]]) -> int:
    """Return the index of the innermost composite (or plot) around source and targets.

    SCXML appendix D: getTransitionDomain, findLCCA. The source of an internal transition is its own domain.
    """
    known = {history: kept for history, kept in remembered.items() if history not in edge.cleared}
    real = effective_targets(compiled, edge.targets, known)
    if edge.internal and all(compiled.inside(target, edge.source) for target in real):
        return edge.source
    around = set.intersection(*(set(compiled.nodes[target].around) for target in real))
    return next(
        index for index in compiled.nodes[edge.source].around if index in around and _is_scope(compiled.nodes[index])
    )


def _is_scope(node: StateNode) -> bool:
    return not node.orthogonal and not node.transparent


def everything(frame: Frame) -> Iterable[tuple[Frame, int]]:
    """Return all active states of a frame and of the frames inside it."""
    return [(inner, index) for inner in frame.frames() for index in inner.configuration.active]


def select(root: Frame, trigger: Trigger, guard: Guard) -> tuple[list[Enabled], list[Enabled]]:
    """Select the transitions that a trigger enables in a frame and all frames inside it.

    Returns:
        The transitions to take, free of conflicts; and those whose states wait for their least time.
    """
    enabled: dict[tuple[Frame, TransitionEdge], Enabled] = {}
    for frame, leaf in _leaves(root):
        found = _first_enabled(frame, leaf, trigger, guard)
        if found is not None:
            enabled.setdefault((found.frame, found.edge), found)
    taken = _without_conflicts([one for one in enabled.values() if not _has_to_wait(one)])
    late = [one for one in enabled.values() if _has_to_wait(one)]
    return taken, [one for one in late if not any(_preempts(other, one) for other in taken)]


def _preempts(one: Enabled, other: Enabled) -> bool:
    return _is_inside(one, other) and bool(one.left() & other.left())


def _has_to_wait(one: Enabled) -> bool:
    return one.edge.source in one.frame.configuration.waiting and bool(one.edge.targets)


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


def _without_conflicts(enabled: list[Enabled]) -> list[Enabled]:
    kept: list[Enabled] = []
    for candidate in enabled:
        left = candidate.left()
        rivals = [other for other in kept if left & other.left()]
        if all(_is_inside(candidate, other) for other in rivals):
            kept = [other for other in kept if other not in rivals]
            kept.append(candidate)
    return kept


def _is_inside(one: Enabled, other: Enabled) -> bool:
    for frame, index in _outwards(one.frame, one.edge.source):
        if frame is other.frame:
            within = frame.compiled.inside(index, other.edge.source)
            return within or (frame is not one.frame and index == other.edge.source)
    return False

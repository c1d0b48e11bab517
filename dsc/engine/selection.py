"""Which transitions are taken: inner before outer, document order, over all running plots at once.

SCXML 1.0, section 3.13 (selectTransitions, removeConflictingTransitions), with plots inside plots as part of
one tree and with the scopes of events (S0.6, S2.5).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from dsc.engine.compiler import Edge
from dsc.engine.entering import effective_targets
from dsc.engine.frames import Frame
from dsc.events import AFTER, Event

Guard = Callable[[Frame, Edge], bool]
"""Whether an edge's guard holds in its frame."""


@dataclass(frozen=True, slots=True)
class Enabled:
    """A transition that will be taken in a running plot."""

    frame: Frame
    edge: Edge

    @property
    def domain(self) -> int:
        """Index of the innermost composite (or plot) around source and targets; -1 if nothing is left.

        SCXML appendix D: getTransitionDomain, findLCCA. A source that is only left internally is its own domain.
        """
        if self.edge.target is None:
            return -1
        if self.edge.internal:
            return self.edge.source
        compiled = self.frame.compiled
        real = effective_targets(compiled, self.edge.targets, self.frame.history)
        around = set.intersection(*(set(compiled.ancestors(target)) for target in real))
        return next(
            index for index in compiled.ancestors(self.edge.source) if index in around and _is_scope(self.frame, index)
        )

    def left(self) -> set[tuple[Frame, int]]:
        """Everything that is exited: active states inside the domain, and all plots inside those."""
        if self.edge.target is None:
            return set()
        domain = self.domain
        found = set()
        for index in self.frame.active:
            if self.frame.compiled.inside(index, domain):
                found.add((self.frame, index))
                if index in self.frame.children:
                    found.update(everything(self.frame.children[index]))
        return found


def _is_scope(frame: Frame, index: int) -> bool:
    node = frame.node(index)
    return not node.orthogonal and not node.transparent


def everything(frame: Frame) -> Iterable[tuple[Frame, int]]:
    """All active states of a frame and of the frames inside it."""
    return [(inner, index) for inner in frame.frames() for index in inner.active]


def select(root: Frame, event: Event | None, guard: Guard) -> list[Enabled]:
    """The transitions that `event` (or, with `None`, a change of the world) enables, free of conflicts."""
    visible = _scope(root, event)
    chosen: dict[tuple[int, int], Enabled] = {}
    for leaf_frame, leaf in root.leaves():
        enabled = _first_enabled(leaf_frame, leaf, event, visible, guard)
        if enabled is not None:
            chosen.setdefault((enabled.frame.serial, id(enabled.edge)), enabled)
    return _without_conflicts(list(chosen.values()))


def is_addressed(root: Frame, event: Event) -> bool:
    """Whether the activation or plot that the event is for is still there."""
    if event.to is not None:
        return any(event.to in frame.active.values() for frame in root.frames())
    return event.frame is None or any(frame.serial == event.frame for frame in root.frames())


def _scope(root: Frame, event: Event | None) -> Callable[[Frame, int], bool]:
    if event is None or (event.to is None and event.frame is None):
        return lambda _frame, _index: True
    if event.to is None:
        return lambda frame, _index: frame.serial == event.frame
    for frame in root.frames():
        for index, serial in frame.active.items():
            if serial == event.to:
                seen = {index} if event.exact else set(frame.around(index))
                return lambda other, at, frame=frame: other is frame and at in seen  # type: ignore[misc]
    return lambda _frame, _index: False


def _first_enabled(
    frame: Frame, leaf: int, event: Event | None, visible: Callable[[Frame, int], bool], guard: Guard
) -> Enabled | None:
    for at, index in _outwards(frame, leaf):
        for around in at.around(index):
            if visible(at, around):
                for edge in _edges(at, around, event):
                    if guard(at, edge):
                        return Enabled(at, edge)
    return None


def _outwards(frame: Frame, index: int) -> Iterator[tuple[Frame, int]]:
    """The node, then the state that holds its plot, and so on to the outermost plot."""
    at: Frame | None = frame
    while at is not None:
        yield at, index
        index, at = at.host, at.parent


def _edges(frame: Frame, index: int, event: Event | None) -> tuple[Edge, ...]:
    node = frame.node(index)
    if event is None:
        return node.always
    if event.name == AFTER:
        return (node.timeouts[event.index][1],) if event.index is not None else ()
    if frame.compiled.scxml:
        return tuple(edge for name, edges in node.edges.items() if matches(name, event.name) for edge in edges)
    return node.edges.get(event.name, ())


def matches(descriptors: str, event: str) -> bool:
    """Whether one of the descriptors is the event's name or a prefix of its tokens (SCXML 3.12.1)."""
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

"""Selection of transitions with their exit and entry sets, across nested plots; inner transitions have priority.

SCXML 1.0, section 3.13 and appendix D (selectTransitions, removeConflictingTransitions, computeExitSet,
computeEntrySet). Nested plots form one tree, and each event has a scope in this tree (S0.6, S2.5).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from dsc.engine.frames import Frame
from dsc.engine.tables import Addressed, CompiledPlot, StateNode, TransitionEdge, Trigger
from dsc.events import AFTER, EVERY, PREEMPTED
from dsc.model.actions import Internal

Guard = Callable[[Frame, TransitionEdge], bool]
"""Function that returns whether the guard of an edge is true in a frame."""
Remembered = Mapping[int, tuple[int, ...]]
"""Nodes that were active at the last exit of a history's parent, by history node."""


@dataclass(frozen=True, slots=True)
class Enabled:
    """An enabled transition of a running plot."""

    frame: Frame
    edge: TransitionEdge

    def left(self) -> set[tuple[Frame, int]]:
        """Return the exit set: the active nodes inside the transition's domain, and those of the plots inside them."""
        compiled, configuration = self.frame.compiled, self.frame.configuration
        indices = left_by(compiled, self.edge, configuration.active, dict(configuration.history))
        found = {(self.frame, index) for index in indices}
        for child in self.frame.inner():
            if compiled.index[child.host] in indices:
                found.update((inner, index) for inner in child.frames() for index in inner.configuration.active)
        return found

    def is_inside(self, other: Enabled) -> bool:
        """Return whether this transition's source is inside the source of `other`, also across nested plots."""
        for frame, index in _outwards(self.frame, self.edge.source):
            if frame is other.frame:
                within = frame.compiled.inside(index, other.edge.source)
                return within or (frame is not self.frame and index == other.edge.source)
        return False

    def preempts(self, other: Enabled) -> bool:
        """Return whether this transition is inside `other` and the two exit sets intersect."""
        return self.is_inside(other) and bool(self.left() & other.left())

    def has_to_wait(self) -> bool:
        """Return whether the transition must wait: it has a target, and its source's least time has not passed."""
        return self.edge.source in self.frame.configuration.waiting and bool(self.edge.targets)


def select(root: Frame, trigger: Trigger, guard: Guard) -> tuple[list[Enabled], list[Enabled]]:
    """Select the transitions that a trigger enables in a frame and all its inner frames.

    Returns:
        Two lists: the transitions to take, without conflicts; transitions whose source's least time has not passed.
    """
    found = (_first_enabled(frame, leaf, trigger, guard) for frame, leaf in _leaves(root))
    enabled = dict.fromkeys(one for one in found if one is not None)
    taken = _without_conflicts([one for one in enabled if not one.has_to_wait()])
    late = [one for one in enabled if one.has_to_wait()]
    return taken, [one for one in late if not any(other.preempts(one) for other in taken)]


def _leaves(frame: Frame) -> Iterator[tuple[Frame, int]]:
    """Yield frame and index of each innermost active node of all plots, in document order."""
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
    """Yield frame and index of a node, then of each host state around its plot, innermost first."""
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
    """Return the transitions of a node for a trigger, in order; empty if there are none."""
    node = compiled.nodes[index]
    if trigger is None:
        return node.always
    if isinstance(trigger, Addressed):
        return _addressed_edges(compiled, index, trigger)
    if compiled.scxml:
        return tuple([edge for name, edges in node.edges.items() if matches(name, trigger) for edge in edges])
    return node.edges.get(trigger, ())


def _addressed_edges(compiled: CompiledPlot, index: int, trigger: Addressed) -> tuple[TransitionEdge, ...]:
    if index != trigger.node and (trigger.exact or not _sees(compiled, index, trigger)):
        return ()
    if trigger.number is None:
        edges = edges_of(compiled, index, trigger.event)
        is_lost = trigger.event == PREEMPTED and index == trigger.node and not edges
        return _entering_again(compiled, index) if is_lost else edges
    timed = {AFTER: compiled.nodes[index].timeouts, EVERY: compiled.nodes[index].cycles}[trigger.event]
    return (timed[trigger.number].edge,)


def _sees(compiled: CompiledPlot, index: int, trigger: Addressed) -> bool:
    """Return whether a node is around the addressed one, or inside it if the trigger permits that."""
    if index in compiled.nodes[trigger.node].around:
        return True
    return trigger.inside and trigger.node in compiled.nodes[index].around


def _entering_again(compiled: CompiledPlot, index: int) -> tuple[TransitionEdge, ...]:
    """Return the transition of a state that has lost a component, unless a state around it handles that."""
    node = compiled.nodes[index]
    if any(PREEMPTED in compiled.nodes[around].edges for around in node.around):
        return ()
    if node.again is None:
        node.again = TransitionEdge(index, PREEMPTED, (index,), None, (), interrupts=True)
    return (node.again,)


def matches(descriptors: str, event: str) -> bool:
    """Return whether an event matches one of the descriptors, which blanks separate (SCXML 3.12.1).

    A descriptor matches the event with its name and every event whose leading tokens equal the descriptor.
    """
    for descriptor in descriptors.split():
        prefix = descriptor.removesuffix(".*").removesuffix(".")
        if prefix in {"*", event} or event.startswith(prefix + "."):
            return True
    return False


# -- exit set and entry set --------------------------------------------------------------------------------


def left_by(compiled: CompiledPlot, edge: TransitionEdge, active: Iterable[int], remembered: Remembered) -> set[int]:
    """Return the exit set of an edge in its plot: indices of the active nodes; empty for an edge without target."""
    if not edge.targets:
        return set()
    around = domain(compiled, edge, remembered)
    return {index for index in active if compiled.inside(index, around)}


def domain(compiled: CompiledPlot, edge: TransitionEdge, remembered: Remembered) -> int:
    """Return the index of a transition's domain: the innermost composite state or plot around source and targets.

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
    """Entry set of a transition: the nodes to enter.

    SCXML appendix D: computeEntrySet, addDescendantStatesToEnter, addAncestorStatesToEnter.

    Attributes:
        nodes: indices of the nodes; they are entered in document order.
        after: effects of history defaults, executed after the entry of the node with that index.
    """

    def __init__(self, compiled: CompiledPlot, remembered: Remembered) -> None:
        self._compiled = compiled
        self._remembered = remembered
        self.nodes: set[int] = set()
        self.after: dict[int, tuple[Internal, ...]] = {}

    def reach(self, around: int, targets: Iterable[int]) -> None:
        """Add every node inside `around` that a transition to `targets` enters."""
        self._add_ways(around, self.effective(targets))
        for index in sorted(self.nodes):  # `_add_content` has already added the regions of default content
            self._add_regions(index)

    def effective(self, targets: Iterable[int]) -> list[int]:
        """Return the targets; remembered or default nodes replace each history (getEffectiveTargetStates)."""
        return [real for target in targets for real in self._resolve_target(target)]

    def _resolve_target(self, target: int) -> Iterable[int]:
        """Return the nodes that replace a target; the default of a history may contain further histories."""
        default = self._compiled.defaults.get(target)
        if default is None:
            return (target,)
        if target in self._remembered:
            return self._remembered[target]
        self.after[self._compiled.nodes[target].parent] = default.effect
        return self._resolve_target(default.target)

    def _add_ways(self, around: int, targets: Sequence[int]) -> set[int]:
        """Add the paths from `around` to the targets, then the targets' default content; return the paths' nodes."""
        ways = {index for target in targets for index in self._compiled.way(around, target)}
        self.nodes |= ways
        for target in targets:
            self._add_content(target)
        return ways

    def _add_content(self, index: int) -> None:
        """Add the default content of a node, unless one of its children is already added."""
        node = self._compiled.nodes[index]
        if node.initial >= 0 and not any(child in self.nodes for child in node.children):
            for inner in self._add_ways(index, self.effective((node.initial,))):
                self._add_regions(inner)

    def _add_regions(self, index: int) -> None:
        """Add the missing regions of an orthogonal state, with their default content."""
        node = self._compiled.nodes[index]
        for child in node.children if node.orthogonal else ():
            if child not in self.nodes:
                self.nodes.add(child)
                self._add_regions(child)
                self._add_content(child)

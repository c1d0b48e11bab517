"""Selection of the transitions of a microstep; part of each Python controller."""

from __future__ import annotations

from dsc.controllers.runtime.state import ControllerState
from dsc.controllers.runtime.tables import Occurrence
from dsc.controllers.runtime.values import Failure


class Selection(ControllerState):
    """The questions about the tree of states, and about enabled transitions."""

    def _inside(self, index: int, around: int) -> bool:
        return around < index <= self.nodes[around].last

    def _children(self, index: int) -> list[int]:
        inside = range(index + 1, self.nodes[index].last + 1)
        return [one for one in inside if self.nodes[one].parent == index and self.nodes[one].memory < 0]

    def _leaves(self) -> list[int]:
        outer = {self.nodes[index].parent for index, active in enumerate(self.active) if active}
        return [index for index, active in enumerate(self.active) if active and index not in outer]

    def _first_enabled(self, leaf: int, occurrence: Occurrence | None) -> int:
        index = leaf
        while index > 0:
            for edge in self._edges_of(index, occurrence):
                if self._holds(edge):
                    return edge
            index = self.nodes[index].parent
        return -1

    def _edges_of(self, index: int, occurrence: Occurrence | None) -> list[int]:
        event = 0 if occurrence is None else occurrence.event
        if occurrence is not None and not self._sees(index, occurrence):
            return []
        if occurrence is not None and occurrence.edge >= 0:
            return [occurrence.edge]
        return [edge for trigger, edge in self.nodes[index].edges if trigger == event]

    def _sees(self, index: int, occurrence: Occurrence) -> bool:
        if occurrence.node < 0 or index == occurrence.node:
            return True
        return not occurrence.exact and self._inside(occurrence.node, index)

    def _holds(self, edge: int) -> bool:
        """Return whether the guard of an edge is true; report its failure once in a macrostep, or once for an event."""
        holds = self.guards[self.edges[edge].guard](self)
        if not isinstance(holds, Failure):
            return holds
        mark = self.turn if self.edges[edge].each else self.macrostep
        if self.marks[edge] != mark:
            self.marks[edge] = mark
            self._fail(holds)
        return False

    def _without_conflicts(self, enabled: list[int]) -> list[int]:
        kept: list[int] = []
        for candidate in enabled:
            rivals = [other for other in kept if self._conflict(candidate, other)]
            if all(self._is_within(candidate, other) for other in rivals):
                kept = [other for other in kept if other not in rivals]
                kept.append(candidate)
        return kept

    def _is_within(self, one: int, other: int) -> bool:
        return self._inside(self.edges[one].source, self.edges[other].source)

    def _conflict(self, one: int, other: int) -> bool:
        """Return whether the exit sets intersect: both contain active nodes, so one domain is in the other one."""
        if not self.edges[one].targets or not self.edges[other].targets:
            return False
        a, b = self._domain(one), self._domain(other)
        return a == b or self._inside(a, b) or self._inside(b, a)

    def _preempts(self, one: int, other: int) -> bool:
        return self._is_within(one, other) and self._conflict(one, other)

    def _domain(self, number: int) -> int:
        edge = self.edges[number]
        real = [one for target in edge.targets for one in self._resolve(target, edge.cleared)]
        if edge.internal and all(self._inside(target, edge.source) for target in real):
            return edge.source
        index = self.nodes[edge.source].parent
        while index > 0:
            node = self.nodes[index]
            if not node.orthogonal and not node.transparent and all(self._inside(target, index) for target in real):
                break
            index = node.parent
        return index

    def _resolve(self, target: int, cleared: tuple[int, ...] = ()) -> list[int]:
        """Return the nodes that replace a target: the remembered nodes or the default of a history."""
        node = self.nodes[target]
        if node.memory < 0:
            return [target]
        known = self.memory.get(node.memory) if node.memory not in cleared else None
        return [node.default] if known is None else known

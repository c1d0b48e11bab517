"""Microsteps: exits, actions of transitions, entries; part of each Python controller."""

from __future__ import annotations

from dsc.controllers.runtime.selection import Selection
from dsc.controllers.runtime.tables import MAX_MICROSTEPS, NO_DATA, Node, Occurrence, Status


class Microsteps(Selection):
    """The execution of transitions."""

    def _react(self, occurrence: Occurrence | None) -> bool:
        """Run one microstep if transitions are enabled; keep the event for states whose least time has not passed."""
        found = [self._first_enabled(leaf, occurrence) for leaf in self._leaves()]
        enabled = [edge for edge in dict.fromkeys(found) if edge >= 0]
        late = [edge for edge in enabled if self.edges[edge].targets and self.waiting[self.edges[edge].source]]
        taken = self._without_conflicts([edge for edge in enabled if edge not in late])
        late = [edge for edge in late if not any(self._preempts(other, edge) for other in taken)]
        keeps = occurrence is not None and not occurrence.periodic and bool(late)
        if occurrence is not None and keeps:
            for node in dict.fromkeys(self.edges[edge].source for edge in late):
                self._keep(occurrence, node)
        if not taken:
            return keeps
        if self.microsteps >= MAX_MICROSTEPS:
            self.status |= Status.RUNAWAY
            self.finished = True
            return False
        self.microsteps += 1
        self._microstep(taken)
        return True

    def _microstep(self, taken: list[int]) -> None:
        leaving, own = [False] * len(self.nodes), [False] * len(self.nodes)
        for edge in taken:
            if self.edges[edge].targets:
                around, source = self._domain(edge), self.edges[edge].source
                for index in range(around + 1, self.nodes[around].last + 1):
                    leaving[index] = leaving[index] or self.active[index]
                own[source] = own[source] or source != around
        self._exit(leaving, own)
        for edge in taken:
            self.blocks[self.edges[edge].effect](self)
        for edge in taken:
            for memory in self.edges[edge].cleared:
                self.memory.pop(memory, None)
        for edge in taken:
            if self.edges[edge].targets:
                self._enter(self._domain(edge), self.edges[edge].targets)

    def _exit(self, leaving: list[bool], own: list[bool]) -> None:
        """Exit nodes, inner nodes first; nodes outside `own` are interrupted."""
        leaves = self._leaves()
        for node in self.nodes:
            if node.memory >= 0 and leaving[node.parent]:
                inside = range(node.parent + 1, self.nodes[node.parent].last + 1)
                children = [one for one in inside if self.active[one] and self.nodes[one].parent == node.parent]
                self.memory[node.memory] = [one for one in leaves if one in inside] if node.deep else children
        for index in reversed(range(1, len(self.nodes))):
            if leaving[index]:
                self._exit_node(index, self.nodes[index], own=own[index])

    def _exit_node(self, index: int, node: Node, *, own: bool) -> None:
        for timer in node.timers:
            self.due.pop(timer, None)
        for activity in node.activities:
            run = self.running.pop(activity, 0)
            if run:
                self.due.pop(self.activities[activity].timer, None)
                self.host.stop(activity, run)
        self.blocks[node.leave if own else node.broken](self)
        self.active[index] = self.waiting[index] = False
        self._forget(index)

    def _enter(self, around: int, targets: tuple[int, ...]) -> None:
        """Enter every node inside `around` that the targets need, outer nodes first."""
        entering: set[int] = set()
        after: dict[int, int] = {}
        self._add_ways(around, self._effective(targets, after), entering, after)
        for index in sorted(entering):
            self._add_regions(index, entering, after)
        for index in sorted(entering):
            self._enter_node(index, self.nodes[index], after.get(index, 0))

    def _enter_node(self, index: int, node: Node, after: int) -> None:
        self.active[index], self.waiting[index] = True, node.waits
        self.serial[index] += 1
        self.blocks[node.entry](self)
        self.blocks[after](self)
        for timer in node.timers:
            self._arm(timer)
        self.blocks[node.outcome](self)
        self._complete_around(index, node)

    def _effective(self, targets: tuple[int, ...], after: dict[int, int]) -> list[int]:
        for target in targets:
            node = self.nodes[target]
            if node.memory >= 0 and node.memory not in self.memory:
                after[node.parent] = node.default_block
        return [real for target in targets for real in self._resolve(target)]

    def _add_ways(self, around: int, targets: list[int], entering: set[int], after: dict[int, int]) -> set[int]:
        """Add the paths from `around` to the targets, then the targets' default content; return the paths' nodes."""
        ways = set()
        for target in targets:
            index = target
            while index != around:
                ways.add(index)
                index = self.nodes[index].parent
        entering |= ways
        for target in targets:
            self._add_content(target, entering, after)
        return ways

    def _add_content(self, index: int, entering: set[int], after: dict[int, int]) -> None:
        initial = self.nodes[index].initial
        if initial >= 0 and not any(child in entering for child in self._children(index)):
            for inner in sorted(self._add_ways(index, self._effective((initial,), after), entering, after)):
                self._add_regions(inner, entering, after)

    def _add_regions(self, index: int, entering: set[int], after: dict[int, int]) -> None:
        for child in self._children(index) if self.nodes[index].orthogonal else ():
            if child not in entering:
                entering.add(child)
                self._add_regions(child, entering, after)
                self._add_content(child, entering, after)

    def _complete_around(self, index: int, node: Node) -> None:
        """Complete the nodes whose content has ended with the entry of a node."""
        if not node.final:
            if node.immediate:
                self._complete(index)
            return
        around = node.parent
        if around == 0 or self.nodes[around].state:
            self._complete(around)
        region = self.nodes[around].parent if self.nodes[around].state else around
        ends = around > 0 and (region == around or self.nodes[region].transparent)
        while ends and all(map(self._is_finished, self._children(self.nodes[region].parent))):
            self._complete(self.nodes[region].parent)
            region = self.nodes[self.nodes[region].parent].parent
            ends = self.nodes[region].transparent

    def _is_finished(self, region: int) -> bool:
        inside = self._children(region)
        if self.nodes[region].transparent:
            within = inside[0]
            if self.nodes[within].orthogonal:
                return all(map(self._is_finished, self._children(within)))
            inside = [*inside, *self._children(within)]
        return any(self.active[one] and self.nodes[one].final for one in inside)

    def _complete(self, index: int) -> None:
        done = self.nodes[index].done
        if index == 0:
            self.finished = True
        elif done and self.scxml:
            self._fire(Occurrence(done))
        elif done:
            self._fire(Occurrence(done, NO_DATA, index, self.serial[index], exact=True))

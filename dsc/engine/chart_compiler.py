"""Compiler: turns a plot into its tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import chain, combinations, islice
from typing import Any

from dsc.engine.tables import CompiledPlot, Default, StateNode, TimedEdge, TransitionEdge
from dsc.model.plot import ActionPlot, initial_of
from dsc.model.states import AnyState, CompositeState, FinalState, HistoryState, OrthogonalState, Region, State
from dsc.model.transitions import Connector, Transition
from knowledge_base.errors import SchemaError, UnknownNameError


def compile_plot(plot: ActionPlot, form: Mapping[str, Any] | None = None) -> CompiledPlot:
    """Lay out the plot's states as nodes and its transitions as edges.

    Raises:
        UnknownNameError: a transition or a scope names a missing state.
        SchemaError: targets cannot be active together, or a history leads to a state outside its own scope.
    """
    layout = _Layout(plot)
    for node in layout.nodes:
        layout.prepare(node)
    return CompiledPlot(plot, tuple(layout.nodes), layout.index, form, layout.defaults(), scxml=plot.dialect == "scxml")


class _Layout:
    """Builds the nodes of a plot, then the edges between them."""

    def __init__(self, plot: ActionPlot) -> None:
        self._scxml = plot.dialect == "scxml"
        self._initials: list[tuple[StateNode, str]] = []
        self.nodes = [StateNode(0, plot.name, (), None)]
        self._add_states(self.nodes[0], plot)
        self.index = {node.name: node.index for node in self.nodes[1:] if node.state is not None}
        for node, first in self._initials:
            node.initial = self._initial(node, first)

    def _add_states(self, parent: StateNode, scope: ActionPlot | CompositeState | Region) -> None:
        self._initials.append((parent, initial_of(scope)))
        for name, state in scope.states.items():
            node = self._append(name, parent, state)
            if isinstance(state, CompositeState):
                self._add_states(node, state)
            elif isinstance(state, OrthogonalState):
                self._add_regions(node, state)
            node.last = len(self.nodes) - 1
        parent.last = len(self.nodes) - 1

    def _add_regions(self, node: StateNode, state: OrthogonalState) -> None:
        for name, region in state.regions.items():
            inner = self._append(f"#{len(self.nodes)}", node, None)
            # SCXML has no region elements: a region that is named after its only state stands for this state.
            inner.transparent = self._scxml and [*region.states] == [name]
            self._add_states(inner, region)
        for name, history in state.connectors.items():
            self._append(name, node, history)

    def _append(self, name: str, parent: StateNode, state: AnyState | None) -> StateNode:
        index = len(self.nodes)
        node = StateNode(index, name, (parent.index, *parent.around), state, last=index)
        if isinstance(state, State):
            node.entry, node.exit, node.broken = state.entry, state.exit, state.on_break or state.exit
            node.at_least = state.at_least
        elif isinstance(state, FinalState):
            node.entry = state.entry
        self.nodes.append(node)
        (parent.histories if isinstance(state, HistoryState) else parent.children).append(index)
        return node

    def _initial(self, parent: StateNode, first: str) -> int:
        found = self.index.get(first, -1)
        around = () if found < 0 else self.nodes[found].around
        if parent.index not in (around if self._scxml else around[:1]):
            valid = [name for name, at in self.index.items() if self.nodes[at].parent == parent.index]
            raise UnknownNameError(f"there is no state '{first}' to begin with", found=first, valid=valid)
        return found

    def defaults(self) -> dict[int, Default]:
        """Return the default target and effect of each history, by node."""
        histories = [(node, node.state) for node in self.nodes if isinstance(node.state, HistoryState)]
        return {node.index: self._default(node, history) for node, history in histories}

    def _default(self, node: StateNode, history: HistoryState) -> Default:
        target = self._target(node, history.target)
        if isinstance(self.nodes[target].state, HistoryState) or node.parent not in self.nodes[target].around:
            raise SchemaError(f"the history '{node.name}' does not lead to a state in its scope", found=node.name)
        return Default(target, history.do)

    def prepare(self, node: StateNode) -> None:
        """Build the edges now if they may contain errors; else build them on first use."""
        if isinstance(node.state, State | Connector):
            node.lay_out = self._lay_out
            if isinstance(node.state, Connector) or not self._is_plain(node.state):
                self._lay_out(node)
        node.settle()

    def _is_plain(self, state: State) -> bool:
        """Return whether each transition has at most one target, and this target exists."""
        for one in chain(chain.from_iterable(state.on.values()), state.after, state.every, state.always):
            if one.also or one.clear or (one.target is not None and one.target not in self.index):
                return False
        return True

    def _lay_out(self, node: StateNode) -> None:
        """Build the transitions of one state in all tables of its node."""
        state = node.state
        if not isinstance(state, State | Connector):
            return
        # Transitions and tables have the same order. A search by place would be slow in large plots.
        edges = (self._edge(node, place, trigger, one) for place, trigger, one in state.placed_transitions())
        if isinstance(state, State):
            node.edges = {event: tuple(islice(edges, len(many))) for event, many in state.on.items()}
            node.timeouts = tuple([TimedEdge(timed.seconds, next(edges)) for timed in state.after])
            node.cycles = tuple([TimedEdge(timed.seconds, next(edges)) for timed in state.every])
        else:
            node.edges, node.timeouts, node.cycles = {}, (), ()
        node.always = tuple(edges)

    def _edge(
        self, node: StateNode, place: tuple[str | int, ...], trigger: str, transition: Transition
    ) -> TransitionEdge:
        targets = tuple([self._target(node, name) for name in transition.targets])
        if len(targets) > 1 and not self._together(targets):
            raise SchemaError(f"targets of a transition of '{node.name}' exclude each other", found=node.name)
        return TransitionEdge(
            node.index, trigger, targets, transition.guard, transition.effect, transition.rule,
            transition.internal and isinstance(node.state, CompositeState), place, transition.passed,
            tuple(self._cleared(node, transition)) if transition.clear else (),
        )  # fmt: skip

    def _together(self, targets: Sequence[int]) -> bool:
        """Return whether all targets can be active together: any two are in different regions (SCXML 3.11)."""
        ways = [[*reversed(self.nodes[target].around), target] for target in targets]
        for first, second in combinations(ways, 2):
            split = sum(1 for one, other in zip(first, second, strict=False) if one == other)
            if split in {len(first), len(second)} or not self.nodes[first[split - 1]].orthogonal:
                return False
        return True

    def _target(self, source: StateNode, name: str) -> int:
        found = self.index.get(name)
        if found is None:
            raise UnknownNameError(
                f"there is no state '{name}' for a transition of '{source.name}'", found=name, valid=self.index
            )
        return found

    def _cleared(self, source: StateNode, transition: Transition) -> Iterator[int]:
        """Yield the histories that a transition clears: those of the state, and with `*` those of all states inside."""
        for name in transition.clear:
            node = self.nodes[self._target(source, name.removesuffix("*"))]
            regions = [self.nodes[child] for child in node.children] if node.orthogonal else []
            everything = self.nodes[node.index : node.last + 1]
            for one in everything if name.endswith("*") else [node, *regions]:
                yield from one.histories

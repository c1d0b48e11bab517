"""Compilation of a plot to the model of a controller; forms that a controller cannot have are refused together."""

from __future__ import annotations

from collections.abc import Sequence

from dsc.controllers.actions import BlockBuilder
from dsc.controllers.declarations import declare
from dsc.controllers.expressions import Typing
from dsc.controllers.model import Controller, Edge, Fixed, Node, Timer, Value
from dsc.controllers.names import completed_events, error_numbers, event_names, triggers
from dsc.controllers.refusals import Refusals
from dsc.engine.tables import CompiledPlot, StateNode, TimedEdge, TransitionEdge, compile_plot
from dsc.events import DONE, TIMED_OUT
from dsc.model.actions import Emit
from dsc.model.language import TermField
from dsc.model.plot import ActionPlot
from dsc.model.reading import FormPath
from dsc.model.states import FinalState, HistoryState, State
from knowledge_base.language.syntax.expression import Expression
from knowledge_base.language.syntax.text import to_text


def compile_controller(plot: ActionPlot) -> Controller:
    """Return the model of a plot's controller.

    Raises:
        PlotError: the plot has forms that a controller cannot have; the error lists all of them with their places.
    """
    refusals = Refusals(plot)
    refusals.add_forms()
    compiled = compile_plot(plot)
    controller = Controller(plot.name, compiled.scxml)
    controller.events, controller.first_event = event_names(compiled)
    controller.error_events = error_numbers(controller.events)
    typing = declare(controller, compiled, refusals)
    _Tables(controller, compiled, typing, refusals).build()
    if any(one.kind == "within" for one in controller.timers):
        controller.timed_out = controller.events.index(TIMED_OUT)
    refusals.raise_all()
    return controller


class _Tables:
    """Builder of the tables of nodes, edges and timers."""

    def __init__(self, controller: Controller, compiled: CompiledPlot, typing: Typing, refusals: Refusals) -> None:
        self._controller, self._compiled = controller, compiled
        self._typing, self._refusals = typing, refusals
        self._blocks = BlockBuilder(controller, compiled, typing, refusals)
        self._paths: dict[str, FormPath] = {name: path for name, _, path in compiled.plot.walk()}
        self._completed = completed_events(compiled) if compiled.scxml else {}
        histories = [node.index for node in compiled.nodes if isinstance(node.state, HistoryState)]
        self._memories = {index: number for number, index in enumerate(histories)}
        controller.memories = len(histories)

    def build(self) -> None:
        for node in self._compiled.nodes:
            self._controller.nodes.append(self._node(node))

    def _node(self, node: StateNode) -> Node:
        path = self._paths.get(node.name, ())
        state, add = node.state, self._blocks.add
        first = len(self._controller.activities)
        entry = add(f"entry of {node.name}", node.entry, (*path, "entry"), node.index)
        leave = add(f"exit of {node.name}", node.exit, (*path, "exit"), node.index)
        broken = leave
        if node.broken != node.exit:
            broken = add(f"interruption of {node.name}", node.broken, (*path, "on_break"), node.index)
        outcome = 0
        if isinstance(state, FinalState) and state.emit is not None:
            fired = Emit(emit=state.emit, arguments=state.arguments)
            outcome = add(f"outcome of {node.name}", (fired,), path, node.index)
        activities = tuple(range(first, len(self._controller.activities)))
        edges, timers = self._edges(node, path)
        fields: dict[str, int | bool] = {
            "parent": node.parent, "last": node.last, "initial": node.initial, "state": state is not None,
            "orthogonal": node.orthogonal, "transparent": node.transparent, "final": node.final,
            "entry": entry, "leave": leave, "broken": broken, "outcome": outcome,
            "waits": node.at_least is not None, "done": self._done(node),
            "immediate": type(state) is State and not self._compiled.scxml and DONE in node.edges,
            **self._history(node, path),
        }  # fmt: skip
        return Node(node.name, fields, edges, timers, activities)

    def _history(self, node: StateNode, path: FormPath) -> dict[str, int | bool]:
        if not isinstance(node.state, HistoryState):
            return {"memory": -1, "deep": False, "default": -1, "default_block": 0}
        default = self._compiled.defaults[node.index]
        block = self._blocks.add(f"default of {node.name}", default.effect, (*path, "do"), node.index)
        deep = node.state.history == "deep"
        return {"memory": self._memories[node.index], "deep": deep, "default": default.target, "default_block": block}

    def _done(self, node: StateNode) -> int:
        if self._compiled.scxml:
            name = self._completed.get(node.index)
            return 0 if name is None else self._controller.events.index(name)
        return self._controller.events.index(DONE) if DONE in node.edges else 0

    # -- transitions and times ---------------------------------------------------------------------------

    def _edges(self, node: StateNode, path: FormPath) -> tuple[tuple[tuple[int, int], ...], tuple[int, ...]]:
        """Return the triggers with their edges, and the timers of a node."""
        found: list[tuple[int, int]] = [(0, self._edge(edge, path)) for edge in node.always]
        by_label = {label: [self._edge(edge, path) for edge in edges] for label, edges in node.edges.items()}
        for number, event in enumerate(self._controller.events):
            edges_for_event = [
                edge
                for label, edges in by_label.items()
                if number and triggers(self._compiled, label, event)
                for edge in edges
            ]
            found += [(number, edge) for edge in edges_for_event]
        timers = []
        if node.at_least is not None:
            timers.append(
                self._timer(Timer("at_least", node.index, -1, self._seconds(node.at_least, (*path, "at_least"))))
            )
        timers += self._add_timed("after", node.timeouts, path)
        timers += self._add_timed("every", node.cycles, path)
        return tuple(found), tuple(timers)

    def _add_timed(self, kind: str, timed: Sequence[TimedEdge], path: FormPath) -> list[int]:
        made = []
        for one in timed:
            seconds = self._seconds(one.seconds, (*path, *one.edge.place, "seconds"))
            made.append(self._timer(Timer(kind, one.edge.source, self._edge(one.edge, path), seconds)))  # type: ignore[arg-type]
        return made

    def _timer(self, timer: Timer) -> int:
        self._controller.timers.append(timer)
        return len(self._controller.timers) - 1

    def _seconds(self, term: TermField, path: FormPath) -> Value:
        with self._refusals.at(path):
            return self._typing.convert(self._typing.value(term), "number", term.place)
        return Fixed(0.0, "number")

    def _edge(self, edge: TransitionEdge, path: FormPath) -> int:
        source, here = self._compiled.nodes[edge.source].name, (*path, *edge.place)
        words = " ".join(map(str, edge.place))
        guard = self._guard(f"{source}: {words}", edge.guard, (*here, "when"))
        effect = self._blocks.add(f"{source}: {words}", edge.effect, here, edge.source)
        cleared = tuple([self._memories[index] for index in edge.cleared])
        each = self._compiled.scxml and edge.place[0] == "on"
        self._controller.edges.append(
            Edge(f"{source}: {words}", edge.source, edge.targets, guard, effect, edge.internal, each, cleared)
        )
        return len(self._controller.edges) - 1

    def _guard(self, about: str, guard: Expression | None, path: FormPath) -> int:
        if guard is None:
            return 0
        with self._refusals.at(path):
            self._controller.guards.append((f"{about}: {to_text(guard)}", self._typing.condition(guard)))
            return len(self._controller.guards) - 1
        return 0

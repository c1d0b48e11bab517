"""This engine: plots from data, validated, in a library; a machine for each instance."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from dsc.dynamic.knowledge_situation import KnowledgeSituation
from dsc.dynamic.library import Library
from dsc.engine.machine import Machine
from dsc.events import Event
from dsc.model.plot import ActionPlot
from dsc.validation import raise_findings, validate_plot
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema import Schema
from peers.charts import PING, PONG, Chart, State
from peers.contender import Contender

KNOWLEDGE = KnowledgeBase(Schema.parse("(define (domain none))"))


class Ready(NamedTuple):
    """A library, the name of its plot to run, and a situation for macrosteps without queries of the knowledge base."""

    library: Library
    plot: str
    situation: KnowledgeSituation


def form(chart: Chart) -> dict[str, Any]:
    """Return the chart in the form in which people write plots."""
    return {"plot": "bench", "receives": {PING: None, PONG: None}, "states": _states(chart.states)}


def _states(states: Mapping[str, State]) -> dict[str, Any]:
    return {key: value for name, state in states.items() for key, value in _state(name, state)}


def _state(name: str, state: State) -> list[tuple[str, Any]]:
    if state.regions:
        regions = {region: {"states": _states(states)} for region, states in state.regions.items()}
        return [(name, {"on": state.on, "regions": regions})]
    inside = {"states": _states(state.states)} if state.states else {}
    return [(name, {"on": dict(state.on), **inside})]


def ready(*forms: dict[str, Any]) -> Ready:
    """Return plots from data, all of them validated and the first one compiled."""
    plots = [ActionPlot.model_validate(each) for each in forms]
    library = Library(plots)
    for plot in plots:
        raise_findings(validate_plot(plot, library))
    library.compiled(plots[0].name)
    return Ready(library, plots[0].name, KnowledgeSituation(KNOWLEDGE, library))


class Running(NamedTuple):
    """A machine, and the situation to send with every event."""

    machine: Machine
    situation: KnowledgeSituation


class ThisEngine(Contender):
    """`Machine.send(event, situation)` with one situation, since no chart here queries the knowledge base."""

    name = "this engine"
    package = "dynamic-state-charts"

    def write(self, chart: Chart) -> dict[str, Any]:
        return form(chart)

    def load(self, data: dict[str, Any]) -> Ready:
        return ready(data)

    def start(self, loaded: Ready) -> Running:
        machine = Machine(loaded.library)
        machine.start(loaded.plot, {}, loaded.situation)
        return Running(machine, loaded.situation)

    def where(self, machine: Running) -> frozenset[str]:
        paths = machine.machine.state.configuration()
        plot = next(iter(machine.machine.chart))
        around = {name for name, state, _ in plot.walk() if not _is_leaf(state)}
        return frozenset(paths) - around

    def run(self, machine: Running, event: str, times: int) -> None:
        send, situation, happened = machine.machine.send, machine.situation, Event(event)
        for _ in range(times):
            send(happened, situation)

    def run_each(self, machines: Sequence[Running], event: str) -> None:
        happened = Event(event)
        for machine, situation in machines:
            machine.send(happened, situation)


def _is_leaf(state: object) -> bool:
    return not hasattr(state, "states") and not hasattr(state, "regions")


CONTENDER = ThisEngine()

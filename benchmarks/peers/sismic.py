"""sismic: queue the event, execute one macrostep; contracts are off, since no other contender has them."""

from collections.abc import Mapping, Sequence
from typing import Any

from sismic.interpreter import Interpreter
from sismic.io.datadict import import_from_dict
from sismic.model import Event, Statechart

from peers.charts import Chart, State
from peers.contender import Contender


def _states(states: Mapping[str, State]) -> list[dict[str, Any]]:
    return [_state(name, state) for name, state in states.items()]


def _state(name: str, state: State) -> dict[str, Any]:
    data: dict[str, Any] = {"name": name}
    if state.on:
        data["transitions"] = [{"event": event, "target": target} for event, target in state.on.items()]
    if state.states:
        data |= _scope(state.states)
    if state.regions:
        data["parallel states"] = [{"name": region, **_scope(states)} for region, states in state.regions.items()]
    return data


def _scope(states: Mapping[str, State]) -> dict[str, Any]:
    return {"initial": next(iter(states)), "states": _states(states)}


class Sismic(Contender):
    """`interpreter.queue(event).execute_once()`."""

    name = package = "sismic"

    def write(self, chart: Chart) -> dict[str, Any]:
        return {"statechart": {"name": "bench", "root state": {"name": "root", **_scope(chart.states)}}}

    def load(self, data: dict[str, Any]) -> Statechart:
        return import_from_dict(data)

    def start(self, loaded: Statechart) -> Interpreter:
        interpreter = Interpreter(loaded, ignore_contract=True)
        interpreter.execute()
        return interpreter

    def where(self, machine: Interpreter) -> frozenset[str]:
        return frozenset(machine.statechart.leaf_for(machine.configuration))

    def run(self, machine: Interpreter, event: str, times: int) -> None:
        happened = Event(event)
        for _ in range(times):
            machine.queue(happened).execute_once()

    def run_each(self, machines: Sequence[Interpreter], event: str) -> None:
        happened = Event(event)
        for machine in machines:
            machine.queue(happened).execute_once()


CONTENDER = Sismic()

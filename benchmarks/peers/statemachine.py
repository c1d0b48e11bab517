"""python-statemachine: a class from a definition; events are methods, which its queue takes in turn."""

from collections.abc import Mapping, Sequence
from typing import Any

from statemachine import StateChart
from statemachine.io import create_machine_class_from_definition

from peers.charts import Chart, State
from peers.contender import Contender


def _states(states: Mapping[str, State]) -> dict[str, Any]:
    return {name: {"initial": number == 0, **_state(state)} for number, (name, state) in enumerate(states.items())}


def _state(state: State) -> dict[str, Any]:
    data: dict[str, Any] = {"on": {event: [{"target": target}] for event, target in state.on.items()}}
    if state.states:
        data["states"] = _states(state.states)
    if state.regions:
        data["parallel"] = True
        data["states"] = {name: {"states": _states(states)} for name, states in state.regions.items()}
    return data


class PythonStatemachine(Contender):
    """`machine.ping()`."""

    name = package = "python-statemachine"

    def write(self, chart: Chart) -> dict[str, Any]:
        return _states(chart.states)

    def load(self, data: dict[str, Any]) -> type[StateChart]:
        return create_machine_class_from_definition("Bench", states=data)  # consumes the data

    def start(self, loaded: type[StateChart]) -> StateChart:
        return loaded()

    def where(self, machine: StateChart) -> frozenset[str]:
        return frozenset(state.id for state in machine.configuration if not state.states)

    def run(self, machine: StateChart, event: str, times: int) -> None:
        send = getattr(machine, event)
        for _ in range(times):
            send()

    def run_each(self, machines: Sequence[StateChart], event: str) -> None:
        for machine in machines:
            getattr(machine, event)()


CONTENDER = PythonStatemachine()

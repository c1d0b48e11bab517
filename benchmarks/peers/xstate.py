"""xstate-statemachine: an XState configuration in the synchronous interpreter."""

from collections.abc import Mapping, Sequence
from typing import Any

from xstate_statemachine import Event, MachineNode, SyncInterpreter, create_machine

from peers.charts import Chart, State
from peers.contender import Contender


def _scope(states: Mapping[str, State]) -> dict[str, Any]:
    return {"initial": next(iter(states)), "states": {name: _state(state) for name, state in states.items()}}


def _state(state: State) -> dict[str, Any]:
    data: dict[str, Any] = {"on": dict(state.on)} if state.on else {}
    if state.states:
        data |= _scope(state.states)
    if state.regions:
        data |= {"type": "parallel", "states": {name: _scope(states) for name, states in state.regions.items()}}
    return data


class XState(Contender):
    """`interpreter.send(event)`."""

    name = package = "xstate-statemachine"

    def write(self, chart: Chart) -> dict[str, Any]:
        return {"id": "bench", **_scope(chart.states)}

    def load(self, data: dict[str, Any]) -> MachineNode:
        return create_machine(data)

    def start(self, loaded: MachineNode) -> SyncInterpreter:
        return SyncInterpreter(loaded).start()

    def where(self, machine: SyncInterpreter) -> frozenset[str]:
        return frozenset(path.rpartition(".")[2] for path in machine.current_state_ids)

    def run(self, machine: SyncInterpreter, event: str, times: int) -> None:
        send, happened = machine.send, Event(event)
        for _ in range(times):
            send(happened)

    def run_each(self, machines: Sequence[SyncInterpreter], event: str) -> None:
        happened = Event(event)
        for machine in machines:
            machine.send(happened)


CONTENDER = XState()

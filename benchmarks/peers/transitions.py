"""transitions: one machine for many models, with its queue; the hierarchical machine for nested states."""

from collections.abc import Mapping, Sequence
from typing import Any

from transitions import Machine
from transitions.extensions import HierarchicalMachine

from peers.charts import Chart, State
from peers.contender import Contender

SEPARATOR = "_"


class Model:
    """A model, to which the machine adds its triggers."""


def _scope(states: Mapping[str, State]) -> dict[str, Any]:
    return {
        "children": [_state(name, state) for name, state in states.items()],
        "initial": next(iter(states)),
        "transitions": _edges(states),
    }


def _edges(states: Mapping[str, State]) -> list[list[str]]:
    return [[event, name, target] for name, state in states.items() for event, target in state.on.items()]


def _state(name: str, state: State) -> dict[str, Any]:
    if state.regions:
        return {"name": name, "parallel": [{"name": key, **_scope(states)} for key, states in state.regions.items()]}
    return {"name": name, **(_scope(state.states) if state.states else {})}


class Transitions(Contender):
    """`model.ping()`; automatic transitions between all states are switched off."""

    name = package = "transitions"

    def write(self, chart: Chart) -> dict[str, Any]:
        return _scope(chart.states)

    def load(self, data: dict[str, Any]) -> Machine:
        nested = any("children" in state or "parallel" in state for state in data["children"])
        kind = HierarchicalMachine if nested else Machine
        return kind(
            model=None, states=data["children"], initial=data["initial"], transitions=data["transitions"],
            queued=True, auto_transitions=False,
        )  # fmt: skip

    def start(self, loaded: Machine) -> Model:
        model = Model()
        loaded.add_model(model)
        return model

    def where(self, machine: Model) -> frozenset[str]:
        return frozenset(path.rpartition(SEPARATOR)[2] for path in _flat(machine.state))

    def run(self, machine: Model, event: str, times: int) -> None:
        send = getattr(machine, event)
        for _ in range(times):
            send()

    def run_each(self, machines: Sequence[Model], event: str) -> None:
        for machine in machines:
            getattr(machine, event)()


def _flat(state: str | list[Any]) -> list[str]:
    return [state] if isinstance(state, str) else [path for part in state for path in _flat(part)]


CONTENDER = Transitions()

"""The floor without an object: a local variable and a table, to show that the choice of floor matters little."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from peers.charts import Chart
from peers.contender import Contender
from peers.floor import Table, table_of


@dataclass(slots=True)
class Place:
    """The state before and after the loop."""

    table: Table
    state: Any


class Loop(Contender):
    """`state = table[state][event]`."""

    name = "bare loop"

    def write(self, chart: Chart) -> Table:
        return table_of(chart)

    def load(self, data: Table) -> Table:
        return {state: dict(row) for state, row in data.items()}

    def start(self, loaded: Table) -> Place:
        return Place(loaded, next(iter(loaded)))

    def where(self, machine: Place) -> frozenset[str]:
        return machine.state if isinstance(machine.state, frozenset) else frozenset({machine.state})

    def run(self, machine: Place, event: str, times: int) -> None:
        state, table = machine.state, machine.table
        for _ in range(times):
            state = table[state][event]
        machine.state = state

    def run_each(self, machines: Sequence[Place], event: str) -> None:
        for machine in machines:
            machine.state = machine.table[machine.state][event]


CONTENDER = Loop()

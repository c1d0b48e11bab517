"""The floor: a minimal hand-written object with two dictionary look-ups, for the state and for the event.

It has neither entry nor exit. A configuration of several states is one key of the precomputed table.
"""

from collections.abc import Sequence
from typing import Any

from peers.charts import PING, Chart
from peers.contender import Contender

Table = dict[Any, dict[str, Any]]


class Machine:
    """A state and a table."""

    __slots__ = ("state", "table")

    def __init__(self, table: Table) -> None:
        self.table = table
        self.state = next(iter(table))

    def send(self, event: str) -> None:
        self.state = self.table[self.state][event]


def table_of(chart: Chart) -> Table:
    """Return the chart as reached configurations, each with the target of every event."""
    if _is_flat(chart):
        return {name: dict(state.on) for name, state in chart.states.items()}
    reached = [chart.leaves(n) for n in range(chart.rounds)]
    return {at: {PING: reached[n - len(reached) + 1]} for n, at in enumerate(reached)}


def _is_flat(chart: Chart) -> bool:
    return not any(state.states or state.regions for state in chart.states.values())


class Floor(Contender):
    """A class with a `send` of one line."""

    name = "floor"

    def write(self, chart: Chart) -> Table:
        return table_of(chart)

    def load(self, data: Table) -> Table:
        return {state: dict(row) for state, row in data.items()}

    def start(self, loaded: Table) -> Machine:
        return Machine(loaded)

    def where(self, machine: Machine) -> frozenset[str]:
        return machine.state if isinstance(machine.state, frozenset) else frozenset({machine.state})

    def run(self, machine: Machine, event: str, times: int) -> None:
        send = machine.send
        for _ in range(times):
            send(event)

    def run_each(self, machines: Sequence[Machine], event: str) -> None:
        for machine in machines:
            machine.send(event)


CONTENDER = Floor()

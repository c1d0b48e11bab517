"""Trace records of components: their wires, and their waits for resources (S0.16, S1.18, S1.21)."""

from __future__ import annotations

from dsc.components.wiring import Wiring
from dsc.supervision.activation import ComponentActivation
from dsc.trace import Trace


class ComponentTracer:
    """Recorder of the wires and the waits of a run's components.

    Args:
        trace: receives the records.
        wiring: the wires of the run.
        activation: the activation tree of the run.
    """

    def __init__(self, trace: Trace, wiring: Wiring, activation: ComponentActivation) -> None:
        self._trace = trace
        self._wiring = wiring
        self._activation = activation
        self._wires: dict[str, dict[str, str | None]] = {}
        self._waiting: dict[str, str] = {}

    def listen(self) -> None:
        """Record later changes, until `close`."""
        self._wires = self._wiring.wires()
        self._wiring.listen(self._note_wires)
        self._activation.waits.listen(self._note_waits)

    def close(self) -> None:
        """Record no further change."""
        self._wiring.leave(self._note_wires)
        self._activation.waits.leave(self._note_waits)

    def record_wires(self) -> None:
        """Record the wires of all components, for the start of a run."""
        for name, wires in self._wires.items():
            self._trace.record("component", component=name, wires=wires)

    def _note_wires(self) -> None:
        before, self._wires = self._wires, self._wiring.wires()
        for name, wires in self._wires.items():
            if wires != before.get(name):
                self._trace.record("component", component=name, wires=wires)

    def _note_waits(self) -> None:
        before, self._waiting = self._waiting, self._activation.waiting
        for name in {**before, **self._waiting}:
            if before.get(name) != self._waiting.get(name):
                self._trace.record("component", component=name, waits=self._waiting.get(name))

"""Reading of sensors: the event `cycle` brings their values to the outermost plot (S3.2)."""

from __future__ import annotations

from dsc.engine.machine_state import MachineState
from dsc.events import Event


def read_sensors(state: MachineState, event: Event) -> MachineState:
    """Return the state in which the sensors have the values of a `cycle` event; other sensors keep their values."""
    root = state.root
    robot = None if root is None else root.compiled.plot.robot
    if root is None or robot is None:
        return state
    readings = {name: value for name, value in event.attributes.items() if name in robot.sensors}
    return MachineState(root._replace(variables={**root.variables, **readings}), state.serials, state.finished)

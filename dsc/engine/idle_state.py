"""Idle states: machines whose plot has no data share their states and the steps between these."""

from __future__ import annotations

from dsc.engine.automaton import MOST_TRIGGERS, Configuration
from dsc.engine.machine_state import FrameState, MachineState
from dsc.engine.steps import Step
from dsc.events import Event


class IdleState(MachineState):
    """The state of all machines with the same configuration and nothing else; equal to a `MachineState`.

    Attributes:
        steps: by event name, the last step from this state that only changed the configuration.
    """

    steps: dict[str, Step]

    def keep(self, step: Step, event: Event) -> None:
        """Keep a step from this state on an event; events from outside may have any name."""
        if len(self.steps) >= MOST_TRIGGERS:
            self.steps.clear()
        self.steps[event.name] = step


def idle_state(root: FrameState, serials: int, configuration: Configuration) -> IdleState:
    """Return the shared state of a plot without data in a configuration."""
    known = configuration.idle
    if not isinstance(known, IdleState):
        known = IdleState(root._replace(configuration=configuration), serials)
        known.steps = {}
        configuration.idle = known  # complete, since other threads read it
    return known


def state_between(root: FrameState, serials: int) -> MachineState:
    """Return a machine's state between two steps; without data besides the configuration, it is a shared object."""
    frame_serial = 1  # serial number of the outermost plot
    if serials > frame_serial or root.variables or root.children:
        return MachineState(root, serials)
    return idle_state(root, serials, root.configuration)

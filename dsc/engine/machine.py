"""The step function and its thin holder."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from dsc.engine.macrostep import Macrostep
from dsc.engine.moving import move
from dsc.engine.situation import Situation
from dsc.engine.state import MachineState
from dsc.engine.steps import Step
from dsc.engine.tables import Chart
from dsc.events import Event


def start(
    chart: Chart, plot: str, arguments: Mapping[str, Any], situation: Situation, serials: int = 0
) -> Step:
    """Enter the plot and run to completion.

    Args:
        chart: where plots are found.
        plot: its name.
        arguments: values for its parameters.
        situation: the world.
        serials: the last serial number that was given out before, so that no action id is used twice.

    Raises:
        InputError: the plot is unknown, or a parameter is missing or unknown.
        RunawayError: the chart does not come to rest.
    """
    macrostep = Macrostep(chart, situation, MachineState(serials=serials))
    macrostep.start(plot, arguments)
    return macrostep.finish(None, handled=True)


def step(chart: Chart, state: MachineState, event: Event | None, situation: Situation) -> Step:
    """React to one event and run to completion: a pure function of its arguments.

    With `event=None` only transitions without trigger are looked at: the world may have changed.

    Raises:
        RunawayError: the chart does not come to rest.
    """
    if state.root is None:
        return Step(state, event, handled=False)
    if event is not None and event.to is None and event.frame is None:
        moved = move(state, state.root, event, situation)
        if moved is not None:
            return moved
    macrostep = Macrostep(chart, situation, state)
    handled = macrostep.react(event)
    return macrostep.finish(event, handled=handled)


def leave(chart: Chart, state: MachineState, situation: Situation) -> Step:
    """Leave all active states without reaching the end: their exit actions put the skills at rest (S0.15)."""
    if state.root is None:
        return Step(state, None, handled=False)
    macrostep = Macrostep(chart, situation, state)
    macrostep.leave()
    return macrostep.finish(None, handled=False)


@dataclass(slots=True)
class Machine:
    """Holds the state of one running chart; everything else is in `step`.

    Attributes:
        chart: where plots are found.
        state: the state after the last step.
    """

    chart: Chart
    state: MachineState = field(default_factory=MachineState)

    def start(self, plot: str, arguments: Mapping[str, Any], situation: Situation) -> Step:
        """See `start`; serial numbers go on from those of the state."""
        done = start(self.chart, plot, arguments, situation, self.state.serials)
        self.state = done.state
        return done

    def send(self, event: Event | None, situation: Situation) -> Step:
        """See `step`."""
        done = step(self.chart, self.state, event, situation)
        self.state = done.state
        return done

    def leave(self, situation: Situation) -> Step:
        """See `leave`."""
        done = leave(self.chart, self.state, situation)
        self.state = done.state
        return done

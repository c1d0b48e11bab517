"""Cycle-based execution: a program drives the steps of a plot with a robot section at its own rate (S3.2).

A simulator or the loop of a robot calls `CycleController.step` once a cycle. The engine and its semantics are as in an
event-driven run: the cycle is the event `cycle`, which brings the values of the sensors.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from dsc.data_types import data_type
from dsc.dynamic.knowledge_situation import KnowledgeSituation
from dsc.dynamic.library import Library
from dsc.engine import steps
from dsc.engine.machine import Machine
from dsc.engine.macrostep import MAX_MICROSTEPS
from dsc.errors import RunawayError
from dsc.events import CYCLE, NO_ATTRIBUTES, Event
from dsc.model.plot import ActionPlot
from dsc.model.robot import Number, RobotSection, Sensor
from dsc.text.profiles import Profile, devices_of, with_profile
from dsc.validation import raise_findings, validate_plot
from dsc.validation.subject import addressed_by
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema import Schema

_TIME = data_type("number from -4e9 to 4e9 in s")
"""The times of cycles: nanoseconds have 64 bits in generated controllers."""
_SECOND = 1_000_000_000
"""Nanoseconds in a second; times are whole nanoseconds, as in generated controllers."""


@dataclass(order=True)
class _Timer:
    due: int
    order: int
    activation: int = field(compare=False)
    event: Event = field(compare=False)


class CycleController:
    """A plot with a robot section that drives a robot in cycles.

    Such a plot has no components and uses no other plots: it reads sensors and sets motors.

    Args:
        plot: the plot, with a robot section.
        parameters: values for the plot's parameters, by name.
        profile: the settings for the robot: its devices by sensor and motor, and defaults of the parameters.

    Attributes:
        ended: whether the plot has ended, also by an error; then each motor has its initial value.
        emitted: outcome events of the plot, in order.

    Raises:
        PlotError: the plot has mistakes.
        InputError: the plot has no robot section, or uses a component; a parameter or the profile does not fit; or an
            evaluation failed, and no state handles `error`.
    """

    def __init__(
        self, plot: ActionPlot, parameters: Mapping[str, Any] = NO_ATTRIBUTES, profile: Profile | None = None
    ) -> None:
        profile = profile or Profile.model_validate({"profile": "none"})
        plot = with_profile(plot, profile)
        self._library = Library([plot])
        raise_findings(validate_plot(plot, self._library))
        self._robot, self._devices = _robot_of(plot), devices_of(plot, profile)
        self._sensors = {self._devices[name]: name for name in self._robot.sensors}
        self._machine, self._knowledge = Machine(self._library), KnowledgeBase(Schema())
        self._timers: list[_Timer] = []
        self._orders = 0
        self._clock = 0
        self._first: int | None = None
        self._last = -math.inf
        self._read: dict[str, int] = {}
        self.ended = False
        self.emitted: list[Event] = []
        self._after(self._machine.start(plot.name, parameters, self._situation()))

    @property
    def motors(self) -> dict[str, Number]:
        """The values of the motors by device, saturated at the bounds of their ranges."""
        root, motors = self._machine.state.root, self._robot.motors
        return {
            self._devices[name]: one.start if root is None else one.clip(root.variables[name])
            for name, one in motors.items()
        }

    @property
    def active(self) -> list[str]:
        """Paths of the active states, outer states first."""
        return list(self._machine.state.configuration())

    def step(self, sensors: Mapping[str, Number], now: float) -> dict[str, Number]:
        """Execute a cycle and return the values of the motors by device.

        The timers due until `now` come first, in their order, and read the values of the cycle before. The event
        `cycle` with the values of the sensors follows. The timers of the initial states count from the first cycle.

        Args:
            sensors: values of the sensors by device; one with a `rate` may be missing for the time of a reading.
            now: the time in seconds, which begins anywhere and does not decrease.

        Raises:
            UnknownNameError: no sensor is a device of that name.
            InputError: a value is missing, of another type or out of range, or the time is not finite or decreases:
                nothing happens. Or an evaluation failed, and no state handles `error`: the controller has ended.
            RunawayError: the chart goes round; the controller has ended.
        """
        time = self._count(now)
        readings = self._check(sensors, time)
        self._first, self._last = _nanoseconds(now) - time, now
        self._time_out(time)
        if not self.ended:
            self._send(Event(CYCLE, readings))
        return self.motors

    def _time_out(self, time: int) -> None:
        """Handle the timers that are due until a time, in their order."""
        handled = 0
        while not self.ended and self._timers and min(self._timers).due <= time:
            timer = min(self._timers)
            self._timers.remove(timer)
            handled = 1 if timer.due > self._clock else handled + 1
            if handled > MAX_MICROSTEPS:
                error = RunawayError(f"{MAX_MICROSTEPS} timers are due at the same time", self.active)
                self._take(self._machine.leave(self._situation()))
                raise error
            self._clock = max(self._clock, timer.due)
            self._send(timer.event)
        self._clock = max(self._clock, time)

    def _count(self, now: float) -> int:
        """Return the nanoseconds since the first cycle."""
        _TIME.check("the time of a cycle", now)
        if now < self._last:
            raise InputError(f"the time of a cycle does not decrease: {now:g} s follows {self._last:g} s")
        time = _nanoseconds(now)
        return 0 if self._first is None else time - self._first

    def _check(self, sensors: Mapping[str, Number], time: int) -> dict[str, Number]:
        if not isinstance(sensors, Mapping):
            remedy = f"pass a map, e.g. {{{', '.join(f'{device!r}: ...' for device in self._sensors)}}}"
            raise InputError(f"the values of the sensors are a map by name, not {sensors!r}: {remedy}")
        for device in sensors:
            if device not in self._sensors:
                message = f"the robot has no sensor '{device}'"
                raise UnknownNameError(message, found=str(device), valid=self._sensors)
        readings = {}
        for device, name in self._sensors.items():
            sensor = self._robot.sensors[name]
            if device in sensors:
                readings[name] = sensor.kind.check(f"the sensor '{device}'", sensors[device])
            elif not self._is_valid(name, sensor, time):
                raise InputError(self._missing(name, sensor), found=device)
        self._read.update(dict.fromkeys(readings, time))
        return readings

    def _is_valid(self, name: str, sensor: Sensor, time: int) -> bool:
        """Return whether the last reading of a sensor is still valid."""
        return sensor.rate is not None and name in self._read and (time - self._read[name]) * sensor.rate <= _SECOND

    def _missing(self, name: str, sensor: Sensor) -> str:
        late = ""
        if sensor.rate is not None:
            older = f"its last value is older than {1 / sensor.rate:g} s"
            late = f"; {older if name in self._read else 'it has had no value before'}"
        return f"the sensor '{self._devices[name]}' has no value in this cycle{late}; it is of type {sensor.type}"

    def _situation(self) -> KnowledgeSituation:
        return KnowledgeSituation(self._knowledge, self._library, lambda: self._clock / _SECOND)

    def _send(self, event: Event) -> None:
        try:
            self._after(self._machine.send(event, self._situation()))
        except RunawayError:
            self._take(self._machine.leave(self._situation()))
            raise

    def _after(self, step: steps.Step) -> None:
        self._take(step)
        if step.errors or step.bugs:
            self._take(self._machine.leave(self._situation()))
            problems = "; ".join((*step.errors, *step.bugs))
            raise InputError(f"{problems}: no state handles the `error`, and the plot has ended")

    def _take(self, step: steps.Step) -> None:
        self.emitted += step.emitted
        for output in step.output:
            match output:
                case steps.StartTimer(activation, index, seconds, event):
                    self._orders += 1
                    due = self._clock + _nanoseconds(seconds)
                    fired = Event(event, to=activation, exact=True, number=index)
                    self._timers.append(_Timer(due, self._orders, activation, fired))
                case steps.Cancel(activation):
                    self._timers = [one for one in self._timers if one.activation != activation]
                case _:
                    pass
        self.ended = step.state.root is None


def _robot_of(plot: ActionPlot) -> RobotSection:
    if plot.robot is None:
        raise InputError(f"the plot '{plot.name}' has no robot section, which declares sensors and motors")
    for component in sorted(addressed_by(plot)):
        message = f"the plot '{plot.name}' uses the component '{component}'; in cycles it has only sensors and motors"
        raise InputError(message, found=component)
    return plot.robot


def _nanoseconds(seconds: float) -> int:
    return math.floor(seconds * _SECOND + 0.5)

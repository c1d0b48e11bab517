"""Cycles of a controller: sensors in, motors out; part of each Python controller of a plot with a robot section."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

from dsc.controllers.runtime.interpreter import Interpreter
from dsc.controllers.runtime.tables import Occurrence, Status


class Device(NamedTuple):
    """A sensor or motor: the word of its variable, its class, its range, and the value of a motor after the end."""

    word: str
    kind: type
    least: float
    most: float
    start: Any


class CycleInterpreter(Interpreter):
    """A controller in cycles."""

    sensors: ClassVar[Mapping[str, Device]]
    motors: ClassVar[Mapping[str, Device]]
    cycle_event: ClassVar[int]
    data: Any

    def cycle(self, sensors: Mapping[str, Any], now_ns: int) -> dict[str, Any]:
        """Execute `step`, store the values of the sensors, fire `cycle`, and return the values of the motors.

        The timers of the initial states count from the first cycle. `status` has the result. After `BUSY` there was no
        cycle; call it again. Raise `ValueError` for a time that decreases, and for values of sensors that are missing,
        unknown, of another type or out of range; then nothing happens.
        """
        self._require_init()
        self._check_now(now_ns)
        if self.cycled and now_ns < self.clock:
            raise ValueError(f"the time does not decrease: {now_ns} follows {self.clock}")
        readings = self._read(sensors)
        if not self.cycled:
            self.due = {timer: (due + now_ns - self.clock, order) for timer, (due, order) in self.due.items()}
            self.clock, self.cycled = now_ns, True
        self.step(now_ns)
        if not self.ended and not self.status & Status.BUSY:
            for word, value in readings.items():
                setattr(self.data, word, value)
            self._handle(Occurrence(self.cycle_event))
        return {name: self._value(one) for name, one in self.motors.items()}

    def _read(self, sensors: Mapping[str, Any]) -> dict[str, Any]:
        if not isinstance(sensors, Mapping):
            raise ValueError(f"the sensors are a map by name, not {sensors!r}")
        for name in sensors:
            if name not in self.sensors:
                raise ValueError(f"there is no sensor {name!r}; the sensors are {[*self.sensors]}")
        return {one.word: _reading(name, one, sensors) for name, one in self.sensors.items()}

    def _value(self, motor: Device) -> Any:
        return (
            motor.start if self.ended else motor.kind(min(max(getattr(self.data, motor.word), motor.least), motor.most))
        )


def _reading(name: str, sensor: Device, sensors: Mapping[str, Any]) -> Any:
    if name not in sensors:
        raise ValueError(f"the sensor '{name}' has no value in this cycle")
    value: Any = sensors[name]
    wanted = {float: (int, float), int: (int,), bool: (bool,)}[sensor.kind]
    if type(value) not in wanted or not sensor.least <= value <= sensor.most:
        raise ValueError(f"'{name}' is a {sensor.kind.__name__} from {sensor.least} to {sensor.most}, not {value!r}")
    return sensor.kind(value)

"""The robot section of a plot: sensors in, motors out, constants and operations; `dsc.cycles` executes it (S3.2, S3.3).

Sensors, motors and constants are variables of the plot: the event `cycle` brings values of sensors, and motors are
assigned.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BeforeValidator, Field, StrictBool, StrictFloat, StrictInt

from dsc.data_types import DataType, data_type
from dsc.model.actions import OfRobot, Perform
from dsc.model.declarations import PlotVariable, TypeText
from dsc.model.language import Frozen, TermField
from dsc.model.reading import in_yaml
from knowledge_base.errors import UnknownNameError
from knowledge_base.language.syntax.expression import Constant

_Declared = TypeVar("_Declared")


def _number(value: Any) -> Any:
    if isinstance(value, int | float) and math.isfinite(value):
        return value
    raise ValueError(f"a finite number, true or false was expected; found {in_yaml(value)}")


Number = Annotated[StrictBool | StrictInt | StrictFloat, BeforeValidator(_number)]
"""A value of a sensor, motor or constant."""


def _device_type(text: str) -> str:
    if data_type(text).kind not in {"number", "integer", "boolean"}:
        raise ValueError(f"a sensor or motor has a number, an integer or a boolean as value; found the type '{text}'")
    return text


class Device(PlotVariable):
    """A sensor or motor; the type alone is the short form, e.g. `number from 0 to 1023`.

    Attributes:
        type: a number, integer or boolean, with its range and unit, e.g. `number from -6.28 to 6.28 in rad/s`.
        initial: the value at the start; by default 0, or the bound closest to 0, or false.
    """

    type: Annotated[TypeText, AfterValidator(_device_type)]
    initial: Number | None = None  # type: ignore[assignment]  # a constant

    @property
    def kind(self) -> DataType:
        """The type as a value."""
        return data_type(self.type)

    @property
    def start(self) -> Number:
        """The value at the start."""
        if self.initial is not None:
            return self.initial
        return False if self.kind.kind == "boolean" else self.clip(0)

    def clip(self, value: Number) -> Number:
        """Return the value of the range that is closest to `value`."""
        least, most = self.kind.least, self.kind.most
        if least is not None and value < least:
            value = least
        if most is not None and value > most:
            value = most
        return int(value) if self.kind.kind == "integer" else value


class Sensor(Device):
    """A sensor, which the plot only reads.

    Attributes:
        rate: readings per second. A sensor with a rate may lack a reading in a cycle: until the time of a reading has
            passed, the last one is valid.
    """

    rate: float | None = Field(default=None, gt=0, strict=True)


class RobotActivity(Frozen):
    """An activity, which actions start and stop by name.

    Attributes:
        start: values of motors at the start.
        stop: values of motors at the stop.
    """

    start: dict[str, TermField] = Field(default_factory=dict)
    stop: dict[str, TermField] = Field(default_factory=dict)


class RobotSection(Frozen):
    """Sensors, motors, constants, operations and activities of a robot that a plot drives in cycles.

    Attributes:
        sensors: sensors by name, with their types.
        motors: motors by name, with their types.
        constants: numbers and truth values by name.
        operations: for each name, values of motors, which the action `perform` assigns.
        activities: activities by name; a boolean of that name is true while the activity is active.
    """

    sensors: dict[str, Sensor] = Field(default_factory=dict)
    motors: dict[str, Device] = Field(default_factory=dict)
    constants: dict[str, Number] = Field(default_factory=dict)
    operations: dict[str, dict[str, TermField]] = Field(default_factory=dict)
    activities: dict[str, RobotActivity] = Field(default_factory=dict)

    @property
    def read_only(self) -> Mapping[str, str]:
        """The names that a plot only reads, each with its kind in words."""
        found = {**dict.fromkeys(self.sensors, "a sensor"), **dict.fromkeys(self.constants, "a constant")}
        return {**found, **dict.fromkeys(self.activities, "an activity")}

    @property
    def assignments(self) -> dict[tuple[str, ...], dict[str, TermField]]:
        """The values of motors in operations and activities, by their paths in the written form."""
        found: dict[tuple[str, ...], dict[str, TermField]] = {}
        for name, values in self.operations.items():
            found["operations", name] = values
        for name, activity in self.activities.items():
            found |= {("activities", name, "start"): activity.start, ("activities", name, "stop"): activity.stop}
        return found

    def motor_values(self, action: OfRobot) -> dict[str, TermField]:
        """Return the values that an action assigns to motors, and to the name of an activity.

        Raises:
            UnknownNameError: there is no operation or activity of that name.
        """
        if isinstance(action, Perform):
            return _look_up("operation", action.perform, self.operations)
        name, active = action.change
        activity = _look_up("activity", name, self.activities)
        return {**(activity.start if active else activity.stop), name: Constant(active)}

    @property
    def variables(self) -> dict[str, PlotVariable]:
        """The variables of the section; a motor has no bounds here, as its value is saturated."""
        bare = {name: one.kind.kind for name, one in self.motors.items()}
        types = {**{name: one.type for name, one in self.sensors.items()}, **bare}
        values = {name: one.start for name, one in (*self.sensors.items(), *self.motors.items())}
        for name, value in {**self.constants, **dict.fromkeys(self.activities, False)}.items():
            types[name], values[name] = "boolean" if isinstance(value, bool) else "number", value
        return {name: PlotVariable(type=types[name], initial=Constant(value)) for name, value in values.items()}


def _look_up(kind: str, name: str, declared: Mapping[str, _Declared]) -> _Declared:
    if name not in declared:
        raise UnknownNameError(f"there is no {kind} '{name}'", found=name, valid=declared)
    return declared[name]

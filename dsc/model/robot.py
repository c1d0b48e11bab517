"""The robot section of a plot: sensors in, motors out, constants and operations; `dsc.cycles` executes it (S3.2, S3.3).

Sensors, motors and constants are variables of the plot: the event `cycle` brings values of sensors, and motors are
assigned.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field, StrictBool, StrictFloat, StrictInt

from dsc.data_types import DataType, data_type
from dsc.model.declarations import PlotVariable, TypeText
from dsc.model.language import Frozen, TermField
from dsc.model.reading import in_yaml
from knowledge_base.language.syntax.expression import Constant


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


class RobotSection(Frozen):
    """Sensors, motors, constants and operations of a robot that a plot drives in cycles.

    Attributes:
        sensors: sensors by name, with their types.
        motors: motors by name, with their types.
        constants: numbers and truth values by name.
        operations: for each name, values of motors, which the action `perform` assigns.
    """

    sensors: dict[str, Sensor] = Field(default_factory=dict)
    motors: dict[str, Device] = Field(default_factory=dict)
    constants: dict[str, Number] = Field(default_factory=dict)
    operations: dict[str, dict[str, TermField]] = Field(default_factory=dict)

    @property
    def read_only(self) -> Mapping[str, str]:
        """The names that a plot only reads, each with its kind in words."""
        return {**dict.fromkeys(self.sensors, "sensor"), **dict.fromkeys(self.constants, "constant")}

    @property
    def variables(self) -> dict[str, PlotVariable]:
        """The sensors, motors and constants as variables; a motor has no bounds here, as its value is saturated."""
        bare = {name: one.kind.kind for name, one in self.motors.items()}
        types = {**{name: one.type for name, one in self.sensors.items()}, **bare}
        values = {name: one.start for name, one in (*self.sensors.items(), *self.motors.items())}
        for name, value in self.constants.items():
            types[name], values[name] = "boolean" if isinstance(value, bool) else "number", value
        return {name: PlotVariable(type=types[name], initial=Constant(value)) for name, value in values.items()}

"""Data of a controller: parameters, variables and outputs, and the kinds of attributes and arguments."""

from __future__ import annotations

from dsc.controllers.expressions import RefusedError, Typing, bound, kind_of, number_bounds, whole_bounds
from dsc.controllers.model import Combination, Comparison, Condition, Controller, Device, Fixed, Kind, Parameter, Read
from dsc.controllers.names import actions_of, arguments_of, declare_attributes, join_all
from dsc.controllers.refusals import Refusals
from dsc.data_types import data_type
from dsc.engine.tables import CompiledPlot
from dsc.events import CYCLE
from dsc.model import robot
from dsc.model.actions import Emit
from dsc.model.declarations import PlotParameter, PlotVariable
from dsc.model.language import TermField


def declare(controller: Controller, compiled: CompiledPlot, refusals: Refusals) -> Typing:
    """Add the data of a plot to its controller, and return the typing of its terms."""
    plot = compiled.plot
    typing = Typing(controller.data, controller.attributes, compiled.index, checked=not compiled.scxml)
    for name, parameter in plot.parameters.items():
        with refusals.at(("parameters", name)):
            controller.parameters[name] = _parameter(name, parameter, typing)
            controller.data[name] = controller.parameters[name].kind
    for group, variables in (("variables", plot.all_variables), ("outputs", plot.outputs)):
        for name, variable in variables.items():
            with refusals.at((group, name)):
                _declare_variable(controller, name, variable, typing)
    if plot.robot is not None:
        controller.cycle = controller.events.index(CYCLE)
        controller.sensors = {name: _device(one) for name, one in plot.robot.sensors.items()}
        controller.motors = {name: _device(one) for name, one in plot.robot.motors.items()}
    declare_attributes(compiled, controller.attributes, refusals)
    actions = [*actions_of(compiled)]
    fired = [one.arguments for one in actions if isinstance(one, Emit)]
    for _ in range(len(fired) + 1):  # an attribute may be that of another event
        join_all(controller.attributes, fired, typing, refusals)
    join_all(controller.arguments, map(arguments_of, actions), typing, refusals)
    return typing


def _declare_variable(controller: Controller, name: str, variable: PlotVariable, typing: Typing) -> None:
    wanted = data_type(variable.type)
    kind = kind_of(wanted, f"'{name}'")
    if variable.initial is None:
        raise RefusedError(f"'{name}' has no `initial`; each variable of a controller has a value")
    controller.initial.append((name, typing.of_type(typing.value(variable.initial), wanted)))
    controller.data[name] = kind


def _device(one: robot.Device) -> Device:
    kind = kind_of(one.kind, "a device")
    if kind == "boolean":
        return Device(kind, Fixed(value=False, kind=kind), Fixed(value=True, kind=kind), Fixed(one.start, kind))
    if kind == "integer":
        least, most = whole_bounds(one.kind.least, one.kind.most)
        return Device(kind, Fixed(least, kind), Fixed(most, kind), Fixed(one.start, kind))
    low, high = number_bounds(one.kind.least, one.kind.most)
    return Device(kind, Fixed(low, kind), Fixed(high, kind), Fixed(float(one.start), kind))


def _parameter(name: str, parameter: PlotParameter, typing: Typing) -> Parameter:
    wanted = data_type(parameter.type)
    kind = kind_of(wanted, f"'{name}'")
    default = None if parameter.default is None else _default(name, parameter.default, kind, typing)
    bounds = [(wanted.least, wanted.most)] if typing.checked else []
    own: Read = Read("data", name, kind)
    conditions: list[Condition] = []
    for least, most in (*bounds, (parameter.least, parameter.most)):
        if kind != "boolean" and (least is not None or most is not None):
            conditions.append(Comparison("eq", own, bound(own, least, most)))
    if parameter.among:
        values = [typing.convert(_fix(name, one), kind) for one in parameter.among]
        conditions.append(Combination(every=False, parts=tuple(Comparison("eq", own, one) for one in values)))
    return Parameter(kind, default, tuple(conditions))


def _fix(name: str, value: object) -> Fixed:
    if isinstance(value, bool | int | float):
        kind: Kind = "boolean" if isinstance(value, bool) else "integer" if isinstance(value, int) else "number"
        return Fixed(value, kind)
    raise RefusedError(f"a value of '{name}' is a name or text; the data of a controller are numbers")


def _default(name: str, term: TermField, kind: Kind, typing: Typing) -> Fixed:
    value = typing.convert(typing.value(term), kind)
    if not isinstance(value, Fixed):
        raise RefusedError(f"the default of '{name}' is computed; a controller has constants as defaults")
    return value

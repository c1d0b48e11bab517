"""Evaluation of terms, plot arguments and the arguments of external actions."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from dsc.engine.machine_state import NOTHING
from dsc.engine.situation import Situation
from dsc.engine.steps import Output, SendMessage, SetParameter, Start, SwitchMode
from dsc.model.actions import Configure, ExternalAction, Send, Trigger
from dsc.model.plot import ActionPlot
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.language.syntax.expression import Constant, Term, Variable


def evaluate(term: Term, bindings: Mapping[str, Any], situation: Situation) -> Any:
    """Return the value of a term; a variable may hold a value of any type, such as a plot.

    Raises:
        InputError: a variable is not bound, or the term is not a number where one is needed.
    """
    if isinstance(term, Constant):
        return term.value
    if isinstance(term, Variable):
        if term.name not in bindings:
            raise UnknownNameError(
                f"variable '?{term.name}' has no value here", place=term.place, found=term.name, valid=bindings
            )
        return bindings[term.name]
    return situation.value(term, bindings)


def delay_of(seconds: Any, least: float = 0) -> float:
    """Return the seconds of a timer; raise `InputError` if the value is not a duration or is below `least`."""
    if isinstance(seconds, bool) or not isinstance(seconds, int | float) or not least <= seconds < math.inf:
        bound = f" of at least {least:g}" if least else ""
        raise InputError(f"a timer needs a number of seconds{bound}; found {seconds!r}")
    return float(seconds)


def fill_parameters(plot: ActionPlot, arguments: Mapping[str, Any], situation: Situation) -> Mapping[str, Any]:
    """Return the variables of a new instance: arguments, defaults and initial values.

    Raises:
        InputError: a parameter is missing or out of its range, or an argument is not a parameter.
    """
    if not (arguments or plot.parameters or plot.variables or plot.outputs):
        return NOTHING
    for given in arguments:
        if given not in plot.parameters:
            raise UnknownNameError(f"plot '{plot.name}' has no parameter '{given}'", found=given, valid=plot.parameters)
    variables: dict[str, Any] = {}
    for name, parameter in plot.parameters.items():
        if name in arguments:
            value = arguments[name]
        elif parameter.default is not None:
            value = evaluate(parameter.default, variables, situation)
        else:
            raise InputError(f"plot '{plot.name}' needs its parameter '{name}'")
        variables[name] = parameter.range.check(f"{plot.name}.{name}", value) if parameter.bounded else value
    for name, variable in (*plot.variables.items(), *plot.outputs.items()):
        variables[name] = None if variable.initial is None else evaluate(variable.initial, variables, situation)
    return variables


def output_of(action: ExternalAction, activation: int, number: int, value: Callable[[Term], Any]) -> Output:
    """Return an external action with the values of its arguments."""
    if isinstance(action, Trigger):
        component, skill = action.trigger.split(".")
        arguments = {name: value(term) for name, term in action.arguments.items()}
        action_id = f"a{activation}.{number}"
        return Start(action_id, activation, component, skill, arguments, action.names, action.within)
    if isinstance(action, Configure):
        component, parameter = action.set.split(".")
        return SetParameter(component, parameter, value(action.to))
    if isinstance(action, Send):
        component, port = action.send.split(".")
        return SendMessage(component, port, {name: value(term) for name, term in action.arguments.items()})
    return SwitchMode(action.switch, action.to)

"""Execution of actions in a running plot: variables, knowledge, events, and output to components."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

from dsc.data_types import check_all
from dsc.engine import steps
from dsc.engine.binding import find_values
from dsc.engine.frames import Frame
from dsc.engine.machine_state import NOTHING
from dsc.engine.situation import Situation
from dsc.engine.step_builder import StepBuilder
from dsc.engine.tables import CompiledPlot, StateNode, TransitionEdge
from dsc.events import AFTER, AT_LEAST, ERROR, EVERY, EXECUTION_ERROR, PROGRAMMING_ERROR, Event
from dsc.model.actions import (
    Assign,
    Bind,
    Block,
    Choose,
    Configure,
    Emit,
    ExternalAction,
    Internal,
    Log,
    Perform,
    Send,
    StartActivity,
    StopActivity,
    Switch,
    Tell,
    Trigger,
    Unwire,
    Wire,
    Withdraw,
)
from dsc.model.data_forms import Values, is_literal, literal_value
from dsc.model.language import TermField
from dsc.model.plot import ActionPlot
from dsc.model.reading import FormPath
from dsc.rank import Rank
from dsc.run_log import run_logger
from knowledge_base.errors import InputError, UnknownNameError, UserCodeError
from knowledge_base.language.syntax.expression import Arithmetic, Call, Constant, Expression, Term, Variable
from knowledge_base.tracebacks import whole_traceback

_LOG = run_logger(__package__)

_EXPONENT_FROM = 1e21
"""Smallest number that ECMAScript writes with an exponent."""
_INTERNAL = frozenset(get_args(Internal))
_OF_PLOT = "'{owner}.{name}'"
_NO_CLASS: frozenset[type] = frozenset()
SHORTEST_PERIOD = 0.001
"""Lower bound of a period in seconds; a shorter period would block all other events."""


class Performer:
    """Executor of actions.

    Attributes:
        situation: the knowledge that conditions and terms read.
        results: collects what the actions do.
        event: the current event, whose attributes the actions read.
    """

    __slots__ = ("event", "results", "situation")

    def __init__(self, situation: Situation, results: StepBuilder) -> None:
        self.situation = situation
        self.results = results
        self.event: Event | None = None

    def fail(self, frame: Frame, state: str, error: InputError, *, what: str = "", part: FormPath = ()) -> None:
        """Fire an error event in the plot after a failed evaluation; for an exception of user code, another event.

        Args:
            frame: the plot.
            state: the name of the state.
            error: the reason.
            what: the part of the state, as text before the path of the state.
            part: the path of this part in the form of the state.
        """
        subject = f"{what}{frame.prefix}{state}{file_and_line(frame.compiled.plot, state, part)}"
        known = error.place is not None and error.place.source is not None  # else it is a place in the term
        reason = f"{subject}: {error if known else error.text}"
        name = EXECUTION_ERROR if frame.compiled.scxml else ERROR
        if isinstance(error, UserCodeError) and not frame.compiled.scxml:
            name = PROGRAMMING_ERROR
            _LOG.error("%s\n%s", reason, whole_traceback(error))
        self.results.fire(Event(name, {"reason": reason}, frame=frame.serial))

    # -- values ------------------------------------------------------------------------------------------

    def bindings(self, frame: Frame) -> Mapping[str, Any]:
        """Return the values of the frame's variables and of the current event's attributes, by name."""
        if self.event is None or not self.event.attributes:
            return frame.variables
        return {**frame.variables, **self.event.bindings()}

    def holds(self, frame: Frame, condition: Expression) -> bool:
        """Return whether a condition is true in a frame; raise `InputError` if its evaluation fails."""
        return self.situation.holds(condition, self.bindings(frame))

    def enables(self, frame: Frame, edge: TransitionEdge, condition: Expression) -> bool:
        """Return whether a guard is true, or the transition's `bind` finds values; errors as for `holds`."""
        return self.holds(frame, condition) if edge.bind is None else self.find(frame, edge.bind) is not None

    def find(self, frame: Frame, bind: Bind) -> Mapping[str, Any] | None:
        """Return the values that a transition binds; `None` if there are none. Errors as for `find_values`."""
        return find_values(bind, self.situation, self.bindings(frame))

    def value(self, frame: Frame, term: TermField) -> Any:
        """Return the value of a term in a frame; raise `InputError` if its evaluation fails."""
        return evaluate(term, self.bindings(frame), self.situation, frame.compiled)

    def values(self, frame: Frame, terms: Mapping[str, TermField]) -> dict[str, Any]:
        """Return the values of named terms in a frame; raise `InputError` if an evaluation fails."""
        return {name: self.value(frame, term) for name, term in terms.items()} if terms else {}

    # -- actions -----------------------------------------------------------------------------------------

    def act(
        self,
        frame: Frame,
        state: str,
        actions: Iterable[ExternalAction | Internal],
        activation: int = 0,
        first: int = 0,
        part: FormPath = (),
    ) -> None:
        """Execute a block of actions of a state; action numbers start at `first` within the activation.

        `part` is the path of the block in the form of the state, for messages.

        A failed evaluation fires an error event. The remaining actions are still executed; in dialect `scxml` they are
        skipped (SCXML 4.9). A branch condition whose evaluation fails counts as false (SCXML 5.9.1).
        """
        for number, action in enumerate(actions, first):
            try:
                # `isinstance` would ask each type of the union, which takes 1 µs for classes of pydantic.
                if type(action) in _INTERNAL:
                    self._perform(frame, state, action)  # type: ignore[arg-type]
                else:
                    self.results.put(self._output_of(frame, state, action, activation, number))  # type: ignore[arg-type]
            except InputError as error:
                self.fail(frame, state, error, part=part)
                if frame.compiled.scxml or isinstance(action, Bind):  # later actions read what it binds
                    return

    def start_timers(self, frame: Frame, node: StateNode, activation: int) -> None:
        """Start all timers of an entered state."""
        if node.at_least is not None:
            self.start_timer(frame, node, activation, AT_LEAST, 0, node.at_least)
        for event, many in ((AFTER, node.timeouts), (EVERY, node.cycles)):
            for index, timed in enumerate(many):
                self.start_timer(frame, node, activation, event, index, timed.seconds)

    def start_timer(
        self, frame: Frame, node: StateNode, activation: int, event: str, index: int, seconds: TermField
    ) -> None:
        """Start one timer of a state; a delay whose evaluation fails fires an error event instead."""
        try:
            delay = _delay_of(self.value(frame, seconds), least=SHORTEST_PERIOD if event == EVERY else 0)
        except InputError as error:
            self.fail(frame, node.name, error, part=(event, index))
        else:
            self.results.put(steps.StartTimer(activation, index, delay, event))

    def _output_of(
        self, frame: Frame, state: str, action: ExternalAction, activation: int, number: int
    ) -> steps.Output:
        """Return the output for an external action, with evaluated arguments."""
        match action:
            case Trigger():
                component, skill = action.trigger.split(".")
                arguments = self.values(frame, action.arguments)
                action_id = f"a{activation}.{number}"
                rank = _rank(frame, state)
                return steps.Start(
                    action_id, activation, component, skill, arguments, action.names, action.within, rank
                )
            case Configure():
                component, parameter = action.set.split(".")
                return steps.SetParameter(component, parameter, self.value(frame, action.to), activation)
            case Send():
                component, port = action.send.split(".")
                return steps.SendMessage(component, port, self.values(frame, action.arguments), activation)
            case Switch():
                return steps.SwitchMode(action.switch, action.to, activation)
            case Wire():
                component, port = action.wire.split(".")
                return steps.SetWire(component, port, str(self.value(frame, action.to)), activation)
            case Unwire():
                component, port = action.unwire.split(".")
                return steps.SetWire(component, port, None, activation)

    def _perform(  # noqa: C901, PLR0912  # a table by kind
        self, frame: Frame, state: str, action: Internal
    ) -> None:
        match action:
            case Assign(assign=terms):
                _set_variables(frame, self.values(frame, terms))
            case Tell(tell=effect):
                self.results.tell(self.situation.tell(effect, self.bindings(frame)))
            case Bind(names=names):
                found = self.find(frame, action)
                if found is None:
                    raise InputError(f"a transition of this step ended what was found for {', '.join(names)}")
                _set_variables(frame, dict(found))
            case Emit():
                attributes = self.values(frame, action.arguments)
                if action.delay is None:
                    self.emit(frame, action.emit, attributes)
                else:
                    self._emit_later(frame, action, action.delay, attributes)
            case Withdraw(withdraw=term):
                self.results.put(steps.Revoke(frame.serial, str(self.value(frame, term))))
            case Log(log=parts, label=label):
                text = "".join(_ecmascript_text(self.value(frame, part)) for part in parts)
                self.results.put(steps.Note(label, text))
            case Choose():
                for inner in action.then if self._chooses(frame, state, action) else action.otherwise:
                    self._perform(frame, state, inner)
            case Block(block=inside):
                self.act(frame, state, inside)
            case Perform() | StartActivity() | StopActivity():
                if isinstance(action, Perform) or frame.variables[action.change[0]] is not action.change[1]:
                    _set_variables(frame, self.values(frame, frame.compiled.plot.motor_values(action)))

    def _chooses(self, frame: Frame, state: str, action: Choose) -> bool:
        try:
            return self.holds(frame, action.condition)
        except InputError as error:
            self.fail(frame, state, error, what="condition of a branch in ")
            return False

    def _emit_later(self, frame: Frame, action: Emit, delay: TermField, attributes: Mapping[str, Any]) -> None:
        name = "" if action.id is None else str(self.value(frame, action.id))
        if action.into is not None:
            name = f"{action.emit}.{self.results.number()}"
            frame.variables = {**frame.variables, action.into: name}
        event = Event(action.emit, attributes, frame=frame.serial)
        self.results.put(steps.SendLater(event, _delay_of(self.value(frame, delay)), name))

    def emit(self, frame: Frame, name: str, attributes: Mapping[str, Any]) -> None:
        """Fire an event in a plot; an outcome of the plot is an event of its host, or of the run.

        Raises:
            InputError: an attribute of an outcome does not have its declared type.
        """
        types = frame.compiled.plot.emits.get(name)
        if types and not frame.compiled.scxml:
            attributes = dict(attributes)
            check_all("the attribute '{name}' of '{owner}'", name, attributes, types, frame.compiled.records)
        if name not in frame.compiled.plot.emits:
            self.results.fire(Event(name, attributes, frame=frame.serial))
        elif frame.parent is None:
            self.results.emit(Event(name, attributes))
        elif not frame.gone:
            self.results.fire(Event(name, attributes, to=frame.parent.activations[frame.host]))
        # Otherwise another transition of this microstep exited the host, and the outcome is dropped.


def file_and_line(plot: ActionPlot, state: str, part: FormPath = ()) -> str:
    """Return the place of a part of a state as ` (main.yaml:7)`; empty if it is unknown.

    The folder is omitted, so that the records of a run do not depend on it.
    """
    path = next((path for name, _, path in plot.walk() if name == state), None)
    place = None if path is None else plot.place((*path, *part))
    return "" if place is None or place.source is None else f" ({Path(place.source).name}:{place.line})"


def _set_variables(frame: Frame, values: dict[str, Any]) -> None:
    compiled = frame.compiled
    for name, value in values.items():
        if type(value) not in compiled.exact.get(name, _NO_CLASS):  # most values need no further check
            check_all(_OF_PLOT, compiled.plot.name, values, compiled.types, compiled.records)
            break
    frame.variables = {**frame.variables, **values}


def _rank(frame: Frame, state: str) -> Rank:
    """Return the rank of the skills of a state: the innermost declared priority, also of states around the plot."""
    depth, preempts, handles = 0, False, False
    priority: float | None = None
    around: Frame | None = frame
    while around is not None:
        node = around.compiled.nodes[around.compiled.index[state]]
        depth += len(node.around)
        if priority is None:
            preempts, handles, priority = preempts or node.preempts, handles or node.handles, node.priority
        state, around = around.host, around.parent
    return Rank(priority or 0.0, handles, depth, preempts)


def fill_parameters(compiled: CompiledPlot, arguments: Mapping[str, Any], situation: Situation) -> Mapping[str, Any]:
    """Return the variables of a new plot instance by name, from arguments, defaults and initial values.

    Raises:
        InputError: a parameter is missing, out of its range or of another type, or an argument names no parameter.
    """
    plot = compiled.plot
    declared = plot.variables if plot.robot is None else plot.all_variables  # most plots have no robot section
    if not (arguments or plot.parameters or declared or plot.outputs):
        return NOTHING
    for given in arguments:
        if given not in plot.parameters:
            raise UnknownNameError(f"plot '{plot.name}' has no parameter '{given}'", found=given, valid=plot.parameters)
    variables: dict[str, Any] = {}
    for name, parameter in plot.parameters.items():
        if name in arguments:
            value = arguments[name]
        elif parameter.default is not None:
            value = evaluate(parameter.default, variables, situation, compiled)
        elif parameter.required:
            raise InputError(f"plot '{plot.name}' needs its parameter '{name}'")
        else:
            value = None
        variables[name] = value
        if parameter.bounded and value is not None:
            variables[name] = parameter.range.check(f"{plot.name}.{name}", value)
    for name, variable in (*declared.items(), *plot.outputs.items()):
        variables[name] = (
            None if variable.initial is None else evaluate(variable.initial, variables, situation, compiled)
        )
    if compiled.types:
        own = {name: value for name, value in variables.items() if value is not None or name in plot.parameters}
        check_all(_OF_PLOT, plot.name, own, compiled.types, compiled.records)
        variables.update(own)
    return variables


def evaluate(term: Term, bindings: Mapping[str, Any], situation: Situation, compiled: CompiledPlot) -> Any:
    """Return the value of a term of a plot; the value of a variable may have any type, e.g. a plot as data.

    Raises:
        InputError: a variable is not bound, an operand of arithmetic is not a number, or a conversion fails.
    """
    if isinstance(term, Constant):
        return term.value
    if isinstance(term, Variable):
        return bindings[term.name] if term.name in bindings else Values(bindings).value(term.name, term.place)
    if isinstance(term, Call):
        if is_literal(term):
            return literal_value(term, lambda part: evaluate(part, bindings, situation, compiled))
        if term.function in compiled.conversions:
            given = [evaluate(part, bindings, situation, compiled) for part in term.args]
            return compiled.conversions[term.function].value(given, compiled.records)
    if isinstance(term, Arithmetic) and compiled.conversions:
        numbers = [evaluate(part, bindings, situation, compiled) for part in term.args]
        term = replace(term, args=tuple(map(Constant, numbers)))
    return situation.value(term, bindings)


def _delay_of(seconds: Any, least: float = 0) -> float:
    """Return a timer's delay in seconds; raise `InputError` for a value that is not a duration of at least `least`."""
    if isinstance(seconds, bool) or not isinstance(seconds, int | float) or not least <= seconds < math.inf:
        bound = f" of at least {least:g}" if least else ""
        raise InputError(f"a timer needs a number of seconds{bound}; found {seconds!r}")
    return float(seconds)


def _ecmascript_text(value: Any) -> str:
    """Return the text that ECMAScript prints for a value."""
    if value is None:
        return "undefined"
    if isinstance(value, bool):
        return str(value).lower()
    is_whole = isinstance(value, float) and value.is_integer() and abs(value) < _EXPONENT_FROM
    return f"{value:.0f}" if is_whole else str(value)

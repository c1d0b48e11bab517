"""Skills: typed actions of components, and the smallest plot around one skill (S0.7, S0.8, S1.1).

A skill ends with an outcome event and observations, which the plot interprets. A skill is one decorated coroutine
function; its annotations declare its parameters and outcomes:

```python
Item = NewType("Item", str)


class Grasped(Outcome): ...


class Slipped(Outcome):
    item: Item


class Gripper(Component):
    @skill
    async def grasp(self, call: SkillCall[Any], item: Item) -> Grasped | Slipped:
        await call.clock.sleep(2.0)
        return Grasped(observed=Delta(added=(fact("holding", item),)))
```
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Awaitable, Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Literal, TypeVar, cast, get_args, overload

from dsc.annotations import FoundRecords, Namespace, evaluated, names_around
from dsc.blocking import in_process, in_thread
from dsc.calls import SkillCall
from dsc.data_types import Records
from dsc.events import EXECUTIVES
from dsc.model.plot import ActionPlot
from dsc.outcomes import Outcome, declared_outcomes
from dsc.python_values import Builder, plain_value, typed_parameters
from knowledge_base.errors import InputError, Place, SchemaError, UnknownNameError, tolerated
from knowledge_base.user_objects import shown

AfterCrash = Literal["repeat", "same_id", "sense"]
"""The reaction to an action whose effect is unknown after a crash.

`repeat` executes the action again; the action must be idempotent. `same_id` executes the action with its former id, for
which the component acts only one time. `sense` observes the world first, without a repetition.
"""

SkillBody = Callable[..., Any]
"""The decorated function, which returns an `Outcome`: a coroutine function or, if the body blocks, a plain function."""
_Body = TypeVar("_Body", bound=SkillBody)
_Coroutine = TypeVar("_Coroutine", bound=Callable[..., Awaitable[Outcome]])
_Plain = TypeVar("_Plain", bound=Callable[..., Outcome])
Pattern = Literal["skill", "query", "event", "message"]
"""The communication pattern of a `trigger` (S1.1).

A `skill` ends by itself, and a `query` ends with its answer. An `event` stays active until its state is left.
"""


@dataclass(frozen=True, slots=True)
class SkillSignature:
    """The interface of a skill.

    Attributes:
        component: the component's name. The skill's name in charts is `component.name`.
        name: the skill's name.
        parameters: types by parameter name; `None` accepts any value.
        defaults: values of optional parameters.
        outcomes: events that the skill may end with or report, with their attributes and types.
        pattern: see `Pattern`.
        after_crash: see `AfterCrash`.
        unlimited: whether the skill has no time limit, unless the trigger declares one.
        within: seconds after which the skill is cancelled and ends with `timed_out`, unless the trigger declares other
            seconds; `None` means 300 s.
        place: file and line of the body; empty if unknown.
        records: the records in the types of parameters and attributes, see `dsc.data_types`.
    """

    component: str
    name: str
    parameters: Mapping[str, str | None]
    defaults: Mapping[str, Any]
    outcomes: Mapping[str, Mapping[str, str | None]]
    pattern: Pattern = "skill"
    after_crash: AfterCrash = "sense"
    unlimited: bool = False
    place: str = ""
    within: float | None = None
    records: Records = field(default_factory=dict)


Execution = Callable[[Any, SkillBody, SkillCall[Any], Mapping[str, Any]], Awaitable[Outcome]]
"""Function that executes a decorated body; receives the component, the bound body, the call and the arguments."""


@dataclass(frozen=True, slots=True)
class Declared:
    """The declaration of a decorated body.

    Attributes:
        types: types of parameters by name; `None` accepts any value.
        outcomes: as in `SkillSignature`.
        execute: executes a call with the body.
        own: number of leading parameters of the body that charts do not set.
        pattern: see `Pattern`.
        after_crash: see `AfterCrash`.
        unlimited: as in `SkillSignature`.
        within: as in `SkillSignature`.
        records: as in `SkillSignature`.
        builders: functions that make the values of Python for arguments with records or enumerations.
        values: for an event, the types of the values that `update` passes to its test, by name.
    """

    types: Mapping[str, str | None]
    outcomes: Mapping[str, Mapping[str, str | None]]
    execute: Execution
    own: int = 2
    pattern: Pattern = "skill"
    after_crash: AfterCrash = "sense"
    unlimited: bool = False
    within: float | None = None
    records: Records = field(default_factory=dict)
    builders: Mapping[str, Builder] = field(default_factory=dict)
    values: Mapping[str, str | None] = field(default_factory=dict)

    def build(self, arguments: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return the arguments as the body's annotations state; raise `InputError` for data that have no such value."""
        if not self.builders:
            return arguments
        made = {name: build(arguments[name]) for name, build in self.builders.items() if name in arguments}
        return {**arguments, **made}

    def __call__(self, body: _Body) -> _Body:
        """Attach this declaration to `body`, and return `body`.

        Raises:
            SchemaError: an outcome has the name of an event that only the executive fires, or the body has no parameter
                for the call. The error is also raised if the body is not a coroutine function, or is one and blocks.
            UnknownNameError: `types` has a name that is not a parameter.
        """
        with refused_at(body) as named:
            refuse_reserved(named, self.outcomes)
            _require_form(named, body, self)
        setattr(body, DECLARED, self)
        return body


def require_function(body: object, decorator: str) -> None:
    """Raise `InputError` unless a decorator is applied to a function."""
    if not inspect.isfunction(inspect.unwrap(body) if callable(body) else body):
        raise InputError(f"`@{decorator}` decorates a function, whose annotations declare it, not {shown(body)}")


@contextmanager
def refused_at(body: SkillBody) -> Iterator[str]:
    """Give errors of the block the place of a decorated body; the value is the body's name in messages."""
    with tolerated():
        try:
            yield named(body)
        except InputError as error:
            error.place = error.place or Place(*_line_of(body))
            raise


def named(body: SkillBody) -> str:
    """Return the name of a body in messages: the class and the method."""
    return body.__qualname__.rpartition("<locals>.")[2]


DECLARED = "__dsc_skill__"
"""Name of the attribute in which a body stores its declaration."""


@overload
def skill(body: _Coroutine, /) -> _Coroutine: ...
@overload
def skill(
    *, after_crash: AfterCrash = ..., unlimited: bool = ..., within: float | None = ...
) -> Callable[[_Coroutine], _Coroutine]: ...
@overload
def skill(
    *, blocking: Literal["thread", "process"], after_crash: AfterCrash = ..., within: float | None = ...
) -> Callable[[_Plain], _Plain]: ...
def skill(
    body: SkillBody | None = None,
    /,
    *,
    blocking: Literal["thread", "process"] | None = None,
    after_crash: AfterCrash = "sense",
    unlimited: bool = False,
    within: float | None = None,
) -> SkillBody:
    """Declare a component's method, or a function (see `dsc.components.assembly`), as a skill.

    The annotations are the declaration. The returned classes are the outcomes: `-> Grasped | Slipped`. The classes in
    the annotation of the call are events that the skill reports before its end: `call: SkillCall[Progress]`. The
    annotations of parameters are their types, see `dsc.annotations.type_of`.

    Args:
        body: the method or function, if the decorator has no options.
        blocking: whether the body is a plain function that blocks, and where it runs. In a thread, the body checks its
            `BlockingCall` periodically. A process is ended instead; its arguments, outcome and component are pickled.
        after_crash: the reaction if a run is resumed and the component cannot report the action's result.
        unlimited: whether the skill has no time limit without `within`, e.g. as it watches something. A run in
            simulated time ends with a deadlock if nothing else can happen.
        within: seconds after which the skill is cancelled and ends with `timed_out`; a trigger with `within` declares
            other seconds. The default is 300 s.

    Raises:
        InputError: `blocking` or `within` has an invalid value, or a skill with `within` is `unlimited`.
        SchemaError: the annotations do not declare outcomes, or name something that does not exist, or the body does
            not have the form of a skill.
    """
    if body is not None:
        require_function(body, "skill")
    if blocking not in _EXECUTIONS:
        message = f"a skill blocks in a thread or a process, not {shown(blocking)}"
        raise InputError(message, found=str(blocking), valid=("thread", "process"))
    if after_crash not in get_args(AfterCrash):
        message = f"after a crash a skill is {', '.join(get_args(AfterCrash))}, not {shown(after_crash)}"
        raise InputError(message, found=str(after_crash), valid=get_args(AfterCrash))
    if not isinstance(unlimited, bool):
        raise InputError(f"`unlimited` is true or false, not {shown(unlimited)}")
    if within is not None:
        _require_limit(within, unlimited=unlimited)

    def declare(body: SkillBody) -> SkillBody:
        own, names = 2 if "." in named(body) else 1, names_around(body.__globals__)
        outcomes, records = dict[str, dict[str, str | None]](), FoundRecords()
        with refused_at(body):
            outcomes |= returned_outcomes(body, names, records)
            outcomes |= _reported_outcomes(body, own, names, records)
        how = {"after_crash": after_crash, "unlimited": unlimited, "within": within}
        return declaration(body, own, names, outcomes, records, execute=_EXECUTIONS[blocking], **how)(body)

    return declare if body is None else declare(body)


def declaration(
    body: SkillBody,
    first: int,
    names: Namespace,
    outcomes: Mapping[str, Mapping[str, str | None]],
    records: FoundRecords,
    **how: Any,
) -> Declared:
    """Return the declaration that the annotations of a body's parameters complete, beginning with parameter `first`.

    Raises:
        SchemaError: an annotation has no valid type, or the parameter cannot be passed by name.
    """
    types, builders = dict[str, str | None](), dict[str, Builder]()
    with refused_at(body):  # which may collect errors
        types, builders = typed_parameters(body, first, names, records)
    return Declared(types, outcomes, records=records, builders=builders, **how)


def returned_outcomes(
    body: SkillBody, names: Namespace, records: FoundRecords, *, optional: bool = False
) -> dict[str, dict[str, str | None]]:
    """Return the outcomes in the return annotation of a body; `optional` permits `None`.

    Raises:
        SchemaError: the body has no return annotation, or it names something else than outcome classes.
    """
    annotation = inspect.signature(body).return_annotation
    what = f"the returned value of '{named(body)}'"
    if annotation is inspect.Signature.empty:
        raise SchemaError(f"'{named(body)}' has no return annotation; write its outcomes, as in `-> Grasped | Slipped`")
    return declared_outcomes(annotation, names, what, records, optional=optional)


def _reported_outcomes(
    body: SkillBody, own: int, names: Namespace, records: FoundRecords
) -> dict[str, dict[str, str | None]]:
    """Return the outcomes in the annotation of the call, `SkillCall[Progress]`; usually there are none."""
    parameters = list(inspect.signature(body).parameters.values())[:own]
    annotation = parameters[-1].annotation if parameters else inspect.Parameter.empty
    if isinstance(annotation, str) and "[" not in annotation:  # the name may exist only for a type checker
        return {}
    what = f"the call of '{named(body)}'"
    found = [declared_outcomes(one, names, what, records) for one in get_args(evaluated(annotation, names, what))]
    return {event: attributes for one in found for event, attributes in one.items()}


async def _await_body(_: Any, body: SkillBody, call: SkillCall[Any], arguments: Mapping[str, Any]) -> Outcome:
    coming = body(call, **arguments)
    if not inspect.isawaitable(coming):
        raise SchemaError("it is not a coroutine: write `async def`, or declare it `blocking`")
    return cast(Outcome, await coming)


async def _in_thread(_: Any, body: SkillBody, call: SkillCall[Any], arguments: Mapping[str, Any]) -> Outcome:
    return await in_thread(body, call, arguments)


async def _in_process(component: Any, body: SkillBody, call: SkillCall[Any], arguments: Mapping[str, Any]) -> Outcome:
    return await in_process(body, component.name, call, arguments)


_EXECUTIONS: Mapping[str | None, Execution] = {None: _await_body, "thread": _in_thread, "process": _in_process}


@cache
def signatures(kind: type[object], name: str) -> Mapping[str, SkillSignature]:
    """Return the signatures of the decorated methods of a component class, for a component with that `name`.

    The result is cached by class and name, as each skill call reads it.
    """
    found = {}
    for attribute, body in inspect.getmembers(kind, inspect.isfunction):
        declared: Declared | None = getattr(body, DECLARED, None)
        if declared is not None:
            found[attribute] = signature_of(name, attribute, body, declared)
    return found


def refuse_reserved(skill_name: str, outcomes: Iterable[str]) -> None:
    """Raise `SchemaError` for an outcome that only the executive fires, e.g. `done`."""
    for event in outcomes:
        if event in EXECUTIVES:
            raise SchemaError(
                f"skill '{skill_name}' cannot have the outcome '{event}', which the executive itself fires", found=event
            )


def check_arguments(signature: SkillSignature, arguments: Mapping[str, Any]) -> None:
    """Raise `InputError` for an argument that is missing or that the skill does not declare."""
    name = f"{signature.pattern} '{signature.component}.{signature.name}'"
    for given in arguments:
        if given not in signature.parameters:
            raise UnknownNameError(f"{name} has no parameter '{given}'", found=given, valid=signature.parameters)
    for wanted in signature.parameters:
        if wanted not in arguments and wanted not in signature.defaults:
            raise InputError(f"{name} needs its parameter '{wanted}'")


def signature_of(component: str, name: str, body: SkillBody, declared: Declared) -> SkillSignature:
    """Return the interface of a decorated body as skill `name` of `component`."""
    given = list(inspect.signature(body).parameters.values())[declared.own :]
    return SkillSignature(
        component=component,
        name=name,
        parameters={p.name: declared.types.get(p.name) for p in given},
        defaults={p.name: plain_value(p.default) for p in given if p.default is not inspect.Parameter.empty},
        outcomes=declared.outcomes,
        pattern=declared.pattern,
        after_crash=declared.after_crash,
        unlimited=declared.unlimited,
        place=_place_of(body),
        within=declared.within,
        records=declared.records,
    )


def _require_limit(within: float, *, unlimited: bool) -> None:
    if isinstance(within, bool) or not isinstance(within, int | float) or not 0 < within < math.inf:
        raise InputError(f"`within` is a positive number of seconds, not {shown(within)}")
    if unlimited:
        raise InputError("a skill has `within` seconds, or is `unlimited`, not both")


def _place_of(body: SkillBody) -> str:
    file, line = _line_of(body)
    return "" if file is None else f"{file}:{line}"


def _line_of(body: SkillBody) -> tuple[str | None, int | None]:
    code = getattr(inspect.unwrap(body), "__code__", None)
    return (None, None) if code is None else (code.co_filename, code.co_firstlineno)


def _require_form(named: str, body: SkillBody, declared: Declared) -> None:
    """Raise an error unless a skill's body has the form that its declaration needs, see `Declared.__call__`."""
    parameters = list(inspect.signature(body).parameters.values())
    own = declared.own - ("." not in named)  # a function has no `self`
    if declared.pattern == "skill" and not (len(parameters) >= own and _is_call(parameters[own - 1])):
        given = ", ".join(one.name for one in parameters)
        wanted = "self, call" if "." in named else "call"
        raise SchemaError(f"skill '{named}' has no parameter for its call: write ({wanted}, ...), not ({given})")
    coroutine = inspect.iscoroutinefunction(inspect.unwrap(body))
    if declared.execute is _await_body and not coroutine:
        raise SchemaError(f"skill '{named}' is not a coroutine: write `async def`, or declare it `blocking`")
    if declared.execute in {_in_thread, _in_process} and coroutine:
        raise SchemaError(f"skill '{named}' is a coroutine, and a blocking skill is a plain function: write `def`")
    names = [one.name for one in parameters[own:]]
    for name in declared.types:
        if name not in names:
            raise UnknownNameError(f"skill '{named}' has no parameter '{name}'", found=name, valid=names)


def _is_call(parameter: inspect.Parameter) -> bool:
    """Return whether a parameter receives the call: by its name `call`, a leading underscore, or its annotation."""
    annotation = getattr(parameter.annotation, "__name__", str(parameter.annotation))
    return parameter.name.startswith(("call", "_")) or annotation.endswith("Call")


def primitive_plot(
    skill: SkillSignature,
    *,
    done: str,
    name: str | None = None,
    implements: str | None = None,
    when: str | None = None,
    effects: Literal["observed", "assumed"] = "observed",
    within: float | None = None,
) -> ActionPlot:
    """Return a plot that triggers the skill, completes after outcome `done`, and emits every other outcome.

    If the skill raises an error or exceeds its deadline, the plot stays in state `execute`. As a step of a plan, the
    plot has then failed.

    Args:
        skill: the skill's signature, e.g. `arm.skills()["grasp"]`.
        done: the outcome that completes the plot.
        name: the plot's name; by default the skill's.
        implements: the planning action that the plot executes; plot and action must have equal parameter names.
        when: the condition under which the plot fits as a candidate.
        effects: whether the skill observes the action's effects, or the executive assumes them after `done`.
        within: seconds after which the skill is cancelled; by default those of the skill.

    Raises:
        UnknownNameError: the skill has no outcome `done`.
        InputError: `within` is not a positive number of seconds.
        SchemaError: an outcome of the skill has the name of an event that only the executive fires.
    """
    refuse_reserved(f"{skill.component}.{skill.name}", skill.outcomes)
    if done not in skill.outcomes:
        raise UnknownNameError(f"skill '{skill.name}' has no outcome '{done}'", found=done, valid=skill.outcomes)
    others = {event: attributes for event, attributes in skill.outcomes.items() if event != done}
    on: dict[str, Any] = {done: "completed"}
    for event, attributes in others.items():
        on[event] = {"to": "ended", "emit": event, "with": {key: f"?event.{key}" for key in attributes}}
    parameters = {key: _parameter(skill, key) for key in skill.parameters if _can_be_given(skill, key)}
    trigger: dict[str, Any] = {
        "trigger": f"{skill.component}.{skill.name}", "with": {key: f"?{key}" for key in parameters}
    }  # fmt: skip
    if within is not None:
        _require_limit(within, unlimited=False)
        trigger["within"] = within
    states: dict[str, Any] = {"execute": {"entry": trigger, "on": on}, "completed": {"final": True}}
    if others:
        states["ended"] = {"final": True}
    return ActionPlot.model_validate(
        {
            "plot": name or skill.name,
            "parameters": parameters,
            "emits": {event: {key: kind or "symbol" for key, kind in a.items()} for event, a in others.items()},
            "implements": implements,
            "when": when,
            "effects": effects,
            "states": states,
        }
    )


def _can_be_given(skill: SkillSignature, key: str) -> bool:
    """Return whether a chart can set the parameter. Plots cannot express a default such as a list or `None`."""
    return key not in skill.defaults or isinstance(skill.defaults[key], str | int | float | bool)


def _parameter(skill: SkillSignature, key: str) -> dict[str, Any]:
    declared = {"type": skill.parameters[key] or "symbol"}
    return {**declared, "default": skill.defaults[key]} if key in skill.defaults else declared

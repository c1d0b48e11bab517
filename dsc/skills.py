"""Skills: typed actions of components, and the smallest plot around one skill (S0.7, S0.8, S1.1).

A skill ends with an outcome event and observations, which the plot interprets. A skill is one decorated coroutine
function:

```python
class Gripper(Component):
    @skill(outcomes={"grasped": {}, "slipped": {"item": "item"}})
    async def grasp(self, call: SkillCall, item: str) -> Outcome:
        await call.clock.sleep(2.0)
        return Outcome("grasped", observed=Delta(added=(fact("holding", item),)))
```
"""

from __future__ import annotations

import inspect
from collections.abc import Awaitable, Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal, TypeVar, cast

from dsc.blocking import in_process, in_thread
from dsc.calls import Outcome, SkillCall
from dsc.events import EXECUTIVES
from dsc.model.plot import ActionPlot
from knowledge_base.errors import InputError, Place, SchemaError, UnknownNameError, tolerated
from knowledge_base.language.checking.inputs import shown

AfterCrash = Literal["repeat", "same_id", "sense"]
"""The reaction to an action whose effect is unknown after a crash.

`repeat` executes the action again; the action must be idempotent. `same_id` executes the action with its former id, for
which the component acts only one time. `sense` observes the world first, without a repetition.
"""

SkillBody = Callable[..., Any]
"""The decorated function, which returns an `Outcome`: a coroutine function or, if the body blocks, a plain function."""
_Body = TypeVar("_Body", bound=SkillBody)
Pattern = Literal["skill", "query", "event"]
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
        place: file and line of the body; empty if unknown.
    """

    component: str
    name: str
    parameters: Mapping[str, str | None]
    defaults: Mapping[str, Any]
    outcomes: Mapping[str, Mapping[str, str | None]]
    pattern: Pattern = "skill"
    after_crash: AfterCrash = "sense"
    place: str = ""


CarryOut = Callable[[Any, SkillBody, SkillCall, Mapping[str, Any]], Awaitable[Outcome]]
"""Function that executes a decorated body; receives the component, the bound body, the call and the arguments."""


@dataclass(frozen=True, slots=True)
class Declared:
    """The declaration of a decorated body.

    Attributes:
        types: types of parameters by name; the annotations `int`, `float` and `bool` declare the other types.
        outcomes: as in `SkillSignature`.
        carry_out: executes a call with the body.
        own: number of leading parameters of the body that charts do not set.
        pattern: see `Pattern`.
        after_crash: see `AfterCrash`.
    """

    types: Mapping[str, str]
    outcomes: Mapping[str, Mapping[str, str | None]]
    carry_out: CarryOut
    own: int = 2
    pattern: Pattern = "skill"
    after_crash: AfterCrash = "sense"

    def __call__(self, body: _Body) -> _Body:
        """Attach this declaration to `body`, and return `body`.

        Raises:
            SchemaError: an outcome has the name of an event that only the executive fires, or the body has no parameter
                for the call. The error is also raised if the body is not a coroutine function, or is one and blocks.
            UnknownNameError: `types` has a name that is not a parameter.
        """
        named = body.__qualname__.rpartition("<locals>.")[2]
        with tolerated():
            try:
                refuse_reserved(named, self.outcomes)
                _require_form(named, body, self)
            except InputError as error:
                error.place = error.place or Place(*_line_of(body))
                raise
        setattr(body, DECLARED, self)
        return body


DECLARED = "__dsc_skill__"
"""Name of the attribute in which a body stores its declaration."""
_ANNOTATED: Mapping[Any, str] = {"int": "number", "float": "number", "bool": "boolean"} | {
    int: "number", float: "number", bool: "boolean",
}  # fmt: skip


def skill(
    outcomes: Mapping[str, Mapping[str, str | None]],
    types: Mapping[str, str] | None = None,
    *,
    blocking: Literal["thread", "process"] | None = None,
    after_crash: AfterCrash = "sense",
) -> Callable[[_Body], _Body]:
    """Declare a component's method, or a function (see `dsc.components.robot`), as a skill.

    Args:
        outcomes: every event that the skill may end with or report, with the event's attributes and their types.
        types: types of the skill's parameters by name. The annotations `int`, `float` and `bool` declare other types; a
            parameter without a type accepts any value.
        blocking: whether the body is a plain function that blocks, and where it runs. In a thread, the body checks its
            `BlockingCall` periodically. A process is ended instead; its arguments, outcome and component are pickled.
        after_crash: the reaction if a run is resumed and the component cannot report the action's result.

    Raises:
        InputError: the outcomes are not a mapping, or `blocking` has an invalid value.
    """
    require_names(outcomes, "the outcomes of a skill", "@skill(outcomes={'grasped': {}})")
    for event, attributes in outcomes.items():
        require_names(attributes, f"the attributes of '{event}'", "{'item': 'item'}")
    if blocking not in _CARRIED_OUT:
        message = f"a skill blocks in a thread or a process, not {shown(blocking)}"
        raise InputError(message, found=str(blocking), valid=("thread", "process"))
    declared = {event: dict(attributes) for event, attributes in outcomes.items()}
    return Declared(dict(types or {}), declared, _CARRIED_OUT[blocking], after_crash=after_crash)


def require_names(declared: object, what: str, example: str) -> None:
    """Raise `InputError` unless `declared` is a mapping whose keys are names."""
    if not isinstance(declared, Mapping) or not all(isinstance(name, str) for name in declared):
        raise InputError(f"{what} are a mapping of names, as in {example}, not {shown(declared)}")


async def _awaited(_: Any, body: SkillBody, call: SkillCall, arguments: Mapping[str, Any]) -> Outcome:
    coming = body(call, **arguments)
    if not inspect.isawaitable(coming):
        raise SchemaError("it is not a coroutine: write `async def`, or declare it `blocking`")
    return cast(Outcome, await coming)


async def _in_thread(_: Any, body: SkillBody, call: SkillCall, arguments: Mapping[str, Any]) -> Outcome:
    return await in_thread(body, call, arguments)


async def _in_process(component: Any, body: SkillBody, call: SkillCall, arguments: Mapping[str, Any]) -> Outcome:
    return await in_process(body, component.name, call, arguments)


_CARRIED_OUT: Mapping[str | None, CarryOut] = {None: _awaited, "thread": _in_thread, "process": _in_process}


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
    name = f"{signature.component}.{signature.name}"
    for given in arguments:
        if given not in signature.parameters:
            raise UnknownNameError(
                f"skill '{name}' has no parameter '{given}'", found=given, valid=signature.parameters
            )
    for wanted in signature.parameters:
        if wanted not in arguments and wanted not in signature.defaults:
            raise InputError(f"skill '{name}' needs its parameter '{wanted}'")


def signature_of(component: str, name: str, body: SkillBody, declared: Declared) -> SkillSignature:
    """Return the interface of a decorated body as skill `name` of `component`."""
    given = list(inspect.signature(body).parameters.values())[declared.own :]
    return SkillSignature(
        component=component,
        name=name,
        parameters={p.name: declared.types.get(p.name, _ANNOTATED.get(p.annotation)) for p in given},
        defaults={p.name: p.default for p in given if p.default is not inspect.Parameter.empty},
        outcomes=declared.outcomes,
        pattern=declared.pattern,
        after_crash=declared.after_crash,
        place=_place_of(body),
    )


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
    if declared.carry_out is _awaited and not coroutine:
        raise SchemaError(f"skill '{named}' is not a coroutine: write `async def`, or declare it `blocking`")
    if declared.carry_out in {_in_thread, _in_process} and coroutine:
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

    Raises:
        UnknownNameError: the skill has no outcome `done`.
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
    trigger = {"trigger": f"{skill.component}.{skill.name}", "with": {key: f"?{key}" for key in parameters}}
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

"""Outcomes of skills are checked against their declaration, on the way of every answer."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from typing import Any

from dsc.calls import OBSERVED, Outcome
from dsc.components.component import Component
from dsc.components.hooks import is_own, running_task
from dsc.engine.steps import Start
from dsc.events import NO_ATTRIBUTES, SKILL_ERROR, TIMED_OUT
from knowledge_base.errors import InputError, SchemaError, UnknownNameError, described
from knowledge_base.language.inputs import require_delta, shown
from knowledge_base.language.world import World


def encoded(value: Any) -> Any:
    """Plain data of its own, so that nothing is shared by accident."""
    if isinstance(value, dict) and not value:  # most skills take and say nothing
        return {}
    return json.loads(json.dumps(value, allow_nan=False))


def declared(component: Component, start: Start, outcome: object) -> Outcome:
    """The outcome, encoded; an error if it is none, or the skill's signature does not declare it, or not so."""
    try:
        return _sound(outcome, component.skills()[start.skill].outcomes)
    except InputError as error:
        return broken(start, str(error))
    except BaseException as error:
        if not is_own(error, running_task()):
            raise
        return broken(start, f"what it ended with cannot be read: {described(error)}")


def _sound(outcome: object, outcomes: Mapping[str, Declared]) -> Outcome:
    if not isinstance(outcome, Outcome):
        raise InputError(f"it ended with {shown(outcome)}, which is no outcome")
    event, attributes = outcome.event, outcome.attributes
    if not isinstance(event, str):
        raise InputError(f"it ended with the event {shown(event)}, which is no text")
    event = str.__str__(event)  # a subclass, e.g. an `Enum`, is compared in a way of its own
    declared = NO_ATTRIBUTES if event == OBSERVED else outcomes.get(event)
    if declared is None:
        raise InputError(f"it ended with '{event}', which it does not declare")
    if not isinstance(attributes, Mapping):
        raise InputError(f"the attributes of '{event}' are a mapping, not {shown(attributes)}")
    try:
        require_delta(outcome.observed)
    except InputError as error:
        raise InputError(f"what it observed with '{event}' is no change of knowledge: {error}") from None
    require_declared(event, attributes, declared)
    try:
        return Outcome(event, encoded(dict(attributes)), outcome.observed)
    except (TypeError, ValueError) as error:
        raise InputError(f"the attributes of '{event}' are no plain data: {described(error, named=False)}") from None


def broken(start: Start, reason: str) -> Outcome:
    """How a skill ends that did what no skill may do; the reason becomes one line."""
    skill = f"{start.component}.{start.skill}"
    return Outcome(SKILL_ERROR, {"skill": skill, "reason": f"{skill}: {' '.join(reason.split())}"})


def late(start: Start, seconds: float, missing: str = "") -> Outcome:
    """How a skill ends that did not end within its time; it did not even begin if what it waited for was `missing`."""
    skill = f"{start.component}.{start.skill}"
    reason = f"{skill}: no outcome within {seconds:g} s" + (f", it waited for {missing}" if missing else "")
    return Outcome(TIMED_OUT, {"skill": skill, "seconds": seconds, "reason": reason})


Declared = Mapping[str, str | None]
"""Names of attributes -> types; `None` is anything."""


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _is_text(value: object) -> bool:
    return isinstance(value, str)


_FITS: Mapping[str | None, tuple[str, Callable[[object], bool]]] = {
    "number": ("a finite number", _is_number),
    "boolean": ("a truth value", lambda value: isinstance(value, bool)),
    "text": ("text", _is_text),
    "symbol": ("a name", _is_text),
}  # what is no thing, in words; for things somebody has to be asked who knows them


def require_declared(event: str, attributes: Mapping[str, Any], declared: Declared) -> None:
    """Whether an outcome may have these attributes, as far as that can be said without knowing the world.

    Raises:
        UnknownNameError: one is not declared.
        InputError: one is missing, or is of another type.
    """
    if attributes.keys() != declared.keys():
        _refuse_names(event, attributes, declared)
    for name, type_ in declared.items():
        wanted = _FITS.get(type_)
        if wanted is not None and not wanted[1](attributes[name]):
            raise InputError(f"the attribute '{name}' of '{event}' is {wanted[0]}, not {shown(attributes[name])}")


def _refuse_names(event: str, attributes: Mapping[str, Any], declared: Declared) -> None:
    for name in attributes:
        if name not in declared:
            message = f"the outcome '{event}' has no attribute {shown(name)}"
            raise UnknownNameError(message, found=str(name), valid=declared)
    missing = next(name for name in declared if name not in attributes)
    kind = declared[missing]
    raise InputError(f"the outcome '{event}' needs its attribute '{missing}'" + (f" of type {kind}" if kind else ""))


def require_things(event: str, attributes: Mapping[str, Any], declared: Declared, *worlds: World) -> None:
    """Whether what is declared as a thing is one that is known in one of these worlds, e.g. before and after a change.

    Raises:
        InputError: it is no name, there is no such thing, or it is of another type.
    """
    schema = worlds[0].schema
    for name, wanted in declared.items():
        if wanted is None or wanted not in schema.types:
            continue
        value = attributes.get(name)
        known = [world.type_of(value) for world in worlds] if isinstance(value, str) else []
        found = next((type_ for type_ in known if type_ is not None), None)
        if found is not None and schema.is_a(found, wanted):
            continue
        said = f"the attribute '{name}' of '{event}' is of type {wanted}, and"
        if not isinstance(value, str):
            raise InputError(f"{said} {shown(value)} is no name")
        if found is not None:
            raise SchemaError(f"{said} '{value}' is of type {found}", found=value)
        valid = {thing for world in worlds for thing in world.objects(wanted)}
        raise UnknownNameError(f"{said} there is no object '{value}'", found=value, valid=valid)

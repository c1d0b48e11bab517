"""Outcome checks: a skill's outcome is validated against its signature, and against the world when it is taken."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from typing import Any

from dsc.calls import OBSERVED, Outcome
from dsc.components.hooks import is_own, running_task
from dsc.engine.steps import NO_CHANGE, Start
from dsc.events import NO_ATTRIBUTES, SKILL_ERROR, TIMED_OUT
from dsc.messages import SkillMessage
from dsc.skills import SkillSignature
from knowledge_base.errors import InputError, SchemaError, UnknownNameError, described
from knowledge_base.facts import Delta
from knowledge_base.language.checking.inputs import require_delta, shown
from knowledge_base.language.evaluation.world import World
from knowledge_base.store import KnowledgeBase

Declared = Mapping[str, str | None]
"""Names of attributes -> types; `None` is anything."""


def encoded(value: Any) -> Any:
    """Copy plain data, so that nothing is shared by accident."""
    if isinstance(value, dict) and not value:  # most skills have neither arguments nor attributes
        return {}
    return json.loads(json.dumps(value, allow_nan=False))


def validated(outcome: object, start: Start, signature: SkillSignature) -> Outcome:
    """Return the outcome with encoded attributes, or a `skill_error` if the signature does not declare it so."""
    try:
        return _conforming(outcome, signature.outcomes)
    except InputError as error:
        return broken(start, str(error))
    except BaseException as error:
        if not is_own(error, running_task()):
            raise
        return broken(start, f"what it ended with cannot be read: {described(error)}")


def _conforming(outcome: object, outcomes: Mapping[str, Declared]) -> Outcome:
    if not isinstance(outcome, Outcome):
        raise InputError(f"it ended with {shown(outcome)}, which is no outcome")
    event, attributes, observed = outcome.event, outcome.attributes, outcome.observed
    if not isinstance(event, str):
        raise InputError(f"it ended with the event {shown(event)}, which is no text")
    event = str.__str__(event)  # a subclass, e.g. an `Enum`, may compare differently
    declared = NO_ATTRIBUTES if event == OBSERVED else outcomes.get(event)
    if declared is None:
        raise InputError(f"it ended with '{event}', which it does not declare")
    if not isinstance(attributes, Mapping):
        raise InputError(f"the attributes of '{event}' are a mapping, not {shown(attributes)}")
    if type(observed) is Delta and observed == NO_CHANGE:  # the common case
        observed = NO_CHANGE
    else:
        _require_change(event, observed)
    return Outcome(event, _plain(event, attributes, declared) if attributes or declared else {}, observed)


def _require_change(event: str, observed: object) -> None:
    try:
        require_delta(observed)
    except InputError as error:
        raise InputError(f"what it observed with '{event}' is no change of knowledge: {error}") from None


def _plain(event: str, attributes: Mapping[str, Any], declared: Declared) -> dict[str, Any]:
    """Return a copy of the attributes as plain data.

    Raises:
        UnknownNameError: one is not declared.
        InputError: one is missing, is of another type, or is not plain data.
    """
    if attributes.keys() != declared.keys():
        _refuse_names(event, attributes, declared)
    for name, type_ in declared.items():
        wanted = _FITS.get(type_)
        if wanted is not None and not wanted[1](attributes[name]):
            raise InputError(f"the attribute '{name}' of '{event}' is {wanted[0]}, not {shown(attributes[name])}")
    try:
        plain: dict[str, Any] = encoded(dict(attributes))
    except (TypeError, ValueError) as error:
        raise InputError(f"the attributes of '{event}' are no plain data: {described(error, named=False)}") from None
    return plain


def validated_in_world(message: SkillMessage, knowledge: KnowledgeBase) -> SkillMessage:
    """Return the message, or a `skill_error` if its outcome contradicts the schema or names unknown objects.

    Args:
        message: its outcome conforms to the skill's signature.
        knowledge: the world before the observations of the outcome.
    """
    said = message.outcome
    if said.observed is NO_CHANGE and not message.declared:
        return message
    try:
        worlds: list[World] = [knowledge]
        if said.observed:
            worlds.insert(0, after := knowledge.overlay())
            after.apply(said.observed)
        _require_objects(said.event, said.attributes, message.declared or {}, *worlds)
    except Exception as error:  # noqa: BLE001  # an outcome may contain anything, e.g. unhashable values
        outcome = broken(message.start, described(error, named=not isinstance(error, InputError)))
        return SkillMessage(message.start, outcome, final=True, goes_on=not message.final)
    return message


def broken(start: Start, reason: str) -> Outcome:
    """The `skill_error` of a skill that broke a rule; the reason becomes one line."""
    skill = f"{start.component}.{start.skill}"
    return Outcome(SKILL_ERROR, {"skill": skill, "reason": f"{skill}: {' '.join(reason.split())}"})


def late(start: Start, seconds: float, missing: str = "") -> Outcome:
    """The `timed_out` of a skill; if a component was `missing`, the skill has not begun."""
    skill = f"{start.component}.{start.skill}"
    reason = f"{skill}: no outcome within {seconds:g} s" + (f", it waited for {missing}" if missing else "")
    return Outcome(TIMED_OUT, {"skill": skill, "seconds": seconds, "reason": reason})


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _is_text(value: object) -> bool:
    return isinstance(value, str)


_FITS: Mapping[str | None, tuple[str, Callable[[object], bool]]] = {
    "number": ("a finite number", _is_number),
    "boolean": ("a truth value", lambda value: isinstance(value, bool)),
    "text": ("text", _is_text),
    "symbol": ("a name", _is_text),
}
"""Types without objects, in words, with their tests."""


def _refuse_names(event: str, attributes: Mapping[str, Any], declared: Declared) -> None:
    for name in attributes:
        if name not in declared:
            message = f"the outcome '{event}' has no attribute {shown(name)}"
            raise UnknownNameError(message, found=str(name), valid=declared)
    missing = next(name for name in declared if name not in attributes)
    kind = declared[missing]
    raise InputError(f"the outcome '{event}' needs its attribute '{missing}'" + (f" of type {kind}" if kind else ""))


def _require_objects(event: str, attributes: Mapping[str, Any], declared: Declared, *worlds: World) -> None:
    """Require that each attribute of an object type names an object of one of these worlds.

    Raises:
        InputError: it is not a name, there is no such object, or it is of another type.
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

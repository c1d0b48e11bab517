"""How skills end, as far as that is not theirs to say: what they do wrong, and what nobody waits for any longer."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from dsc.calls import OBSERVED, Outcome
from dsc.components.component import Component
from dsc.components.hooks import is_own, running_task
from dsc.engine.steps import Start
from dsc.events import NO_ATTRIBUTES, SKILL_ERROR, TIMED_OUT
from dsc.sequencer.attributes import Declared, require_declared
from knowledge_base.errors import InputError, described
from knowledge_base.language.inputs import require_delta, shown


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

"""Encoding of messages, pending items and frames of a machine as plain JSON values, and their decoding.

A plot that is a value (e.g. a plan, in a variable or an attribute) is long and occurs repeatedly. So the plot is stored
one time, by its hash; `{"$form": hash}` replaces each occurrence.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields
from typing import Any

from dsc.calls import RECORDED
from dsc.engine.machine_state import NOTHING, FrameState
from dsc.engine.steps import SendLater, SendMessage, SetParameter, SetWire, Start, StartTimer, SwitchMode
from dsc.events import NO_ATTRIBUTES, Event
from dsc.messages import (
    FromOutside,
    KnowledgeMessage,
    LateMessage,
    Message,
    ParameterMessage,
    PlotsMessage,
    SkillMessage,
    TimerMessage,
    WireMessage,
)
from dsc.outcomes import Outcome
from dsc.runs.hashed_forms import Shortener, full, full_value, plot_hashes, plots_of_hashes
from dsc.runs.tables import Form
from dsc.skills import SkillSignature
from knowledge_base.exchange import delta_form, delta_of

Awaited = Start | StartTimer | SendLater | LateMessage | SetParameter | SwitchMode | SendMessage | SetWire
"""Pending items, which a restart needs.

A parameter or mode is effective until it is set again. A message is pending until the component has received it.
"""

_VISIBILITY = Event._fields[2:]
_PUBLIC = [Event._field_defaults[name] for name in _VISIBILITY]


SKILLS = "skills"
"""Key of a run's header with the hash of the deployed skills."""


def signature_forms(skills: Iterable[SkillSignature]) -> Form:
    """Return the signatures of skills as plain data; of a default, only its presence remains."""
    return {f"{one.component}.{one.name}": _signature_form(one) for one in skills}


def _signature_form(skill: SkillSignature) -> Form:
    return {one.name: getattr(skill, one.name) for one in fields(skill)} | {"defaults": dict.fromkeys(skill.defaults)}


def signatures_in(header: Mapping[str, Any], form: Callable[[str], Any]) -> list[SkillSignature] | None:
    """Return the deployed skills in a run's header; `None` if it has none."""
    forms = full_value(header.get(SKILLS), form)
    return None if forms is None else signatures_of(forms)


def signatures_of(forms: Mapping[str, Form]) -> list[SkillSignature]:
    """Return the skills of forms from `signature_forms`."""
    return [SkillSignature(**one) for one in forms.values()]


# -- messages ------------------------------------------------------------------------------------------------


def message_form(message: Message, short: Shortener) -> Form:
    """Return a message as plain data; a skill's message refers to its action by the id."""
    match message:
        case Event() | KnowledgeMessage() | ParameterMessage() | WireMessage() | PlotsMessage():
            return _outside_form(message, short)
        case SkillMessage():
            outcome = message.outcome
            form = {"action": message.start.action_id, "outcome": outcome.event, "final": message.final}
            if message.conflated:
                form["conflated"] = message.conflated
            if message.activated:
                form["activated"] = True
            # the trace has the records of a report about an inner run
            attributes = {} if outcome.event == RECORDED else short(outcome.attributes)
            return form | {"attributes": attributes, "observed": delta_form(outcome.observed)}
        case TimerMessage():
            return {"timer": _plain(message.timer)}
        case LateMessage():
            return {"late": message.number, "message": _outside_form(message.message, short)}
        case SendLater():
            return {"sent": _later_form(message, short)}


def message_of(form: Mapping[str, Any], action: Callable[[str], Start], find: Callable[[str], Any]) -> Message:
    """Return the message of a form from `message_form`; `action` returns the start of an action id."""
    match form:
        case {"action": action_id}:
            outcome = Outcome(form["outcome"], full(form["attributes"], find), delta_of(form["observed"]))
            return SkillMessage(
                action(action_id), outcome, form["final"], conflated=form.get("conflated", 0),
                activated=form.get("activated", False),
            )  # fmt: skip
        case {"timer": timer}:
            return TimerMessage(StartTimer(**timer))
        case {"late": number}:
            return LateMessage(_outside_of(form["message"], find), number)
        case {"sent": later}:
            return _later_of(later, find)
        case _:
            return _outside_of(form, find)


def _outside_form(message: FromOutside, short: Shortener) -> Form:
    match message:
        case Event():
            return {"event": _event_form(message, short)}
        case KnowledgeMessage():
            return {"change": delta_form(message.delta), "author": message.author}
        case ParameterMessage():
            return {"set": _plain(message)}
        case WireMessage():
            return {"wire": _plain(message)}
        case PlotsMessage():
            components = {"components": message.components} if message.components else {}
            return {"plots": plot_hashes(message.plots, short), "active": message.active, **components}


def _outside_of(form: Mapping[str, Any], find: Callable[[str], Any]) -> FromOutside:
    match form:
        case {"change": delta, "author": author}:
            return KnowledgeMessage(delta_of(delta), author)
        case {"set": setting}:
            return ParameterMessage(**setting)
        case {"wire": wire}:
            return WireMessage(**wire)
        case {"plots": plots, "active": active}:
            return PlotsMessage(plots_of_hashes(plots, find), active, form.get("components", {}))
        case _:
            return _event_of(form["event"], find)


# -- pending items --------------------------------------------------------------------------------------------


def awaited_form(what: Awaited, short: Shortener) -> Form:
    """Return a pending item as plain data."""
    match what:
        case Start():
            return _plain(what) | {"arguments": short(what.arguments), "names": dict(what.names)}
        case SendLater():
            return _later_form(what, short)
        case LateMessage():
            return message_form(what, short)
        case SetParameter():
            return _plain(what) | {"value": short.short(what.value)}
        case SendMessage():
            return _plain(what) | {"arguments": short(what.arguments)}
        case StartTimer() | SwitchMode() | SetWire():
            return _plain(what)


def awaited_of(  # noqa: PLR0911  a table by kind
    kind: str, form: Mapping[str, Any], find: Callable[[str], Any]
) -> Awaited:
    """Return the pending item of a form from `awaited_form`; `kind` is the name of the item's class."""
    match kind:
        case "Start":
            return Start.from_json({**form, "arguments": full(form["arguments"], find)})
        case "SendLater":
            return _later_of(form, find)
        case "SetParameter":
            return SetParameter(**{**form, "value": full_value(form["value"], find)})
        case "StartTimer":
            return StartTimer(**form)
        case "SwitchMode":
            return SwitchMode(**form)
        case "SetWire":
            return SetWire(**form)
        case "SendMessage":
            return SendMessage(**{**form, "arguments": full(form["arguments"], find)})
        case "LateMessage":
            return LateMessage(_outside_of(form["message"], find), form["late"])
        case _:
            raise ValueError(f"there is no pending item of the kind '{kind}'")


def _later_form(later: SendLater, short: Shortener) -> Form:
    return {"event": _event_form(later.event, short), "seconds": later.seconds, "id": later.id}


def _later_of(form: Mapping[str, Any], find: Callable[[str], Any]) -> SendLater:
    return SendLater(_event_of(form["event"], find), form["seconds"], form["id"])


def _event_form(event: Event, short: Shortener) -> Form:
    """Return an event as plain data without default values, as most events have only a name."""
    name, attributes, *visibility = event
    form: Form = {"name": name}
    if attributes:
        form["attributes"] = short(attributes)
    if visibility != _PUBLIC:
        form.update(zip(_VISIBILITY, visibility, strict=True))
    return form


def _event_of(form: Mapping[str, Any], find: Callable[[str], Any]) -> Event:
    return Event(**{**form, "attributes": full(form.get("attributes", NO_ATTRIBUTES), find)})


def events_form(events: Iterable[Event], short: Shortener) -> list[Form]:
    """Return events as plain data."""
    return [_event_form(event, short) for event in events]


def events_of(forms: Iterable[Mapping[str, Any]], find: Callable[[str], Any]) -> tuple[Event, ...]:
    """Return the events of forms from `events_form`."""
    return tuple([_event_of(form, find) for form in forms])


# -- frames --------------------------------------------------------------------------------------------------


def frame_news(before: FrameState | None, frame: FrameState, short: Shortener) -> Form:
    """Return the change of a frame, or the whole frame if it is new; its child frames appear as serial numbers."""
    if before is None or before.compiled is not frame.compiled:
        return {
            **frame._replace(children=NOTHING).to_json(),
            "form": short.short(frame.compiled.form),
            "variables": short(frame.variables),
            "children": _inside(frame),
        }
    news: Form = {}
    if frame.configuration is not before.configuration:
        news.update(frame.configuration.form)
    if frame.variables is not before.variables:  # 1 and 1.0 are equal, but not identical
        news["variables"] = short(frame.variables)
    if frame.activations is not before.activations and frame.activations != before.activations:
        news["activations"] = dict(frame.activations)
    if frame.children is not before.children and _inside(frame) != _inside(before):
        news["children"] = _inside(frame)
    if frame.kept is not before.kept:
        news["kept"] = frame.kept_form()
    return news


def frame_form(serial: int, frames: Mapping[int, Form], find: Callable[[str], Any]) -> Form:
    """Return the frame with that serial number and all frames inside it, in the form of `FrameState.to_json`."""
    form = dict(frames[serial])
    form["children"] = {host: frame_form(child, frames, find) for host, child in form["children"].items()}
    form["form"] = full_value(form["form"], find)
    form["variables"] = full(form["variables"], find)
    return form


def _inside(frame: FrameState) -> dict[str, int]:
    return {host: child.serial for host, child in frame.children.items()}


def _plain(value: Any) -> Form:
    """Return a frozen dataclass of plain fields as a mapping; `asdict` would copy deeply, which is slower."""
    return {name: getattr(value, name) for name in value.__dataclass_fields__}

"""Checks of messages: skills' outcomes against signature and world, and untyped input to a run."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any, get_args

from dsc.calls import OBSERVED, RECORDED
from dsc.components.component import Component
from dsc.components.hooks import is_own, reason_of, running_task
from dsc.components.wiring import required_port
from dsc.data_types import WORDS, Records, check_all, data_type, objects_in
from dsc.dynamic.library import Library
from dsc.engine.plot_changes import ActivePlots
from dsc.engine.steps import NO_CHANGE, Start
from dsc.events import NO_ATTRIBUTES, PROGRAMMING_ERROR, RESERVED, SKILL_ERROR, TIMED_OUT, Event
from dsc.messages import KnowledgeMessage, ParameterMessage, SkillMessage, WireMessage
from dsc.model.plot import ActionPlot
from dsc.outcomes import Outcome
from dsc.run_log import run_logger
from dsc.runs.store import RunStore
from dsc.sequencer.clock import LoopClock
from dsc.skills import SkillSignature
from dsc.trace import Trace
from knowledge_base.errors import HistoryError, InputError, SchemaError, UnknownNameError
from knowledge_base.facts import Delta
from knowledge_base.language.checking.inputs import require, require_delta, require_several, require_text
from knowledge_base.language.evaluation.world_protocol import World
from knowledge_base.store import KnowledgeBase
from knowledge_base.user_objects import described, has_type, shown

_LOG = run_logger("dsc.skills")
Declared = Mapping[str, str | None]
"""Types of attributes by name; `None` accepts any type."""


def encoded(value: Any) -> Any:
    """Return a copy of plain data, so that two owners share no object by accident."""
    if isinstance(value, dict) and not value:  # most skills have neither arguments nor attributes
        return {}
    return json.loads(json.dumps(value, allow_nan=False))


def _copy(value: Any, name: str) -> Any:
    """Return a copy of plain data from outside; raise `InputError` for other data."""
    try:
        return encoded(value)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: not plain data: {described(error, named=False)}") from None


# -- outcomes of skills ------------------------------------------------------------------------------------


def failed(start: Start, reason: str) -> Outcome:
    """Return the outcome `skill_error` of a skill, with the reason as one line."""
    skill = f"{start.component}.{start.skill}"
    return Outcome(SKILL_ERROR, {"skill": skill, "reason": f"{skill}: {' '.join(reason.split())}"})


def faulty(start: Start, reason: str) -> Outcome:
    """Return the outcome `programming_error` of a skill; the reason begins with the skill or hook that is faulty."""
    return Outcome(PROGRAMMING_ERROR, {"skill": f"{start.component}.{start.skill}", "reason": " ".join(reason.split())})


def _invalid(start: Start, reason: str, place: str) -> Outcome:
    """Return the outcome `programming_error` of a skill with an invalid outcome, and log the reason."""
    where = f" ({place})" if place else ""
    outcome = faulty(start, f"{start.component}.{start.skill}: {reason}{where}")
    _LOG.error("%s", outcome.attributes["reason"])
    return outcome


def late(start: Start, seconds: float, waited: str = "", observed: Delta = NO_CHANGE) -> Outcome:
    """Return the outcome `timed_out` of a skill, which waited `for` a component or `at` a line."""
    skill = f"{start.component}.{start.skill}"
    reason = f"{skill}: no outcome within {seconds:g} s" + (f", it waited {waited}" if waited else "")
    return Outcome(TIMED_OUT, {"skill": skill, "seconds": seconds, "reason": reason}, observed)


def validated(outcome: object, start: Start, signature: SkillSignature) -> Outcome:
    """Return the outcome with encoded attributes, or a `programming_error` if the outcome violates the signature."""
    try:
        return _conforming(outcome, signature)
    except InputError as error:
        return _invalid(start, str(error), signature.place)
    except BaseException as error:
        if not is_own(error, running_task()):
            raise
        return _invalid(start, f"its outcome cannot be read: {described(error)}", signature.place)


def arguments_for(start: Start, signature: SkillSignature) -> dict[str, Any]:
    """Return a copy of the arguments of a skill, converted to their types.

    Raises:
        InputError: an argument does not have its type.
    """
    arguments: dict[str, Any] = encoded(start.arguments)
    skill = f"{start.component}.{start.skill}"
    check_all("the argument '{name}' of {owner}", skill, arguments, signature.parameters, signature.records)
    return arguments


_REPORTS: Mapping[str, Declared] = {OBSERVED: NO_ATTRIBUTES, RECORDED: {"lines": "list of text"}}
"""Attributes of the reports that only knowledge and trace receive."""


def _conforming(outcome: object, signature: SkillSignature) -> Outcome:
    outcomes = signature.outcomes
    if not isinstance(outcome, Outcome):
        raise InputError(f"it ended with {shown(outcome)}, which is not an Outcome")
    event, attributes, observed = outcome.event, outcome.attributes, outcome.observed
    if not isinstance(event, str):
        raise InputError(f"it ended with the event {shown(event)}, which is not text")
    event = str.__str__(event)  # a subclass, e.g. an `Enum`, may compare differently
    declared = _REPORTS.get(event, outcomes.get(event))
    if declared is None:
        raise UnknownNameError(f"it ended with '{event}', which it does not declare", found=event, valid=outcomes)
    if not isinstance(attributes, Mapping):
        raise InputError(f"the attributes of '{event}' are a mapping, not {shown(attributes)}")
    if type(observed) is Delta and observed == NO_CHANGE:  # the common case
        observed = NO_CHANGE
    else:
        try:
            require_delta(observed)
        except InputError as error:
            raise InputError(f"the observation of '{event}': {error}") from None
        if observed.removed and observed.added:  # additions win, as in an effect: a drive to the place where it begins
            observed = NO_CHANGE.then(observed)
    return Outcome(
        event, _plain(event, attributes, declared, signature.records) if attributes or declared else {}, observed
    )


def _plain(
    event: str, attributes: Mapping[str, Any], declared: Declared, records: Records, what: str = "outcome"
) -> dict[str, Any]:
    """Return a copy of the attributes of an outcome or event as plain data.

    Raises:
        UnknownNameError: an attribute is not declared.
        InputError: an attribute is missing, has another type, or is not plain data.
    """
    for name in attributes:
        if name not in declared:
            message = f"the {what} '{event}' has no attribute {shown(name)}"
            raise UnknownNameError(message, found=str(name), valid=declared)
    checked = dict(attributes)
    for name, kind in declared.items():
        wanted = None if kind is None else data_type(kind)
        if name not in attributes and (wanted is None or wanted.kind != "optional"):
            of_type = f" of type {kind}" if kind else ""
            raise InputError(f"the {what} '{event}' needs its attribute '{name}'{of_type}")
        value = attributes.get(name)
        fits = type(value) is not float and wanted is not None and type(value) in wanted.exact
        if wanted is not None and not (fits and (type(value) is not str or len(value) < _LONG)):
            checked[name] = wanted.check(f"the attribute '{name}' of '{event}'", value, records)
    plain: dict[str, Any] = _copy(checked, f"the attributes of '{event}'")
    return plain


def validated_in_world(
    message: SkillMessage, knowledge: KnowledgeBase, signature: Callable[[Start], SkillSignature]
) -> SkillMessage:
    """Return the message, or a `programming_error` if its outcome contradicts the schema or the world.

    If the outcome only refers to objects that were deleted, the result is a `skill_error`: the skill could not know.

    Args:
        message: a message whose outcome conforms to the skill's signature.
        knowledge: the world before the observations of the outcome.
        signature: returns the signature of the skill.
    """
    said = message.outcome
    if said.observed is NO_CHANGE and not message.declared:
        return message
    skill = signature(message.start)
    try:
        worlds: list[World] = [knowledge]
        if said.observed:
            worlds.insert(0, after := knowledge.overlay())
            after.apply(said.observed)
        _require_objects(said.event, said.attributes, message.declared or {}, skill.records, *worlds)
    except Exception as error:  # noqa: BLE001  # an outcome may contain anything, e.g. unhashable values
        reason = reason_of(error)
        if has_type(error, UnknownNameError) and _was_deleted(error.found, knowledge):
            outcome = failed(message.start, reason)
        else:
            outcome = _invalid(message.start, reason, skill.place)
        return SkillMessage(message.start, outcome, final=True, continues=not message.final)
    return message


def _was_deleted(name: str | None, knowledge: KnowledgeBase) -> bool:
    """Return whether one of the latest `_MOST_SEARCHED` changes has deleted the object."""
    try:
        latest = knowledge.changes(since=max(0, knowledge.version - _MOST_SEARCHED))
    except HistoryError:  # some of these changes are no longer kept
        return False
    return any(name in change.delta.removed_nodes for change in latest)


_MOST_SEARCHED = 1_000
"""Number of changes in which a deleted object is searched."""


def _require_objects(
    event: str, attributes: Mapping[str, Any], declared: Declared, records: Records, *worlds: World
) -> None:
    """Require that each part of an attribute that has an object type names an object in one of these worlds.

    Raises:
        InputError: the attribute is not a name, or there is no such object, or the object has another type.
    """
    for name, kind in declared.items():
        if kind is None or kind in _SCALARS:
            continue
        for at, value, wanted in objects_in(data_type(kind), attributes.get(name), records):
            place = f"the attribute '{name}' of '{event}'" + (f" at {at}" if at else "")
            _require_object(place, value, wanted, *worlds)


_LONG = 1_000
"""Number of characters from which the length of a text is checked."""
_SCALARS = frozenset({"number", "integer", "boolean", *WORDS})


def _require_object(place: str, value: object, wanted: str, *worlds: World) -> None:
    """Require that a value names an object of a type in one of these worlds; an undeclared type accepts every name."""
    schema = worlds[0].schema
    if wanted not in schema.types:
        return
    known = [world.type_of(value) for world in worlds] if isinstance(value, str) else []
    found = next((type_ for type_ in known if type_ is not None), None)
    if found is not None and schema.is_a(found, wanted):
        return
    said = f"{place} is of type {wanted}, and"
    if not isinstance(value, str):
        raise InputError(f"{said} {shown(value)} is not a name")
    if found is not None:
        raise SchemaError(f"{said} '{value}' is of type {found}", found=value)
    valid = {thing for world in worlds for thing in world.objects(wanted)}
    raise UnknownNameError(f"{said} there is no object '{value}'", found=value, valid=valid)


# -- input from outside ------------------------------------------------------------------------------------


def require_parts(library: object, knowledge: object, clock: object, trace: object, store: object) -> None:
    """Raise `InputError` unless a sequencer can use these parts; `trace` and `store` may be `None`."""
    require(library, Library, "the plots are given as a Library, made by Library(plots)")
    require(knowledge, KnowledgeBase, "the knowledge is a KnowledgeBase")
    require(clock, LoopClock, "the clock is a LoopClock, made inside the loop that runs the sequencer")
    if trace is not None:
        require(trace, Trace, "a trace is a Trace")
    if store is not None:
        require(store, RunStore, "a store is a RunStore")


def require_seconds(after: object) -> None:
    """Raise `InputError` unless the value is a finite number of seconds."""
    if isinstance(after, bool) or not isinstance(after, int | float) or not math.isfinite(after):
        raise InputError(f"a delay is a finite number of seconds, not {shown(after)}")


def checked_event(said: object, plots: Library, knowledge: KnowledgeBase) -> Event:
    """Return the event with copied attributes, which fit the declaration under `receives` of at least one plot.

    Raises:
        InputError: the value is not an event, only the executive fires the event, or an attribute is not plain data.
            An attribute may also be missing, have another type, or name a missing object.
        UnknownNameError: no plot receives the event, or the plots that receive it do not declare an attribute.
    """
    plain = isinstance(said, Event) and said.attributes is NO_ATTRIBUTES  # the common case
    if not isinstance(said, Event) or not (plain or isinstance(said.attributes, Mapping)):
        raise InputError(f'an event is an Event with its attributes, as Event("stop", {{}}), not {shown(said)}')
    if said.name in RESERVED:
        raise InputError(f"the event '{said.name}' is fired by the executive itself", found=said.name)
    attributes = {} if plain else dict(said.attributes)
    errors = []
    for plot in plots:
        declared = (plot.receives if plot.robot is None else plot.all_receives).get(said.name)
        if declared is not None:
            try:
                checked = _plain(said.name, attributes, declared, plots.records, "event")
                _require_objects(said.name, checked, declared, plots.records, knowledge)
                attributes = checked
                break
            except InputError as error:
                errors.append(error)
    else:
        if errors:
            raise errors[0]
        plots.require_receiver(said.name)  # none declares the event
    if plain and not attributes:
        return said
    copied = _copy(attributes, f"the attributes of '{said.name}'") if attributes else NO_ATTRIBUTES
    return said._replace(attributes=copied)


def checked_change(delta: Delta, author: str, knowledge: KnowledgeBase) -> KnowledgeMessage:
    """Return the message for a change of knowledge; raise `InputError` if the change contradicts the schema."""
    require_delta(delta)
    require_text(author, "an author")
    knowledge.overlay().apply(delta)
    return KnowledgeMessage(delta, author)


def checked_setting(
    owner: str, name: str, value: object, components: Mapping[str, Component], library: Library
) -> ParameterMessage:
    """Return the message for an operator's setting of a parameter.

    Raises:
        UnknownNameError: there is no such component or plot, or it declares no such parameter.
        InputError: the value is out of range or violates a relation, or operators may not set the parameter.
    """
    require_text(owner, "the name of a component or plot")
    require_text(name, "a parameter's name")
    if owner in components:
        components[owner].parameter_values.check(name, value, "operator")
    elif owner in library:
        library.plot(owner).with_default(name, value, "operator")
    else:
        valid = [*components, *(plot.name for plot in library)]
        raise UnknownNameError(f"there is no component or plot '{owner}'", found=owner, valid=valid)
    assert value is None or isinstance(value, str | int | float | bool)  # noqa: S101  # as every value of a range is
    return ParameterMessage(owner, name, value, of_plot=owner not in components)


def plots_by_name(plots: object) -> dict[str, ActionPlot]:
    """Return one plot, or several plots, by name; raise `InputError` for any other value, or two of one name."""
    several = [plots] if isinstance(plots, ActionPlot) else plots
    require_several(several, "the plots")
    assert isinstance(several, Iterable)  # noqa: S101  # as required
    found: dict[str, ActionPlot] = {}
    for plot in several:
        require(plot, ActionPlot, "a plot is an ActionPlot, as load_plot and parse_plot give it")
        if plot.name in found:
            raise SchemaError(f"two plots are named '{plot.name}'", found=plot.name)
        found[plot.name] = plot
    return found


def require_active(active: object) -> None:
    """Raise `InputError` for an unknown treatment of running plots."""
    valid = get_args(ActivePlots)
    if active not in valid:
        raise UnknownNameError(f"`active` is one of {', '.join(valid)}", found=str(active), valid=valid)


def checked_wire(port: str, to: str | None, components: Mapping[str, Component]) -> WireMessage:
    """Return the message for an operator's wire.

    Raises:
        UnknownNameError: there is no such component or port.
        InputError: the service does not fit.
    """
    require_text(port, "a required port")
    if to is not None:
        require_text(to, "a provided port")
    required_port(port, components, to)
    return WireMessage(port, to)


def checked_arguments(plot: ActionPlot, given: object, world: World, library: Library) -> Mapping[str, Any]:
    """Return the validated arguments of a plot of a library; `given` may be `None`.

    Raises:
        InputError: `given` is not a mapping, or a value is not plain data or has another type than its parameter.
        UnknownNameError: a part of a value has a type of the schema, and the world has no such object.
    """
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise InputError(f"arguments are a mapping of parameters' names to values, not {shown(given)}")
    for name, value in given.items():
        declared = plot.parameters.get(name)
        if declared is not None:
            place = f"'{plot.name}.{name}'"
            checked = data_type(declared.type).check(place, value, library.records)
            for at, one, wanted in objects_in(data_type(declared.type), checked, library.records):
                _require_object(f"{place} at {at}" if at else place, one, wanted, world)
        _copy(value, f"the argument '{name}'")
    return given

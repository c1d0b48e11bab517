"""Input checks: untyped input to a run is validated one time, with one line of error."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from dsc.components.component import Component
from dsc.dynamic.library import Library
from dsc.events import NO_ATTRIBUTES, RESERVED, Event
from dsc.messages import KnowledgeMessage, ParameterMessage
from dsc.model.plot import ActionPlot
from dsc.runs.store import RunStore
from dsc.sequencer.clock import LoopClock
from dsc.sequencer.outcome_checks import encoded
from dsc.trace import Trace
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.facts import Delta
from knowledge_base.language.checking.inputs import require, require_delta, require_text, shown
from knowledge_base.store import KnowledgeBase

_NUMBER = int | float


def require_parts(library: object, knowledge: object, clock: object, trace: object, store: object) -> None:
    """Raise `InputError` unless these are what a sequencer is made of; the last two may be missing."""
    require(library, Library, "the plots are given as a Library, made by Library(plots)")
    require(knowledge, KnowledgeBase, "the knowledge is a KnowledgeBase")
    require(clock, LoopClock, "the clock is a LoopClock, made inside the loop that runs the sequencer")
    if trace is not None:
        require(trace, Trace, "a trace is a Trace")
    if store is not None:
        require(store, RunStore, "a store is a RunStore")


def event(said: object) -> Event:
    """The event with copied attributes.

    Raises:
        InputError: it is not an event, only the executive fires it, or an attribute is not plain data.
    """
    plain = isinstance(said, Event) and said.attributes is NO_ATTRIBUTES  # as most are
    if not isinstance(said, Event) or not (plain or isinstance(said.attributes, Mapping)):
        raise InputError(f'an event is an Event with its attributes, as Event("stop", {{}}), not {shown(said)}')
    if said.name in RESERVED:
        raise InputError(f"the event '{said.name}' is fired by the executive itself", found=said.name)
    if plain:
        return said
    if not said.attributes:
        return said._replace(attributes=NO_ATTRIBUTES)
    return said._replace(attributes=_plain(dict(said.attributes), f"the attributes of '{said.name}' are"))


def change(delta: Delta, author: str, knowledge: KnowledgeBase) -> KnowledgeMessage:
    """A change of knowledge that fits its schema; raises `InputError`."""
    require_delta(delta)
    require_text(author, "an author")
    knowledge.overlay().apply(delta)
    return KnowledgeMessage(delta, author)


def parameter(
    owner: str, name: str, value: object, components: Mapping[str, Component], library: Library
) -> ParameterMessage:
    """An operator's setting of a parameter.

    Raises:
        UnknownNameError: there is no such component or plot, or it declares no such parameter.
        InputError: the value is out of range, breaks a relation, or is not for operators to say.
    """
    require_text(owner, "the name of a component or plot")
    require_text(name, "a parameter's name")
    if owner in components:
        components[owner].parameters.check(name, value, "operator")
    elif owner in library:
        library.plot(owner).with_default(name, value, "operator")
    else:
        valid = [*components, *(plot.name for plot in library)]
        raise UnknownNameError(f"there is no component or plot '{owner}'", found=owner, valid=valid)
    assert value is None or isinstance(value, str | int | float | bool)  # noqa: S101  as everything that fits a range
    return ParameterMessage(owner, name, value, of_plot=owner not in components)


def arguments(plot: ActionPlot, given: object) -> Mapping[str, Any]:
    """The arguments of a plot, validated.

    Raises:
        InputError: it is not a mapping, a value is not plain data, or a number or truth value is of another type.
    """
    if not isinstance(given, Mapping):
        raise InputError(f"arguments are a mapping of parameters' names to values, not {shown(given)}")
    for name, value in given.items():
        declared = plot.parameters.get(name)
        if declared is not None and declared.type in {"number", "boolean"}:
            declared.range.check(f"{plot.name}.{name}", value)
        _plain(value, f"the argument '{name}' is")
    return given


def require_seconds(after: object) -> None:
    """Raise `InputError` unless it is a time that passes."""
    if isinstance(after, bool) or not isinstance(after, _NUMBER) or not math.isfinite(after):
        raise InputError(f"something comes after a finite number of seconds, not {shown(after)}")


def _plain(value: Any, what: str) -> Any:
    try:
        return encoded(value)
    except (TypeError, ValueError) as error:
        raise InputError(f"{what} no plain data: {error}") from None

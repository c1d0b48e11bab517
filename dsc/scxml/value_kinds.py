"""Kinds of the values of a chart's data and events, which show where ECMAScript would convert a value.

The kinds are computed from the document, from the values in `data`, `assign` and `send`. An event that the chart does
not itself fire comes from outside. The plot declares its attributes in `receives`, with the types that expressions
require.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

from dsc.engine.transition_selection import matches
from dsc.errors import NotExpressibleError
from knowledge_base.errors import Place
from knowledge_base.language.syntax.expression import Arithmetic, Constant, Term, Variable

NUMBER, TEXT, BOOLEAN = "number", "text", "boolean"
UNDEFINED = "undefined"
ANY = "any"
NO_VALUE = Constant("undefined", quoted=True)
"""Constant for ECMAScript's `undefined`, which plots lack; no other text of an imported chart has this spelling."""
Kinds = frozenset[str]
WHOLE = ""
"""Key of `_event.data` itself; all other keys are properties of `_event.data`."""
_EVENT = "event."


@dataclass(frozen=True, slots=True)
class Sent:
    """An event that the chart fires.

    Attributes:
        event: name of the event.
        carries: data of the event, by the spelling in the document; `None` without data.
        scope: scope of the terms in `carries`.
    """

    event: str
    carries: Mapping[str, Term] | None
    scope: Scope


@dataclass(slots=True)
class Data:
    """Kinds of all data of a chart, and the events that it fires and receives.

    Attributes:
        kinds: kinds of values by variable; `None` until they are computed, which disables the checks.
        sent: the events that the chart fires.
        received: types of the attributes that the chart reads, by event from outside and attribute in lower case.
        spelt: spelling in the document of the attributes in `received`.
    """

    kinds: dict[str, Kinds] | None = None
    sent: list[Sent] = field(default_factory=list)
    received: dict[str, dict[str, str]] = field(default_factory=dict)
    spelt: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Scope:
    """The names that an expression may use.

    Attributes:
        names: names of the plot's variables, by the spelling of the data in the document.
        data: kinds of the data.
        events: descriptors of the events that `_event` may be; `None` if `_event` may be any event.
    """

    names: Mapping[str, str]
    data: Data = field(default_factory=Data)
    events: tuple[str, ...] | None = None

    def on(self, events: Iterable[str]) -> Scope:
        """Return the scope of a transition with these descriptors; without descriptors, `_event` may be any event."""
        return replace(self, events=tuple(events) or None)

    def kinds_of(self, term: Term) -> Kinds:
        """Return the kinds of values that a term may have."""
        if isinstance(term, Constant):
            return frozenset({_kind(term.value)})
        if isinstance(term, Arithmetic):
            return frozenset({NUMBER})
        if not isinstance(term, Variable) or self.data.kinds is None:
            return frozenset({ANY})
        if not term.name.startswith(_EVENT):
            return self.data.kinds.get(term.name, frozenset({UNDEFINED}))
        return self._kinds_of_attribute(term.name.removeprefix(_EVENT))

    def check_read(self, attribute: str, place: Place | None) -> None:
        """Raise an error if ECMAScript would read another value for `_event.data.ATTRIBUTE` than the plot.

        The attribute `WHOLE` stands for `_event.data` itself.

        Raises:
            NotExpressibleError: an event that `_event` may be has other data, or another spelling of the attribute.
        """
        if self.data.kinds is None:
            return
        what = f"_event.data.{attribute}" if attribute else "_event.data"
        if not attribute and (self._outside() or self._has_platforms()):
            raise _refusal(f"'{what}' of an event that is not sent with <content> has no counterpart", place)
        for sent in self._candidates():
            if sent.carries is None:
                if not attribute:
                    raise _refusal(f"'{what}' is undefined for the event '{sent.event}'", place)
            elif attribute not in sent.carries:
                raise _refusal(f"'{what}' is undefined for the event '{sent.event}', which has other data", place)
        for event in self._outside():
            known = self.data.spelt.setdefault(attribute.lower(), attribute)
            if known != attribute:
                raise _refusal(f"'{what}' is spelt '{known}' elsewhere, and names are folded to lower case", place)
            self.data.received[event].setdefault(attribute.lower(), "")

    def want(self, term: Term, kind: str) -> bool:
        """Return whether a term has this kind; an attribute of an event from outside is declared with the kind."""
        kinds = self.kinds_of(term)
        if self.data.kinds is None:
            return True
        if kinds - {ANY} not in ({kind}, frozenset()) or not kinds:
            return False
        if ANY not in kinds:
            return True
        if not isinstance(term, Variable) or not term.name.startswith(_EVENT):
            return False
        return self._declare(term.name.removeprefix(_EVENT), kind)

    def _declare(self, attribute: str, kind: str) -> bool:
        events = self._outside()
        if self.events is None or "*" in self.events:  # `_event` may be any event
            return False
        for event in events:
            declared = self.data.received[event]
            if declared.get(attribute, "") not in {"", kind}:
                return False
            declared[attribute] = kind
        return bool(events)

    def _kinds_of_attribute(self, attribute: str) -> Kinds:
        found = {kind for sent in self._candidates() for kind in _carried_kinds(sent, attribute)}
        return frozenset(found | ({ANY} if self._outside() else set()))

    def _candidates(self) -> list[Sent]:
        return [one for one in self.data.sent if self.events is None or any(matches(d, one.event) for d in self.events)]

    def _outside(self) -> list[str]:
        """Return the events from outside that `_event` may be."""
        if self.events is None:
            return [*self.data.received]
        return [event for event in self.data.received if any(matches(d, event) for d in self.events)]

    def _has_platforms(self) -> bool:
        """Return whether `_event` may be an event of the interpreter itself, which has no data."""
        return self.events is None or any(d.startswith(("done.", "error.", "*")) for d in self.events)


def _carried_kinds(sent: Sent, attribute: str) -> Iterable[str]:
    for name, term in (sent.carries or {}).items():
        if (name.lower() or "data") == attribute:
            yield from sent.scope.kinds_of(term)


def _kind(value: object) -> str:
    if isinstance(value, bool):
        return BOOLEAN
    if value == NO_VALUE.value:
        return UNDEFINED
    return NUMBER if isinstance(value, int | float) else TEXT


def _refusal(why: str, place: Place | None) -> NotExpressibleError:
    return NotExpressibleError("expression", why, place=place)


def compute_kinds(data: Data, given: Iterable[tuple[str, Term | None, Scope]]) -> None:
    """Compute the kinds of all variables.

    Args:
        data: data whose `kinds` are set.
        given: variable, assigned term and scope of each assignment; the term `None` leaves the variable undefined.
    """
    listed = list(given)
    data.kinds = {name: frozenset() for name, _, _ in listed}
    _spread(data.kinds, listed, frozenset({ANY}))
    for name, term, scope in listed:
        if term is not None and ANY in scope.kinds_of(term):
            known = data.kinds[name] - {UNDEFINED}
            if len(known) != 1 or not scope.want(term, *known):
                data.kinds[name] |= {ANY}
    _spread(data.kinds, [one for one in listed if not _is_attribute(one[1])], frozenset())


def _spread(kinds: dict[str, Kinds], given: list[tuple[str, Term | None, Scope]], without: Kinds) -> None:
    changed = True
    while changed:
        changed = False
        for name, term, scope in given:
            more = frozenset({UNDEFINED}) if term is None else scope.kinds_of(term) - without
            if not more <= kinds[name]:
                kinds[name] |= more
                changed = True


def _is_attribute(term: Term | None) -> bool:
    return isinstance(term, Variable) and term.name.startswith(_EVENT)

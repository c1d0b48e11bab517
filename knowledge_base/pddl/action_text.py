"""The `:action` and `:durative-action` sections of a domain file as read; names are not resolved yet."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

from knowledge_base.errors import ParseError, Place, SchemaError
from knowledge_base.language.syntax.durative import Duration, DurativeParts
from knowledge_base.language.syntax.effect import NO_EFFECT, AllOf, Effect, ForEach, NumericEffect, When
from knowledge_base.language.syntax.expression import (
    TRUE,
    And,
    Constant,
    Expression,
    Forall,
    Term,
    TypedVariable,
    Variable,
    free_variables,
    substitute,
)
from knowledge_base.language.syntax.sexpr import Group, Node, Word, parse_variables
from knowledge_base.language.syntax.text import parse_condition, parse_effect, parse_term, to_text, variables_text
from knowledge_base.pddl.definition import (
    ACROSS_TIMES,
    ACTION_PARTS,
    CHOSEN_DURATION,
    DURATION_AT_END,
    refuse_forms,
    refused,
    word,
)

ACTION, DURATIVE_ACTION = ":action", ":durative-action"
_PARTS = {
    ACTION: (":parameters", ":precondition", ":effect"),
    DURATIVE_ACTION: (":parameters", ":duration", ":condition", ":effect"),
}
_COMPARED = (
    *("duration", "precondition", "condition over all", "condition at the end"),
    *("effect at the start", "effect"),
)
_DURATION = Variable("duration")
_START, _OVER_ALL, _END = "at start", "over all", "at end"
_T = TypeVar("_T")


def read_duration(node: Node) -> Duration:
    """Return the duration of an action; `()` is any duration.

    The forms are `(= ?duration 5)` and bounds such as `(and (>= ?duration 4) (<= ?duration 6))`.

    Raises:
        ParseError: the form is wrong.
        UnsupportedConstructError: the duration is determined at the end of the action.
    """
    least: Term = Constant(0)
    most: Term = Constant(math.inf)
    for group in _bounds(node):
        operator, bound = _bound(group)
        least = bound if operator in ("=", ">=") else least
        most = bound if operator in ("=", "<=") else most
    return Duration(least, most)


def read_timed(condition: Node | None, effect: Node | None, duration: Duration) -> DurativeParts:
    """Return the condition and the effect of a durative action, by time.

    Raises:
        ParseError: the form is wrong, or a part has no time.
        UnsupportedConstructError: an effect depends on a condition at another time, or on a duration that is not fixed.
    """
    needed = [] if condition is None else list(_conditions(condition))
    done = [] if effect is None else [(when, _with_duration(e, duration)) for when, e in _effects(effect)]
    return DurativeParts(
        start=_at(_START, needed, And),
        over_all=_at(_OVER_ALL, needed, And),
        end=_at(_END, needed, And),
        start_effect=_at(_START, done, AllOf),
        end_effect=_at(_END, done, AllOf),
    )


def _bounds(node: Node) -> list[Group]:
    group = _group(node, "a duration is written (= ?duration SECONDS)")
    if not group.items:
        return []
    if group.head() == "and":
        return [bound for part in group.items[1:] for bound in _bounds(part)]
    if group.head() == "at" and len(group.items) == 3:
        if _time(group) == _END:
            raise refused(DURATION_AT_END, "at end", group.place)
        return _bounds(group.items[2])
    return [group]


def _bound(group: Group) -> tuple[str, Term]:
    operator = group.head()
    if operator not in ("=", "<=", ">=") or len(group.items) != 3 or parse_term(group.items[1]) != _DURATION:
        raise ParseError(
            "a duration is written (= ?duration SECONDS), (>= ?duration SECONDS) or (<= ?duration SECONDS)",
            place=group.place,
        )
    return operator, parse_term(group.items[2])


def _conditions(node: Node) -> Iterator[tuple[str, Expression]]:
    """Yield the parts of a durative condition, each with its time."""
    group = _group(node, "a condition is written in parentheses")
    match group.head(), len(group.items):
        case None, 0:
            return
        case "and", _:
            for part in group.items[1:]:
                yield from _conditions(part)
        case "forall", 3:
            variables = parse_variables(group.items[1])
            for when, e in _conditions(group.items[2]):
                yield when, Forall(variables, e, place=group.place)
        case (("at" | "over"), 3) if (when := _time(group)) in (_START, _OVER_ALL, _END):
            yield when, parse_condition(group.items[2])
        case _:
            raise ParseError(
                "a condition of a durative action says when: (at start CONDITION), (over all CONDITION) or"
                " (at end CONDITION)",
                place=group.place,
            )


def _effects(node: Node) -> Iterator[tuple[str, Effect]]:
    """Yield the parts of a durative effect, each with its time."""
    group = _group(node, "an effect is written in parentheses")
    match group.head(), len(group.items):
        case None, 0:
            return
        case "and", _:
            for part in group.items[1:]:
                yield from _effects(part)
        case "forall", 3:
            variables = parse_variables(group.items[1])
            for when, e in _effects(group.items[2]):
                yield when, ForEach(variables, e, place=group.place)
        case "when", 3:
            needed, done = list(_conditions(group.items[1])), list(_effects(group.items[2]))
            times = {when for when, _ in (*needed, *done)}
            if len(times) > 1 or _OVER_ALL in times:
                raise refused(ACROSS_TIMES, "when", group.place)
            for when in times:
                yield when, When(_at(when, needed, And), _at(when, done, AllOf), place=group.place)
        case "at", 3 if (when := _time(group)) in (_START, _END):
            yield when, parse_effect(group.items[2])
        case _:
            raise ParseError(
                "an effect of a durative action says when: (at start EFFECT) or (at end EFFECT)", place=group.place
            )


def _time(group: Group) -> str:
    which = group.items[1]
    return f"{group.head()} {which.folded()}" if isinstance(which, Word) else ""


def _group(node: Node, wanted: str) -> Group:
    if isinstance(node, Word):
        raise ParseError(f"{wanted}, not '{node.text}'", place=node.place)
    return node


def _at(when: str, parts: Iterable[tuple[str, _T]], join: Callable[[tuple[_T, ...]], _T]) -> _T:
    """Return the parts with the time `when`, joined by `join` unless only one part has this time."""
    found = tuple(part for time, part in parts if time == when)
    return found[0] if len(found) == 1 else join(found)


def _with_duration(effect: Effect, duration: Duration) -> Effect:
    """Return the effect with `?duration` replaced by the duration, which must be fixed."""
    match effect:
        case AllOf(parts):
            return replace(effect, parts=tuple(_with_duration(part, duration) for part in parts))
        case ForEach(_, inner) | When(_, inner):
            return replace(effect, effect=_with_duration(inner, duration))
        case NumericEffect(_, _, value) if _DURATION.name in free_variables(value):
            if not duration.fixed:
                raise refused(CHOSEN_DURATION, "?duration", effect.place)
            return replace(effect, value=substitute(value, {_DURATION.name: duration.least}))
        case _:
            return effect


@dataclass(frozen=True, slots=True)
class ActionText:
    """A planning action as written; omitted parts are `()`, true, or no effect.

    A durative action has a `duration` and `timed` parts. Its precondition and effect equal these parts if no other
    action runs during the action (see `DurativeParts`).
    """

    name: str
    parameters: tuple[TypedVariable, ...]
    precondition: Expression
    effect: Effect
    place: Place | None = field(compare=False)
    duration: Duration | None = None
    timed: DurativeParts | None = None


def read_actions(sections: Iterable[tuple[str, Group]]) -> tuple[ActionText, ...]:
    """Return the actions among the sections of a domain, in order.

    Raises:
        ParseError: the form of an action is wrong.
        UnsupportedConstructError: an action uses a construct that no planner here supports.
        SchemaError: two different actions have one name.
    """
    return united(_action(keyword, group) for keyword, group in sections if keyword in _PARTS)


def united(actions: Iterable[ActionText]) -> tuple[ActionText, ...]:
    """Return the actions without repetitions.

    Raises:
        SchemaError: two actions of one name differ. The message contains both places and the difference.
    """
    found: dict[str, ActionText] = {}
    for action in actions:
        first = found.setdefault(action.name, action)
        if first != action:
            raise SchemaError(
                f"the action '{action.name}' is defined differently before (at {first.place}), with "
                + _difference(first, action),
                place=action.place,
            )
    return tuple(found.values())


def _difference(first: ActionText, second: ActionText) -> str:
    """Return the first part in which two actions differ, in both versions."""
    for part, before, here in zip(("parameters", *_COMPARED), _part_texts(first), _part_texts(second), strict=True):
        if before != here:
            return f"the {part} {before} instead of {here}"
    return "other words"


def _part_texts(action: ActionText) -> Iterator[str]:
    yield variables_text(action.parameters)
    duration, timed = action.duration, action.timed
    yield "none" if duration is None else f"from {to_text(duration.least)} to {to_text(duration.most)}"
    if timed is None:
        timed = DurativeParts(start=action.precondition, end_effect=action.effect)
    yield from map(to_text, (timed.start, timed.over_all, timed.end, timed.start_effect, timed.end_effect))


def _action(keyword: str, group: Group) -> ActionText:
    if len(group.items) < 2:
        raise ParseError(f"an action has a name: ({keyword} NAME ...)", place=group.place)
    name = word(group.items[1], "the action's name")
    if name.text.startswith(":"):
        raise ParseError(f"an action has a name: ({keyword} NAME ...)", place=name.place)
    parts = _action_parts(keyword, group.items[2:], name)
    parameters = parse_variables(parts[":parameters"]) if ":parameters" in parts else ()
    return (_durative if keyword == DURATIVE_ACTION else _instantaneous)(name, parameters, parts)


def _instantaneous(name: Word, parameters: tuple[TypedVariable, ...], parts: dict[str, Node]) -> ActionText:
    return ActionText(
        name=name.folded(),
        parameters=parameters,
        precondition=parse_condition(parts[":precondition"]) if ":precondition" in parts else TRUE,
        effect=parse_effect(parts[":effect"]) if ":effect" in parts else NO_EFFECT,
        place=name.place,
    )


def _durative(name: Word, parameters: tuple[TypedVariable, ...], parts: dict[str, Node]) -> ActionText:
    if ":duration" not in parts:
        raise ParseError(f"how long does '{name.text}' take? ':duration (= ?duration SECONDS)'", place=name.place)
    duration = read_duration(parts[":duration"])
    timed = read_timed(parts.get(":condition"), parts.get(":effect"), duration)
    return ActionText(name.folded(), parameters, timed.precondition, timed.effect, name.place, duration, timed)


def _action_parts(keyword: str, nodes: Sequence[Node], name: Word) -> dict[str, Node]:
    parts: dict[str, Node] = {}
    for position in range(0, len(nodes), 2):
        key = word(nodes[position], f"a keyword of the action '{name.text}'")
        part = key.folded()
        if part in ACTION_PARTS:
            raise refused(ACTION_PARTS[part], part, key.place)
        if part not in _PARTS[keyword]:
            what = "a durative action" if keyword == DURATIVE_ACTION else "an action"
            raise ParseError(f"{what} has no part '{key.text}'", place=key.place, found=key.text, valid=_PARTS[keyword])
        if part in parts:
            raise ParseError(f"a second '{part}' of the action '{name.text}'", place=key.place)
        if position + 1 == len(nodes):
            raise ParseError(f"'{part}' is followed by nothing", place=key.place)
        refuse_forms(nodes[position + 1])
        parts[part] = nodes[position + 1]
    return parts

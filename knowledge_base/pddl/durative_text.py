"""The parts of a `:durative-action` that have to do with time: its duration, timed conditions and timed effects."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

from knowledge_base.errors import ParseError
from knowledge_base.language.syntax.durative import Duration, DurativeParts
from knowledge_base.language.syntax.effect import AllOf, Effect, ForEach, NumericEffect, When
from knowledge_base.language.syntax.expression import (
    And,
    Arithmetic,
    Constant,
    Expression,
    Forall,
    Term,
    Variable,
    free_variables,
)
from knowledge_base.language.syntax.sexpr import Group, Node, Word, parse_variables
from knowledge_base.language.syntax.text import parse_condition, parse_effect, parse_term
from knowledge_base.pddl.beyond import ACROSS_TIMES, CHOSEN_DURATION, DURATION_AT_END, refused

_DURATION = Variable("duration")
_START, _OVER_ALL, _END = "at start", "over all", "at end"
_T = TypeVar("_T")
_ByTime = dict[str, list[_T]]


def read_duration(node: Node) -> Duration:
    """`(= ?duration 5)`, bounds such as `(and (>= ?duration 4) (<= ?duration 6))`, or `()` for any duration.

    Raises:
        ParseError: it is none of these.
        UnsupportedConstructError: it is settled at the end of the action.
    """
    least: Term = Constant(0)
    most: Term = Constant(math.inf)
    for group in _bounds(node):
        operator, bound = _bound(group)
        least = bound if operator in ("=", ">=") else least
        most = bound if operator in ("=", "<=") else most
    return Duration(least, most)


def read_timed(condition: Node | None, effect: Node | None, duration: Duration) -> DurativeParts:
    """A durative action's condition and effect, by time.

    Raises:
        ParseError: the form is wrong, or a part does not say when.
        UnsupportedConstructError: an effect depends on a condition at another time, or on a chosen duration.
    """
    needed: _ByTime[Expression] = {_START: [], _OVER_ALL: [], _END: []}
    done: _ByTime[Effect] = {_START: [], _END: []}
    if condition is not None:
        _condition(condition, needed, lambda e: e)
    if effect is not None:
        _effect(effect, done, lambda e: e)
    timed = {when: _all(AllOf, [_with_duration(e, duration) for e in parts]) for when, parts in done.items()}
    return DurativeParts(
        start=_all(And, needed[_START]),
        over_all=_all(And, needed[_OVER_ALL]),
        end=_all(And, needed[_END]),
        start_effect=timed[_START],
        end_effect=timed[_END],
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


def _condition(node: Node, found: _ByTime[Expression], scope: Callable[[Expression], Expression]) -> None:
    group = _group(node, "a condition is written in parentheses")
    match group.head(), len(group.items):
        case None, 0:
            return
        case "and", _:
            for part in group.items[1:]:
                _condition(part, found, scope)
        case "forall", 3:
            variables = parse_variables(group.items[1])
            _condition(group.items[2], found, lambda e: scope(Forall(variables, e, place=group.place)))
        case (("at" | "over"), 3) if (when := _time(group)) in found:
            found[when].append(scope(parse_condition(group.items[2])))
        case _:
            raise ParseError(
                "a condition of a durative action says when: (at start CONDITION), (over all CONDITION) or"
                " (at end CONDITION)",
                place=group.place,
            )


def _effect(node: Node, found: _ByTime[Effect], scope: Callable[[Effect], Effect]) -> None:
    group = _group(node, "an effect is written in parentheses")
    match group.head(), len(group.items):
        case None, 0:
            return
        case "and", _:
            for part in group.items[1:]:
                _effect(part, found, scope)
        case "forall", 3:
            variables = parse_variables(group.items[1])
            _effect(group.items[2], found, lambda e: scope(ForEach(variables, e, place=group.place)))
        case "when", 3:
            _conditional_effect(group, found, scope)
        case "at", 3 if (when := _time(group)) in found:
            found[when].append(scope(parse_effect(group.items[2])))
        case _:
            raise ParseError(
                "an effect of a durative action says when: (at start EFFECT) or (at end EFFECT)", place=group.place
            )


def _conditional_effect(group: Group, found: _ByTime[Effect], scope: Callable[[Effect], Effect]) -> None:
    needed: _ByTime[Expression] = {_START: [], _OVER_ALL: [], _END: []}
    done: _ByTime[Effect] = {_START: [], _END: []}
    _condition(group.items[1], needed, lambda e: e)
    _effect(group.items[2], done, lambda e: e)
    times = {when for by_time in (needed, done) for when, parts in by_time.items() if parts}
    if len(times) > 1 or _OVER_ALL in times:
        raise refused(ACROSS_TIMES, "when", group.place)
    for when in times & done.keys():
        found[when].append(scope(When(_all(And, needed[when]), _all(AllOf, done[when]), place=group.place)))


def _time(group: Group) -> str:
    which = group.items[1]
    return f"{group.head()} {which.folded()}" if isinstance(which, Word) else ""


def _group(node: Node, wanted: str) -> Group:
    if isinstance(node, Word):
        raise ParseError(f"{wanted}, not '{node.text}'", place=node.place)
    return node


def _all(join: Callable[[tuple[_T, ...]], _T], parts: list[_T]) -> _T:
    return parts[0] if len(parts) == 1 else join(tuple(parts))


def _with_duration(effect: Effect, duration: Duration) -> Effect:
    """The effect with the duration in place of `?duration`, which only a fixed one can take."""
    match effect:
        case AllOf(parts):
            return replace(effect, parts=tuple(_with_duration(part, duration) for part in parts))
        case ForEach(_, inner) | When(_, inner):
            return replace(effect, effect=_with_duration(inner, duration))
        case NumericEffect(_, _, value) if _DURATION.name in free_variables(value):
            if not duration.fixed:
                raise refused(CHOSEN_DURATION, "?duration", effect.place)
            return replace(effect, value=_term_with_duration(value, duration))
        case _:
            return effect


def _term_with_duration(term: Term, duration: Duration) -> Term:
    if term == _DURATION:
        return duration.least
    if isinstance(term, Arithmetic):
        return replace(term, args=tuple(_term_with_duration(arg, duration) for arg in term.args))
    return term

"""The request to a worker: a problem as a line of JSON, which lists each fact once and refers to facts by number.

Serialization must be fast, since a robot may wait. Successive problems share most ground actions, so the text of each
action is cached with gaps for the numbers of its facts.

Keys of the JSON object:

- `facts`: predicate and arguments of each fact.
- `init` and `goal`: fact numbers.
- `actions`: arrays of the step or null; fact numbers of precondition, adds and deletes; cost; bounds; assignments; the
  span of a durative action or null.
- `whole`: whether the problem has an unsliced form, which a later request may contain.
- Other attributes of `planning.model.problem.Problem`.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import chain
from typing import Any

from knowledge_base.facts import Fact
from knowledge_base.language.syntax.identity_cache import IdentityCache
from knowledge_base.owner_cache import cache_on_owner
from planning.model.ground_action import ActionSpan, GroundAction
from planning.model.plan import PlanStep
from planning.model.problem import Problem
from planning.model.quantities import Assignment, NumericBound, from_json, to_json

_Row = tuple[str, tuple[Fact, ...]]
"""The text of an action with gaps, and the facts whose numbers fill the gaps."""


@cache_on_owner
def write_problem(problem: Problem) -> bytes:
    """Return the problem as a line of JSON; kept on it, since all engines of a race receive an equal request."""
    rows = [_rows.find(action, None) or _rows.keep(action, None, _row(action)) for action in problem.actions]
    before = len(problem.init) + len(problem.goal)
    mentioned = [*problem.init, *problem.goal, *chain.from_iterable([facts for _, facts in rows])]
    places = list(map(id, mentioned))  # ids compare faster than facts; `mentioned` keeps the ids unique
    number: dict[Fact, int] = {}
    first = dict(zip(places, mentioned, strict=True))
    known = {place: number.setdefault(fact, len(number)) for place, fact in first.items()}
    numbers = [known[place] for place in places]
    rest = {
        "facts": [[fact.predicate, *fact.args] for fact in number],
        "domain": problem.domain,
        "objects": dict(problem.objects),
        "init": numbers[: len(problem.init)],
        "goal": numbers[len(problem.init) : before],
        "unreachable": problem.unreachable,
        "numbers": [[to_json(fluent), value] for fluent, value in problem.numbers.items()],
        "bounds": list(map(_bound_to_json, problem.bounds)),
        "notes": problem.notes,
        "one_at_a_time": problem.one_at_a_time,
        "whole": problem.unsliced is not None,
    }
    actions = ",".join([text for text, _ in rows]) % tuple(numbers[before:])
    return f'{json.dumps(rest)[:-1]}, "actions": [{actions}]}}\n'.encode()


def read(request: Mapping[str, Any]) -> Problem:
    """Return the problem of a decoded request."""
    facts = [Fact(predicate, tuple(args)) for predicate, *args in request["facts"]]

    def named(numbers: Iterable[int]) -> tuple[Fact, ...]:
        return tuple([facts[n] for n in numbers])

    return Problem(
        domain=request["domain"],
        objects=dict(request["objects"]),
        init=named(request["init"]),
        goal=named(request["goal"]),
        actions=tuple(
            GroundAction(
                None if step is None else PlanStep.from_json(step),
                named(pre),
                named(add),
                named(gone),
                cost,
                tuple(map(_bound_from_json, bounds)),
                _assignments_from_json(assignments),
                None if span is None else _span(span, named),
            )
            for step, pre, add, gone, cost, bounds, assignments, span in request["actions"]
        ),
        unreachable=tuple(request["unreachable"]),
        numbers={_fluent(fluent): number for fluent, number in request["numbers"]},
        bounds=tuple(map(_bound_from_json, request["bounds"])),
        notes=tuple(request["notes"]),
        one_at_a_time=request["one_at_a_time"],
    )


def _row(action: GroundAction) -> _Row:
    span = action.span
    later = () if span is None else (span.over_all, span.end, span.adds, span.deletes)
    groups = (action.precondition, action.adds, action.deletes, *later)
    gaps = [f"[{','.join(['%d'] * len(facts))}]" for facts in groups]
    parts = [
        _text(action.step and action.step.to_json()),
        *gaps[:3],
        _text(action.cost),
        _text(list(map(_bound_to_json, action.bounds))),
        _text(_assignments_to_json(action.assignments)),
        "null" if span is None else f"[{','.join([*_span_text(span), *gaps[3:]])}]",
    ]
    return f"[{','.join(parts)}]", tuple(chain.from_iterable(groups))


def _span_text(span: ActionSpan) -> list[str]:
    """Return all parts of a span except its facts."""
    bounds = (list(map(_bound_to_json, some)) for some in (span.lasting_bounds, span.end_bounds))
    return [*map(_text, (span.least, span.most, *bounds, _assignments_to_json(span.assignments)))]


def _span(data: Sequence[Any], named: Callable[[Iterable[int]], tuple[Fact, ...]]) -> ActionSpan:
    least, most, lasting, end, assignments, *facts = data
    over_all, at_end, adds, deletes = map(named, facts)
    return ActionSpan(
        least, most, over_all, at_end, adds, deletes,
        lasting_bounds=tuple(map(_bound_from_json, lasting)), end_bounds=tuple(map(_bound_from_json, end)),
        assignments=_assignments_from_json(assignments),
    )  # fmt: skip


def _assignments_to_json(assignments: Iterable[Assignment]) -> list[Any]:
    return [[to_json(one.fluent), to_json(one.amount), one.increase] for one in assignments]


def _assignments_from_json(data: Iterable[Any]) -> tuple[Assignment, ...]:
    return tuple(Assignment(_fluent(one), from_json(amount), more) for one, amount, more in data)


def _text(part: Any) -> str:
    """Return JSON text with `%` escaped, because the caller formats the text with `%`."""
    return json.dumps(part).replace("%", "%%")


def _bound_to_json(bound: NumericBound) -> list[Any]:
    return [bound.operator, to_json(bound.left), to_json(bound.right)]


def _bound_from_json(data: Sequence[Any]) -> NumericBound:
    return NumericBound(data[0], from_json(data[1]), from_json(data[2]))


def _fluent(data: Any) -> Fact:
    name, *args = data["fluent"]
    return Fact(name, tuple(args))


# Not on the actions: a `CachingPlanner` keeps the actions of many problems.
_rows: IdentityCache[GroundAction, _Row] = IdentityCache(size=20_000)

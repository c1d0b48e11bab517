"""The parts that all skills with behaviour trees share: their declaration, and the execution of an action."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable
from typing import Any, TypeVar, Union

from dsc.annotations import FoundRecords, names_around
from dsc.components.hooks import contained
from dsc.outcomes import Outcome, declared_outcomes
from dsc.skills import AfterCrash, Execution, declaration, named
from knowledge_base.errors import InputError
from knowledge_base.facts import Delta
from knowledge_base.user_objects import shown

_Body = TypeVar("_Body", bound=Callable[..., Any])


def declare_tree(
    ends: tuple[type[Outcome], type[Outcome]],
    reports: Iterable[type[Outcome]],
    after_crash: AfterCrash,
    execute: Execution,
) -> Callable[[_Body], _Body]:
    """Return a decorator that declares a method as a skill which `execute` executes.

    Args:
        ends: the outcomes after success and after failure of the tree, classes without attributes.
        reports: the classes of the outcomes that actions report before the end.
        after_crash: as for `skill`.
        execute: executes a call with the decorated method.

    Raises:
        InputError: an end is not a class of an outcome, or has attributes.
        SchemaError: an annotation has no valid type.
    """
    for end in ends:
        _require_bare(end)

    def declare(body: _Body) -> _Body:
        records, names = FoundRecords(), names_around(body.__globals__)
        classes = Union.__getitem__((*ends, *reports))
        outcomes = declared_outcomes(classes, names, f"'{named(body)}'", records)
        return declaration(body, 2, names, outcomes, records, execute=execute, after_crash=after_crash)(body)

    return declare


def _require_bare(end: object) -> None:
    if not (isinstance(end, type) and issubclass(end, Outcome)):
        raise InputError(f"a tree ends with a class of an outcome, as in success=Served, not with {shown(end)}")
    if end.declared:
        raise InputError(f"a tree ends with {end.__name__}, for whose attributes it has no values", found=end.__name__)


async def execute_action(
    name: str, begin: Callable[[], Awaitable[Outcome]], observe: Callable[[Delta], None]
) -> Outcome:
    """Execute a coroutine of an action, report its observations, and return its outcome.

    Raises:
        InputError: the coroutine returns another value than an outcome.
    """
    with contained():
        outcome = await begin()
    if not isinstance(outcome, Outcome):
        raise InputError(f"the action '{name}' ended with {shown(outcome)}, which is not an outcome")
    if outcome.observed:
        observe(outcome.observed)
    return outcome

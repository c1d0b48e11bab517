"""Plain questions as Python source, which answers them several times as fast as closures do.

*Plain* is a conjunction of facts, types, negated facts and types, and equations, about variables and constants; for a
condition also such a conjunction under one `exists`. Nothing of a text but the names of predicates and types gets into
the source, as literals; variables are numbered, and values come from outside. The look-ups and their order are those
of `compiler`: where several may come next, the source has each of the ways and counts before it takes one.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import CodeType, FunctionType
from typing import Any, Protocol

from knowledge_base.language.code_generation import CodeGenerator
from knowledge_base.language.expression import (
    Atom,
    Comparison,
    Constant,
    Exists,
    Expression,
    Not,
    Variable,
    variables_in_order,
)
from knowledge_base.language.joins import Conjunct, TypeRange, as_range, conjuncts, order
from knowledge_base.language.vocabulary import Vocabulary

MOST_LOOKUPS = 3
"""Each further one multiplies the ways that the source has."""
MOST_TESTS = 50


class Index(Protocol):
    """Facts as the code looks them up: all of a predicate, those with a value in one place, and their arguments."""

    @property
    def by_predicate(self) -> Mapping[str, object]:
        """Facts by predicate."""
        ...

    @property
    def by_argument(self) -> Mapping[Any, object]:
        """Facts by predicate, position and value."""
        ...

    @property
    def listed(self) -> object:
        """What lists them."""
        ...


class IndexedWorld(Protocol):
    """What the code is bound to; it stays the same object while the world changes."""

    @property
    def facts(self) -> Index:
        """What is true."""
        ...

    @property
    def nodes(self) -> Mapping[str, str]:
        """All things with their types."""
        ...

    @property
    def stamp(self) -> object:
        """Has the `version`, which is `None` while a change is being made."""
        ...

    def objects(self, type_name: str) -> Iterable[str]:
        """The things of that type or a subtype."""
        ...


@dataclass(frozen=True, slots=True)
class GeneratedSource:
    """A function's code, to be made a function for each world.

    It takes the values of the parameters in order. Its names are those that `bound` gives it; and, unless it is a bare
    test, `lock`, and `judge`, which is given all values if one is no plain text or `MISSING`, or if
    there are too many.
    """

    code: CodeType
    constants: Mapping[str, object]

    def bound(self, state: IndexedWorld, **more: object) -> FunctionType:
        """The function for a world, which stays the same object while it changes."""
        scope: dict[str, Any] = {
            "facts": state.facts.by_predicate,
            "by_argument": state.facts.by_argument,
            "listed": state.facts.listed,
            "types": state.nodes,
            "objects": state.objects,
            "stamp": state.stamp,
            **more,
            **self.constants,
        }
        exec(self.code, scope)  # noqa: S102  written here from checked values; texts are not executed
        function: FunctionType = scope["question"]
        return function


def condition_source(e: Expression, schema: Vocabulary, params: Sequence[str]) -> GeneratedSource | None:
    """Whether `e` holds, all of whose free variables are `params`; `None` if it is not plain."""
    if isinstance(e, Exists):
        parts: list[Conjunct] = [*map(TypeRange, e.variables), *conjuncts(e.body)]
    else:
        parts = list(conjuncts(e))
    return _written(parts, schema, params, None)


def test_source(e: Expression, schema: Vocabulary, params: Sequence[str]) -> GeneratedSource | None:
    """As `condition_source`, for who holds the lock and has judged the values; `None` also if something is looked up.

    The function takes more values than it has parameters, too.
    """
    return _written(list(conjuncts(e)), schema, params, None, bare=True)


def query_source(e: Expression, schema: Vocabulary, params: Sequence[str]) -> GeneratedSource | None:
    """All values of the free variables of `e` that are not `params`; `None` if it is not plain."""
    names = tuple(dict.fromkeys(name for name in variables_in_order(e) if name not in params))
    return _written(list(conjuncts(e)), schema, params, names)


def _written(
    parts: list[Conjunct],
    schema: Vocabulary,
    params: Sequence[str],
    answers: tuple[str, ...] | None,
    *,
    bare: bool = False,
) -> GeneratedSource | None:
    if len(parts) > MOST_TESTS or not all(_plain(part, schema) for part in parts):
        return None
    steps = order((as_range(part, schema) for part in parts), frozenset(params), schema)
    author = CodeGenerator(steps, schema, params, answers)
    if author.lookups > (0 if bare else MOST_LOOKUPS):
        return None
    lines = author.test() if bare else author.question()
    return GeneratedSource(compile("\n".join(lines), "<question>", "exec"), author.constants)


def _plain(part: Conjunct, schema: Vocabulary) -> bool:
    match part:
        case TypeRange():
            return True
        case Atom(name, args):
            return name not in schema.computed and all(isinstance(arg, Variable | Constant) for arg in args)
        case Not(body):
            return isinstance(body, Atom) and _plain(body, schema)
        case Comparison("=" | "!=", left, right):
            return isinstance(left, Variable | Constant) and isinstance(right, Variable | Constant)
        case _:
            return False

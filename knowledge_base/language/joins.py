"""In which order the conditions of a conjunction are looked up, so that few candidates are tried.

Greedy by what is already bound: tests first, then atoms with bound arguments, then other atoms, then types,
then `or` and `exists`. Among atoms the one with the fewest matches is taken, if the world can count them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from knowledge_base.errors import InputError
from knowledge_base.language.binding import found_variables
from knowledge_base.language.expression import (
    And,
    Atom,
    Comparison,
    Expression,
    Imply,
    Not,
    Or,
    TypedVariable,
    Variable,
    free_variables,
    variable_place,
)
from knowledge_base.schema import Schema


@dataclass(frozen=True, slots=True)
class Range:
    """The condition that a variable is a thing of one of its types."""

    variable: TypedVariable


Conjunct = Expression | Range

_MOST_COMPARED = 4


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """One look-up, with the variables that it tests or finds values for."""

    conjunct: Conjunct
    free: frozenset[str]
    schema: Schema

    def is_ready(self, bound: frozenset[str]) -> bool:
        """Whether it can be done when the variables `bound` have values."""
        return self.free <= bound | _finds(self.conjunct, bound, self.schema)

    def cost(self, bound: frozenset[str]) -> tuple[int, int, int]:
        """Kind of look-up (tests are 0 to 2), then open arguments, then bound ones; smaller is earlier."""
        unbound = len(self.free - bound)
        match self.conjunct:
            case Atom(name, _) if name in self.schema.computed:
                return (2, 0, 0)
            case Atom(_, args):
                open_args = sum(isinstance(a, Variable) and a.name not in bound for a in args)
                found = 3 if open_args < len(args) else 4
                return (found if unbound else 0, open_args, -len(args))
            case Range():
                return (5 if unbound else 1, unbound, 0)
            case Comparison():
                return (1, 0, 0)
            case _:
                return (6 if unbound else 2, unbound, 0)


def conjuncts(e: Expression) -> Iterator[Expression]:
    """The conditions that `e` is the conjunction of."""
    if isinstance(e, And):
        for part in e.parts:
            yield from conjuncts(part)
    else:
        yield e


def opposite(e: Expression) -> Expression:
    """The negation of `e`, with `not` pushed inside so that its parts can be looked up."""
    match e:
        case Not(body):
            return body
        case Or(parts):
            return And(tuple(opposite(p) for p in parts), place=e.place)
        case Imply(premise, conclusion):
            return And((premise, opposite(conclusion)), place=e.place)
        case _:
            return Not(e, place=e.place)


def order(conditions: Iterable[Conjunct], bound: frozenset[str], schema: Schema) -> list[Step]:
    """The look-ups in a good order when the variables `bound` have values and no numbers of facts are known.

    Raises:
        InputError: a variable is only tested and nothing finds values for it.
    """
    pending = [Step(c, _free(c), schema) for c in conditions]
    steps: list[Step] = []
    while pending:
        ready = [s for s in pending if s.is_ready(bound)]
        if not ready:
            raise _unfound(pending, bound)
        best = min(ready, key=lambda s: s.cost(bound))
        pending.remove(best)
        steps.append(best)
        bound |= best.free
    return steps


def candidates(steps: Mapping[int, Step], bound: frozenset[str]) -> list[tuple[int, Step]]:
    """The look-ups that may come next, of `steps` in the order of `order`: atoms, or else a single other.

    Only a few, because they are compared by number of matches each time.
    """
    ready = [(i, s) for i, s in steps.items() if s.is_ready(bound)]
    atoms = [(i, s) for i, s in ready if isinstance(s.conjunct, Atom)]
    return atoms[:_MOST_COMPARED] or ready[:1]


def _free(conjunct: Conjunct) -> frozenset[str]:
    if isinstance(conjunct, Range):
        return frozenset((conjunct.variable.name,))
    return free_variables(conjunct)


def _finds(conjunct: Conjunct, bound: frozenset[str], schema: Schema) -> frozenset[str]:
    return _free(conjunct) if isinstance(conjunct, Range) else found_variables(conjunct, schema, bound)


def _unfound(pending: list[Step], bound: frozenset[str]) -> InputError:
    stuck = [s.conjunct for s in pending if not isinstance(s.conjunct, Range)]
    names = sorted(frozenset().union(*map(free_variables, stuck)) - bound)
    place = next((p for e in stuck if (p := variable_place(e, names[0])) is not None), None)
    return InputError(f"nothing finds values for '?{names[0]}', which is only tested", place=place)

"""In which order the conditions of a conjunction are looked up, so that few candidates are tried.

Greedy by what is already bound: tests first, then atoms with bound arguments, then other atoms, then types,
then `or` and `exists`. Among atoms the one with the fewest matches is taken, if the world can count them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from heapq import heapify, heappop, heappush
from itertools import islice

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
from knowledge_base.language.vocabulary import Vocabulary


@dataclass(frozen=True, slots=True)
class TypeRange:
    """The condition that a variable is a thing of one of its types."""

    variable: TypedVariable


Conjunct = Expression | TypeRange

_MOST_COMPARED = 4


@dataclass(frozen=True, slots=True, eq=False)
class JoinStep:
    """One look-up, with the variables that it tests or finds values for."""

    conjunct: Conjunct
    free: frozenset[str]
    schema: Vocabulary

    def is_ready(self, bound: AbstractSet[str]) -> bool:
        """Whether it can be done when the variables `bound` have values."""
        unbound = self.free - bound
        return not unbound or unbound <= _finds(self.conjunct, self.free & bound, self.schema)

    def cost(self, bound: AbstractSet[str]) -> tuple[int, int, int]:
        """Kind of look-up (tests are 0 to 2), then open arguments, then bound ones; smaller is earlier.

        It never grows with more variables in `bound`.
        """
        unbound = len(self.free - bound)
        match self.conjunct:
            case Atom(name, _) if name in self.schema.computed:
                return (2, 0, 0)
            case Atom(_, args):
                open_args = sum(isinstance(a, Variable) and a.name not in bound for a in args)
                found = 3 if open_args < len(args) else 4
                return (found if unbound else 0, open_args, -len(args))
            case TypeRange():
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


def as_range(conjunct: Conjunct, schema: Vocabulary) -> Conjunct:
    """A type's atom about a variable ranges over the things of that type."""
    match conjunct:
        case Atom(name, (Variable(variable),)) if schema.is_type(name, 1):
            return TypeRange(TypedVariable(variable, (name,), place=conjunct.place))
        case _:
            return conjunct


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


def order(conditions: Iterable[Conjunct], bound: frozenset[str], schema: Vocabulary) -> list[JoinStep]:
    """The look-ups in a good order when the variables `bound` have values and no numbers of facts are known.

    Raises:
        InputError: a variable is only tested and nothing finds values for it.
    """
    steps = [JoinStep(c, _free(c), schema) for c in conditions]
    known = set(bound)
    users: dict[str, list[int]] = {}
    for i, step in enumerate(steps):
        for name in step.free - known:
            users.setdefault(name, []).append(i)
    taken: dict[int, JoinStep] = {}
    agenda = [(s.cost(known), i) for i, s in enumerate(steps) if s.is_ready(known)]
    heapify(agenda)
    while agenda:
        _, i = heappop(agenda)
        if i in taken:  # it stood there with an earlier, greater cost
            continue
        taken[i] = steps[i]
        found = steps[i].free - known
        known |= found
        for user in dict.fromkeys(user for name in found for user in users[name]):
            if user not in taken and steps[user].is_ready(known):
                heappush(agenda, (steps[user].cost(known), user))
    if len(taken) < len(steps):
        raise _unfound([s for i, s in enumerate(steps) if i not in taken], known)
    return list(taken.values())


def candidates(steps: Mapping[int, JoinStep], bound: frozenset[str]) -> list[tuple[int, JoinStep]]:
    """The look-ups that may come next, of `steps` in the order of `order`: atoms, or else a single other.

    Only a few, because they are compared by number of matches each time.
    """
    atoms = ((i, s) for i, s in steps.items() if isinstance(s.conjunct, Atom) and s.is_ready(bound))
    others = ((i, s) for i, s in steps.items() if s.is_ready(bound))
    return list(islice(atoms, _MOST_COMPARED)) or list(islice(others, 1))


def _free(conjunct: Conjunct) -> frozenset[str]:
    if isinstance(conjunct, TypeRange):
        return frozenset((conjunct.variable.name,))
    return free_variables(conjunct)


def _finds(conjunct: Conjunct, bound: frozenset[str], schema: Vocabulary) -> frozenset[str]:
    return _free(conjunct) if isinstance(conjunct, TypeRange) else found_variables(conjunct, schema, bound)


def _unfound(pending: list[JoinStep], bound: AbstractSet[str]) -> InputError:
    stuck = [s.conjunct for s in pending if not isinstance(s.conjunct, TypeRange)]
    names = sorted(frozenset().union(*map(free_variables, stuck)) - bound)
    place = next((p for e in stuck if (p := variable_place(e, names[0])) is not None), None)
    return InputError(f"nothing finds values for '?{names[0]}', which is only tested", place=place)

"""Numbering of literals, bounds and fluents: numbers are compared and looked up faster than values."""

from __future__ import annotations

from typing import TYPE_CHECKING

from knowledge_base.facts import Fact, Value
from planning.problem.conditions import Leaf, Literal, is_so
from planning.quantities import NumericBound, worth

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from knowledge_base.language.evaluation.world import World


NOT = "not "
"""The prefix of a predicate for a negative literal (positive normal form). No declared name has a blank."""


class _Images(dict[int, int]):
    """A mapping that computes each entry on first access."""

    def __init__(self, rename: Callable[[int], int]) -> None:
        super().__init__()
        self._rename = rename

    def __missing__(self, number: int) -> int:
        image = self[number] = self._rename(number)
        return image


class Numbering:
    """A growing table of numbers for literals, bounds and fluents; a number never changes its meaning.

    Attributes:
        fluents: the numbers of numeric fluents.
    """

    def __init__(self) -> None:
        self._numbers: dict[Fact | NumericBound, int] = {}
        self._named: list[Fact | NumericBound] = []
        self._by_predicate: dict[str, list[tuple[int, tuple[Value, ...]]]] = {}
        self._bounds: dict[int, NumericBound] = {}
        self._facts: dict[int, Fact] = {}
        self._images: dict[tuple[str, str], _Images] = {}
        self._wants: dict[int, dict[int, None]] = {}
        self._supports: dict[int, dict[int, None]] = {}
        self.fluents: set[int] = set()

    @property
    def wants(self) -> Mapping[int, Mapping[int, None]]:
        """Bound -> the fluents in it."""
        return self._wants

    @property
    def supports(self) -> Mapping[int, Mapping[int, None]]:
        """Fluent -> the bounds with it."""
        return self._supports

    def of(self, leaf: Leaf) -> int:
        """Return the number of a literal or bound."""
        if isinstance(leaf, Literal):
            return self._number(leaf.fact) + (not leaf.positive)
        known = self._numbers.get(leaf)
        return self._bound(leaf) if known is None else known

    def fluent(self, fluent: Fact) -> int:
        """Return the number of a numeric fluent."""
        number = self._number(fluent)
        self.fluents.add(number)
        return number

    def named(self, number: int) -> Fact | NumericBound:
        """Return the fact or bound of the number; a negative literal has the fact that it denies."""
        return self._named[number >> 1]

    def fact(self, number: int) -> Fact:
        """Return the literal in positive normal form."""
        known = self._facts.get(number)
        if known is None:
            fact = self._named[number >> 1]
            if not isinstance(fact, Fact):
                raise TypeError(f"{fact} is not a fact")
            known = self._facts[number] = as_fact(Literal(fact, not number & 1))
        return known

    def present(self, world: World) -> set[int]:
        """Return the numbers of all literals and bounds that hold in `world`; fluents have no truth value."""
        values = {one: worth(world, one) for one in map(self.fact, sorted(self.fluents))}
        held = {number for number, bound in self._bounds.items() if bound.holds(values)}
        for predicate, listed in self._by_predicate.items():
            if predicate in world.schema.computed:
                held.update([number + (not is_so(Fact(predicate, args), world)) for number, args in listed])
            else:  # one query for all: most facts of the predicate have a number
                known = set(world.match(predicate, (None,) * len(listed[0][1])))
                held.update([number + (args not in known) for number, args in listed])
        return held

    def images(self, name: str, other: str) -> Mapping[int, int]:
        """Return a mapping from each literal to the same literal about `other` instead of `name`."""
        if (name, other) not in self._images:
            self._images[name, other] = _Images(lambda number: self._renamed(number, name, other))
        return self._images[name, other]

    def _renamed(self, number: int, name: str, other: str) -> int:
        fact = self._named[number >> 1]
        if isinstance(fact, NumericBound) or name not in fact.args:
            return number
        args: tuple[Value, ...] = tuple([other if value == name else value for value in fact.args])
        return self._number(Fact(fact.predicate, args)) + (number & 1)

    def _number(self, one: Fact | NumericBound) -> int:
        number = self._numbers.get(one)
        if number is None:
            number = self._numbers[one] = 2 * len(self._named)
            self._named.append(one)
            if isinstance(one, NumericBound):
                self._bounds[number] = one
            else:
                self._by_predicate.setdefault(one.predicate, []).append((number, one.args))
        return number

    def _bound(self, bound: NumericBound) -> int:
        number = self._number(bound)
        for one in bound.fluents():
            fluent = self.fluent(one)
            self._wants.setdefault(number, {})[fluent] = None
            self._supports.setdefault(fluent, {})[number] = None
        return number


def as_fact(literal: Literal) -> Fact:
    """Return the literal in positive normal form."""
    return literal.fact if literal.positive else Fact(NOT + literal.fact.predicate, literal.fact.args)

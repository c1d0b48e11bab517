"""Literals, bounds and numeric fluents as numbers, which are compared and looked up much faster than values.

Whatever is numbered has an even number; the odd one after a fact's is the literal that it does not hold.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from knowledge_base.facts import Fact, Value
from planning.posing.conditions import Leaf, Literal, is_so
from planning.quantities import Bound, worth

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from knowledge_base.language.evaluation import World

NOT = "not "
"""Before a predicate: the fact that carries a negative literal (positive normal form). No declared name has a blank."""


class _Images(dict[int, int]):
    """Made when they are asked for."""

    def __init__(self, rename: Callable[[int], int]) -> None:
        super().__init__()
        self._rename = rename

    def __missing__(self, number: int) -> int:
        image = self[number] = self._rename(number)
        return image


class Numbering:
    """Grows; a number once given stays.

    Attributes:
        fluents: the numbers of numeric fluents.
    """

    def __init__(self) -> None:
        self._numbers: dict[Fact | Bound, int] = {}
        self._named: list[Fact | Bound] = []
        self._by_predicate: dict[str, list[tuple[int, tuple[Value, ...]]]] = {}
        self._bounds: dict[int, Bound] = {}
        self._facts: dict[int, Fact] = {}
        self._images: dict[tuple[str, str], _Images] = {}
        self._wants: dict[int, dict[int, None]] = {}
        self._supports: dict[int, dict[int, None]] = {}
        self.fluents: set[int] = set()

    @property
    def wants(self) -> Mapping[int, Mapping[int, None]]:
        """Bound -> the fluents it asks about."""
        return self._wants

    @property
    def supports(self) -> Mapping[int, Mapping[int, None]]:
        """Fluent -> the bounds that ask about it."""
        return self._supports

    def of(self, leaf: Leaf) -> int:
        """The number of a literal or bound."""
        if isinstance(leaf, Literal):
            return self._number(leaf.fact) + (not leaf.positive)
        known = self._numbers.get(leaf)
        return self._bound(leaf) if known is None else known

    def fluent(self, fluent: Fact) -> int:
        """The number of a numeric fluent."""
        number = self._number(fluent)
        self.fluents.add(number)
        return number

    def named(self, number: int) -> Fact | Bound:
        """What has the number, or is denied by it."""
        return self._named[number >> 1]

    def fact(self, number: int) -> Fact:
        """The literal in positive normal form."""
        known = self._facts.get(number)
        if known is None:
            fact = self._named[number >> 1]
            if not isinstance(fact, Fact):
                raise TypeError(f"{fact} is no fact")
            known = self._facts[number] = as_fact(Literal(fact, not number & 1))
        return known

    def present(self, world: World) -> set[int]:
        """The numbers of all literals and bounds that hold in `world`; fluents have no truth."""
        values = {one: worth(world, one) for one in map(self.fact, sorted(self.fluents))}
        held = {number for number, bound in self._bounds.items() if bound.holds(values)}
        for predicate, listed in self._by_predicate.items():
            if predicate in world.schema.computed:
                held.update([number + (not is_so(Fact(predicate, args), world)) for number, args in listed])
            else:  # all at once: most of what is asked about is named here
                known = set(world.match(predicate, (None,) * len(listed[0][1])))
                held.update([number + (args not in known) for number, args in listed])
        return held

    def images(self, name: str, other: str) -> Mapping[int, int]:
        """Literal -> the same literal about `other` in the place of `name`; for every literal."""
        if (name, other) not in self._images:
            self._images[name, other] = _Images(lambda number: self._renamed(number, name, other))
        return self._images[name, other]

    def _renamed(self, number: int, name: str, other: str) -> int:
        fact = self._named[number >> 1]
        if isinstance(fact, Bound) or name not in fact.args:
            return number
        args: tuple[Value, ...] = tuple([other if value == name else value for value in fact.args])
        return self._number(Fact(fact.predicate, args)) + (number & 1)

    def _number(self, one: Fact | Bound) -> int:
        number = self._numbers.get(one)
        if number is None:
            number = self._numbers[one] = 2 * len(self._named)
            self._named.append(one)
            if isinstance(one, Bound):
                self._bounds[number] = one
            else:
                self._by_predicate.setdefault(one.predicate, []).append((number, one.args))
        return number

    def _bound(self, bound: Bound) -> int:
        number = self._number(bound)
        for one in bound.fluents():
            fluent = self.fluent(one)
            self._wants.setdefault(number, {})[fluent] = None
            self._supports.setdefault(fluent, {})[number] = None
        return number


def as_fact(literal: Literal) -> Fact:
    """The literal in positive normal form."""
    return literal.fact if literal.positive else Fact(NOT + literal.fact.predicate, literal.fact.args)

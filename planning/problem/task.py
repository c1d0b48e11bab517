"""A ground problem in numbers, which are compared and looked up faster than values, and the `Problem` made from it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, TypeVar

from knowledge_base.facts import Fact, Value
from knowledge_base.language.evaluation.world import World
from planning.plan import PlanStep
from planning.problem.conditions import Leaf, Literal, is_so
from planning.quantities import Assignment, NumericBound, fluents, worth
from planning.strips import GroundAction, Problem

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


_T = TypeVar("_T")

_MOST_KNOWN = 16


class GroundOperator(NamedTuple):
    """One variant of a ground action in numbers; a tuple, since each problem makes thousands.

    Attributes:
        step: the step; `None` for bookkeeping.
        needs: literals and bounds that must hold before.
        adds: literals that hold afterwards, and fluents that it changes.
        deletes: literals that no longer hold afterwards.
        assignments: the changes of these fluents.
        cost: `None` if its change of the metric is not a cost.
        number: an identity that the operator keeps when pruning removes parts of it.
    """

    step: PlanStep | None
    needs: tuple[int, ...]
    adds: tuple[int, ...]
    deletes: tuple[int, ...]
    assignments: tuple[Assignment, ...] = ()
    cost: float | None = 1.0
    number: int = -1


Key = tuple[str, tuple[str, ...]] | None


def key(step: PlanStep | None) -> Key:
    """Return the step by value, which is hashed much faster than the step."""
    return None if step is None else (step.action, step.args)


class OperatorIndex:
    """Ground operators in order, with indexes built on first use; positions refer to operators."""

    def __init__(self, ways: Sequence[GroundOperator]) -> None:
        self.all = ways
        self._known: dict[Hashable, Any] = {}

    def known(self, key: Hashable, work_out: Callable[[], _T]) -> _T:
        """Return the cached result for `key`, or compute and cache it."""
        found: _T = self._known.pop(key) if key in self._known else work_out()
        self._known[key] = found  # the latest is evicted last
        if len(self._known) > _MOST_KNOWN:
            del self._known[next(iter(self._known))]
        return found

    @cached_property
    def counts(self) -> Sequence[int]:
        """The number of needs of each operator."""
        return [len(way.needs) for way in self.all]

    @cached_property
    def users(self) -> Mapping[int, Sequence[int]]:
        """Literal or bound -> the operators that need it."""
        users: dict[int, list[int]] = {}
        for i, way in enumerate(self.all):
            for one in way.needs:
                users.setdefault(one, []).append(i)
        return users

    @cached_property
    def adders(self) -> Mapping[int, Sequence[int]]:
        """Literal or fluent -> the operators that add or change it without needing it."""
        adders: dict[int, list[int]] = {}
        for i, way in enumerate(self.all):
            for one in way.adds:
                if one not in way.needs:
                    adders.setdefault(one, []).append(i)
        return adders

    @cached_property
    def touching(self) -> Mapping[int, Sequence[int]]:
        """Literal, bound or fluent -> the operators that need, add, change or delete it."""
        touching: dict[int, list[int]] = {}
        for i, way in enumerate(self.all):
            for one in {*way.needs, *way.adds, *way.deletes}:
                touching.setdefault(one, []).append(i)
        return touching

    @cached_property
    def naming(self) -> Mapping[str, Sequence[int]]:
        """Object -> the operators whose steps name it."""
        naming: dict[str, list[int]] = {}
        for i, way in enumerate(self.all):
            for name in set(way.step.args) if way.step else ():
                naming.setdefault(name, []).append(i)
        return naming

    @cached_property
    def of_step(self) -> Mapping[Key, Sequence[int]]:
        """Step, see `key` -> its operators."""
        of_step: dict[Key, list[int]] = {}
        for i, way in enumerate(self.all):
            of_step.setdefault(key(way.step), []).append(i)
        return of_step


@dataclass(frozen=True, slots=True)
class Task:
    """A ground problem in numbers.

    Attributes:
        numbering: the facts, bounds and fluents of the numbers.
        init: literals and bounds that hold.
        goal: literals and bounds to reach.
        ways: the ground operators.
        left: position of an operator -> its relevant part; `None` before pruning.
        settled: literals and bounds that pruning removed, since they hold in every reachable state.
    """

    numbering: Numbering
    init: Collection[int]
    goal: tuple[int, ...]
    ways: OperatorIndex
    left: Mapping[int, GroundOperator] | None = None
    settled: frozenset[int] = frozenset()


_MOST_KEPT = 20_000  # ground actions; a problem of 50 items has 3,000


class Assembly:
    """Makes problems from tasks that share a numbering and ground operators."""

    def __init__(self, numbering: Numbering) -> None:
        self._numbering = numbering
        self._made: dict[int, tuple[GroundOperator, GroundAction]] = {}  # by identity

    def problem(
        self, domain: str, task: Task, things: Mapping[str, str], world: World | None, notes: tuple[str, ...]
    ) -> Problem:
        """Return the `Problem` of the task.

        Args:
            domain: the name of the domain.
            task: the pruned task, in numbers.
            things: all objects with their types.
            world: the source of the values of numeric fluents; `None` if the task has no fluents.
            notes: remarks for readers.
        """
        init, _ = self._split(task.init)
        goal, bounds = self._split(task.goal)
        ways = task.ways.all if task.left is None else task.left.values()
        known = self._made.get
        actions = tuple([found[1] if (found := known(id(way))) else self._action(way) for way in ways])
        mentioned = dict.fromkeys([arg for action in actions if action.step for arg in action.step.args])
        mentioned.update(dict.fromkeys(str(value) for fact in (*init, *goal) for value in fact.args))
        objects = {one: things[one] for one in mentioned if one in things}
        asked = _fluents(actions, bounds) if self._numbering.fluents else ()
        numbers = {} if world is None else {one: worth(world, one) for one in asked}
        return Problem(domain, objects, init, goal, actions, numbers=numbers, bounds=bounds, notes=notes)

    def _action(self, way: GroundOperator) -> GroundAction:
        if len(self._made) >= _MOST_KEPT:
            self._made.clear()
        action = self._make(way)
        self._made[id(way)] = way, action
        return action

    def _make(self, way: GroundOperator) -> GroundAction:
        numbering = self._numbering
        needs, bounds = self._split(way.needs)
        adds = tuple([numbering.fact(one) for one in way.adds if one not in numbering.fluents])
        deletes = tuple(map(numbering.fact, way.deletes))
        cost = 0.0 if way.cost is None else way.cost
        return GroundAction(way.step, needs, adds, deletes, cost, bounds, way.assignments)

    def _split(self, numbers: Iterable[int]) -> tuple[tuple[Fact, ...], tuple[NumericBound, ...]]:
        """Return facts in positive normal form, and bounds."""
        facts: list[Fact] = []
        bounds: list[NumericBound] = []
        for number in numbers:
            one = self._numbering.named(number)
            if isinstance(one, NumericBound):
                bounds.append(one)
            else:
                facts.append(self._numbering.fact(number))
        return tuple(facts), tuple(bounds)


def _fluents(actions: Iterable[GroundAction], goal: Iterable[NumericBound]) -> dict[Fact, None]:
    """Return the numeric fluents of bounds and assignments, as a set in order."""
    found = dict.fromkeys(fluent for bound in goal for fluent in bound.fluents())
    for action in actions:
        found.update((fluent, None) for bound in action.bounds for fluent in bound.fluents())
        for one in action.assignments:
            found.update(dict.fromkeys((one.fluent, *fluents(one.amount))))
    return found

"""A ground problem in numbers, since numbers are compared and looked up faster than facts; and its `Problem`."""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import filterfalse
from typing import Any, NamedTuple, TypeVar

from knowledge_base.facts import Fact, Value
from knowledge_base.language.evaluation.world_protocol import World
from planning.model.ground_action import GroundAction
from planning.model.plan import PlanStep
from planning.model.problem import Problem
from planning.model.quantities import Assignment, NumericBound, fluents, value_of
from planning.problem.conditions import Leaf, Literal, is_so

NOT = "not "
"""The prefix of the predicate of a complementary fact (positive normal form). No declared name has a blank."""


_T = TypeVar("_T")
_V = TypeVar("_V")


class LazyTable(dict[int, _V]):
    """A mapping that computes each value on first access."""

    def __init__(self, compute: Callable[[int], _V]) -> None:
        super().__init__()
        self._compute = compute

    def __missing__(self, number: int) -> _V:
        made = self[number] = self._compute(number)
        return made


class Numbering:
    """A growing table of numbers for literals, bounds and fluents; a number never changes its meaning.

    Attributes:
        facts: the literal of each number, in positive normal form.
        bounds: the bound of each number.
        fluents: the numbers of numeric fluents.
        objects: the objects that the literal, bound or fluent of each number contains.
        wants: the fluents of each bound.
        supports: the bounds with each fluent.
    """

    def __init__(self) -> None:
        self.facts: LazyTable[Fact] = LazyTable(self._fact)
        self.bounds: dict[int, NumericBound] = {}
        self.fluents: set[int] = set()
        self.objects: LazyTable[frozenset[str]] = LazyTable(self._objects)
        self.wants: dict[int, dict[int, None]] = {}
        self.supports: dict[int, dict[int, None]] = {}
        self._numbers: dict[Fact | NumericBound, int] = {}
        self._named: list[Fact | NumericBound] = []
        self._by_predicate: dict[str, list[tuple[int, tuple[Value, ...]]]] = {}
        self._images: dict[tuple[str, str], LazyTable[int]] = {}

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
        """Return the fact or bound of the number; for a negative literal, the negated fact."""
        return self._named[number >> 1]

    def split(self, numbers: Collection[int]) -> tuple[tuple[Fact, ...], tuple[NumericBound, ...]]:
        """Return the facts of the numbers, in positive normal form, and the bounds."""
        if self.bounds.keys().isdisjoint(numbers):
            return tuple(map(self.facts.__getitem__, numbers)), ()
        facts = tuple([self.facts[one] for one in numbers if one not in self.bounds])
        return facts, tuple([self.bounds[one] for one in numbers if one in self.bounds])

    def true_facts(self, numbers: Iterable[int]) -> Iterator[Fact]:
        """Yield the facts of the positive literals among the numbers of literals and fluents."""
        for number in numbers:
            if not number & 1 and number not in self.fluents:
                yield self.facts[number]

    def _fact(self, number: int) -> Fact:
        fact = self._named[number >> 1]
        if not isinstance(fact, Fact):
            raise TypeError(f"{fact} is not a fact")
        return as_fact(Literal(fact, not number & 1))

    def _objects(self, number: int) -> frozenset[str]:
        one = self._named[number >> 1]
        facts = (one,) if isinstance(one, Fact) else one.fluents()
        return frozenset([str(value) for fact in facts for value in fact.args])

    def present(self, world: World) -> set[int]:
        """Return the numbers of all literals and bounds that hold in `world`; fluents have no truth value."""
        values = {fluent: value_of(world, fluent) for fluent in map(self.facts.__getitem__, sorted(self.fluents))}
        held = {number for number, bound in self.bounds.items() if bound.holds(values)}
        computed = world.schema.computed
        for predicate, listed in self._by_predicate.items():
            if predicate in computed:
                held.update([number + (not is_so(Fact(predicate, args), world)) for number, args in listed])
            else:  # one query for all facts, since most facts of the predicate have a number
                declared = predicate in world.schema.predicates  # others are bookkeeping of the problem
                known = set(world.match(predicate, (None,) * len(listed[0][1]))) if declared else set()
                for number, args in listed:
                    held.add(number + (args not in known))
        return held

    def images(self, name: str, other: str) -> Mapping[int, int]:
        """Return a mapping from each literal to the literal with `other` instead of `name`."""
        if (name, other) not in self._images:
            self._images[name, other] = LazyTable(lambda number: self._rename(number, name, other))
        return self._images[name, other]

    def _rename(self, number: int, name: str, other: str) -> int:
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
                self.bounds[number] = one
            else:
                self._by_predicate.setdefault(one.predicate, []).append((number, one.args))
        return number

    def _bound(self, bound: NumericBound) -> int:
        number = self._number(bound)
        for one in bound.fluents():
            fluent = self.fluent(one)
            self.wants.setdefault(number, {})[fluent] = None
            self.supports.setdefault(fluent, {})[number] = None
        return number


def as_fact(literal: Literal) -> Fact:
    """Return the literal in positive normal form."""
    return literal.fact if literal.positive else Fact(NOT + literal.fact.predicate, literal.fact.args)


_MOST_KNOWN = 16


class GroundOperator(NamedTuple):
    """One alternative of a plan step in numbers; a tuple, since each problem has thousands of operators.

    Attributes:
        step: the plan step; `None` for a bookkeeping action.
        needs: literals and bounds that must hold before.
        adds: literals that hold afterwards, and fluents that the operator changes.
        deletes: literals that no longer hold afterwards.
        assignments: the changes of the fluents.
        cost: the cost; `None` if the operator's change of the metric is not a cost.
        number: an identity, which stays the same when pruning removes parts of the operator.
    """

    step: PlanStep | None
    needs: tuple[int, ...]
    adds: tuple[int, ...]
    deletes: tuple[int, ...]
    assignments: tuple[Assignment, ...] = ()
    cost: float | None = 1.0
    number: int = -1


def ground_operator(
    step: PlanStep | None,
    condition: Iterable[Leaf],
    effects: Iterable[Literal],
    numbering: Numbering,
    assignments: tuple[Assignment, ...] = (),
    cost: float = 1.0,
) -> GroundOperator:
    """Return the operator with a conjunction as its condition, and with effects that do not contradict each other."""
    made = [numbering.of(effect) for effect in effects]
    touched = [numbering.fluent(one.fluent) for one in assignments]
    needs = tuple([numbering.of(leaf) for leaf in condition])
    return GroundOperator(step, needs, (*made, *touched), tuple([number ^ 1 for number in made]), assignments, cost)


def ground_action(way: GroundOperator, numbering: Numbering) -> GroundAction:
    """Return the operator as a ground action with facts in positive normal form."""
    fact = numbering.facts.__getitem__
    needs, bounds = numbering.split(way.needs)
    adds = tuple(map(fact, filterfalse(numbering.fluents.__contains__, way.adds)))
    cost = 0.0 if way.cost is None else way.cost
    return GroundAction(way.step, needs, adds, tuple(map(fact, way.deletes)), cost, bounds, way.assignments)


Key = tuple[str, tuple[str, ...]] | None


def key(step: PlanStep | None) -> Key:
    """Return action and arguments of the step as a tuple, because a tuple is hashed faster than a step."""
    return None if step is None else (step.action, step.args)


class OperatorIndex:
    """Ground operators in order, with indexes that are computed on first use; an index contains positions."""

    def __init__(self, ways: Sequence[GroundOperator]) -> None:
        self.all = ways
        self._known: dict[Hashable, Any] = {}

    def known(self, key: Hashable, compute: Callable[[], _T]) -> _T:
        """Return the cached result for `key`, or compute and cache the result of `compute`."""
        found: _T = self._known.pop(key) if key in self._known else compute()
        self._known[key] = found  # at the end, so that the least recently used result is evicted first
        if len(self._known) > _MOST_KNOWN:
            del self._known[next(iter(self._known))]
        return found

    @cached_property
    def counts(self) -> Sequence[int]:
        """The number of needs of each operator."""
        return [len(way.needs) for way in self.all]

    @cached_property
    def users(self) -> Mapping[int, Sequence[int]]:
        """The positions of the operators that need each literal or bound."""
        return _positions([way.needs for way in self.all])

    @cached_property
    def adders(self) -> Mapping[int, Sequence[int]]:
        """The positions of the operators that add each literal, or change each fluent, without needing it."""
        return _positions([[one for one in way.adds if one not in way.needs] for way in self.all])

    @cached_property
    def touching(self) -> Mapping[int, Sequence[int]]:
        """The positions of the operators that need, add, change or delete each literal, bound or fluent."""
        return _positions([{*way.needs, *way.adds, *way.deletes} for way in self.all])

    @cached_property
    def naming(self) -> Mapping[str, Sequence[int]]:
        """The positions of the operators whose step has each object as an argument."""
        return _positions([set(way.step.args) if way.step else set() for way in self.all])

    @cached_property
    def of_step(self) -> Mapping[Key, Sequence[int]]:
        """The positions of the operators of each step; for the keys see `key`."""
        return _positions([(key(way.step),) for way in self.all])


def _positions(those: Iterable[Iterable[_T]]) -> dict[_T, list[int]]:
    """Return, for each value, the positions of the collections that contain it."""
    found: dict[_T, list[int]] = {}
    for i, values in enumerate(those):
        for value in values:
            found.setdefault(value, []).append(i)
    return found


@dataclass(frozen=True, slots=True)
class Task:
    """A ground problem in numbers.

    Attributes:
        numbering: the facts, bounds and fluents of the numbers.
        init: the literals and bounds that hold initially.
        goal: the literals and bounds to reach.
        ways: the ground operators.
        left: the relevant part of each operator, by position; `None` before pruning.
        settled: literals and bounds that pruning removed, because they hold in every reachable state.
    """

    numbering: Numbering
    init: Collection[int]
    goal: tuple[int, ...]
    ways: OperatorIndex
    left: Mapping[int, GroundOperator] | None = None
    settled: frozenset[int] = frozenset()


_MOST_KEPT = 20_000  # ground actions; the table with 50 items has about 3,000


class Assembly:
    """Constructor of problems from tasks that share a numbering and ground operators."""

    def __init__(self, numbering: Numbering) -> None:
        self._numbering = numbering
        self._made: dict[int, tuple[GroundOperator, GroundAction]] = {}  # by identity

    def problem(
        self, domain: str, task: Task, things: Mapping[str, str], world: World | None, notes: tuple[str, ...]
    ) -> Problem:
        """Return the `Problem` of the task.

        Args:
            domain: the name of the domain.
            task: the pruned task.
            things: the type of each object, by the object's name.
            world: the world with the values of numeric fluents; `None` if the task has no fluents.
            notes: remarks for users.
        """
        init, _ = self._numbering.split(task.init)
        goal, bounds = self._numbering.split(task.goal)
        ways = task.ways.all if task.left is None else task.left.values()
        known = self._made.get
        actions = tuple([found[1] if (found := known(id(way))) else self._action(way) for way in ways])
        mentioned = dict.fromkeys([arg for action in actions if action.step for arg in action.step.args])
        mentioned.update(dict.fromkeys([str(value) for fact in (*init, *goal) for value in fact.args]))
        objects = {one: things[one] for one in mentioned if one in things}
        asked = _fluents(actions, bounds) if self._numbering.fluents else ()
        numbers = {} if world is None else {one: value_of(world, one) for one in asked}
        return Problem(domain, objects, init, goal, actions, numbers=numbers, bounds=bounds, notes=notes)

    def _action(self, way: GroundOperator) -> GroundAction:
        if len(self._made) >= _MOST_KEPT:
            self._made.clear()
        action = ground_action(way, self._numbering)
        self._made[id(way)] = way, action
        return action


def _fluents(actions: Iterable[GroundAction], goal: Iterable[NumericBound]) -> dict[Fact, None]:
    """Return the numeric fluents of bounds and assignments, as a set in order."""
    found = dict.fromkeys(fluent for bound in goal for fluent in bound.fluents())
    for action in actions:
        found.update((fluent, None) for bound in action.bounds for fluent in bound.fluents())
        for one in action.assignments:
            found.update(dict.fromkeys((one.fluent, *fluents(one.amount))))
    return found

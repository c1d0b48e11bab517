"""The steps of a search: look-ups of facts and objects, in an order that leads to few candidates.

The order is greedy in the bound variables: first tests, then atoms with bound arguments, then other atoms, then types,
then `or` and `exists`. Among atoms, the search chooses the one with the fewest matches, if the world can estimate their
number.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from heapq import heapify, heappop, heappush
from itertools import islice

from knowledge_base.errors import InputError
from knowledge_base.facts import Value
from knowledge_base.language.checking.binding import found_variables
from knowledge_base.language.checking.vocabulary import Vocabulary
from knowledge_base.language.evaluation.terms import Argument, Bindings, compile_argument
from knowledge_base.language.evaluation.world_protocol import World
from knowledge_base.language.syntax.expression import (
    And,
    Atom,
    Comparison,
    Expression,
    Term,
    TypedVariable,
    Variable,
    free_variables,
    variable_place,
)


@dataclass(frozen=True, slots=True)
class TypeRange:
    """The condition that the value of a variable is an object of one of its types."""

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
        """Return whether the look-up is possible when the variables `bound` have values."""
        unbound = self.free - bound
        return not unbound or unbound <= _finds(self.conjunct, self.free & bound, self.schema)

    def cost(self, bound: AbstractSet[str]) -> tuple[int, int, int]:
        """Return the kind of look-up (0 to 2 for tests), the number of open arguments, and a third number.

        Steps with smaller costs are executed earlier. The third number is smaller for an atom with more arguments.

        The cost never grows with more variables in `bound`.
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
    """Yield the parts of the conjunction `e`, or `e` itself."""
    if isinstance(e, And):
        for part in e.parts:
            yield from conjuncts(part)
    else:
        yield e


def as_range(conjunct: Conjunct, schema: Vocabulary) -> Conjunct:
    """Return an atom of a type with a variable as a range over the objects of that type, else `conjunct` itself."""
    match conjunct:
        case Atom(name, (Variable(variable),)) if schema.is_type(name, 1):
            return TypeRange(TypedVariable(variable, (name,), place=conjunct.place))
        case _:
            return conjunct


def order(conditions: Iterable[Conjunct], bound: frozenset[str], schema: Vocabulary) -> list[JoinStep]:
    """Return the look-ups in a good order for the bound variables `bound`, without numbers of facts.

    Raises:
        InputError: a variable is only tested, and no condition finds values for it.
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
        if i in taken:  # an outdated entry with a greater cost
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
    """Return the possible next look-ups, in the order of `steps`.

    These are at most `_MOST_COMPARED` atoms, or else one other look-up.

    Only a few are returned, because the search compares their numbers of matches at every step.
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


Search = Callable[[World, Bindings], Iterator[Bindings]]
Answer = dict[str, Value]
Answering = Callable[[World, Iterable[Bindings]], list[Answer]]


class Lookup:
    """A search through the facts that match an atom with the open variables `finds`."""

    def __init__(self, atom: Atom, schema: Vocabulary, finds: frozenset[str]) -> None:
        first: dict[str, int] = {}
        self._repeated: list[tuple[int, int]] = []
        self._computed: list[tuple[int, Argument]] = []
        getters: list[Argument | None] = []
        self._predicate = atom.predicate
        for position, arg in enumerate(atom.args):
            if isinstance(arg, Variable) and arg.name in finds:
                getters.append(None)
                if first.setdefault(arg.name, position) != position:
                    self._repeated.append((first[arg.name], position))
            elif free_variables(arg).isdisjoint(finds):
                getters.append(compile_argument(arg, schema))
            else:  # computed from the values that the other arguments find
                getters.append(None)
                self._computed.append((position, compile_argument(arg, schema)))
        self._found = tuple(first.items())
        self._single = self._found[0] if len(first) == 1 else None
        self._exact = not (self._repeated or self._computed)
        self._pattern = _pattern(getters, [_name(arg, finds) for arg in atom.args])

    def __call__(self, world: World, bindings: Bindings) -> Iterator[Bindings]:
        """Return an iterator over `bindings` extended by the values of the open variables, for each matching fact."""
        matches = self._matches(world, bindings)
        if self._single is not None:
            name, i = self._single
            return ({**bindings, name: args[i]} for args in matches)
        return (self._extend(bindings, args) for args in matches)

    def answering(self, names: tuple[str, ...]) -> Answering:
        """Return a function that returns the answers for candidates.

        An answer contains the values of the variables `names` for one candidate and one matching fact.
        """
        if self._single is None or not self._exact:
            return lambda world, candidates: [
                {name: found[name] for name in names} for each in candidates for found in self(world, each)
            ]
        (own, i), predicate, pattern = self._single, self._predicate, self._pattern
        if names == (own,):
            return lambda world, candidates: [
                {own: args[i]} for each in candidates for args in world.match(predicate, pattern(world, each))
            ]
        template: Answer = dict.fromkeys(names, "")  # fixes the order of the variables
        others = [name for name in names if name != own]

        def answers(world: World, candidates: Iterable[Bindings]) -> list[Answer]:
            answers: list[Answer] = []
            for each in candidates:
                answer = template.copy()
                for name in others:
                    answer[name] = each[name]
                answers += [{**answer, own: args[i]} for args in world.match(predicate, pattern(world, each))]
            return answers

        return answers

    def size(self, world: World, bindings: Bindings) -> int:
        """Return an upper bound of the number of matching facts."""
        return world.estimate(self._predicate, self._pattern(world, bindings))

    def _matches(self, world: World, bindings: Bindings) -> Iterable[tuple[Value, ...]]:
        matches = world.match(self._predicate, self._pattern(world, bindings))
        if self._exact:
            return matches
        return (args for args in matches if self._agrees(args, world, bindings))

    def _agrees(self, args: tuple[Value, ...], world: World, bindings: Bindings) -> bool:
        if any(args[i] != args[j] for i, j in self._repeated):
            return False
        found = self._extend(bindings, args)
        return all(args[i] == get(world, found) for i, get in self._computed)

    def _extend(self, bindings: Bindings, args: tuple[Value, ...]) -> Answer:
        found = dict(bindings)
        for name, i in self._found:
            found[name] = args[i]
        return found


def _name(arg: Term, finds: frozenset[str]) -> str | None:
    return arg.name if isinstance(arg, Variable) and arg.name not in finds else None


def _pattern(
    getters: Sequence[Argument | None], names: Sequence[str | None]
) -> Callable[[World, Bindings], tuple[Value | None, ...]]:
    """Return a function that returns the pattern of a look-up.

    Most patterns bind one end of an arc to a variable and leave the other end open.
    """
    match getters:
        case [None, None]:
            return lambda _world, _bindings: (None, None)
        case [None, end] if end:
            goal = names[1]
            if goal is not None:
                return lambda _world, bindings: (None, bindings[goal])
            return lambda world, bindings: (None, end(world, bindings))
        case [start, None] if start:
            origin = names[0]
            if origin is not None:
                return lambda _world, bindings: (bindings[origin], None)
            return lambda world, bindings: (start(world, bindings), None)
        case _:
            return lambda world, bindings: tuple([get and get(world, bindings) for get in getters])


def smallest(
    choices: Sequence[tuple[int, Lookup | Search]], world: World, bindings: Bindings
) -> tuple[int, Lookup | Search]:
    """Return the first choice with the fewest matches; the matches of a single choice are not counted."""
    if len(choices) == 1:
        return choices[0]
    found, least = choices[0], -1
    for choice in choices:
        lookup = choice[1]
        size = lookup.size(world, bindings) if isinstance(lookup, Lookup) else 0
        if least < 0 or size < least:
            found, least = choice, size
    return found


def things(variable: TypedVariable) -> Search:
    """Return a search through the objects that the variable ranges over."""
    name, types = variable.name, variable.types or ("object",)

    def search(world: World, bindings: Bindings) -> Iterator[Bindings]:
        found = dict.fromkeys(thing for t in types for thing in world.objects(t))
        return ({**bindings, name: thing} for thing in found)

    return search


def alternatives(branches: Sequence[Search]) -> Search:
    """Return a search that yields the results of all branches in order.

    An error of one branch is raised after all results.
    """

    def search(world: World, bindings: Bindings) -> Iterator[Bindings]:
        failed: InputError | None = None
        for branch in branches:
            try:
                yield from branch(world, bindings)
            except InputError as error:
                failed = failed or error
        if failed is not None:
            raise failed

    return search


def distinct(inner: Search, finds: frozenset[str]) -> Search:
    """Return a search that yields each choice of values for the variables `finds` only once."""
    names = sorted(finds)

    def search(world: World, bindings: Bindings) -> Iterator[Bindings]:
        seen: set[tuple[Value, ...]] = set()
        for found in inner(world, bindings):
            choice = tuple(found[name] for name in names)
            if choice not in seen:
                seen.add(choice)
                yield {**bindings, **dict(zip(names, choice, strict=True))}

    return search

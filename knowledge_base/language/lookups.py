"""Where the values of variables come from: the facts that match an atom, the things of a type."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

from knowledge_base.errors import InputError
from knowledge_base.facts import Value
from knowledge_base.language.expression import Atom, Term, TypedVariable, Variable, free_variables
from knowledge_base.language.terms import Argument, Bindings, compile_argument
from knowledge_base.language.vocabulary import Vocabulary
from knowledge_base.language.world import World

Search = Callable[[World, Bindings], Iterator[Bindings]]
Answer = dict[str, Value]
Answering = Callable[[World, Iterable[Bindings]], list[Answer]]


class Lookup:
    """A search through the facts that match an atom whose variables `finds` are open."""

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
            else:  # computed from what the other arguments find
                getters.append(None)
                self._computed.append((position, compile_argument(arg, schema)))
        self._found = tuple(first.items())
        self._single = self._found[0] if len(first) == 1 else None
        self._exact = not (self._repeated or self._computed)
        self._pattern = _pattern(getters, [_name(arg, finds) for arg in atom.args])

    def __call__(self, world: World, bindings: Bindings) -> Iterator[Bindings]:
        """`bindings` with the values of the open variables, for every fact that matches; looked up one by one."""
        matches = self._matches(world, bindings)
        if self._single is not None:
            name, i = self._single
            return ({**bindings, name: args[i]} for args in matches)
        return (self._extended(bindings, args) for args in matches)

    def answering(self, names: tuple[str, ...]) -> Answering:
        """A function that gives the values of the variables `names` for every candidate and fact that matches it."""
        if self._single is None or not self._exact:
            return lambda world, candidates: [
                {name: found[name] for name in names} for each in candidates for found in self(world, each)
            ]
        (own, i), predicate, pattern = self._single, self._predicate, self._pattern
        if names == (own,):
            return lambda world, candidates: [
                {own: args[i]} for each in candidates for args in world.match(predicate, pattern(world, each))
            ]
        template: Answer = dict.fromkeys(names, "")  # for the order
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
        """At most how many facts match; 0 if the world cannot say so cheaply."""
        estimate = getattr(world, "estimate", None)
        return estimate(self._predicate, self._pattern(world, bindings)) if estimate else 0

    def _matches(self, world: World, bindings: Bindings) -> Iterable[tuple[Value, ...]]:
        matches = world.match(self._predicate, self._pattern(world, bindings))
        if self._exact:
            return matches
        return (args for args in matches if self._agrees(args, world, bindings))

    def _agrees(self, args: tuple[Value, ...], world: World, bindings: Bindings) -> bool:
        if any(args[i] != args[j] for i, j in self._repeated):
            return False
        found = self._extended(bindings, args)
        return all(args[i] == get(world, found) for i, get in self._computed)

    def _extended(self, bindings: Bindings, args: tuple[Value, ...]) -> Answer:
        found = dict(bindings)
        for name, i in self._found:
            found[name] = args[i]
        return found


def _name(arg: Term, finds: frozenset[str]) -> str | None:
    return arg.name if isinstance(arg, Variable) and arg.name not in finds else None


def _pattern(
    getters: Sequence[Argument | None], names: Sequence[str | None]
) -> Callable[[World, Bindings], tuple[Value | None, ...]]:
    """What to look for; most look-ups go from one end of an arc, a variable with that name, to the other."""
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
    """The choice with the fewest matches; the first of them, or the only one without counting."""
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
    """A search through the things that the variable ranges over."""
    name, types = variable.name, variable.types or ("object",)

    def search(world: World, bindings: Bindings) -> Iterator[Bindings]:
        found = dict.fromkeys(thing for t in types for thing in world.objects(t))
        return ({**bindings, name: thing} for thing in found)

    return search


def alternatives(branches: Sequence[Search]) -> Search:
    """All that one of the branches finds, branch by branch; an error of one comes after all others."""

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
    """Only what `inner` finds for the variables `finds`, each choice once."""
    names = sorted(finds)

    def search(world: World, bindings: Bindings) -> Iterator[Bindings]:
        seen: set[tuple[Value, ...]] = set()
        for found in inner(world, bindings):
            choice = tuple(found[name] for name in names)
            if choice not in seen:
                seen.add(choice)
                yield {**bindings, **dict(zip(names, choice, strict=True))}

    return search

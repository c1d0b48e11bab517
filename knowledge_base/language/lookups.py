"""Where the values of variables come from: the facts that match an atom, the things of a type."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from knowledge_base.facts import Value
from knowledge_base.language.expression import Atom, TypedVariable, Variable, free_variables
from knowledge_base.language.terms import Argument, Bindings, compile_argument
from knowledge_base.language.world import World
from knowledge_base.schema import Schema

Search = Callable[[World, Bindings], Iterator[Bindings]]


class Lookup:
    """A search through the facts that match an atom whose variables `finds` are open."""

    def __init__(self, atom: Atom, schema: Schema, finds: frozenset[str]) -> None:
        first: dict[str, int] = {}
        self._repeated: list[tuple[int, int]] = []
        self._computed: list[tuple[int, Argument]] = []
        self._getters: list[Argument | None] = []
        self._predicate = atom.predicate
        for position, arg in enumerate(atom.args):
            if isinstance(arg, Variable) and arg.name in finds:
                self._getters.append(None)
                if first.setdefault(arg.name, position) != position:
                    self._repeated.append((first[arg.name], position))
            elif free_variables(arg).isdisjoint(finds):
                self._getters.append(compile_argument(arg, schema))
            else:  # computed from what the other arguments find
                self._getters.append(None)
                self._computed.append((position, compile_argument(arg, schema)))
        self._found = tuple(first.items())

    def __call__(self, world: World, bindings: Bindings) -> Iterator[Bindings]:
        """`bindings` with the values of the open variables, for every fact that matches."""
        for args in world.match(self._predicate, self._pattern(world, bindings)):
            if all(args[i] == args[j] for i, j in self._repeated):
                found = {**bindings, **{name: args[i] for name, i in self._found}}
                if not self._computed or all(args[i] == get(world, found) for i, get in self._computed):
                    yield found

    def size(self, world: World, bindings: Bindings) -> int:
        """At most how many facts match; 0 if the world cannot say so cheaply."""
        estimate = getattr(world, "estimate", None)
        return estimate(self._predicate, self._pattern(world, bindings)) if estimate else 0

    def _pattern(self, world: World, bindings: Bindings) -> tuple[Value | None, ...]:
        return tuple([get and get(world, bindings) for get in self._getters])


def smallest(
    choices: Sequence[tuple[int, Lookup | Search]], world: World, bindings: Bindings
) -> tuple[int, Lookup | Search]:
    """The choice with the fewest matches; the first of them, or the only one without counting."""
    if len(choices) == 1:
        return choices[0]
    return min(choices, key=lambda c: c[1].size(world, bindings) if isinstance(c[1], Lookup) else 0)


def things(variable: TypedVariable) -> Search:
    """A search through the things that the variable ranges over."""
    name, types = variable.name, variable.types or ("object",)

    def search(world: World, bindings: Bindings) -> Iterator[Bindings]:
        found = dict.fromkeys(thing for t in types for thing in world.objects(t))
        return ({**bindings, name: thing} for thing in found)

    return search


def alternatives(branches: Sequence[Search]) -> Search:
    """All that one of the branches finds, branch by branch."""

    def search(world: World, bindings: Bindings) -> Iterator[Bindings]:
        for branch in branches:
            yield from branch(world, bindings)

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

"""What the language is evaluated on, whoever keeps it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

from knowledge_base.facts import Content, Value
from knowledge_base.language.vocabulary import Vocabulary


class World(Protocol):
    """A state of the world: the store, pending changes on top of it, a planner's state.

    Predicates are the told ones; types as predicates, computed predicates, quantifiers and comparisons are the
    language's affair and are built from these answers. A world that also has `estimate(predicate, pattern) -> int`,
    at most how many facts match, lets conjunctions begin with the rarest. One that has `reference(function, args) ->
    str | None`, where what the function is worth comes from, refuses to have it set. One that has `spend()` is told of
    every effect that is applied on it, and may end that (`bounds`).
    """

    @property
    def schema(self) -> Vocabulary:
        """What may be said about it."""
        ...

    def holds(self, predicate: str, args: tuple[Value, ...]) -> bool:
        """Whether the fact is true."""
        ...

    def match(self, predicate: str, pattern: tuple[Value | None, ...]) -> Iterable[tuple[Value, ...]]:
        """The arguments of all facts that agree with `pattern`; `None` is open; in order of insertion."""
        ...

    def value(self, function: str, args: tuple[Value, ...]) -> Content:
        """What the function is worth; until it is set, what `content.UNSET` says."""
        ...

    def objects(self, type_name: str) -> Iterable[str]:
        """The things of that type or a subtype, in order of insertion."""
        ...

    def type_of(self, name: str) -> str | None:
        """The thing's type; `None` if there is no such thing."""
        ...

"""Questions by their text: parsed and checked once, then evaluated."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import TypeVar

from knowledge_base.facts import Value
from knowledge_base.language.checking.check import Free, check
from knowledge_base.language.checking.inputs import fitted_names, require_condition, require_params
from knowledge_base.language.evaluation.evaluator import Asked, Queried, asked, queried, rows
from knowledge_base.language.evaluation.world import World
from knowledge_base.language.syntax.expression import Expression, free_variables
from knowledge_base.language.syntax.identity_cache import IdentityCache
from knowledge_base.language.syntax.text import parse_condition

_parsed = lru_cache(maxsize=1024)(parse_condition)


_MOST_KEPT = 4096

_Key = tuple[str | int, ...]
"""A text, or the identity of an expression, and the names of the parameters."""
_K = TypeVar("_K")
_T = TypeVar("_T")


def _keep(kept: dict[_K, _T], key: _K, made: _T) -> None:
    if len(kept) >= _MOST_KEPT:
        kept.clear()
    kept[key] = made


class Questions:
    """Parses texts and checks them against the schema and the known things; always of the same schema.

    A question that passed is not checked again. A thing that it names may be removed later; then nothing holds of it.
    """

    def __init__(self) -> None:
        self._asked: dict[str | int, Asked] = {}
        self._queried: dict[_Key, Queried] = {}
        self._given: dict[_Key, tuple[Expression, tuple[str, ...] | None]] = {}
        self._passed: IdentityCache[Expression, set[tuple[Free, frozenset[str]]]] = IdentityCache(1024)

    def given(
        self, text: str | Expression, params: Mapping[str, Value] | None, world: World, free: Free
    ) -> Mapping[str, Value]:
        """Parameters by the names that the question has for them; fitted once for each set of names.

        Raises:
            UnknownNameError: the question has no such variable.
            InputError: as for `condition` or `query`; or these are no parameters.
        """
        if params is None:
            return {}
        require_params(params)
        if not params:
            return params
        key = (text if isinstance(text, str) else id(text), *params)
        found = self._given.get(key)
        if found is None:
            require_condition(text)
            e = _parsed(text) if isinstance(text, str) else text
            known = [name if name in free_variables(e) else name.lower() for name in params]
            self._checked(e, dict.fromkeys(known, ""), world, free)  # what is wrong with the text comes first
            names = fitted_names(e, params)
            found = e, None if names == tuple(params) else names
            _keep(self._given, key, found)
        _, other = found
        return params if other is None else dict(zip(other, params.values(), strict=True))

    def ask(self, text: str | Expression, params: Mapping[str, Value], world: World) -> bool:
        """Whether the condition is true of `world`; errors as for `condition`."""
        key = text if isinstance(text, str) else id(text)  # which parameters are missing it finds out itself
        found = self._asked.get(key)
        if found is None:
            found = asked(self.condition(text, params, world), world.schema)
            _keep(self._asked, key, found)
        return found.holds(world, params)

    def answers(self, text: str | Expression, params: Mapping[str, Value], world: World) -> list[dict[str, Value]]:
        """The values that make the query true of `world`; errors as for `query`."""
        key = (text if isinstance(text, str) else id(text), *params)
        found = self._queried.get(key)
        if found is None:
            found = queried(self.query(text, params, world), world.schema, params)
            _keep(self._queried, key, found)
        return found.answers(world, params)

    def rows(self, text: str | Expression, params: Mapping[str, Value], world: World) -> Iterator[dict[str, Value]]:
        """The answers one by one; errors as for `query`."""
        return rows(self.query(text, params, world), world, params)

    def condition(self, text: str | Expression, params: Mapping[str, Value], world: World) -> Expression:
        """The condition, all of whose free variables are in `params`.

        Raises:
            ParseError: the text is no condition.
            UnknownNameError: an undeclared predicate, function, type, variable or object.
            SchemaError: a wrong number of arguments or a type that can never fit.
        """
        return self._checked(text, params, world, "error")

    def query(self, text: str | Expression, params: Mapping[str, Value], world: World) -> Expression:
        """The query, which asks for its free variables that are not in `params`.

        Raises:
            InputError: as for `condition`, or a variable occurs only under `not` or in a comparison.
        """
        return self._checked(text, params, world, "answers")

    def _checked(self, text: str | Expression, params: Mapping[str, Value], world: World, free: Free) -> Expression:
        require_condition(text)
        e = _parsed(text) if isinstance(text, str) else text
        passed = self._passed.find(e, world.schema)
        if passed is None:
            passed = self._passed.keep(e, world.schema, set())
        kind = (free, frozenset(params))
        if kind not in passed:
            check(e, world.schema, dict.fromkeys(params), free, objects=_Things(world))
            passed.add(kind)
        return e


class _Things(Mapping[str, str]):
    """The things of a world with their types, looked up one by one."""

    def __init__(self, world: World) -> None:
        self._world = world

    def __getitem__(self, name: str) -> str:
        found = self._world.type_of(name)
        if found is None:
            raise KeyError(name)
        return found

    def __iter__(self) -> Iterator[str]:
        return iter(self._world.objects("object"))

    def __len__(self) -> int:
        return sum(1 for _ in self)

"""Queries: each text is parsed and checked only the first time; prepared queries receive new values at each call."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import TypeVar

from knowledge_base.errors import InputError
from knowledge_base.facts import Value
from knowledge_base.language.checking.check import Free, check
from knowledge_base.language.checking.inputs import fitted_names, require_condition, require_params
from knowledge_base.language.evaluation.evaluator import Asked, Queried, asked, queried, rows
from knowledge_base.language.evaluation.world_protocol import World
from knowledge_base.language.syntax.expression import Expression, free_variables
from knowledge_base.language.syntax.identity_cache import IdentityCache
from knowledge_base.language.syntax.text import parse_condition
from knowledge_base.user_objects import shown
from knowledge_base.world.read_write_lock import ReadWriteLock
from knowledge_base.world.state import WorldState

Binding = dict[str, Value]
"""One answer of a query: names of variables (without `?`) with their values."""

_MOST_KEPT = 4096
_parsed = lru_cache(maxsize=1024)(parse_condition)
_Key = tuple[str | int, ...]
"""A text, or the identity of an expression; then the names of the parameters."""
_K = TypeVar("_K")
_T = TypeVar("_T")


def _keep(kept: dict[_K, _T], key: _K, made: _T) -> None:
    if len(kept) >= _MOST_KEPT:
        kept.clear()
    kept[key] = made


class Questions:
    """Parser and checker of query texts for one schema and the known objects.

    A query that passed the check is not checked again, not even after the removal of an object in the query. No fact
    about a removed object is true.
    """

    def __init__(self) -> None:
        self._asked: dict[str | int, Asked] = {}
        self._queried: dict[_Key, Queried] = {}
        self._given: dict[_Key, tuple[Expression, tuple[str, ...] | None]] = {}
        self._passed: IdentityCache[Expression, set[tuple[Free, frozenset[str]]]] = IdentityCache(1024)

    def given(
        self, text: str | Expression, params: Mapping[str, Value] | None, world: World, free: Free
    ) -> Mapping[str, Value]:
        """Return the parameters under the names of the query's variables.

        The names are matched only the first time for each set of names.

        Raises:
            UnknownNameError: a parameter is not a variable of the query.
            InputError: as for `condition` or `query`; or `params` is not a mapping to values.
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
            self._check(e, dict.fromkeys(known, ""), world, free)  # first report errors of the text
            names = fitted_names(e, params)
            found = e, None if names == tuple(params) else names
            _keep(self._given, key, found)
        _, other = found
        return params if other is None else dict(zip(other, params.values(), strict=True))

    def ask(self, text: str | Expression, params: Mapping[str, Value], world: World) -> bool:
        """Return whether the condition is true in `world`; errors as for `condition`."""
        key = text if isinstance(text, str) else id(text)  # the evaluation checks the parameters
        found = self._asked.get(key)
        if found is None:
            found = asked(self.condition(text, params, world), world.schema)
            _keep(self._asked, key, found)
        return found.holds(world, params)

    def answers(self, text: str | Expression, params: Mapping[str, Value], world: World) -> list[Binding]:
        """Return the bindings that make the query true in `world`; errors as for `query`."""
        key = (text if isinstance(text, str) else id(text), *params)
        found = self._queried.get(key)
        if found is None:
            found = queried(self.query(text, params, world), world.schema, params)
            _keep(self._queried, key, found)
        return found.answers(world, params)

    def rows(self, text: str | Expression, params: Mapping[str, Value], world: World) -> Iterator[Binding]:
        """Return an iterator over the answers; errors as for `query`."""
        return rows(self.query(text, params, world), world, params)

    def condition(self, text: str | Expression, params: Mapping[str, Value], world: World) -> Expression:
        """Return the condition; `params` must contain all free variables of the condition.

        Raises:
            ParseError: the text is not a condition.
            UnknownNameError: an undeclared predicate, function, type, variable or object.
            SchemaError: a wrong number of arguments, or a type that no object can match.
        """
        return self._check(text, params, world, "error")

    def query(self, text: str | Expression, params: Mapping[str, Value], world: World) -> Expression:
        """Return the query for the free variables that `params` does not contain.

        Raises:
            InputError: as for `condition`, or a variable occurs only under `not` or in a comparison.
        """
        return self._check(text, params, world, "answers")

    def _check(self, text: str | Expression, params: Mapping[str, Value], world: World, free: Free) -> Expression:
        require_condition(text)
        e = _parsed(text) if isinstance(text, str) else text
        passed = self._passed.find(e, world.schema)
        if passed is None:
            passed = self._passed.keep(e, world.schema, set())
        kind = (free, frozenset(params))
        if kind not in passed:
            check(e, world.schema, dict.fromkeys(params), free, objects=_Things(world))
            world.schema.require_defined(e)
            passed.add(kind)
        return e


class Prepared:
    """A query with parameters; `View.prepare` creates it.

    Args:
        text: the query.
        parameters: the variables that receive a value at each call, in this order.
        state: the world; its changes do not replace this object.
        lock: lock of the world.
        questions: parses and checks the text.

    Raises:
        ParseError, UnknownNameError, SchemaError, InputError: as for `View.query`.
    """

    def __init__(
        self,
        text: str | Expression,
        parameters: tuple[str, ...],
        state: WorldState,
        lock: ReadWriteLock,
        questions: Questions,
    ) -> None:
        params = dict.fromkeys(parameters, "")
        require_params(params)
        if len(params) < len(parameters):
            raise InputError(f"the parameters are named once each, not {shown(parameters)}")
        with lock:
            given = questions.given(text, params, state, "answers")
            e = questions.query(text, given, state)
        self.text = text
        self.parameters = parameters
        self._names = tuple(given)
        self._state = state
        self._lock = lock
        condition = asked(e, state.schema)
        self._holds = condition.test if condition.free.issubset(given) else condition.holds
        self._query = queried(e, state.schema, given)

    def ask(self, *values: Value) -> bool:
        """Return whether the query is true for these values of its parameters.

        Raises:
            UnknownNameError: the query has other free variables.
            InputError, SchemaError: too few or too many values, or an object that is not a value.
        """
        given = self._given(values)
        with self._lock:
            return self._holds(self._state, given)

    def query(self, *values: Value) -> list[Binding]:
        """Return the bindings of the other free variables as `View.query` does; value errors as for `ask`."""
        given = self._given(values)
        with self._lock:
            return self._query.answers(self._state, given)

    def _given(self, values: tuple[Value, ...]) -> dict[str, Value]:
        """Return the checked values by the names of the parameters."""
        if len(self._names) != len(values):
            names = ", ".join(f"?{name}" for name in self._names) or "none"
            raise InputError(f"the question takes the values of its parameters ({names}), not {len(values)} values")
        given = dict(zip(self._names, values))  # noqa: B905  `strict` costs as much as the rest
        for value in values:
            if type(value) is not str:
                require_params(given)
                break
        return given


class _Things(Mapping[str, str]):
    """The objects of a world with their types; each type is read only when it is needed."""

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

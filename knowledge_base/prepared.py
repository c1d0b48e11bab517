"""Questions made ready for one world: read and checked once, asked again and again with other values."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from threading import RLock
from typing import Any

from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.facts import Value
from knowledge_base.inputs import require_params, shown
from knowledge_base.language.asking import asked, queried
from knowledge_base.language.author import MISSING
from knowledge_base.language.expression import Expression
from knowledge_base.language.memory import IdentityCache
from knowledge_base.language.source import Source, condition_source, query_source
from knowledge_base.questions import Questions
from knowledge_base.state import WorldState

Binding = dict[str, Value]
"""One answer of a query: variables' names (without `?`) with their values."""
Asking = Callable[..., bool]
Querying = Callable[..., list[Binding]]

_Key = tuple[str | int, ...]
_MOST_KEPT = 4096


@dataclass(frozen=True, slots=True)
class Prepared:
    """A question with a place for each of its parameters, made by `prepare`.

    Attributes:
        text: the question.
        parameters: the variables whose values are given, in this order.
        query: gives the values of the other variables, as the method of the knowledge base does.
        ask: whether it is true; an error if it has other variables.
    """

    text: str | Expression
    parameters: tuple[str, ...]
    query: Querying
    ask: Asking


class ReadyQuestions:
    """The questions that were asked of a world, as functions of their parameters' values.

    Plain ones are answered by generated code (`language.source`), the others by closures.

    Args:
        state: the world; it stays the same object while it changes.
        lock: held while it changes.
        questions: reads and checks texts.
    """

    def __init__(self, state: WorldState, lock: RLock, questions: Questions) -> None:
        self._state = state
        self._lock = lock
        self._questions = questions
        self._asks: dict[_Key, tuple[object, Asking]] = {}  # a question lives as long as its identity is a key
        self._queries: dict[_Key, tuple[object, Querying]] = {}

    def asking(self, text: str | Expression, params: Mapping[str, Value]) -> Asking:
        """A function of the parameters' values that says whether the condition is true.

        Raises:
            UnknownNameError, SchemaError, InputError: as for `View.ask`.
        """
        key = (text if type(text) is str else id(text), *params)
        found = self._asks.get(key)
        if found is None:
            with self._lock:
                given = self._questions.given(text, params, self._state, "error")
                found = self._asks[key] = text, self._ask(text, given)
                _limit(self._asks)
        return found[1]

    def querying(self, text: str | Expression, params: Mapping[str, Value]) -> Querying:
        """A function of the parameters' values that gives those of the other free variables.

        Raises:
            UnknownNameError, SchemaError, InputError: as for `View.query`.
        """
        key = (text if type(text) is str else id(text), *params)
        found = self._queries.get(key)
        if found is None:
            with self._lock:
                given = self._questions.given(text, params, self._state, "answers")
                found = self._queries[key] = text, self._query(text, given)
                _limit(self._queries)
        return found[1]

    def prepared(self, text: str | Expression, parameters: Iterable[str]) -> Prepared:
        """The question with a place for each of its parameters; errors as for `querying`."""
        names = tuple(parameters)
        params = dict.fromkeys(names, "")
        require_params(params)
        if len(params) < len(names):
            raise InputError(f"the parameters are named once each, not {shown(names)}")
        query = self.querying(text, params)
        try:
            ask = self.asking(text, params)
        except UnknownNameError:  # it has more variables: that is said to who asks

            def ask(*values: Value) -> bool:
                return self.asking(text, params)(*values)

        return Prepared(text, names, query, ask)

    def _ask(self, text: str | Expression, params: Mapping[str, Value]) -> Asking:
        names, state, lock = tuple(params), self._state, self._lock
        e = self._questions.condition(text, params, state)
        source = _source(_conditions, condition_source, e, state, names)
        if source is not None:
            return self._bound(source, names)
        holds = asked(e, state.schema).holds

        def ask(*values: Value) -> bool:
            given = _given(names, values)
            with lock:
                return holds(state, given)

        return ask

    def _query(self, text: str | Expression, params: Mapping[str, Value]) -> Querying:
        names, state, lock = tuple(params), self._state, self._lock
        e = self._questions.query(text, params, state)
        source = _source(_queries, query_source, e, state, names)
        if source is not None:
            return self._bound(source, names)
        answers = queried(e, state.schema, names).answers

        def query(*values: Value) -> list[Binding]:
            given = _given(names, values)
            with lock:
                return answers(state, given)

        return query

    def _bound(self, source: Source, names: tuple[str, ...]) -> Callable[..., Any]:
        def judge(values: tuple[Value, ...]) -> None:
            _given(names, tuple(value for value in values if value is not MISSING))

        return source.bound(self._state, lock=self._lock, judge=judge)


def _given(names: tuple[str, ...], values: tuple[Value, ...]) -> dict[str, Value]:
    """The values by the parameters' names, judged."""
    if len(names) != len(values):
        said = ", ".join(f"?{name}" for name in names) or "none"
        raise InputError(f"the question takes the values of its parameters ({said}), not {len(values)} values")
    given = dict(zip(names, values, strict=True))
    require_params(given)
    return given


_Sources = dict[tuple[str, ...], Source | None]
_conditions: IdentityCache[Expression, _Sources] = IdentityCache()
_queries: IdentityCache[Expression, _Sources] = IdentityCache()


def _source(
    cache: IdentityCache[Expression, _Sources],
    write: Callable[..., Source | None],
    e: Expression,
    state: WorldState,
    names: tuple[str, ...],
) -> Source | None:
    """Written once for all worlds of a schema, past ones too."""
    schema = state.schema
    written = cache.find(e, schema)
    if written is None:
        written = cache.keep(e, schema, {})
    if names not in written:
        written[names] = write(e, schema, names)
    return written[names]


def _limit(kept: dict[_Key, Any]) -> None:
    if len(kept) > _MOST_KEPT:
        kept.clear()

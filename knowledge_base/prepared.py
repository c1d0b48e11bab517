"""Questions made ready for one world: read and checked once, asked again and again with other values."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.facts import Value
from knowledge_base.language.check import Free
from knowledge_base.language.code_generation import MISSING
from knowledge_base.language.evaluator import asked, queried
from knowledge_base.language.expression import Expression
from knowledge_base.language.generated_code import GeneratedSource, condition_source, query_source
from knowledge_base.language.identity_cache import IdentityCache
from knowledge_base.language.inputs import require_params, shown
from knowledge_base.questions import Questions
from knowledge_base.world.read_write_lock import ReadWriteLock
from knowledge_base.world.schema import Schema
from knowledge_base.world.state import WorldState

Binding = dict[str, Value]
"""One answer of a query: variables' names (without `?`) with their values."""
Asking = Callable[..., bool]
Querying = Callable[..., list[Binding]]

Names = tuple[str, ...]

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


@dataclass(frozen=True, slots=True)
class _Way:
    """A way to ask: is it true, or who makes it true.

    Attributes:
        free: what free variables without a value are.
        checked: reads and checks a text.
        write: makes a plain question source.
        closure: a function of world and bindings that answers any.
        sources: what was written, once for all worlds of a schema, past ones too.
    """

    free: Free
    checked: Callable[[Questions, str | Expression, Mapping[str, Value], WorldState], Expression]
    write: Callable[[Expression, Schema, Names], GeneratedSource | None]
    closure: Callable[[Expression, Schema, Names], Callable[[WorldState, Mapping[str, Value]], Any]]
    sources: IdentityCache[Expression, dict[Names, GeneratedSource | None]] = field(default_factory=IdentityCache)

    def source(self, e: Expression, schema: Schema, names: Names) -> GeneratedSource | None:
        """The source of the question; `None` if it is not plain."""
        written = self.sources.find(e, schema)
        if written is None:
            written = self.sources.keep(e, schema, {})
        if names not in written:
            written[names] = self.write(e, schema, names)
        return written[names]


_ASK = _Way("error", Questions.condition, condition_source, lambda e, schema, _: asked(e, schema).holds)
_QUERY = _Way("answers", Questions.query, query_source, lambda e, schema, names: queried(e, schema, names).answers)


class _Ready:
    """The questions that were asked of a world in one way, as functions of their parameters' values."""

    def __init__(self, way: _Way, state: WorldState, lock: ReadWriteLock, questions: Questions) -> None:
        self._way = way
        self._state = state
        self._lock = lock
        self._questions = questions
        self._kept: dict[_Key, tuple[object, Callable[..., Any]]] = {}  # who lives has its identity for itself

    def of(self, text: str | Expression, params: Mapping[str, Value]) -> Callable[..., Any]:
        """The function for that question; made when it is asked for the first time."""
        key = (text if type(text) is str else id(text), *params)
        found = self._kept.get(key)
        if found is None:
            with self._lock:
                if len(self._kept) >= _MOST_KEPT:
                    self._kept.clear()
                given = self._questions.given(text, params, self._state, self._way.free)
                found = self._kept[key] = text, self._made(text, given)
        return found[1]

    def _made(self, text: str | Expression, params: Mapping[str, Value]) -> Callable[..., Any]:
        way, state, lock, names = self._way, self._state, self._lock, tuple(params)
        e = way.checked(self._questions, text, params, state)

        def judge(values: tuple[Value, ...]) -> None:
            _given(names, tuple(value for value in values if value is not MISSING))

        source = way.source(e, state.schema, names)
        if source is not None:
            return source.bound(state, lock=lock, judge=judge)
        answer = way.closure(e, state.schema, names)

        def question(*values: Value) -> Any:
            given = _given(names, values)
            with lock:
                return answer(state, given)

        return question


class ReadyQuestions:
    """The questions that were asked of a world.

    Plain ones are answered by generated code (`language.source`), the others by closures.

    Args:
        state: the world; it stays the same object while it changes.
        lock: held while it changes.
        questions: reads and checks texts.

    Attributes:
        asking: gives, for a text and parameters, a function of their values that says whether the condition is true;
            errors as for `View.ask`.
        querying: one that gives the values of the other free variables; errors as for `View.query`.
    """

    def __init__(self, state: WorldState, lock: ReadWriteLock, questions: Questions) -> None:
        self.asking: Callable[..., Asking] = _Ready(_ASK, state, lock, questions).of
        self.querying: Callable[..., Querying] = _Ready(_QUERY, state, lock, questions).of

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


def _given(names: tuple[str, ...], values: tuple[Value, ...]) -> dict[str, Value]:
    """The values by the parameters' names, judged."""
    if len(names) != len(values):
        said = ", ".join(f"?{name}" for name in names) or "none"
        raise InputError(f"the question takes the values of its parameters ({said}), not {len(values)} values")
    given = dict(zip(names, values, strict=True))
    require_params(given)
    return given

"""Prepared question: read and checked once, asked again and again with other values."""

from __future__ import annotations

from knowledge_base.errors import InputError
from knowledge_base.facts import Value
from knowledge_base.language.checking.inputs import require_params, shown
from knowledge_base.language.evaluation.evaluator import asked, queried
from knowledge_base.language.syntax.expression import Expression
from knowledge_base.questions import Questions
from knowledge_base.world.read_write_lock import ReadWriteLock
from knowledge_base.world.state import WorldState

Binding = dict[str, Value]
"""One answer of a query: variables' names (without `?`) with their values."""


class Prepared:
    """A question with a place for each of its parameters, made by `View.prepare`.

    Args:
        text: the question.
        parameters: the variables whose values are given, in this order.
        state: the world; it stays the same object while it changes.
        lock: that of the world.
        questions: reads and checks the text.

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
        """Whether the question is true for these values of its parameters.

        Raises:
            UnknownNameError: it has other free variables.
            InputError, SchemaError: the values are too few, too many, or no values.
        """
        given = self._given(values)
        with self._lock:
            return self._holds(self._state, given)

    def query(self, *values: Value) -> list[Binding]:
        """The values of its other free variables, as `View.query` gives them; errors for the values as for `ask`."""
        given = self._given(values)
        with self._lock:
            return self._query.answers(self._state, given)

    def _given(self, values: tuple[Value, ...]) -> dict[str, Value]:
        """The values by the parameters' names, checked."""
        if len(self._names) != len(values):
            said = ", ".join(f"?{name}" for name in self._names) or "none"
            raise InputError(f"the question takes the values of its parameters ({said}), not {len(values)} values")
        given = dict(zip(self._names, values, strict=True))
        for value in values:
            if type(value) is not str:
                require_params(given)
                break
        return given

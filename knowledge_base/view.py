"""View: all questions about a world, present or past."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import islice

from knowledge_base.errors import ConflictError, InputError
from knowledge_base.exchange import to_json
from knowledge_base.facts import Content, Fact, Value
from knowledge_base.language.checking.inputs import shown
from knowledge_base.language.evaluation.explanation import Explanation, explain
from knowledge_base.language.evaluation.query_plan import QueryPlan, plan_query
from knowledge_base.language.evaluation.world import BoundedWorld, Bounds, Meter
from knowledge_base.language.syntax.expression import TRUE, Expression
from knowledge_base.pddl.problem_text import Metric
from knowledge_base.pddl.writer import problem_to_text
from knowledge_base.questions import Binding, Prepared, Questions
from knowledge_base.world.graph import Graph, WorldGraph
from knowledge_base.world.overlay import Overlay
from knowledge_base.world.read_write_lock import ReadWriteLock
from knowledge_base.world.schema import Schema
from knowledge_base.world.state import WorldState

_TOGETHER = 100
"""Answers that a stream finds each time it takes the lock."""


class View:
    """Questions about a world, from several threads; each answer is a finished list about one version.

    It is itself a `World` (`schema`, `holds`, `match`, `value`, `objects`, `type_of`).
    """

    def __init__(self, state: WorldState, version: int) -> None:
        self._lock = ReadWriteLock()
        self._state = state
        self._version = version
        self._questions = Questions()
        self._graph: WorldGraph | None = None

    @property
    def schema(self) -> Schema:
        """Schema of the world."""
        return self._state.schema

    @property
    def version(self) -> int:
        """Number of changes committed before."""
        return self._version

    @property
    def graph(self) -> Graph:
        """The world as a graph, read-only; see `world.graph` for its form.

        The first access makes it. That of a `KnowledgeBase` follows every commit from then on; other threads must not
        commit while it is being walked.
        """
        with self._lock:
            if self._graph is None:
                self._graph = WorldGraph(self._state)
            return self._graph.view

    def query(
        self,
        text: str | Expression,
        params: Mapping[str, Value] | None = None,
        limit: int | None = None,
        bounds: Bounds | None = None,
    ) -> list[Binding]:
        """Return the values of the free variables that make the text true, each choice once.

        Args:
            text: a condition such as `(and (on ?o ?table) (cup ?o))`.
            params: variables that have a value already; they are not part of the answers.
            limit: most answers; the search ends with the last of them.
            bounds: work, seconds and cancellation that end the search with an error.

        Raises:
            OutOfBoundsError: the search exceeds its bounds, or was cancelled.
            ParseError: the text is not a condition.
            UnknownNameError: an undeclared predicate, function or type, an unknown thing, or a parameter that the text
                does not have.
            SchemaError: a wrong number of arguments or a type that can never fit.
            InputError: a variable occurs only under `not` or in a comparison.
        """
        if bounds is None is limit:
            with self._lock:
                given = self._questions.given(text, params, self._state, "answers")
                return self._questions.answers(text, given, self._state)
        return list(islice(self.stream(text, params, bounds=bounds), _whole(limit)))

    def stream(
        self, text: str | Expression, params: Mapping[str, Value] | None = None, *, bounds: Bounds | None = None
    ) -> Iterator[Binding]:
        """Return the answers of `query` in the same order, each when it is found.

        Other threads may query and change the knowledge between two answers. An error about candidates that cannot be
        computed comes after all answers.

        Raises:
            ConflictError: a change was committed before the last answer; `at` gives a world that stays unchanged.
            InputError: as for `query`.
        """
        meter = Meter(bounds)
        with self._lock, meter.over(text):
            params = self._questions.given(text, params, self._state, "answers")
            found = self._questions.rows(text, params, BoundedWorld(self._state, meter))
        return self._streamed(found, text, meter)

    def _streamed(self, found: Iterator[Binding], text: str | Expression, meter: Meter) -> Iterator[Binding]:
        version, more = self._version, True
        while more:
            answers: list[Binding] = []
            wrong: InputError | None = None
            with self._lock:
                if self._version != version:
                    said = "a change was committed while the answers were read; ask kb.at(version=kb.version)"
                    raise ConflictError(said)
                try:
                    with meter.over(text):
                        for answer in islice(found, _TOGETHER):
                            answers.append(answer)  # noqa: PERF402  answers before an error count
                except InputError as error:
                    wrong = error
            yield from answers
            if wrong is not None:
                raise wrong
            more = len(answers) == _TOGETHER

    def ask(
        self, text: str | Expression, params: Mapping[str, Value] | None = None, bounds: Bounds | None = None
    ) -> bool:
        """Whether the text is true; errors as for `query`, and a free variable without a value is one."""
        if bounds is None:
            with self._lock:
                given = self._questions.given(text, params, self._state, "error")
                return self._questions.ask(text, given, self._state)
        meter = Meter(bounds)
        with self._lock, meter.over(text):
            given = self._questions.given(text, params, self._state, "error")
            return self._questions.ask(text, given, BoundedWorld(self._state, meter))

    def prepare(self, text: str | Expression, *parameters: str) -> Prepared:
        """Prepare a question for repeated use: `kb.prepare("(on ?x ?place)", "place").query("table")`.

        The text is parsed and checked now; the question takes values alone, in the order of the parameters' names.

        Raises:
            ParseError, UnknownNameError, SchemaError, InputError: as for `query`.
        """
        return Prepared(text, parameters, self._state, self._lock, self._questions)

    def explain(
        self, text: str | Expression, params: Mapping[str, Value] | None = None, *, bounds: Bounds | None = None
    ) -> Explanation:
        """Why the text is true or false; errors as for `ask`."""
        meter = Meter(bounds)
        with self._lock, meter.over(text):
            params = self._questions.given(text, params, self._state, "error")
            world = self._state if bounds is None else BoundedWorld(self._state, meter)
            return explain(self._questions.condition(text, params, self._state), world, params)

    def explain_query(self, text: str | Expression, params: Mapping[str, Value] | None = None) -> QueryPlan:
        """The look-ups of the query in the order in which they would run now; errors as for `query`."""
        with self._lock:
            params = self._questions.given(text, params, self._state, "answers")
            return plan_query(self._questions.query(text, params, self._state), self._state, params)

    def overlay(self) -> Overlay:
        """Return a world of pending changes on top of this one, which stays unchanged."""
        return Overlay(self)

    def snapshot(self) -> WorldState:
        """The world as it is now, latest values of sources included, as a copy that nothing changes."""
        with self._lock:
            return self._state.copy(fed=True)

    def to_json(self) -> str:
        """All of it as JSON, schema and version included; `KnowledgeBase.from_json` reads it back."""
        with self._lock:
            return to_json(self._state, self._version)

    def to_pddl(
        self, domain: str, name: str = "world", goal: str | Expression | None = None, metric: Metric | None = None
    ) -> str:
        """All of it as a PDDL problem for the domain of that name, which is not written.

        Args:
            domain: name of the domain.
            name: name of the problem.
            goal: condition to reach, if any.
            metric: quantity that the best plan minimises or maximises, if any.

        Raises:
            InputError: as for `ask`, for the goal; and a name or number that PDDL cannot spell.
        """
        with self._lock:
            wanted = TRUE if goal is None else self._questions.condition(goal, {}, self._state)
            return problem_to_text(self._state, name, domain, wanted, metric)

    def nodes(self) -> dict[str, str]:
        """All things with their types, in order of insertion."""
        with self._lock:
            return dict(self._state.nodes)

    def facts(self) -> list[Fact]:
        """All facts, predicate by predicate, in order of insertion."""
        with self._lock:
            return list(self._state.facts)

    def values(self) -> dict[Fact, Content]:
        """Values that functions were set to."""
        with self._lock:
            return dict(self._state.values)

    def holds(self, predicate: str, args: tuple[Value, ...]) -> bool:
        """Whether the fact is true."""
        with self._lock:
            return self._state.holds(predicate, args)

    def match(self, predicate: str, pattern: tuple[Value | None, ...]) -> list[tuple[Value, ...]]:
        """The arguments of all facts that agree with `pattern`; `None` is open; in order of insertion."""
        with self._lock:
            return list(self._state.match(predicate, pattern))

    def estimate(self, predicate: str, pattern: tuple[Value | None, ...]) -> int:
        """At most how many facts agree with `pattern`, without looking through them."""
        with self._lock:
            return self._state.estimate(predicate, pattern)

    def value(self, function: str, args: tuple[Value, ...]) -> Content:
        """Value of the function; until it is set 0, `""`, `False` or `()`, by its type.

        Raises:
            UnknownNameError: there is no such function.
        """
        with self._lock:
            return self._state.value(function, args)

    def reference(self, function: str, args: tuple[Value, ...]) -> str | None:
        """Reference of the source that feeds the function, if there is one."""
        with self._lock:
            return self._state.reference(function, args)

    def objects(self, type_name: str) -> list[str]:
        """The things of that type or a subtype, in order of insertion.

        Raises:
            UnknownNameError: there is no such type.
        """
        with self._lock:
            return self._state.objects(type_name)

    def type_of(self, name: str) -> str | None:
        """The thing's type; `None` if there is no such thing."""
        with self._lock:
            return self._state.type_of(name)


def _whole(limit: int | None) -> int | None:
    if limit is not None and (isinstance(limit, bool) or not isinstance(limit, int) or limit < 0):
        raise InputError(f"a limit is a whole number, 0 or more, not {shown(limit)}")
    return limit

"""View: all queries of a world, present or past."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import islice
from typing import TYPE_CHECKING

from knowledge_base.errors import ConflictError, InputError, SchemaError
from knowledge_base.exchange import to_json
from knowledge_base.facts import Content, Delta, Fact, Value
from knowledge_base.language.checking.vocabulary import Signature
from knowledge_base.language.evaluation.explanation import Explanation, explain
from knowledge_base.language.evaluation.query_plan import QueryPlan, plan_query
from knowledge_base.language.evaluation.world_protocol import BoundedWorld, Bounds, Meter, WorldDefaults
from knowledge_base.language.syntax.expression import TRUE, Expression
from knowledge_base.notebook import svg_of
from knowledge_base.pddl.problem_text import Metric
from knowledge_base.pddl.writer import problem_to_text
from knowledge_base.questions import Binding, Prepared, Questions
from knowledge_base.spelling import number_text
from knowledge_base.user_objects import shown
from knowledge_base.world.overlay import Overlay
from knowledge_base.world.read_write_lock import ReadWriteLock
from knowledge_base.world.schema import Schema
from knowledge_base.world.state import WorldState

if TYPE_CHECKING:
    from knowledge_base.world.graph import Graph, WorldGraph

_TOGETHER = 100
"""Number of answers that a stream computes during one acquisition of the lock."""


class View(WorldDefaults):
    """Queries of a world from several threads; each result is a complete list for one version.

    A view is itself a `World`.
    """

    _repr_svg_ = svg_of("world")

    def __init__(self, state: WorldState, version: int) -> None:
        self._lock = ReadWriteLock()
        self._state = state
        self._version = version
        self._questions = Questions()
        self._graph: WorldGraph | None = None
        self._checked: set[tuple[str, int]] = set()

    @property
    def schema(self) -> Schema:
        """Schema of the world."""
        return self._state.schema

    @property
    def version(self) -> int:
        """Number of the version, which equals the number of changes committed so far."""
        return self._version

    @property
    def graph(self) -> Graph:
        """The world as a read-only graph; `world.graph` describes its nodes and arcs.

        The first access builds the graph. In a `KnowledgeBase`, every later commit updates the graph; other threads
        must not commit while a caller iterates over the graph.
        """
        with self._lock:
            if self._graph is None:
                from knowledge_base.world.graph import WorldGraph  # noqa: PLC0415  loads networkx

                self._graph = WorldGraph(self._state)
            return self._graph.view

    def query(
        self,
        text: str | Expression,
        params: Mapping[str, Value] | None = None,
        limit: int | None = None,
        bounds: Bounds | None = None,
    ) -> list[Binding]:
        """Return the bindings of the free variables that make the condition true, each binding once.

        Args:
            text: a condition such as `(and (on ?o ?table) (cup ?o))`.
            params: variables with a fixed value; the answers do not contain them.
            limit: maximum number of answers; the search ends after this number.
            bounds: limits of work and seconds, and a cancellation; each limit ends the search with an error.

        Raises:
            OutOfBoundsError: the search exceeds its bounds, or is cancelled.
            ParseError: the text is not a condition.
            UnknownNameError: an undeclared predicate, function or type, an unknown object, or a parameter that is not a
                variable of the text.
            SchemaError: a wrong number of arguments, or a type that no object can match.
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
        """Return an iterator over the answers of `query` in the same order; each answer is available when it is found.

        Other threads may query and change the knowledge base between two answers. An error about candidates without a
        computable value is raised after all answers.

        Raises:
            ConflictError: a change was committed before the last answer; use `at` to query a fixed version.
            InputError: as for `query`.
        """
        meter = Meter(bounds)
        with self._lock, meter.over(text):
            params = self._questions.given(text, params, self._state, "answers")
            found = self._questions.rows(text, params, BoundedWorld(self._state, meter))
        return self._stream(found, text, meter)

    def _stream(self, found: Iterator[Binding], text: str | Expression, meter: Meter) -> Iterator[Binding]:
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
        """Return whether the condition is true.

        Errors as for `query`; a free variable without a value is also an error.
        """
        if bounds is None:
            with self._lock:
                given = self._questions.given(text, params, self._state, "error")
                return self._questions.ask(text, given, self._state)
        meter = Meter(bounds)
        with self._lock, meter.over(text):
            given = self._questions.given(text, params, self._state, "error")
            return self._questions.ask(text, given, BoundedWorld(self._state, meter))

    def prepare(self, text: str | Expression, *parameters: str) -> Prepared:
        """Prepare a query for repeated use: `kb.prepare("(on ?x ?place)", "place").query("table")`.

        The text is parsed and checked now. Each call of the prepared query passes only the values, in the order of
        `parameters`.

        Raises:
            ParseError, UnknownNameError, SchemaError, InputError: as for `query`.
        """
        return Prepared(text, parameters, self._state, self._lock, self._questions)

    def explain(
        self, text: str | Expression, params: Mapping[str, Value] | None = None, *, bounds: Bounds | None = None
    ) -> Explanation:
        """Return the explanation why the condition is true or false; errors as for `ask`."""
        meter = Meter(bounds)
        with self._lock, meter.over(text):
            params = self._questions.given(text, params, self._state, "error")
            world = self._state if bounds is None else BoundedWorld(self._state, meter)
            return explain(self._questions.condition(text, params, self._state), world, params)

    def explain_query(self, text: str | Expression, params: Mapping[str, Value] | None = None) -> QueryPlan:
        """Return the look-ups of the query in their present order of execution; errors as for `query`."""
        with self._lock:
            params = self._questions.given(text, params, self._state, "answers")
            return plan_query(self._questions.query(text, params, self._state), self._state, params)

    def overlay(self) -> Overlay:
        """Return a world with pending changes on top of this world, which stays unchanged."""
        return Overlay(self)

    def snapshot(self) -> WorldState:
        """Return an independent copy of the present world, with the latest values of the sources."""
        with self._lock:
            return self._state.copy(fed=True)

    def to_json(self) -> str:
        """Return the world with its schema and version as JSON, which `KnowledgeBase.from_json` reads."""
        with self._lock:
            return to_json(self._state, self._version)

    def to_pddl(
        self, domain: str, name: str = "world", goal: str | Expression | None = None, metric: Metric | None = None
    ) -> str:
        """Return the world as a PDDL problem for the domain of that name; the domain itself is not written.

        Args:
            domain: name of the domain.
            name: name of the problem.
            goal: condition to reach; `None` is a goal that is always true.
            metric: quantity that a plan minimises or maximises, if any.

        Raises:
            InputError: the goal is invalid, as for `ask`; or PDDL cannot spell a name or number.
        """
        with self._lock:
            wanted = TRUE if goal is None else self._questions.condition(goal, {}, self._state)
            return problem_to_text(self._state, name, domain, wanted, metric)

    def nodes(self) -> dict[str, str]:
        """Return all objects with their types, in order of insertion."""
        with self._lock:
            return dict(self._state.nodes)

    def facts(self) -> list[Fact]:
        """Return all facts, grouped by predicate, in order of insertion."""
        with self._lock:
            return list(self._state.facts)

    def values(self) -> dict[Fact, Content]:
        """Return the values that changes have set, by function and arguments."""
        with self._lock:
            return dict(self._state.values)

    def contents(self) -> Delta:
        """Return all objects, facts and values as one change, e.g. to `apply` them to another knowledge base."""
        with self._lock:
            state = self._state
            return Delta(nodes=dict(state.nodes), added=tuple(state.facts), values=dict(state.values))

    def __repr__(self) -> str:
        """Return the sizes and the version: `<KnowledgeBase: 12 objects, 30 facts, 2 values, version 7>`."""
        sizes = f"{len(self.nodes())} objects, {len(self.facts())} facts, {len(self.values())} values"
        return f"<{type(self).__name__}: {sizes}, version {self._version}>"

    def holds(self, predicate: str, args: tuple[Value, ...]) -> bool:
        """Return whether the fact is true; the name of a type asks for the type of an object.

        Raises:
            UnknownNameError: there is no such predicate or type.
            SchemaError: a wrong number of arguments.
            InputError: the arguments are not a tuple.
        """
        is_type = self._check(predicate, args)
        with self._lock:
            if is_type:
                found = self._state.type_of(str(args[0]))
                return found is not None and self.schema.is_a(found, predicate)
            return self._state.holds(predicate, args)

    def match(self, predicate: str, pattern: tuple[Value | None, ...]) -> list[tuple[Value, ...]]:
        """Return the arguments of all facts that match `pattern`, in order of insertion.

        `None` in `pattern` matches every argument. Errors are as for `holds`.
        """
        is_type = self._check(predicate, pattern)
        with self._lock:
            if is_type:
                return [(name,) for name in self._state.objects(predicate) if pattern[0] in (None, name)]
            return list(self._state.match(predicate, pattern))

    def estimate(self, predicate: str, pattern: tuple[Value | None, ...]) -> int:
        """Return an upper bound of the number of facts that match `pattern`, without reading the facts.

        Errors are as for `holds`.
        """
        self._check(predicate, pattern)
        with self._lock:
            return self._state.estimate(predicate, pattern)

    def value(self, function: str, args: tuple[Value, ...]) -> Content:
        """Return the value of the function.

        Before the first assignment, the value is 0, `""`, `False` or `()`, depending on its type.

        Raises:
            UnknownNameError: the function is not declared.
            SchemaError: a wrong number of arguments.
            InputError: the arguments are not a tuple.
        """
        self._check(function, args, self.schema.function)
        with self._lock:
            return self._state.value(function, args)

    def _check(
        self, name: str, args: tuple[Value | None, ...], declared: Callable[[str], Signature] | None = None
    ) -> bool:
        """Raise the errors of `holds`, and return whether a type has that name; each name is checked once."""
        if not isinstance(args, tuple | list):
            raise InputError(f"the arguments of '{name}' are a tuple, e.g. ({shown(args)},), not {shown(args)}")
        if (name, len(args)) in self._checked:
            return False
        if declared is None and self.schema.is_type(name, len(args)):
            return True
        parameters = (declared or self.schema.predicate)(name).parameters
        if len(parameters) != len(args):
            raise SchemaError(f"'{name}' has {number_text(len(parameters), 'argument')}, not {len(args)}", found=name)
        self._checked.add((name, len(args)))
        return False

    def reference(self, function: str, args: tuple[Value, ...]) -> str | None:
        """Return the reference of the source that is bound to the function, or `None`."""
        with self._lock:
            return self._state.reference(function, args)

    def publishes(self, function: str) -> bool:
        """Return whether a transform tree answers the function, and receives its new values."""
        return self._state.publishes(function)

    def require_publishable(self, values: Mapping[Fact, Content]) -> None:
        """Raise `TransformError` if a transform tree refuses one of these values."""
        with self._lock:
            self._state.require_publishable(values)

    def objects(self, type_name: str) -> list[str]:
        """Return the objects of that type and its subtypes, in order of insertion.

        Raises:
            UnknownNameError: the type is not declared.
        """
        with self._lock:
            return self._state.objects(type_name)

    def type_of(self, name: str) -> str | None:
        """Return the type of the object; `None` if the object is unknown."""
        with self._lock:
            return self._state.type_of(name)


def _whole(limit: int | None) -> int | None:
    if limit is not None and (isinstance(limit, bool) or not isinstance(limit, int) or limit < 0):
        raise InputError(f"a limit is a whole number, 0 or more, not {shown(limit)}")
    return limit

"""Plan of a query on a world: the order of its conditions, each looked up or tested."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

from knowledge_base.facts import Value
from knowledge_base.language.checking.binding import check_answers
from knowledge_base.language.evaluation.compiler import SearchPlan, Stage
from knowledge_base.language.evaluation.evaluator import NO_BINDINGS, asked_for
from knowledge_base.language.evaluation.lookups import (
    Conjunct,
    JoinStep,
    Lookup,
    Search,
    TypeRange,
    conjuncts,
    smallest,
)
from knowledge_base.language.evaluation.terms import Bindings
from knowledge_base.language.evaluation.world_protocol import World
from knowledge_base.language.syntax.effect import check_depth
from knowledge_base.language.syntax.expression import (
    Atom,
    Exists,
    Expression,
    Or,
    Term,
    Variable,
    free_variables,
    substitute,
)
from knowledge_base.language.syntax.text import to_text

Kind = Literal["test", "computed", "look up", "scan", "things", "alternatives", "witnesses"]
"""Form of a step's evaluation.

`test`: a condition whose variables all have values. `computed`: a condition that Python evaluates. `look up`: facts
with given arguments. `scan`: all facts of a predicate. `things`: the objects of a type. `alternatives`: each part of an
`or` in turn. `witnesses`: the witnesses of an `exists`.
"""


@dataclass(frozen=True, slots=True)
class QueryStep:
    """One condition of a query, at its place in the order.

    Attributes:
        kind: the form of the evaluation.
        text: the condition with the values of the parameters.
        by: for a look-up, the arguments that have a value before this step.
        finds: the variables that this step finds values for.
        matches: an upper bound of the number of matching facts or objects; `None` if it is unknown.
        varies: whether the order from this step on depends on the values found before.
        reached: whether the first candidate reached this step.
    """

    kind: Kind
    text: str
    by: tuple[str, ...] = ()
    finds: tuple[str, ...] = ()
    matches: int | None = None
    varies: bool = False
    reached: bool = True

    def __str__(self) -> str:
        """Return one line, e.g. `look up (on ?x table) by table: finds ?x, at most 3 matches`."""
        what = f"{self.kind} {self.text}" + (f" by {' '.join(self.by)}" if self.by else "")
        said = [
            *([f"finds {' '.join(f'?{name}' for name in self.finds)}"] if self.finds else ()),
            *([f"at most {self.matches} match{'es' * (self.matches != 1)}"] if self.matches is not None else ()),
            *(["decided while running"] if self.varies else ()),
            *(["not reached"] if not self.reached else ()),
        ]
        return f"{what}: {', '.join(said)}" if said else what


@dataclass(frozen=True, slots=True)
class QueryPlan:
    """The steps of a query in the order in which its first candidate reaches them.

    Attributes:
        text: the query with the values of the parameters.
        answers: the variables that the query finds values for.
        steps: the steps of the evaluation, in order.
    """

    text: str
    answers: tuple[str, ...]
    steps: tuple[QueryStep, ...]

    def __str__(self) -> str:
        """Return the query, and below it one line for each step."""
        return "\n".join([self.text, *(f"{number:3}. {step}" for number, step in enumerate(self.steps, start=1))])

    def to_json(self) -> dict[str, Any]:
        """Return the plan as plain data."""
        return asdict(self)


def plan_query(e: Expression, world: World, bindings: Mapping[str, Value] = NO_BINDINGS) -> QueryPlan:
    """Return the plan of the query `e` on `world`; the plan follows the first candidate of the query.

    Raises:
        InputError: as for `query`.
    """
    check_depth(e)
    bound = free_variables(e).intersection(bindings)
    defined = world.schema.expanded(e)
    check_answers(defined, bound, world.schema)
    follower = _Follower(SearchPlan(conjuncts(defined), world.schema, bound), world, bindings)
    return QueryPlan(to_text(substitute(e, bindings)), asked_for(e, bound), tuple(follower.steps()))


class _Follower:
    """Walk through the stages of a search with one candidate and without backtracking."""

    def __init__(self, plan: SearchPlan, world: World, params: Bindings) -> None:
        self._plan = plan
        self._world = world
        self._params = params
        self._varies = False
        self._candidate: Bindings | None = params

    def steps(self) -> Iterator[QueryStep]:
        stage = self._plan.first
        yield from self._tests(range(len(self._plan.steps)), stage, iter((self._params,)))
        while stage.choices:
            candidate = self._candidate
            self._varies |= stage is not self._plan.first and len(stage.choices) > 1
            chosen, lookup = stage.choices[0] if candidate is None else smallest(stage.choices, self._world, candidate)
            yield self._lookup(self._plan.steps[chosen], stage.bound, lookup)
            found = iter(()) if candidate is None else lookup(self._world, candidate)
            left = [i for i in stage.left if i != chosen]
            stage = self._plan.after(stage, chosen)
            yield from self._tests(left, stage, found)

    def _tests(self, numbers: Iterable[int], stage: Stage, found: Iterator[Bindings]) -> Iterator[QueryStep]:
        """Yield the tests of a stage; the first candidate of `found` that passes them becomes the present candidate."""
        self._candidate = next(found, None)
        left = set(stage.left)
        for conjunct in (self._plan.steps[i].conjunct for i in numbers if i not in left):
            computed = isinstance(conjunct, Atom) and conjunct.predicate in self._world.schema.computed
            yield self._step("computed" if computed else "test", conjunct)
        if stage.test is not None:
            while self._candidate is not None and not stage.test(self._world, self._candidate):
                self._candidate = next(found, None)

    def _lookup(self, step: JoinStep, bound: frozenset[str], lookup: Lookup | Search) -> QueryStep:
        match step.conjunct:
            case Atom(_, args):
                unknown = step.free - bound
                by = tuple(self._text(arg) for arg in args if free_variables(arg).isdisjoint(unknown))
                return self._step("look up" if by else "scan", step.conjunct, bound, by, self._matches(lookup))
            case TypeRange(variable):
                things = {thing for t in variable.types or ("object",) for thing in self._world.objects(t)}
                return self._step("things", step.conjunct, bound, matches=len(things))
            case Exists():
                return self._step("witnesses", step.conjunct, bound)
            case _:
                return self._step("alternatives", step.conjunct, bound)

    def _matches(self, lookup: Lookup | Search) -> int | None:
        if self._candidate is None or not isinstance(lookup, Lookup) or not hasattr(self._world, "estimate"):
            return None
        return lookup.size(self._world, self._candidate)

    def _step(
        self,
        kind: Kind,
        conjunct: Conjunct,
        bound: frozenset[str] | None = None,
        by: tuple[str, ...] = (),
        matches: int | None = None,
    ) -> QueryStep:
        """Return a step; for a look-up, `bound` contains the variables with values before the step."""
        e = _expression(conjunct)
        finds = () if bound is None else asked_for(e, bound)
        reached = self._candidate is not None
        return QueryStep(kind, self._text(e), by, finds, matches, self._varies, reached)

    def _text(self, e: Expression | Term) -> str:
        return to_text(substitute(e, self._params))


def _expression(conjunct: Conjunct) -> Expression:
    if not isinstance(conjunct, TypeRange):
        return conjunct
    variable = conjunct.variable
    kinds = tuple(Atom(t, (Variable(variable.name),)) for t in variable.types or ("object",))
    return kinds[0] if len(kinds) == 1 else Or(kinds)

"""Conditions compiled to closures (tests and searches), once for each condition and schema.

A *test* returns whether a condition is true when all its free variables are bound. A *search* yields the bindings that
make the condition true. Quantifiers are searches too: `exists` searches for a witness, and `forall` for a
counterexample. These searches use the index and do not enumerate all objects.

At every step, a search chooses the next condition: the one with the fewest matches for the variables bound so far.
`SearchPlan` caches the preparation of a step, which depends only on the remaining conditions.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain, groupby
from operator import itemgetter
from typing import cast

from knowledge_base.errors import InputError, UserCodeError
from knowledge_base.facts import Fact
from knowledge_base.language.checking.binding import object_variables
from knowledge_base.language.checking.check import check_arity
from knowledge_base.language.checking.vocabulary import Vocabulary
from knowledge_base.language.evaluation.lookups import (
    Answer,
    Answering,
    Conjunct,
    JoinStep,
    Lookup,
    Search,
    TypeRange,
    alternatives,
    as_range,
    candidates,
    conjuncts,
    distinct,
    order,
    smallest,
    things,
)
from knowledge_base.language.evaluation.terms import (
    Bindings,
    Getter,
    Test,
    compile_arguments,
    compile_comparison,
    compile_membership,
    compile_term,
)
from knowledge_base.language.evaluation.world_protocol import World
from knowledge_base.language.syntax.expression import (
    And,
    Atom,
    Comparison,
    Constant,
    Exists,
    Expression,
    Forall,
    Imply,
    Not,
    Or,
    TypedVariable,
    Variable,
    free_variables,
    is_equality,
)
from knowledge_base.language.syntax.rewriting import opposite

_MOST_STAGES = 1000
Answers = Callable[[World, Bindings], list[Answer]]


def compile_test(e: Expression, schema: Vocabulary) -> Test:
    """Return a function that tests whether `e` is true; a caller must bind all free variables of `e`.

    Raises:
        UnknownNameError: an undeclared predicate, type or function.
        SchemaError: a wrong number of arguments.
    """
    test: Test
    match e:
        case Atom():
            test = _atom(e, schema)
        case Comparison():
            test = compile_comparison(e, schema)
        case Not(body):
            test = _negation(compile_test(body, schema))
        case And(parts):
            test = _all(_tests(parts, schema, _is_difference, negated=True))
        case Or(parts):
            test = _any(_tests(parts, schema, is_equality, negated=False))
        case Imply(premise, conclusion):
            test = _any([_negation(compile_test(premise, schema)), compile_test(conclusion, schema)])
        case Exists():
            test = _compile_search(_witnessing(e, schema), schema, free_variables(e))
        case Forall():
            test = _negation(_compile_search(_refuting(e, schema), schema, free_variables(e)))
    return test


def compile_query(e: Expression, schema: Vocabulary, bound: frozenset[str]) -> Search:
    """Return a search for values of the free variables of `e` that are not in `bound`.

    Raises:
        InputError: such a variable is only tested; other errors as for `compile_test`.
    """
    return _search(conjuncts(e), schema, bound)


def compile_answers(e: Expression, schema: Vocabulary, bound: frozenset[str], names: tuple[str, ...]) -> Answers:
    """Return a function that returns the results of `compile_query` as dictionaries of the variables `names`.

    `names` are the variables that the query finds. All answers differ: facts and objects are found only once, and
    `distinct` removes other repetitions.
    """
    plan = SearchPlan(conjuncts(e), schema, bound, names)
    first_test, only = plan.first.test, plan.first.answering
    if only is not None and first_test is None:
        return lambda world, bindings: only(world, (bindings,))

    def answers(world: World, bindings: Bindings) -> list[Answer]:
        answers: list[Answer] = []
        if first_test is not None and not first_test(world, bindings):
            return answers
        for stage, found in _ends(plan, world, bindings):
            if stage.answering is not None:
                answers += stage.answering(world, found)
            else:
                every = found if stage.last is None else chain.from_iterable(map(partial(stage.last, world), found))
                answers += [{name: each[name] for name in names} for each in every]
        return answers

    return answers


def witnesses(e: Exists, schema: Vocabulary) -> Search:
    """Return a search for the choices of objects that make the body true."""
    e = replace(e, body=schema.expanded(e.body))
    return _search(_witnessing(e, schema), schema, free_variables(e))


def counterexamples(e: Forall, schema: Vocabulary) -> Search:
    """Return a search for the choices of objects that make the body false."""
    e = replace(e, body=schema.expanded(e.body))
    return _search(_refuting(e, schema), schema, free_variables(e))


def _witnessing(e: Exists, schema: Vocabulary) -> list[Conjunct]:
    return [*_ranges(e.variables, e.body, schema), *conjuncts(e.body)]


def _refuting(e: Forall, schema: Vocabulary) -> list[Conjunct]:
    body = opposite(e.body)
    return [*_ranges(e.variables, body, schema), *conjuncts(body)]


def _ranges(variables: tuple[TypedVariable, ...], body: Expression, schema: Vocabulary) -> list[TypeRange]:
    for variable in variables:
        for type_name in variable.types:
            schema.require_type(type_name, variable.place)
    return [TypeRange(v) for v in object_variables(variables, body, schema)]


def _atom(atom: Atom, schema: Vocabulary) -> Test:
    if schema.is_type(atom.predicate, len(atom.args)):
        return _type_test(compile_term(atom.args[0], schema), (atom.predicate,), schema)
    check_arity(schema.predicate(atom.predicate, atom.place), len(atom.args), atom.place)
    if atom.predicate in schema.computed:
        return _compile_computed(atom, schema)
    predicate = atom.predicate
    names = [arg.name for arg in atom.args if isinstance(arg, Variable)]
    if len(names) == len(atom.args) > 1:  # the usual form of a query for one fact
        pick = itemgetter(*names)
        return lambda world, bindings: world.holds(predicate, pick(bindings))
    arguments = compile_arguments(atom.args, schema)
    return lambda world, bindings: world.holds(predicate, arguments(world, bindings))


def _compile_computed(atom: Atom, schema: Vocabulary) -> Test:
    of, arguments = schema.computed[atom.predicate], compile_arguments(atom.args, schema)
    inputs = tuple(
        compile_test(read, schema) if isinstance(read, Atom) else compile_term(read, schema)
        for read in of.inputs(atom.args)
    )

    def test(world: World, bindings: Bindings) -> bool:
        values = [get(world, bindings) for get in inputs]
        try:
            return of.judge(values)
        except InputError as error:
            said = Fact(of.name, arguments(world, bindings))
            kind = UserCodeError if isinstance(error, UserCodeError) else InputError
            raise kind(f"{said} cannot be computed: {error}", place=atom.place) from error

    return test


def _type_test(get: Getter, types: tuple[str, ...], schema: Vocabulary) -> Test:
    allowed = {t for wanted in types or ("object",) for t in schema.subtypes(wanted)}

    def test(world: World, bindings: Bindings) -> bool:
        value = get(world, bindings)
        return isinstance(value, str) and world.type_of(value) in allowed

    return test


def _tests(
    parts: tuple[Expression, ...], schema: Vocabulary, joins: Callable[[Expression], bool], *, negated: bool
) -> list[Test]:
    """Return the tests of the parts; one test has all neighbouring equalities of one variable with plain terms.

    A plan's condition may except hundreds of objects, `(or (= ?s web1) (= ?s web2) ...)`.
    """
    tests: list[Test] = []
    for joined, group in groupby(parts, joins):
        some = list(group)
        if joined and len(some) > 1:
            equalities = [one.body if isinstance(one, Not) else one for one in some]
            found = _equalities(cast("list[Comparison]", equalities), schema)
            tests += [_negation(one) for one in found] if negated else found
        else:
            tests += [compile_test(one, schema) for one in some]
    return tests


def _equalities(equalities: list[Comparison], schema: Vocabulary) -> list[Test]:
    names = Counter(side.name for one in equalities for side in (one.left, one.right) if isinstance(side, Variable))
    if not names:
        return [compile_comparison(one, schema) for one in equalities]
    name, _ = names.most_common(1)[0]
    others: list[Variable | Constant] = []
    rest: list[Test] = []
    for one in equalities:
        sides = cast("tuple[Variable | Constant, Variable | Constant]", (one.left, one.right))
        own = [isinstance(side, Variable) and side.name == name for side in sides]
        if any(own):
            others.append(sides[own.index(True) - 1])
        else:
            rest.append(compile_comparison(one, schema))
    return [compile_membership(name, others), *rest]


def _is_difference(e: Expression) -> bool:
    return isinstance(e, Not) and is_equality(e.body)


def _negation(test: Test) -> Test:
    return lambda world, bindings: not test(world, bindings)


def _all(tests: list[Test]) -> Test:
    if len(tests) == 1:
        return tests[0]

    def test(world: World, bindings: Bindings) -> bool:
        try:
            for part in tests:  # a generator costs twice the time here
                if not part(world, bindings):
                    return False
        except InputError as error:
            return not _decide(tests, world, bindings, by=False, otherwise=error)
        return True

    return test


def _any(tests: list[Test]) -> Test:
    def test(world: World, bindings: Bindings) -> bool:
        try:
            for part in tests:  # a generator costs twice the time here
                if part(world, bindings):
                    return True
        except InputError as error:
            return _decide(tests, world, bindings, by=True, otherwise=error)
        return False

    return test


def _decide(tests: list[Test], world: World, bindings: Bindings, *, by: bool, otherwise: InputError) -> bool:
    """Return whether some part decides the result; raise the error `otherwise` if no part does.

    A part that raises an error does not decide.
    """
    for part in tests:
        try:
            if part(world, bindings) is by:
                return True
        except InputError:
            continue
    raise otherwise


def _compile_search(conditions: Iterable[Conjunct], schema: Vocabulary, bound: frozenset[str]) -> Test:
    """Return a function that tests whether a search finds any candidate.

    The test needs fewer stack frames than the search, which matters for nested quantifiers.
    """
    plan = SearchPlan(conditions, schema, bound)
    first_test = plan.first.test

    def test(world: World, bindings: Bindings) -> bool:
        if first_test is not None and not first_test(world, bindings):  # most searches end here
            return False
        try:
            for stage, found in _ends(plan, world, bindings):
                last = stage.last
                if last is None:
                    if next(found, None) is not None:
                        return True
                    continue
                for candidate in found:
                    if next(last(world, candidate), None) is not None:
                        return True
        except InputError:  # a later candidate may decide, although this candidate cannot be computed
            return next(_candidates(plan, world, bindings), None) is not None
        return False

    return test


def _search(conditions: Iterable[Conjunct], schema: Vocabulary, bound: frozenset[str]) -> Search:
    plan = SearchPlan(conditions, schema, bound)
    first_test = plan.first.test

    def search(world: World, bindings: Bindings) -> Iterator[Bindings]:
        if first_test is not None and not first_test(world, bindings):
            return iter(())
        return _candidates(plan, world, bindings)

    return search


def _candidates(plan: SearchPlan, world: World, bindings: Bindings) -> Iterator[Bindings]:
    """Yield the candidates; an error about candidates without a computable value is raised after all others."""
    failed: list[InputError] = []
    for stage, found in _ends(plan, world, bindings, failed):
        for candidate in _computable(found, failed):
            if stage.last is None:
                yield candidate
            else:
                yield from _computable(stage.last(world, candidate), failed)
    if failed:
        raise failed[0]


def _computable(found: Iterator[Bindings], failed: list[InputError]) -> Iterator[Bindings]:
    """Yield the computable candidates of `found`.

    After an error, a filter continues with its next candidate, but a generator ends.
    """
    while True:
        try:
            yield from found
        except InputError as error:
            _keep_first(failed, error)
        else:
            return


def _keep_first(failed: list[InputError], error: InputError) -> None:
    """Store only the first error; every candidate may raise one."""
    if not failed:
        failed.append(error)


def _ends(
    plan: SearchPlan, world: World, bindings: Bindings, failed: list[InputError] | None = None
) -> Iterator[tuple[Stage, Iterator[Bindings]]]:
    """Yield the stages with at most one look-up left, each with the candidates that passed all tests.

    The caller must evaluate the first test of the plan, and must exhaust the candidates before it continues.
    Backtracking uses an explicit stack, so that long conjunctions do not recurse. If `failed` is a list, errors are
    appended to it, and their candidates are omitted.
    """
    stack: list[tuple[Stage, Iterator[Bindings]]] = [(plan.tested, iter((bindings,)))]
    while stack:
        stage, found = stack[-1]
        if stage.last is not None or not stage.choices:
            stack.pop()
            yield stage, found
            continue
        try:
            candidate = next(found, None)
            if candidate is None:
                stack.pop()
                continue
            i, lookup = smallest(stage.choices, world, candidate)
            after, found = plan.after(stage, i), lookup(world, candidate)
        except InputError as error:
            if failed is None:
                raise
            _keep_first(failed, error)
        else:
            stack.append((after, found if after.test is None else filter(partial(after.test, world), found)))


@dataclass(frozen=True, slots=True)
class Stage:
    """One step of a search: the tests, then one of the look-ups.

    Attributes:
        test: tests the conditions without unbound variables; `None` if no such condition exists.
        choices: the possible next look-ups, with the numbers of their conditions.
        left: the numbers of the conditions that remain after the tests.
        bound: the variables that have a value.
        last: the single remaining look-up, whose results need no further test; else `None`.
        answering: returns the answers of `last`, if the search has names for them.
        after: the following stages that are prepared already, by the number of the chosen condition.
    """

    test: Test | None
    choices: tuple[tuple[int, Lookup | Search], ...]
    left: tuple[int, ...]
    bound: frozenset[str]
    last: Lookup | Search | None
    answering: Answering | None
    after: dict[int, Stage] = field(default_factory=dict)


class SearchPlan:
    """The stages of one search; each is prepared when it is reached for the first time.

    Args:
        conditions: the conditions of the search.
        schema: the declarations.
        bound: the variables that have a value before the search.
        names: the variables of the answers, if the search returns answers.

    Attributes:
        steps: the conditions in order; stages refer to them by number.
        first: the first stage.
        tested: the first stage without its test, for a caller that has evaluated the test.
    """

    def __init__(
        self,
        conditions: Iterable[Conjunct],
        schema: Vocabulary,
        bound: frozenset[str],
        names: tuple[str, ...] | None = None,
    ) -> None:
        self.steps = order((as_range(c, schema) for c in conditions), bound, schema)
        self._schema = schema
        self._names = names
        self._stages: dict[tuple[int, ...], Stage] = {}
        self.first = stage = self._stage(tuple(range(len(self.steps))), bound)
        while stage.choices:  # follow one path through all stages, so that every error in the text is raised now
            stage = self.after(stage, stage.choices[0][0])
        self.tested = replace(self.first, test=None)

    def after(self, stage: Stage, chosen: int) -> Stage:
        """Return the stage after the look-up of the condition with the number `chosen`."""
        found = stage.after.get(chosen)
        if found is None:
            left = tuple([i for i in stage.left if i != chosen])
            found = self._stages.get(left)
            if found is None:
                if len(self._stages) >= _MOST_STAGES:
                    self._stages.clear()
                    self.first.after.clear()
                found = self._stages[left] = self._stage(left, stage.bound | self.steps[chosen].free)
            stage.after[chosen] = found
        return found

    def _stage(self, left: tuple[int, ...], bound: frozenset[str]) -> Stage:
        steps = {i: self.steps[i] for i in left}
        open_steps = {i: s for i, s in steps.items() if not s.free <= bound}
        # `map` instead of comprehensions, whose stack frames add up in deep nesting.
        tests = list(map(self._test, (s.conjunct for i, s in steps.items() if i not in open_steps)))
        chosen = candidates(open_steps, bound)
        lookups = map(partial(_lookup, schema=self._schema, bound=bound), (step for _, step in chosen))
        choices = tuple(zip((i for i, _ in chosen), lookups, strict=True))
        last = choices[0][1] if len(open_steps) == 1 else None
        answering = None
        if isinstance(last, Lookup) and self._names is not None:
            answering = last.answering(self._names)
        return Stage(_all(tests) if tests else None, choices, tuple(open_steps), bound, last, answering)

    def _test(self, conjunct: Conjunct) -> Test:
        if not isinstance(conjunct, TypeRange):
            return compile_test(conjunct, self._schema)
        variable = conjunct.variable
        return _type_test(compile_term(Variable(variable.name), self._schema), variable.types, self._schema)


def _lookup(step: JoinStep, schema: Vocabulary, bound: frozenset[str]) -> Lookup | Search:
    """Return a look-up that finds values for the variables of a condition that are not in `bound`."""
    finds = step.free - bound
    match step.conjunct:
        case TypeRange(variable):
            return things(variable)
        case Atom() as atom:
            check_arity(schema.predicate(atom.predicate, atom.place), len(atom.args), atom.place)
            return Lookup(atom, schema, finds)
        case Or(parts):
            return distinct(alternatives([_search(conjuncts(p), schema, bound) for p in parts]), finds)
        case Exists(variables) as exists:
            hidden = frozenset(v.name for v in variables)
            return distinct(_search(_witnessing(exists, schema), schema, bound - hidden), finds)
        case _:
            raise AssertionError("only these conditions find values")

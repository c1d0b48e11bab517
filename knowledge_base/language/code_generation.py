"""Writes a plain question as the source of a Python function; see `language.source`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import cast

from knowledge_base.language.expression import Atom, Comparison, Constant, Not, Term, TypedVariable, Variable
from knowledge_base.language.joins import Conjunct, JoinStep, TypeRange, candidates
from knowledge_base.language.terms import same
from knowledge_base.language.vocabulary import ROOT_TYPE, Vocabulary

MISSING = object()
"""Stands for a value that was not given."""
_INDENT = "    "


class CodeGenerator:
    """Writes the source of one question, as `test` or as `question`; an author writes once.

    Args:
        steps: the conditions, all of them plain, in a good order.
        schema: what may be said.
        params: the variables whose values the function takes.
        answers: those whose values it finds; `None` for a function that says whether there are any.

    Attributes:
        constants: the values that the source has names for.
        lookups: at most how many of the conditions find values.
    """

    def __init__(
        self, steps: list[JoinStep], schema: Vocabulary, params: Sequence[str], answers: tuple[str, ...] | None
    ) -> None:
        self.constants: dict[str, object] = {"same": same, "missing": MISSING}
        self._steps = dict(enumerate(steps))
        self._schema = schema
        self._params = params
        self._answers = answers
        self._bound = frozenset(params)
        self.lookups = _lookups(steps, self._bound)
        variables = dict.fromkeys([*params, *(name for step in steps for name in sorted(step.free))])
        self._names = {variable: f"v{number}" for number, variable in enumerate(variables)}
        self._lines: list[str] = []

    def test(self) -> list[str]:
        """The function that only tests; more values than it needs are nothing to it."""
        self._line(0, f"def question({', '.join([*map(self._names.__getitem__, self._params), '*_'])}):")
        self._line(1, f"return {self._truth()}")
        return self._lines

    def question(self) -> list[str]:
        """The function that may be called by anybody.

        It takes less time than the lock, so it is done without, and again with it if a change was made meanwhile;
        dictionaries that change while they are walked raise a RuntimeError.
        """
        given = [self._names[name] for name in self._params]
        answer = self._expression()
        if answer is None:
            answer = f"search({', '.join(given)})"
            self._line(0, f"def search({', '.join(given)}):")
            self._search()
        head = [*(f"{name}=missing" for name in given), *(["/"] if given else []), "*more"]
        self._line(0, f"def question({', '.join(head)}):")
        odd = " or ".join([*(f"type({name}) is not str" for name in given), "more"])
        self._line(1, f"if {odd}: judge(({''.join(f'{name}, ' for name in given)}*more,))")
        self._line(1, "before = stamp.version")
        self._line(1, "if before is not None:")
        self._line(2, "try:")
        self._line(3, f"answer = {answer}")
        self._line(3, "if before == stamp.version: return answer")
        self._line(2, "except RuntimeError: pass")
        self._line(1, f"with lock: return {answer}")
        return self._lines

    def _expression(self) -> str | None:
        """The answer as an expression; `None` if it takes statements."""
        everything = tuple(self._steps)
        if not self.lookups:
            return self._truth() if self._answers is None else f"[{{}}] if {self._truth()} else []"
        if self._answers is None or self._tests(everything, self._bound)[0]:
            return None
        clauses = self._chain(everything, self._bound)
        return f"[{self._answer()}{clauses}]" if clauses else None

    def _search(self) -> None:
        if self._answers is not None:
            self._line(1, "found = []")
        self._stage(1, tuple(self._steps), self._bound)
        self._line(1, "return False" if self._answers is None else "return found")

    def _truth(self) -> str:
        tests, _ = self._tests(tuple(self._steps), self._bound)
        return " and ".join(tests) or "True"

    def _line(self, depth: int, text: str) -> None:
        self._lines.append(depth * _INDENT + text)

    def _stage(self, depth: int, left: tuple[int, ...], bound: frozenset[str]) -> None:
        """What is left when the variables `bound` have values: tests, and one look-up of those that may come next."""
        tests, left = self._tests(left, bound)
        if tests:
            self._line(depth, f"if {' and '.join(tests)}:")
            depth += 1
        if not left:
            self._line(depth, "return True" if self._answers is None else f"found.append({self._answer()})")
            return
        if self._answers is not None and (clauses := self._chain(left, bound)):
            self._line(depth, f"found += [{self._answer()}{clauses}]")
            return
        chosen = self._candidates(left, bound)
        if len(chosen) == 1:
            self._loop(depth, chosen[0], self._listed(self._steps[chosen[0]], bound), left, bound)
            return
        lists = [f"l{len(left)}_{number}" for number in chosen]
        for name, number in zip(lists, chosen, strict=True):
            self._line(depth, f"{name} = {self._listed(self._steps[number], bound)}")
        for position, (name, number) in enumerate(zip(lists, chosen, strict=True)):
            later = lists[position + 1 :]
            shortest = " and ".join(f"len({name}) <= len({other})" for other in later)
            self._line(depth, f"{'elif' if position else 'if'} {shortest}:" if later else "else:")
            self._loop(depth + 1, number, name, left, bound)

    def _loop(self, depth: int, number: int, listed: str, left: tuple[int, ...], bound: frozenset[str]) -> None:
        step = self._steps[number]
        target, conditions = self._target(step, bound)
        self._line(depth, f"for {target} in {listed}:")
        depth += 1
        if conditions:
            self._line(depth, f"if {' and '.join(conditions)}:")
            depth += 1
        self._stage(depth, tuple([one for one in left if one != number]), bound | step.free)

    def _chain(self, left: tuple[int, ...], bound: frozenset[str]) -> str | None:
        """The look-ups that are left as clauses of one comprehension; `None` if there are several ways to go on."""
        clauses = ""
        while left:
            chosen = self._candidates(left, bound)
            if len(chosen) > 1:
                return None
            step = self._steps[chosen[0]]
            target, conditions = self._target(step, bound)
            clauses += f" for {target} in {self._listed(step, bound)}"
            bound |= step.free
            tests, left = self._tests(tuple([one for one in left if one != chosen[0]]), bound)
            clauses += "".join(f" if {test}" for test in [*conditions, *tests])
        return clauses

    def _answer(self) -> str:
        return "{" + ", ".join(f"{name!r}: {self._names[name]}" for name in self._answers or ()) + "}"

    def _tests(self, left: tuple[int, ...], bound: frozenset[str]) -> tuple[list[str], tuple[int, ...]]:
        """The conditions that need no more values, and the numbers of the others."""
        settled = [one for one in left if self._steps[one].free <= bound]
        tests = [self._test(self._steps[one].conjunct) for one in settled]
        return tests, tuple([one for one in left if one not in settled])

    def _candidates(self, left: tuple[int, ...], bound: frozenset[str]) -> list[int]:
        return [number for number, _ in candidates({one: self._steps[one] for one in left}, bound)]

    def _test(self, part: Conjunct) -> str:
        match part:
            case TypeRange(variable):
                return self._is_of(self._names[variable.name], variable)
            case Not(body):
                return f"not {self._test(body)}"
            case Comparison(operator, left, right):
                equal = f"same({self._value(left)}, {self._value(right)})"
                return equal if operator == "=" else f"not {equal}"
            case Atom(name, args) if self._schema.is_type(name, len(args)):
                return self._is_of(self._value(args[0]), TypedVariable("", (name,)))
            case Atom(name, args):
                return f"({self._tuple(map(self._value, args))} in facts.get({name!r}, ()))"
            case _:
                raise AssertionError("only plain conditions come here")

    def _is_of(self, value: str, variable: TypedVariable) -> str:
        types = variable.types or (ROOT_TYPE,)
        allowed = frozenset(kind for one in types for kind in self._schema.subtypes(one))
        return f"(types.get({value}) in {self._constant(allowed)})"

    def _listed(self, step: JoinStep, bound: frozenset[str]) -> str:
        """The facts that may match, or the things of a type."""
        if isinstance(step.conjunct, TypeRange):
            types = step.conjunct.variable.types or (ROOT_TYPE,)
            if len(types) == 1:
                return f"objects({types[0]!r})"
            return f"dict.fromkeys([thing for kind in {types!r} for thing in objects(kind)])"
        atom = cast("Atom", step.conjunct)
        given = [(i, self._value(arg)) for i, arg in enumerate(atom.args) if not _is_open(arg, bound)]
        if not given:
            return f"facts.get({atom.predicate!r}, ())"
        if len(given) == 1:
            ((position, value),) = given
            return f"by_argument.get(({atom.predicate!r}, {position}, {value}), ())"
        pattern = dict.fromkeys(range(len(atom.args)), "None") | dict(given)
        return f"listed({atom.predicate!r}, {self._tuple(pattern.values())})"

    def _target(self, step: JoinStep, bound: frozenset[str]) -> tuple[str, list[str]]:
        """What a fact's arguments are assigned to, and what must be true of them then."""
        if isinstance(step.conjunct, TypeRange):
            return self._names[step.conjunct.variable.name], []
        args = cast("Atom", step.conjunct).args
        exact = sum(not _is_open(arg, bound) for arg in args) <= 1  # the list is of that argument then
        targets, conditions = [], []
        for position, arg in enumerate(args):
            name = self._value(arg)
            is_open = _is_open(arg, bound)
            if is_open and name not in targets:
                targets.append(name)
            elif not is_open and exact:
                targets.append("_")
            else:
                targets.append(f"a{position}")
                conditions.append(f"a{position} == {name}")
        return self._tuple(targets), conditions

    def _value(self, term: Term) -> str:
        return self._names[term.name] if isinstance(term, Variable) else self._constant(cast("Constant", term).value)

    def _constant(self, value: object) -> str:
        name = f"k{len(self.constants)}"
        self.constants[name] = value
        return name

    @staticmethod
    def _tuple(parts: Iterable[str]) -> str:
        return "(" + "".join(f"{part}, " for part in parts).rstrip() + ")"


def _lookups(steps: Iterable[JoinStep], bound: frozenset[str]) -> int:
    """At most how many of the conditions find values: facts, and types of what no fact is about."""
    unsettled = [step for step in steps if not step.free <= bound]
    facts = [step for step in unsettled if isinstance(step.conjunct, Atom)]
    about = bound.union(*(step.free for step in facts))
    return len(facts) + sum(isinstance(step.conjunct, TypeRange) and not step.free <= about for step in unsettled)


def _is_open(arg: Term, bound: frozenset[str]) -> bool:
    return isinstance(arg, Variable) and arg.name not in bound

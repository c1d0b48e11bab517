"""Explanation of a condition's truth: a tree of its parts with truth values, and the part that decides."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from knowledge_base.errors import InputError
from knowledge_base.facts import Value
from knowledge_base.language.checking.binding import check_bound, row_variables
from knowledge_base.language.checking.vocabulary import Read
from knowledge_base.language.evaluation.compiler import counterexamples, witnesses
from knowledge_base.language.evaluation.evaluator import NO_BINDINGS, asked, choices, evaluate_term, holds
from knowledge_base.language.evaluation.terms import Bindings
from knowledge_base.language.evaluation.world_protocol import World
from knowledge_base.language.syntax.effect import check_depth
from knowledge_base.language.syntax.expression import (
    And,
    Arithmetic,
    Atom,
    Call,
    Comparison,
    Exists,
    Expression,
    Forall,
    Imply,
    Not,
    Or,
    substitute,
)
from knowledge_base.language.syntax.text import to_text
from knowledge_base.notebook import text
from knowledge_base.spelling import value_text

_Explained = tuple["Explanation", InputError | None]
"""A part, and the error if the part cannot be computed, else `None`."""

MOST_TRIED = 200
"""Maximum number of choices for a false `exists` that are compared to find the nearest miss."""


@dataclass(frozen=True, slots=True)
class Explanation:
    """A condition with the values of its variables, its truth, and the explanations of its parts.

    Attributes:
        text: the condition in the language.
        truth: whether the condition is true; a part that cannot be computed is false if another part decides.
        children: explanations of all parts. For `exists` and `forall`, the explanation of one choice: a witness, the
            nearest miss or a counterexample, if any.
        detail: the values of a comparison's computed sides, the inputs of a computed predicate, the chosen objects, or
            the reason for a missing value.
        decider: index of the child that decides the truth; `None` for a leaf.
    """

    text: str
    truth: bool
    children: tuple[Explanation, ...] = ()
    detail: str | None = None
    decider: int | None = None

    @property
    def deciding(self) -> Explanation:
        """The leaf that decides the truth of the whole, e.g. the first false part of an `and`."""
        here = self
        while here.decider is not None:
            here = here.children[here.decider]
        return here

    def __str__(self) -> str:
        """Return one line, e.g. `(< (failures cup1) 2) is false: 3 < 2`."""
        said = f"{self.text} is {'true' if self.truth else 'false'}"
        return f"{said}: {self.detail}" if self.detail else said

    def lines(self, depth: int = 0, *, deciding: bool = True) -> Iterator[str]:
        """Yield the tree, with one line for each part; arrows mark the parts that decide the truth."""
        indent = "" if depth == 0 else "   " * (depth - 1) + ("-> " if deciding else "   ")
        detail = f"   [{self.detail}]" if self.detail else ""
        yield f"{indent}{'true ' if self.truth else 'false'}  {self.text}{detail}"
        for number, child in enumerate(self.children):
            yield from child.lines(depth + 1, deciding=deciding and number == self.decider)

    def _repr_html_(self) -> str:
        return text(self.lines())

    def to_json(self) -> dict[str, Any]:
        """Return the tree as plain data without empty fields; `decider` is the index of the deciding child, from 0."""
        found: dict[str, Any] = {"text": self.text, "truth": self.truth}
        if self.detail:
            found["detail"] = self.detail
        if self.children:
            found["children"] = [c.to_json() for c in self.children]
        if self.decider is not None:
            found["decider"] = self.decider
        return found


def explain(e: Expression, world: World, bindings: Mapping[str, Value] = NO_BINDINGS) -> Explanation:
    """Return the explanation why `e` is true or false in `world`.

    Raises:
        UnknownNameError: a free variable is not bound, or a name is not declared.
        SchemaError, InputError: as for `holds`.
    """
    check_depth(e)
    check_bound(e, bindings)
    return _explain(e, world, bindings)


def _explain(e: Expression, world: World, bindings: Bindings) -> Explanation:
    text = to_text(substitute(e, bindings))
    match e:
        case Atom() if (definition := world.schema.expanded(e)) is not e:
            inner = _explain(definition, world, bindings)
            found = Explanation(text, inner.truth, (inner,), decider=0)
        case Atom() | Comparison():
            found = Explanation(text, holds(e, world, bindings), detail=_detail(e, world, bindings))
        case Not(body):
            child = _explain(body, world, bindings)
            found = Explanation(text, not child.truth, (child,), decider=0)
        case And(parts):
            found = _junction(text, [_explain_part(p, world, bindings) for p in parts], neutral=True)
        case Or(parts):
            found = _junction(text, [_explain_part(p, world, bindings) for p in parts], neutral=False)
        case Imply(premise, conclusion):
            found = _implication(text, *[_explain_part(p, world, bindings) for p in (premise, conclusion)])
        case Exists():
            found = _existence(text, e, world, bindings)
        case Forall():
            found = _universality(text, e, world, bindings)
    return found


def _explain_part(e: Expression, world: World, bindings: Bindings) -> _Explained:
    """Return the explanation of a part with its error; the error is ignored if another part decides."""
    try:
        return _explain(e, world, bindings), None
    except InputError as error:
        asked(e, world.schema)  # an error in the text is raised even if the part does not decide
        text = to_text(substitute(e, bindings))
        return Explanation(text, truth=False, detail=f"cannot be computed: {error}"), error


def _junction(text: str, parts: Sequence[_Explained], *, neutral: bool) -> Explanation:
    """Return the explanation of `and` (neutral: true) or `or` (neutral: false).

    The first part whose truth is not neutral decides.
    """
    children = tuple(child for child, _ in parts)
    deciding = [i for i, (child, error) in enumerate(parts) if error is None and child.truth is not neutral]
    error = next((error for _, error in parts if error is not None), None)
    if error is not None and not deciding:
        raise error
    truth = not neutral if deciding else neutral
    decider = (deciding or [0])[0] if children else None
    return Explanation(text, truth, children, decider=decider)


def _implication(text: str, premise: _Explained, conclusion: _Explained) -> Explanation:
    (first, unknown_first), (second, unknown_second) = premise, conclusion
    by_premise = unknown_first is None and not first.truth
    by_conclusion = unknown_second is None and second.truth
    error = unknown_first or unknown_second
    if error is not None and not (by_premise or by_conclusion):
        raise error
    return Explanation(text, by_premise or by_conclusion, (first, second), decider=0 if by_premise else 1)


def _existence(text: str, e: Exists, world: World, bindings: Bindings) -> Explanation:
    names = [v.name for v in e.variables]
    witness = next(witnesses(e, world.schema)(world, bindings), None)
    if witness is not None:
        return _explain_shown(text, e.body, names, world, witness, truth=True)
    if row_variables(e.variables, e.body, world.schema):
        return Explanation(text, truth=False, detail="no row fulfils it")
    tried = itertools.islice(choices(e.variables, world), MOST_TRIED)
    nearest = max(({**bindings, **one} for one in tried), key=partial(_nearness, e.body, world), default=None)
    if nearest is None:
        return Explanation(text, truth=False, detail="there is nothing to choose from")
    child = _explain(e.body, world, nearest)
    return Explanation(text, truth=False, children=(child,), detail="the nearest miss", decider=0)


def _universality(text: str, e: Forall, world: World, bindings: Bindings) -> Explanation:
    counterexample = next(counterexamples(e, world.schema)(world, bindings), None)
    if counterexample is None:
        return Explanation(text, truth=True)
    return _explain_shown(text, e.body, [v.name for v in e.variables], world, counterexample, truth=False)


def _explain_shown(
    text: str, body: Expression, names: Sequence[str], world: World, choice: Bindings, *, truth: bool
) -> Explanation:
    chosen = ", ".join(f"?{name} = {value_text(choice[name])}" for name in names)
    child = _explain(body, world, choice)
    return Explanation(text, truth, (child,), detail=chosen or None, decider=0)


def _nearness(body: Expression, world: World, choice: Bindings) -> int:
    """Return the number of true parts.

    Explanations are not computed here, since their cost would multiply with every nested `exists`.
    """
    return sum(_is_so(part, world, choice) for part in body.parts) if isinstance(body, And) else 0


def _is_so(e: Expression, world: World, bindings: Bindings) -> bool:
    try:
        return holds(e, world, bindings)
    except InputError:
        return False


def _detail(e: Atom | Comparison, world: World, bindings: Bindings) -> str | None:
    """Return the compared values or the inputs of a leaf; `None` for a plain fact."""
    if isinstance(e, Comparison):
        return _compare(e, world, bindings)
    of = world.schema.computed.get(e.predicate)
    if of is None:
        return None
    inputs = of.inputs(tuple(substitute(arg, bindings) for arg in e.args))
    return ", ".join(_input(read, world) for read in inputs) or None


def _input(read: Read, world: World) -> str:
    if isinstance(read, Atom):
        return f"{to_text(read)} is {'true' if holds(read, world) else 'false'}"
    return f"{to_text(read)} = {value_text(evaluate_term(read, world))}"


def _compare(e: Comparison, world: World, bindings: Bindings) -> str | None:
    if not any(isinstance(side, Call | Arithmetic) for side in (e.left, e.right)):
        return None
    left, right = (value_text(evaluate_term(side, world, bindings)) for side in (e.left, e.right))
    return f"{left} {e.operator} {right}"

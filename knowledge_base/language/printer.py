"""Expressions, terms and effects back to text; reading the text gives an equal value again."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from knowledge_base.language.effect import Add, AllOf, Delete, Effect, ForEach, NumericEffect, When
from knowledge_base.language.expression import (
    And,
    Arithmetic,
    Atom,
    Call,
    Comparison,
    Constant,
    Exists,
    Expression,
    Forall,
    Imply,
    Not,
    Or,
    Term,
    TypedVariable,
    Variable,
)
from knowledge_base.spelling import value_text

_Form = Call | Arithmetic | Atom | And | Or | Not | Imply | Comparison | AllOf | Delete | When | NumericEffect


def to_text(node: Expression | Term | Effect) -> str:
    """`node` on one line of PDDL, losslessly: `parse(to_text(x)) == x`."""
    match node:
        case Variable(name):
            return f"?{name}"
        case Constant(value, quoted):
            return value_text(value, quoted=quoted)
        case Add(atom):
            return to_text(atom)
        case Exists(variables, body) | Forall(variables, body) | ForEach(variables, body):
            head = "exists" if isinstance(node, Exists) else "forall"
            return f"({head} {variables_text(variables)} {to_text(body)})"
        case _:
            head, parts = _form(node)
            return "(" + " ".join([head, *map(to_text, parts)]) + ")"


def variables_text(variables: Iterable[TypedVariable]) -> str:
    """A typed list in parentheses: `(?a - cup ?b - object)`, each variable with a type of its own."""
    listed = tuple(variables)
    if not any(v.types for v in listed):
        return "(" + " ".join(f"?{v.name}" for v in listed) + ")"
    return "(" + " ".join(_typed(v) for v in listed) + ")"


def _typed(variable: TypedVariable) -> str:
    types = variable.types or ("object",)  # left out, it would take the type of the next one
    return f"?{variable.name} - " + (types[0] if len(types) == 1 else f"(either {' '.join(types)})")


def _form(node: _Form) -> tuple[str, Sequence[Expression | Term | Effect]]:
    form: tuple[str, Sequence[Expression | Term | Effect]]
    match node:
        case Call(head, args) | Arithmetic(head, args) | Atom(head, args):
            form = head, args
        case And(parts):
            form = "and", parts
        case AllOf(effects):
            form = "and", effects
        case Or(parts):
            form = "or", parts
        case Not(body) | Delete(body):
            form = "not", (body,)
        case Imply(premise, conclusion):
            form = "imply", (premise, conclusion)
        case When(condition, effect):
            form = "when", (condition, effect)
        case Comparison(operator, left, right) | NumericEffect(operator, left, right):
            form = operator, (left, right)
    return form

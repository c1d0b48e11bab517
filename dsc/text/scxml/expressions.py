"""Conditions and terms as the ECMAScript expressions of SCXML; what the standard cannot know is refused."""

from __future__ import annotations

import json

from dsc.engine.membership import asked_states
from dsc.text.scxml.errors import NotExpressibleError
from dsc.text.scxml.kinds import NO_VALUE
from knowledge_base.language.expression import (
    ARITHMETIC,
    And,
    Arithmetic,
    Atom,
    Comparison,
    Constant,
    Expression,
    Imply,
    Not,
    Or,
    Term,
    Variable,
)
from knowledge_base.language.printer import to_text

_SIGNS = {"=": "===", "!=": "!=="}


def expression_text(e: Expression) -> str:
    """A condition as a `cond`.

    Raises:
        NotExpressibleError: it asks the knowledge base, or quantifies.
    """
    match e:
        case And(parts):
            return " && ".join(map(_bracketed, parts)) or "true"
        case Or(parts):
            return " || ".join(map(_bracketed, parts)) or "false"
        case Not(body):
            return f"!({expression_text(body)})"
        case Imply(premise, conclusion):
            return f"!({expression_text(premise)}) || {_bracketed(conclusion)}"
        case Comparison(sign, left, right):
            return f"{term_text(left)} {_SIGNS.get(sign, sign)} {term_text(right)}"
        case Atom() if asked := asked_states(e):
            return f"In({json.dumps(asked[0], ensure_ascii=False)})"
        case _:
            raise NotExpressibleError("condition", f"SCXML has no knowledge base to ask {to_text(e)}", place=e.place)


def term_text(term: Term) -> str:
    """A term as an `expr`; raises `NotExpressibleError` for a fluent or a name that is no identifier."""
    match term:
        case Constant(NO_VALUE.value):
            return "undefined"
        case Constant(value):
            return json.dumps(value, ensure_ascii=False)
        case Variable(name):
            return f"_event.data.{identifier(name[6:])}" if name.startswith("event.") else identifier(name)
        case Arithmetic("-", (inner,)):
            return f"-({term_text(inner)})"
        case Arithmetic(sign, args) if sign in ARITHMETIC:
            return "(" + f" {sign} ".join(map(term_text, args)) + ")"
        case _:
            raise NotExpressibleError("term", f"SCXML has no fluent such as {to_text(term)}", place=term.place)


def identifier(name: str) -> str:
    """A variable's name, if it is one in ECMAScript too."""
    if not name.isidentifier():
        raise NotExpressibleError("variable", f"'{name}' is no identifier in SCXML")
    return name


def _bracketed(e: Expression) -> str:
    text = expression_text(e)
    return text if isinstance(e, Atom | Comparison | Not) else f"({text})"

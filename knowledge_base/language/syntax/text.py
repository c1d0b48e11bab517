"""Parser of text or groups to conditions, effects and terms, and the conversion of these to text.

The parser reads the text of a value as an equal value.

Names are converted to lower case, as PDDL ignores case; quoted text is not converted. The parser checks only the form;
`check` compares names with a schema.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from knowledge_base.errors import ParseError, Place, nearest
from knowledge_base.facts import GEOMETRY, MOST_NUMBERS
from knowledge_base.language.syntax.effect import (
    ASSIGNMENTS,
    EFFECT_KEYWORDS,
    Add,
    AllOf,
    Delete,
    Effect,
    ForEach,
    Form,
    NumericEffect,
    When,
    parts_of_form,
)
from knowledge_base.language.syntax.expression import (
    COMPARISONS,
    COMPUTING,
    KEYWORDS,
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
from knowledge_base.language.syntax.sexpr import Group, Node, Word, parse_typed_list, parse_variables, read
from knowledge_base.spelling import TRUTH_VALUES, is_number, value_text

__all__ = ["parse_condition", "parse_effect", "parse_term", "parse_typed_list", "parse_variables"]

LONGEST_NUMBER = 40
"""Maximum length of a number in characters; a longer number is probably a mistake, and slow to read."""


def parse_condition(text: str | Node, source: str | None = None) -> Expression:
    """Return a condition, from its text or from a group; `()` is true, as in PDDL.

    Raises:
        ParseError: the form is wrong; the message contains the place and the expected form.
    """
    group = _group(_only(text, source, "a condition"), "a condition")
    if not group.items:
        return And((), place=group.place)
    head, args = _head(group, "a predicate or one of " + " ".join(KEYWORDS)), group.items[1:]
    if head in KEYWORDS:
        return _keyword_condition(head, args, group)
    return _atom(group, head, KEYWORDS)


def parse_effect(text: str | Node, source: str | None = None) -> Effect:
    """Return the effect that a text or a parsed group describes; `()` is the effect without changes.

    Raises:
        ParseError: the form is wrong, or a keyword of conditions (`or`, `exists`) begins an effect.
    """
    group = _group(_only(text, source, "an effect"), "an effect")
    if not group.items:
        return AllOf((), place=group.place)
    head, args = _head(group, "a predicate or one of " + " ".join(EFFECT_KEYWORDS)), group.items[1:]
    if head in EFFECT_KEYWORDS:
        return _keyword_effect(head, args, group)
    if head in KEYWORDS:
        raise ParseError(f"'{head}' is not an effect", place=group.place, found=head, valid=EFFECT_KEYWORDS)
    return Add(_atom(group, head, EFFECT_KEYWORDS), place=group.place)


def parse_term(text: str | Node, source: str | None = None) -> Term:
    """Return a variable, name, number, quoted text, function, arithmetic or geometry.

    Raises:
        ParseError: the form is wrong.
    """
    node = _only(text, source, "a term")
    return _simple_term(node) if isinstance(node, Word) else _compound_term(node)


def _only(text: str | Node, source: str | None, kind: str) -> Node:
    if isinstance(text, Word | Group):
        return text
    if not isinstance(text, str):
        raise ParseError(f"{kind} is written as text, not as {text!r}", place=Place(source))
    nodes = read(text, source)
    if not nodes:
        raise ParseError(f"the text is empty where {kind} is expected", place=Place(source, 1, 1))
    if len(nodes) > 1:
        raise ParseError(f"{kind} is expected, and here a second begins", place=nodes[1].place)
    return nodes[0]


def _group(node: Node, what: str) -> Group:
    if isinstance(node, Group):
        return node
    if what == "a condition" and node.text.startswith("?"):
        raise ParseError(f"a variable is not a condition; compare it, as in (= {node.text} true)", place=node.place)
    raise ParseError(f"{what} is written in parentheses: ({node.text})", place=node.place)


def _head(group: Group, wanted: str) -> str:
    head = group.head()
    if head is None or head.startswith("?") or is_number(head):
        place = group.items[0].place if group.items else group.place
        raise ParseError(f"after '(' comes {wanted}", place=place)
    return head


def _take(args: Sequence[Node], count: int, group: Group, form: str) -> Sequence[Node]:
    if len(args) == count:
        return args
    place = args[count].place if len(args) > count else group.place
    raise ParseError(f"'{group.head()}' is written {form}; found {len(args)} parts", place=place)


def _keyword_condition(head: str, args: Sequence[Node], group: Group) -> Expression:
    place = group.place
    if head in COMPARISONS:
        left, right = _take(args, 2, group, f"({head} LEFT RIGHT)")
        return Comparison(head, parse_term(left), parse_term(right), place=place)
    if head in ("exists", "forall"):
        variables, body = _take(args, 2, group, f"({head} (?x - TYPE) CONDITION)")
        quantifier = Exists if head == "exists" else Forall
        return quantifier(parse_variables(variables), parse_condition(body), place=place)
    if head == "not":
        return Not(parse_condition(_take(args, 1, group, "(not CONDITION)")[0]), place=place)
    if head == "imply":
        premise, conclusion = _take(args, 2, group, "(imply PREMISE CONCLUSION)")
        return Imply(parse_condition(premise), parse_condition(conclusion), place=place)
    parts = tuple(parse_condition(a) for a in args)
    return And(parts, place=place) if head == "and" else Or(parts, place=place)


def _keyword_effect(head: str, args: Sequence[Node], group: Group) -> Effect:
    place = group.place
    if head == "and":
        return AllOf(tuple(parse_effect(a) for a in args), place=place)
    if head == "not":
        return Delete(_effect_atom(_take(args, 1, group, "(not (PREDICATE ...))")[0]), place=place)
    if head == "forall":
        variables, effect = _take(args, 2, group, "(forall (?x - TYPE) EFFECT)")
        return ForEach(parse_variables(variables), parse_effect(effect), place=place)
    if head == "when":
        condition, effect = _take(args, 2, group, "(when CONDITION EFFECT)")
        return When(parse_condition(condition), parse_effect(effect), place=place)
    fluent, value = _take(args, 2, group, f"({head} (FUNCTION ...) NUMBER)")
    return NumericEffect(head, _fluent(fluent), parse_term(value), place=place)


def _fluent(node: Node) -> Call:
    """Return the function that an effect changes.

    Some files write `(increase total-cost 1)`, without parentheses around the function.
    """
    if isinstance(node, Word) and not node.quoted and not node.text.startswith("?"):
        return Call(node.folded(), (), place=node.place)
    return _call(_group(node, "a function"))


def _effect_atom(node: Node) -> Atom:
    group = _group(node, "a predicate")
    head = _head(group, "a predicate")
    if head in (*KEYWORDS, *ASSIGNMENTS, "when"):
        raise ParseError(f"only a predicate can be deleted, not '{head}'", place=group.place)
    return _atom(group, head, EFFECT_KEYWORDS)


def _atom(group: Group, head: str, keywords: Iterable[str]) -> Atom:
    try:
        return Atom(head, tuple(parse_term(a) for a in group.items[1:]), place=group.place)
    except ParseError:
        nested = any(isinstance(a, Group) for a in group.items[1:])
        if nested and nearest(head, keywords) is not None:  # a misspelt keyword is the more likely mistake
            raise ParseError(
                f"'{head}' is read as a predicate, whose arguments are names, variables or numbers",
                place=group.place,
                found=head,
                valid=keywords,
            ) from None
        raise


def _simple_term(word: Word) -> Term:
    if word.quoted:
        return Constant(word.text, quoted=True, place=word.place)
    text = word.folded()
    if text.startswith("?"):
        if len(text) == 1:
            raise ParseError("'?' without a variable's name", place=word.place)
        return Variable(text[1:], place=word.place)
    if is_number(text):
        return Constant(_number(word), place=word.place)
    if text in TRUTH_VALUES:
        return Constant(TRUTH_VALUES[text], place=word.place)
    if text == "-" or text.startswith(":"):
        raise ParseError(f"'{text}' is not a name, variable or number", place=word.place)
    return Constant(text, place=word.place)


def _number(word: Word) -> int | float:
    if len(word.text) > LONGEST_NUMBER:
        raise ParseError(f"a number has at most {LONGEST_NUMBER} characters", place=word.place)
    try:
        return int(word.text)
    except ValueError:
        value = float(word.text)
    if not math.isfinite(value):
        raise ParseError(f"the number {word.text} is too large", place=word.place)
    return value


def _compound_term(group: Group) -> Term:
    head = _head(group, "a function's name or one of " + " ".join(COMPUTING))
    if head not in COMPUTING:
        return _call(group)
    args = tuple(parse_term(a) for a in group.items[1:])
    if head == GEOMETRY:
        if len(args) > MOST_NUMBERS:
            raise ParseError(f"a geometry has at most {MOST_NUMBERS} numbers; found {len(args)}", place=group.place)
        return Arithmetic(head, args, place=group.place)
    fewest, most = (1 if head == "-" else 2), (2 if head in "-/" else len(args))
    if not fewest <= len(args) <= most:
        raise ParseError(f"'{head}' takes two numbers; found {len(args)}", place=group.place)
    return Arithmetic(head, args, place=group.place)


def _call(group: Group) -> Call:
    head = _head(group, "a function's name")
    if head in (*KEYWORDS, *COMPUTING):
        message = f"'{head}' is not a function; a name, number or function is expected"
        raise ParseError(f"{message} (a condition as text: '\"({head} …)\"')", place=group.place)
    return Call(head, tuple(parse_term(a) for a in group.items[1:]), place=group.place)


_HEADS = {And: "and", AllOf: "and", Or: "or", Not: "not", Delete: "not", Imply: "imply", When: "when"}


def to_text(form: Form) -> str:
    """Return `form` on one line of PDDL without loss: `parse(to_text(x)) == x`."""
    match form:
        case Variable(name):
            return f"?{name}"
        case Constant(value, quoted):
            return value_text(value, quoted=quoted)
        case Add(atom):
            return to_text(atom)
        case Exists(variables, body) | Forall(variables, body) | ForEach(variables, body):
            head = "exists" if isinstance(form, Exists) else "forall"
            return f"({head} {variables_text(variables)} {to_text(body)})"
        case Atom(head) | Call(head) | Arithmetic(head) | Comparison(head) | NumericEffect(head):
            pass
        case _:
            head = _HEADS[type(form)]
    return "(" + " ".join([head, *map(to_text, parts_of_form(form))]) + ")"


def variables_text(variables: Sequence[TypedVariable]) -> str:
    """Return a typed list in parentheses: `(?a - cup ?b - object)`.

    Types are omitted if no variable has one.
    """
    typed = any(v.types for v in variables)  # else an untyped variable would have the type of the next
    return "(" + " ".join(f"?{v.name} - {types_text(v.types)}" if typed else f"?{v.name}" for v in variables) + ")"


def types_text(types: Sequence[str]) -> str:
    """Return the types of a name in the notation of a typed list."""
    return types[0] if len(types) == 1 else f"(either {' '.join(types)})" if types else "object"

"""Statements: facts, values and objects as text, each a change (`Delta`).

A statement is an effect of the language (`(on cup1 table)`, `(not (on cup1 table))`, `(increase (failures cup1) 1)`), a
number in the notation of problems (`(= (weight cup1) 0.2)`), or an object with its type, written like a fact
(`(cup cup1)`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from knowledge_base.errors import InputError, ParseError, SchemaError, UnknownNameError
from knowledge_base.facts import Delta, Fact
from knowledge_base.language.checking.check import check, check_effect
from knowledge_base.language.checking.vocabulary import ROOT_TYPE
from knowledge_base.language.evaluation.evaluator import apply_effect
from knowledge_base.language.evaluation.world_protocol import BoundedWorld, Bounds, Meter, World
from knowledge_base.language.syntax.effect import Add, AllOf, Delete, Effect, ForEach, NumericEffect, When
from knowledge_base.language.syntax.expression import Atom, Call, Comparison, Constant, Expression
from knowledge_base.language.syntax.sexpr import Group, Node, read
from knowledge_base.language.syntax.text import parse_condition, parse_effect, to_text
from knowledge_base.world.overlay import Overlay

MOST_WORK = 500_000
"""Number of facts and objects that all statements of one change may visit, in up to about four seconds."""
_BOUNDS = Bounds(work=MOST_WORK)


def told(statements: Iterable[str | Node], world: World, source: str | None = None, bounds: Bounds = _BOUNDS) -> Delta:
    """Return the change that makes all the statements true, in the order of the statements.

    A statement may mention an object before the statement that declares its type.

    Args:
        statements: the texts or parsed groups, one statement each.
        world: the world before the change.
        source: name of the texts in error messages; the number of the statement follows the name.
        bounds: work, seconds and cancellation for all statements together.

    Raises:
        OutOfBoundsError: the evaluation exceeds the bounds.
        ParseError: a text is not a statement.
        UnknownNameError: an undeclared type, predicate or function, or an object that is neither known nor declared
            here.
        SchemaError: a wrong number of arguments or a wrong type, or a known object has another type.
        InputError: a statement and its negation.
    """
    effects = [_effect(text, _source_name(source, number)) for number, text in enumerate(statements, 1)]
    _require_consistent(effects)
    view, meter = Overlay(world), Meter(bounds)
    seen = BoundedWorld(view, meter)
    for effect in effects:
        if (thing := _thing(effect, world)) is not None:
            view.apply(Delta(nodes=thing))
    known = _types_by_name(view)
    for effect in effects:
        if _thing(effect, world) is None:
            check_effect(effect, world.schema, objects=known)
            with meter.over(source or "an effect"):
                change = apply_effect(effect, seen)
            view.apply(change)
    return view.delta


def retracted(statements: Iterable[str], world: World, source: str | None = None) -> Delta:
    """Return the change that makes the facts false.

    For an object with its type, the change removes the object with all its facts and values.

    Raises:
        InputError: as for `told`; also for a fact that is false already.
    """
    view = Overlay(world)
    known = _types_by_name(view)
    for number, text in enumerate(statements, 1):
        atom = _atom(parse_condition(text, _source_name(source, number)))
        check(atom, world.schema, objects=known)
        view.apply(_taken_back(atom, view))
    return view.delta


def _require_consistent(effects: Iterable[Effect]) -> None:
    """Raise an error that names both places if one statement is the negation of another."""
    said: dict[Atom, Add | Delete] = {}
    for literal in _literals(effects):
        before = said.setdefault(literal.atom, literal)
        if type(before) is not type(literal):
            atom = to_text(literal.atom)
            truth, other = ("true", "false") if isinstance(literal, Add) else ("false", "true")
            message = f"the change contradicts itself: {atom} is {truth} here, and {other} at {before.place}"
            raise InputError(message, place=literal.place, found=atom)


def _literals(effects: Iterable[Effect]) -> Iterator[Add | Delete]:
    for effect in effects:
        match effect:
            case Add() | Delete():
                yield effect
            case AllOf(parts):
                yield from _literals(parts)
            case NumericEffect() | When() | ForEach():
                pass


def _source_name(source: str | None, number: int) -> str | None:
    return None if source is None else f"{source} {number}"


def _effect(text: str | Node, source: str | None) -> Effect:
    """Return the statement as an effect; `=` becomes an assignment of a number."""
    groups = read(text, source) if isinstance(text, str) else [text]
    if len(groups) != 1 or not isinstance(groups[0], Group) or groups[0].head() != "=":
        return parse_effect(text, source)
    said = parse_condition(groups[0])
    if not isinstance(said, Comparison) or not isinstance(said.left, Call):
        raise ParseError("'=' sets a number of a function: (= (FUNCTION ...) NUMBER)", place=said.place)
    return NumericEffect("assign", said.left, said.right, place=said.place)


def _thing(effect: Effect, world: World) -> Mapping[str, str] | None:
    """Return the object with its type if the statement declares an object, else `None`."""
    if not isinstance(effect, Add) or not world.schema.is_type(effect.atom.predicate, len(effect.atom.args)):
        return None
    (arg,) = effect.atom.args
    if not isinstance(arg, Constant) or not isinstance(arg.value, str):
        raise SchemaError(f"a type takes the name of a thing: ({effect.atom.predicate} NAME)", place=effect.place)
    return {arg.value: effect.atom.predicate}


def _types_by_name(world: World) -> dict[str, str]:
    return {name: world.type_of(name) or ROOT_TYPE for name in world.objects(ROOT_TYPE)}


def _atom(e: Expression) -> Atom:
    if not isinstance(e, Atom):
        raise InputError("a retraction names a fact or a thing: (on cup1 table), (cup cup1)", place=e.place)
    return e


def _taken_back(atom: Atom, world: World) -> Delta:
    args = tuple(arg.value for arg in atom.args if isinstance(arg, Constant))
    if world.schema.is_type(atom.predicate, len(args)):
        return Delta(removed_nodes=(_of_type(atom, str(args[0]), world),))
    fact = Fact(atom.predicate, args)
    if not world.holds(atom.predicate, args):
        held = [str(Fact(atom.predicate, other)) for other in world.match(atom.predicate, (None,) * len(args))]
        raise InputError(f"{fact} does not hold", place=atom.place, found=str(fact), valid=held)
    return Delta(removed=(fact,))


def _of_type(atom: Atom, name: str, world: World) -> str:
    own = world.type_of(name)
    if own is None or not world.schema.is_a(own, atom.predicate):
        valid = world.objects(atom.predicate)
        raise UnknownNameError(f"there is no {atom.predicate} '{name}'", place=atom.place, found=name, valid=valid)
    return name

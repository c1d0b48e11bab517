"""Planning actions and axioms, checked against their schema."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, TypeVar

from knowledge_base.errors import InputError, Place, SchemaError, tolerated
from knowledge_base.language.checking.check import check, check_effect, check_parameters
from knowledge_base.language.syntax.durative import Duration, DurativeParts
from knowledge_base.language.syntax.effect import Add, AllOf, Delete, Effect, effect_leaves
from knowledge_base.language.syntax.expression import And, Comparison, Expression, TypedVariable
from knowledge_base.owner_cache import Owner
from knowledge_base.pddl.action_text import ActionText

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from knowledge_base.world.axioms import Axiom
    from knowledge_base.world.schema import Schema


_Form = TypeVar("_Form", Expression, Effect)


@dataclass(frozen=True)
class PlanningAction(Owner):
    """A PDDL action. A planning action with arguments is a `PlanStep`.

    Attributes:
        name, parameters: name and parameters, as in the declaration.
        precondition: the condition before the action; of a durative action, the condition for its execution alone.
        effect: the changes after the action; of a durative action, the changes by its execution alone.
        place: the place of the declaration in the source file.
        duration: the bounds of the duration in seconds; `None` for an instantaneous action.
        timed: the conditions and effects of a durative action at start, over all and at end.
    """

    name: str
    parameters: tuple[TypedVariable, ...]
    precondition: Expression
    effect: Effect
    place: Place | None = field(default=None, compare=False, repr=False)
    duration: Duration | None = None
    timed: DurativeParts | None = None


def action_of(action: ActionText) -> PlanningAction:
    """Return the planning action of a parsed action."""
    return PlanningAction(
        action.name, action.parameters, action.precondition, action.effect, action.place, action.duration, action.timed
    )


def check_action(action: PlanningAction, schema: Schema) -> None:
    """Check an action against the schema; raise `InputError` if it uses an undeclared name."""
    for parameter in action.parameters:
        for one in parameter.types:
            schema.require_type(one, parameter.place)  # each argument is an object
    variables = check_parameters(action.parameters, schema)
    # An unknown constant is an error, because a domain does not contain the objects of a problem.
    timed = action.timed or DurativeParts(start=action.precondition, end_effect=action.effect)
    for condition in (timed.start, timed.over_all, timed.end):
        parts = condition.parts if isinstance(condition, And) else ()
        _check_all(
            condition, parts, partial(check, schema=schema, variables=variables, objects=schema.constants, live=False)
        )
    for effect in (timed.start_effect, timed.end_effect):
        some = effect.parts if isinstance(effect, AllOf) else ()
        _check_all(
            effect,
            some,
            partial(check_effect, schema=schema, variables=variables, objects=schema.constants, live=False),
        )
    if action.duration is not None:
        bounds = Comparison("<=", action.duration.least, action.duration.most)
        with tolerated():
            check(bounds, schema, variables, objects=schema.constants)


def _check_all(whole: _Form, parts: Iterable[_Form], check_one: Callable[[_Form], object]) -> None:
    """Check a form; if it is wrong, check its parts, so that each wrong part is reported."""
    try:
        check_one(whole)
    except InputError:
        before = False
        for part in parts:
            try:
                check_one(part)
            except InputError:
                before = True
                with tolerated():
                    raise
        if not before:
            with tolerated():
                raise


def refuse_changed(actions: Iterable[PlanningAction], axioms: Iterable[Axiom]) -> None:
    """Raise `SchemaError` if a planning action changes a derived predicate."""
    derived = {axiom.predicate: axiom for axiom in axioms}
    for action in actions:
        for leaf in effect_leaves(action.effect):
            if isinstance(leaf, Add | Delete) and leaf.atom.predicate in derived:
                name = leaf.atom.predicate
                raise SchemaError(
                    f"the action '{action.name}' changes '{name}', which is derived (at {derived[name].place})",
                    place=leaf.atom.place,
                )

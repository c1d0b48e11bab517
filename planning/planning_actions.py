"""Planning actions and axioms, checked against the schema that they are written in."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from knowledge_base.errors import Place, SchemaError
from knowledge_base.language.check import check, check_arity, check_effect, check_parameters
from knowledge_base.language.durative import Duration, DurativeParts
from knowledge_base.language.effect import Add, Delete, Effect, effect_leaves
from knowledge_base.language.expression import Atom, Comparison, Expression, TypedVariable, Variable
from knowledge_base.pddl.action_text import ActionText
from knowledge_base.pddl.domain_text import AxiomText

if TYPE_CHECKING:
    from collections.abc import Iterable

    from knowledge_base.world.schema import Schema


@dataclass(frozen=True, slots=True)
class PlanningAction:
    """What the planner may do, in general; with arguments it becomes a `PlanStep`.

    Attributes:
        name, parameters: as declared.
        precondition: what must hold before; of a durative action, what it needs when it is done alone.
        effect: what has changed afterwards; of a durative action, when it was done alone.
        place: where it is defined.
        duration: how long it takes, in seconds; `None` for an action without duration.
        timed: what a durative action needs and does at its start, all the time, and at its end.
    """

    name: str
    parameters: tuple[TypedVariable, ...]
    precondition: Expression
    effect: Effect
    place: Place | None = field(default=None, compare=False, repr=False)
    duration: Duration | None = None
    timed: DurativeParts | None = None


@dataclass(frozen=True, slots=True)
class Axiom:
    """A derived predicate (PDDL 2.2): it holds of these parameters wherever the condition does.

    Several axioms for one predicate are alternatives.
    """

    predicate: str
    parameters: tuple[TypedVariable, ...]
    condition: Expression
    place: Place | None = field(default=None, compare=False, repr=False)


def checked(action: ActionText, schema: Schema) -> PlanningAction:
    """The action, if the schema knows all that it is about.

    Raises:
        InputError: it does not.
    """
    for parameter in action.parameters:
        for one in parameter.types:
            schema.require_type(one, parameter.place)  # a parameter is a thing: a plan names it
    variables = check_parameters(action.parameters, schema)
    # A name that is no constant is a mistake here: the problem's objects are not known to the domain.
    timed = action.timed or DurativeParts(start=action.precondition, end_effect=action.effect)
    for condition in (timed.start, timed.over_all, timed.end):
        check(condition, schema, variables, objects=schema.constants)
    for effect in (timed.start_effect, timed.end_effect):
        check_effect(effect, schema, variables, objects=schema.constants)
    if action.duration is not None:
        bounds = Comparison("<=", action.duration.least, action.duration.most)
        check(bounds, schema, variables, objects=schema.constants)
    return PlanningAction(
        action.name, action.parameters, action.precondition, action.effect, action.place, action.duration, action.timed
    )


def checked_axiom(axiom: AxiomText, schema: Schema) -> Axiom:
    """As `checked`, for an axiom; types that it leaves out are those of its predicate."""
    head = axiom.head
    signature = schema.predicate(head.name, head.place)
    check_arity(signature, len(head.parameters), head.place)
    declared = zip(head.parameters, signature.parameters, strict=True)
    parameters = tuple(own if own.types else replace(own, types=theirs.types) for own, theirs in declared)
    variables = check_parameters(parameters, schema)
    check(Atom(head.name, tuple(Variable(p.name) for p in parameters), place=head.place), schema, variables)
    check(axiom.condition, schema, variables, objects=schema.constants)
    return Axiom(head.name, parameters, axiom.condition, head.place)


def refuse_changed(actions: Iterable[PlanningAction], axioms: tuple[Axiom, ...]) -> None:
    """A derived predicate follows from others; no action may say otherwise."""
    derived = {axiom.predicate: axiom for axiom in axioms}
    for action in actions:
        for leaf in effect_leaves(action.effect):
            if isinstance(leaf, Add | Delete) and leaf.atom.predicate in derived:
                name = leaf.atom.predicate
                raise SchemaError(
                    f"the action '{action.name}' changes '{name}', which is derived (at {derived[name].place})",
                    place=leaf.atom.place,
                )

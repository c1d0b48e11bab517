"""A planning domain: the schema and the planning actions of a PDDL file, checked against each other."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from knowledge_base.errors import InputError, Place, SchemaError, UnknownNameError
from knowledge_base.exchange.domain_writer import action_to_text, axiom_to_text, domain_to_text
from knowledge_base.language.check import check, check_arity, check_effect, check_parameters
from knowledge_base.language.effect import Add, Delete, Effect, effect_leaves, substitute_effect
from knowledge_base.language.evaluation import Explanation, World, apply_effect, explain, holds
from knowledge_base.language.expression import (
    And,
    Atom,
    Comparison,
    Constant,
    Exists,
    Expression,
    Or,
    TypedVariable,
    Variable,
    substitute,
)
from knowledge_base.language.timed import Duration, Timed
from knowledge_base.language.vocabulary import ROOT_TYPE
from knowledge_base.pddl.action_text import ActionText
from knowledge_base.pddl.domain_text import AxiomText, DomainText, parse_domain, read_domain
from knowledge_base.world.schema import Schema
from planning.fragments import merged_text, searched, text_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from knowledge_base.facts import Delta
    from knowledge_base.world.computation import Computed
    from planning.plan import PlanStep

_MOST_GROUND = 1024  # steps; a plan for 50 items has about 130

__all__ = ["Axiom", "Duration", "PlanningAction", "PlanningDomain", "Timed"]


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
    timed: Timed | None = None


@dataclass(frozen=True, slots=True)
class Axiom:
    """A derived predicate (PDDL 2.2): it holds of these parameters wherever the condition does.

    Several axioms for one predicate are alternatives.
    """

    predicate: str
    parameters: tuple[TypedVariable, ...]
    condition: Expression
    place: Place | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class GroundStep:
    """What a step needs and does, its arguments in the place of the parameters.

    Attributes:
        condition: the precondition, without the types of the arguments.
        typed: the types and the precondition, as one conjunction.
        effect: what it changes.
    """

    condition: Expression
    typed: And
    effect: Effect


@dataclass(frozen=True, slots=True)
class PlanningDomain:
    """Planning actions over a schema.

    `axioms` says what derived predicates follow from; `notes`, with their places, what deserves a look in the
    files though it changes nothing.

    The verbs take a step and the world it would be taken in. They raise `UnknownNameError` for a step whose
    action the domain does not have, and `InputError` for a wrong number of arguments.
    """

    name: str
    schema: Schema
    actions: Mapping[str, PlanningAction]
    axioms: tuple[Axiom, ...] = ()
    notes: tuple[str, ...] = field(default=(), compare=False, repr=False)
    _ground: dict[PlanStep, GroundStep] = field(default_factory=dict, init=False, compare=False, repr=False)

    @classmethod
    def from_pddl(cls, path: str | Path, *more: str | Path, computed: Iterable[Computed[Any]] = ()) -> PlanningDomain:
        """The domain of a PDDL file, or of several that each have a part of it.

        Args:
            path: the file.
            *more: others.
            computed: predicates that its conditions use and that Python computes.

        Raises:
            InputError: a file cannot be read or contains a mistake; it says where.
        """
        return cls.from_fragments([Path(one) for one in (path, *more)], computed)

    @classmethod
    def from_fragments(
        cls, fragments: Iterable[PlanningDomain | DomainText | Path | str], computed: Iterable[Computed[Any]] = ()
    ) -> PlanningDomain:
        """The domain that fragments make together, with the name of the first.

        A fragment may use what another declares, wherever it stands. The same declared twice is fine.

        Args:
            fragments: PDDL files (a `Path`, or a name), PDDL texts, or domains; at least one.
            computed: predicates that their conditions use and that Python computes; a domain brings its own.

        Raises:
            InputError: a fragment cannot be read or contains a mistake, or two contradict each other; it says
                where.
        """
        pieces = list(fragments)
        if not pieces:
            raise InputError("a planning domain has at least one fragment")
        if len(pieces) == 1 and isinstance(pieces[0], PlanningDomain):
            return pieces[0]
        texts = [_text(piece) for piece in pieces]
        with searched(texts):
            return cls.from_text(merged_text(texts), (*_computed(pieces), *computed))

    @classmethod
    def parse(
        cls, text: str, source: str | None = None, computed: Iterable[Computed[Any]] = ()
    ) -> PlanningDomain:
        """The domain given as text; `source` names it in messages.

        Raises:
            InputError: it contains a mistake; it says where.
        """
        return cls.from_text(parse_domain(text, source), computed)

    @classmethod
    def from_text(cls, read: DomainText, computed: Iterable[Computed[Any]] = ()) -> PlanningDomain:
        """The domain that a file, or several together, declare.

        Raises:
            InputError: it contains a mistake; it says where.
        """
        schema = Schema.from_text(read).with_computed(*computed)
        actions = {a.name: _checked(a, schema) for a in read.actions}
        axioms = tuple(_checked_axiom(a, schema) for a in read.axioms)
        _refuse_changed(actions.values(), axioms)
        return cls(read.name, schema, actions, axioms, tuple(dict.fromkeys(read.remarks())))

    def to_pddl(self) -> str:
        """All of it as one PDDL file, whatever it was made from; reading that gives the same domain.

        Raises:
            InputError: a name that PDDL cannot spell, or a predicate that Python computes.
        """
        if self.schema.computed:
            computed = next(iter(self.schema.computed))
            raise InputError(f"the predicate '{computed}' is computed by Python, which PDDL cannot say", found=computed)
        return domain_to_text(text_of(self))

    def statements(self) -> dict[str, str]:
        """What plans rely on, in PDDL on one line each: the actions and derived predicates, by what they are called."""
        text = text_of(self)
        found = {f"planning action '{one.name}'": action_to_text(one) for one in text.actions}
        for axiom in text.axioms:
            name = f"derived predicate '{axiom.head.name}'"
            found[name] = f"{found.get(name, '')} {axiom_to_text(axiom)}"
        return {name: " ".join(one.split()) for name, one in found.items()}

    def applicable(self, step: PlanStep, world: World) -> bool:
        """Whether the arguments are of the parameters' types and the precondition holds."""
        action, bindings = self.action(step), self.bindings(step)
        fits = all(
            world.schema.fits(world.type_of(bindings[p.name]) or "", p.types) for p in action.parameters
        )
        return fits and holds(action.precondition, world, bindings)

    def effects(self, step: PlanStep, world: World) -> Delta:
        """What the step changes, whether it is applicable or not."""
        return apply_effect(self.action(step).effect, world, self.bindings(step))

    def precondition(self, step: PlanStep) -> Expression:
        """The step's precondition as one conjunction with its arguments in it, their types first."""
        return self.ground(step).typed

    def ground(self, step: PlanStep) -> GroundStep:
        """The step with its arguments in it; kept, since one plan has most steps of the one before."""
        known = self._ground.get(step)
        if known is None:
            if len(self._ground) >= _MOST_GROUND:
                self._ground.clear()
            known = self._ground[step] = self._grounded(step)
        return known

    def _grounded(self, step: PlanStep) -> GroundStep:
        action, bindings = self.action(step), self.bindings(step)
        types = [_type_test(p, bindings[p.name], self.schema) for p in action.parameters]
        condition = substitute(action.precondition, bindings)
        typed = And((*types, *(condition.parts if isinstance(condition, And) else (condition,))))
        return GroundStep(condition, typed, substitute_effect(action.effect, bindings))

    def why_not(self, step: PlanStep, world: World) -> Explanation:
        """The precondition with truth values; its deciding leaf says what the step is waiting for."""
        return explain(self.precondition(step), world)

    def action(self, step: PlanStep) -> PlanningAction:
        """The action that the step is one case of."""
        found = self.actions.get(step.action)
        if found is None:
            raise UnknownNameError(
                f"there is no planning action '{step.action}'", found=step.action, valid=self.actions
            )
        return found

    def bindings(self, step: PlanStep) -> dict[str, str]:
        """The action's parameters with the step's arguments."""
        parameters = self.action(step).parameters
        if len(parameters) != len(step.args):
            raise InputError(
                f"'{step.action}' takes {len(parameters)} arguments, {step} has {len(step.args)}"
            )
        return {p.name: arg for p, arg in zip(parameters, step.args, strict=True)}


def _computed(pieces: Iterable[object]) -> Iterator[Computed[Any]]:
    for piece in pieces:
        if isinstance(piece, PlanningDomain):
            yield from piece.schema.computed.values()


def _text(fragment: PlanningDomain | DomainText | Path | str) -> DomainText:
    if isinstance(fragment, PlanningDomain):
        return text_of(fragment)
    return fragment if isinstance(fragment, DomainText) else read_domain(fragment)


def _type_test(parameter: TypedVariable, arg: str, schema: Schema) -> Expression:
    types = parameter.types or (ROOT_TYPE,)
    if not all(schema.is_type(one, 1) for one in types):  # a predicate has the name
        it = Variable(parameter.name)
        return Exists((parameter,), Comparison("=", it, Constant(arg)))
    tests = tuple(Atom(one, (Constant(arg),)) for one in types)
    return tests[0] if len(tests) == 1 else Or(tests)


def _checked(action: ActionText, schema: Schema) -> PlanningAction:
    for parameter in action.parameters:
        for one in parameter.types:
            schema.require_type(one, parameter.place)  # a parameter is a thing: a plan names it
    variables = check_parameters(action.parameters, schema)
    # A name that is no constant is a mistake here: the problem's objects are not known to the domain.
    timed = action.timed or Timed(start=action.precondition, end_effect=action.effect)
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


def _checked_axiom(axiom: AxiomText, schema: Schema) -> Axiom:
    head = axiom.head
    signature = schema.predicate(head.name, head.place)
    check_arity(signature, len(head.parameters), head.place)
    declared = zip(head.parameters, signature.parameters, strict=True)
    parameters = tuple(own if own.types else replace(own, types=theirs.types) for own, theirs in declared)
    variables = check_parameters(parameters, schema)
    check(Atom(head.name, tuple(Variable(p.name) for p in parameters), place=head.place), schema, variables)
    check(axiom.condition, schema, variables, objects=schema.constants)
    return Axiom(head.name, parameters, axiom.condition, head.place)


def _refuse_changed(actions: Iterable[PlanningAction], axioms: tuple[Axiom, ...]) -> None:
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

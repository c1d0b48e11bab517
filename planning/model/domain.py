"""A planning domain: schema and planning actions of PDDL files, with each name in the actions checked (S4.6).

Fragments are merged as text forms, before name resolution. A fragment may therefore use names that another fragment
declares, in any order. Equal declarations are merged; contradictory declarations raise an error with both places.
"""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from knowledge_base.errors import InputError, Place, UnknownNameError, tolerated
from knowledge_base.language.checking.inputs import require
from knowledge_base.language.checking.vocabulary import ROOT_TYPE, Signature
from knowledge_base.language.evaluation.evaluator import apply_effect, holds
from knowledge_base.language.evaluation.explanation import Explanation, explain
from knowledge_base.language.evaluation.world_protocol import World
from knowledge_base.language.syntax.durative import Duration
from knowledge_base.language.syntax.effect import Effect, substitute_effect
from knowledge_base.language.syntax.expression import (
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
from knowledge_base.language.syntax.sexpr import TypedName
from knowledge_base.owner_cache import Owner
from knowledge_base.pddl.action_text import ActionText, united
from knowledge_base.pddl.domain_text import AxiomText, DeclarationText, DomainText, parse_domain, read_domain
from knowledge_base.pddl.writer import action_to_text, axiom_to_text, domain_to_text
from knowledge_base.spelling import number_text
from knowledge_base.world.axioms import Axiom, checked_axiom
from knowledge_base.world.schema import Schema, agreed_names
from planning.model.actions import PlanningAction, action_of, check_action, refuse_changed

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from knowledge_base.facts import Delta
    from knowledge_base.world.computation import Computed
    from planning.model.plan import PlanStep

_MOST_GROUND = 1024  # steps; a plan for 50 items has about 130 steps

__all__ = ["Duration", "PlanningAction", "PlanningDomain"]


@dataclass(frozen=True)
class GroundStep(Owner):
    """Precondition and effect of a plan step, with the step's arguments instead of parameters.

    Attributes:
        condition: the precondition, without conditions about the types of the arguments.
        typed: the conditions about types and the precondition, as one conjunction.
        effect: the effect of the step.
    """

    condition: Expression
    typed: And
    effect: Effect


@dataclass(frozen=True)
class PlanningDomain(Owner):
    """Planning actions and axioms over a schema.

    `axioms` define derived predicates. `notes` list harmless irregularities of the files, with their places.

    Methods with a step as a parameter raise `UnknownNameError` if the domain lacks the step's action. They raise
    `InputError` for a wrong number of arguments.
    """

    name: str
    schema: Schema
    actions: Mapping[str, PlanningAction]
    axioms: tuple[Axiom, ...] = ()
    notes: tuple[str, ...] = field(default=(), compare=False, repr=False)
    _ground: dict[PlanStep, GroundStep] = field(default_factory=dict, init=False, compare=False, repr=False)

    @classmethod
    def from_pddl(cls, path: str | Path, *more: str | Path, computed: Iterable[Computed[Any]] = ()) -> PlanningDomain:
        """Return the domain of a PDDL file, or of several PDDL files that each declare a part of it.

        Args:
            path: the first file; it determines the name of the domain.
            *more: the other files.
            computed: predicates in the conditions that Python code computes.

        Raises:
            InputError: a file cannot be read or contains an error; the message contains the place.
        """
        return cls.from_fragments([Path(one) for one in (path, *more)], computed)

    @classmethod
    def from_fragments(
        cls, fragments: Iterable[PlanningDomain | DomainText | Path | str], computed: Iterable[Computed[Any]] = ()
    ) -> PlanningDomain:
        """Return the domain that fragments form together, with the name of the first fragment.

        A fragment may use names that another fragment declares, in any order. Equal declarations may repeat.

        Args:
            fragments: at least one domain, PDDL file (a `Path`, or a file name) or PDDL text.
            computed: predicates in the conditions that Python code computes. A `PlanningDomain` among the fragments
                adds its own computed predicates.

        Raises:
            InputError: a fragment cannot be read or contains an error, or two fragments contradict each other; the
                message contains the place.
        """
        pieces = list(fragments)
        if not pieces:
            raise InputError("a planning domain has at least one fragment")
        if len(pieces) == 1 and isinstance(pieces[0], PlanningDomain):
            return pieces[0]
        texts = [_text(piece) for piece in pieces]
        with _name_fragments(texts):
            return cls.from_text(_merge(texts), (*_computed(pieces), *computed))

    @classmethod
    def parse(cls, text: str, source: str | None = None, computed: Iterable[Computed[Any]] = ()) -> PlanningDomain:
        """Return the domain of a PDDL text; error messages identify the text by `source`.

        Raises:
            InputError: the text contains an error; the message contains the place.
        """
        return cls.from_text(parse_domain(text, source), computed)

    @classmethod
    def from_text(cls, read: DomainText, computed: Iterable[Computed[Any]] = ()) -> PlanningDomain:
        """Return the domain of a parsed file, or of several files that were merged.

        Raises:
            InputError: the text contains an error; the message contains the place.
        """
        schema = Schema.from_text(replace(read, axioms=())).with_computed(*computed)
        actions, axioms = {action.name: action_of(action) for action in read.actions}, list[Axiom]()
        for action in read.actions:
            with tolerated():
                check_action(actions[action.name], schema)
        for axiom in read.axioms:
            with tolerated():
                axioms.append(checked_axiom(axiom, schema))
        with tolerated():
            schema = schema.with_axioms(axioms)
            refuse_changed(actions.values(), axioms)
        return cls(read.name, schema, actions, tuple(axioms), tuple(dict.fromkeys(read.remarks())))

    def to_text(self) -> DomainText:
        """Return the domain as the text form of one file, so that `from_text` returns an equal domain."""
        schema = self.schema
        return DomainText(
            name=self.name,
            requirements=(),
            types=tuple(_typed(schema, name, parent) for name, parent in schema.types.items() if parent),
            constants=tuple(_typed(schema, name, kind) for name, kind in schema.constants.items()),
            predicates=_declarations(schema.predicates.values()),
            functions=_declarations(schema.functions.values()),
            actions=tuple(
                ActionText(a.name, a.parameters, a.precondition, a.effect, a.place, a.duration, a.timed)
                for a in self.actions.values()
            ),
            axioms=tuple(
                AxiomText(DeclarationText(a.predicate, a.parameters, a.place), a.condition) for a in self.axioms
            ),
            notes=self.notes,
        )

    def to_pddl(self) -> str:
        """Return the domain as the text of one PDDL file; `parse` returns an equal domain for this text.

        Raises:
            InputError: PDDL cannot express a name, or Python code computes a predicate.
        """
        if self.schema.computed:
            computed = next(iter(self.schema.computed))
            raise InputError(f"Python computes the predicate '{computed}', which PDDL cannot express", found=computed)
        return domain_to_text(self.to_text())

    def statements(self) -> dict[str, str]:
        """Return each action and derived predicate as PDDL on one line, by its name in messages."""
        text = self.to_text()
        found = {f"planning action '{one.name}'": action_to_text(one) for one in text.actions}
        for axiom in text.axioms:
            name = f"derived predicate '{axiom.head.name}'"
            found[name] = f"{found.get(name, '')} {axiom_to_text(axiom)}"
        return {name: " ".join(one.split()) for name, one in found.items()}

    def applicable(self, step: PlanStep, world: World) -> bool:
        """Return whether the step's arguments fit the types of the parameters and the precondition holds in `world`."""
        action, bindings = self._bind_arguments(step)
        fitting, type_of = world.schema.fitting, world.type_of
        for parameter in action.parameters:
            if type_of(bindings[parameter.name]) not in fitting(parameter.types):
                return False
        return holds(action.precondition, world, bindings)

    def effects(self, step: PlanStep, world: World) -> Delta:
        """Return the changes that the step causes in `world`, even if the step is not applicable."""
        action, bindings = self._bind_arguments(step)
        return apply_effect(action.effect, world, bindings)

    def precondition(self, step: PlanStep) -> Expression:
        """Return one conjunction of the conditions about the arguments' types and the step's precondition."""
        return self.ground(step).typed

    def ground(self, step: PlanStep) -> GroundStep:
        """Return the precondition and effect of the step, cached because successive plans share most steps."""
        known = self._ground.get(step)
        if known is None:
            if len(self._ground) >= _MOST_GROUND:
                self._ground.clear()
            known = self._ground[step] = self._ground_step(step)
        return known

    def _ground_step(self, step: PlanStep) -> GroundStep:
        action, bindings = self._bind_arguments(step)
        types = [_type_test(p, bindings[p.name], self.schema) for p in action.parameters]
        condition = substitute(action.precondition, bindings)
        typed = And((*types, *(condition.parts if isinstance(condition, And) else (condition,))))
        return GroundStep(condition, typed, substitute_effect(action.effect, bindings))

    def why_not(self, step: PlanStep, world: World) -> Explanation:
        """Return the step's precondition with truth values; its deciding leaf is the missing fact."""
        return explain(self.precondition(step), world)

    def action(self, step: PlanStep) -> PlanningAction:
        """Return the planning action of the step."""
        found = self.actions.get(step.action)
        if found is None:
            raise UnknownNameError(
                f"there is no planning action '{step.action}'", found=step.action, valid=self.actions
            )
        return found

    def bindings(self, step: PlanStep) -> dict[str, str]:
        """Return the step's arguments by the names of the action's parameters."""
        return self._bind_arguments(step)[1]

    def _bind_arguments(self, step: PlanStep) -> tuple[PlanningAction, dict[str, str]]:
        action = self.action(step)
        if len(action.parameters) != len(step.args):
            raise InputError(
                f"'{step.action}' takes {number_text(len(action.parameters), 'argument')}, {step} has {len(step.args)}"
            )
        return action, {p.name: arg for p, arg in zip(action.parameters, step.args, strict=True)}


def _merge(texts: Sequence[DomainText]) -> DomainText:
    """Return the union of the fragments, with the name of the first fragment.

    Raises:
        SchemaError: two types, constants or actions with equal names differ. `Schema.from_text` detects contradictions
            of other declarations.
    """
    first = texts[0]
    return DomainText(
        name=first.name,
        requirements=tuple(dict.fromkeys(r for text in texts for r in text.requirements)),
        types=agreed_names((text.types for text in texts), "type"),
        constants=agreed_names((text.constants for text in texts), "constant"),
        predicates=tuple(declared for text in texts for declared in text.predicates),
        functions=tuple(declared for text in texts for declared in text.functions),
        actions=united(action for text in texts for action in text.actions),
        axioms=tuple(dict.fromkeys(axiom for text in texts for axiom in text.axioms)),
        notes=tuple(note for text in texts for note in text.notes),
    )


@contextmanager
def _name_fragments(texts: Sequence[DomainText]) -> Iterator[None]:
    """Add the names of the fragments to an error about a name that no fragment declares."""
    sources = dict.fromkeys(text.source or text.name for text in texts)
    try:
        yield
    except InputError as error:
        if error.found is not None and len(sources) > 1:
            error.message += f" in {', '.join(sources)}"
        raise


def _computed(pieces: Iterable[object]) -> Iterator[Computed[Any]]:
    for piece in pieces:
        if isinstance(piece, PlanningDomain):
            yield from piece.schema.computed.values()


def _text(fragment: PlanningDomain | DomainText | Path | str) -> DomainText:
    if isinstance(fragment, PlanningDomain):
        return fragment.to_text()
    if isinstance(fragment, DomainText):
        return fragment
    require(fragment, (str, Path), "a planning domain is a PlanningDomain, a PDDL file or its text")
    return read_domain(fragment)


def _declarations(signatures: Iterable[Signature]) -> tuple[DeclarationText, ...]:
    return tuple(DeclarationText(s.name, s.parameters, s.place, s.result, s.kind) for s in signatures)


def _typed(schema: Schema, name: str, kind: str) -> TypedName:
    return TypedName(name, (kind,), schema.places.get(name, Place()))


def _type_test(parameter: TypedVariable, arg: str, schema: Schema) -> Expression:
    types = parameter.types or (ROOT_TYPE,)
    if not all(schema.is_type(one, 1) for one in types):  # a predicate has the name of the type
        it = Variable(parameter.name)
        return Exists((parameter,), Comparison("=", it, Constant(arg)))
    tests = tuple(Atom(one, (Constant(arg),)) for one in types)
    return tests[0] if len(tests) == 1 else Or(tests)

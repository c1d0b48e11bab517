"""A planning domain: the schema and the planning actions of a PDDL file, checked against each other."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from knowledge_base.errors import InputError, Place, UnknownNameError
from knowledge_base.exchange.domain_text import ActionText, parse_domain
from knowledge_base.exchange.files import read_text
from knowledge_base.language.check import check, check_effect, check_parameters
from knowledge_base.language.evaluation import Explanation, World, apply_effect, explain, holds
from knowledge_base.language.expression import And, Atom, Constant, Expression, Or, TypedVariable, substitute
from knowledge_base.language.printer import to_text, variables_text
from knowledge_base.schema import ROOT_TYPE, Schema

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from knowledge_base.computation import Computed
    from knowledge_base.facts import Delta
    from knowledge_base.language.effect import Effect
    from planning.plan import PlanStep


@dataclass(frozen=True, slots=True)
class PlanningAction:
    """What the planner may do, in general; with arguments it becomes a `PlanStep`."""

    name: str
    parameters: tuple[TypedVariable, ...]
    precondition: Expression
    effect: Effect
    place: Place | None = field(default=None, compare=False, repr=False)

    def __str__(self) -> str:
        """What it takes, needs and does, in PDDL."""
        return f"({self.name} {variables_text(self.parameters)} {to_text(self.precondition)} {to_text(self.effect)})"


@dataclass(frozen=True, slots=True)
class PlanningDomain:
    """Planning actions over a schema.

    The verbs take a step and the world it would be taken in. They raise `UnknownNameError` for a step whose
    action the domain does not have, and `InputError` for a wrong number of arguments.
    """

    name: str
    schema: Schema
    actions: Mapping[str, PlanningAction]

    @classmethod
    def from_pddl(cls, path: str | Path, computed: Iterable[Computed[Any]] = ()) -> PlanningDomain:
        """The domain of a PDDL file.

        Args:
            path: the file.
            computed: predicates that its conditions use and that Python computes.

        Raises:
            InputError: the file cannot be read or contains a mistake; it says where.
        """
        return cls.parse(read_text(Path(path)), str(path), computed)

    @classmethod
    def parse(
        cls, text: str, source: str | None = None, computed: Iterable[Computed[Any]] = ()
    ) -> PlanningDomain:
        """The domain given as text; `source` names it in messages.

        Raises:
            InputError: it contains a mistake; it says where.
        """
        read = parse_domain(text, source)
        schema = Schema.from_text(read).with_computed(*computed)
        return cls(read.name, schema, {a.name: _checked(a, schema) for a in read.actions})

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
        action, bindings = self.action(step), self.bindings(step)
        types = [_type_test(p, bindings[p.name]) for p in action.parameters]
        grounded = substitute(action.precondition, bindings)
        return And((*types, *(grounded.parts if isinstance(grounded, And) else (grounded,))))

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


def _type_test(parameter: TypedVariable, arg: str) -> Expression:
    tests = tuple(Atom(one, (Constant(arg),)) for one in parameter.types or (ROOT_TYPE,))
    return tests[0] if len(tests) == 1 else Or(tests)


def _checked(action: ActionText, schema: Schema) -> PlanningAction:
    for parameter in action.parameters:
        for one in parameter.types:
            schema.require_type(one, parameter.place)  # a parameter is a thing: a plan names it
    variables = check_parameters(action.parameters, schema)
    # A name that is no constant is a mistake here: the problem's objects are not known to the domain.
    check(action.precondition, schema, variables, objects=schema.constants)
    check_effect(action.effect, schema, variables, objects=schema.constants)
    return PlanningAction(action.name, action.parameters, action.precondition, action.effect, action.place)

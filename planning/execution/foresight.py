"""Foresight of plans: the user's simulation, called and checked (S1.10, S1.20)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Protocol

from knowledge_base.errors import InputError, SchemaError, UnknownNameError
from knowledge_base.language.checking.inputs import require_able
from knowledge_base.language.checking.relations import relation
from knowledge_base.language.syntax.rewriting import names_of
from knowledge_base.tracebacks import place_of
from knowledge_base.user_objects import shown
from planning.analysis.validation import Validation

if TYPE_CHECKING:
    from knowledge_base.errors import Place
    from knowledge_base.language.syntax.expression import Expression, Term
    from knowledge_base.view import View
    from knowledge_base.world.schema import Schema
    from planning.model.plan import Plan


class Foresight(Protocol):
    """A simulation that models more than the planning domain does, e.g. the physics of a ready world (S1.10).

    An attribute `reads`, which is optional, names predicates and functions: if others change their facts or values, the
    coming steps of a running plan are simulated again.
    """

    def foresee(self, plan: Plan, world: View) -> Validation:
        """Simulate the plan from `world`, the state of the world that the robot believes, and return the result.

        The search rejects an invalid plan and excludes the failing step from the next plan. This method runs in a
        separate thread; it must end, and must not change any state. An exception is a programming error, also the
        error with which `world` refuses an unknown name.
        """
        ...


def names_read(foresight: Foresight | None) -> frozenset[str]:
    """Return the predicates and functions that a foresight reads, as its attribute `reads` tells."""
    return frozenset(getattr(foresight, "reads", ()))


def require_foresight(foresight: Foresight | None, schema: Schema) -> None:
    """Raise an error, with the place of the class, unless a foresight has its method, and known names in `reads`.

    Raises:
        InputError: the method `foresee` is missing, or `reads` is not a collection of texts.
        UnknownNameError: the schema declares neither a predicate nor a function with a name in `reads`.
        SchemaError: a name in `reads` denotes a relation of the running program, or a predicate without own facts.
    """
    if foresight is None:
        return
    require_able(foresight, "foresee", "a foresight")
    place, reads = place_of(type(foresight)), getattr(foresight, "reads", ())
    if not isinstance(reads, tuple | list | set | frozenset):
        example = f"({reads!r},)" if isinstance(reads, str) else "('on',)"
        said = f"`reads` of a foresight is a tuple of names such as {example}, not {shown(reads)[:60]}"
        raise InputError(said, place=place)
    for name in reads:
        _require_noticed(name, schema, place)


def _require_noticed(name: object, schema: Schema, place: Place | None) -> None:
    if not isinstance(name, str):
        raise InputError(f"`reads` of a foresight has names as text, not {shown(name)[:60]}", place=place)
    said = f"`reads` of a foresight has '{name}'"
    if relation(name) is not None:
        message = f"{said}, which describes the running program; only changes of facts and values lead to a simulation"
        raise SchemaError(message, place=place, found=name)
    inputs = _inputs(name, schema)
    if inputs:
        message = f"{said}, which has no own facts; name what it follows from: {', '.join(inputs)}"
        raise SchemaError(message, place=place, found=name)
    if name not in schema.predicates and name not in schema.functions:
        message = f"{said}, which is neither a predicate nor a function of the robot"
        raise UnknownNameError(message, place=place, found=name, valid=(*schema.predicates, *schema.functions))


def _inputs(name: str, schema: Schema) -> list[str]:
    """Return the predicates and functions from which a predicate directly follows; empty for one with facts."""
    parts: list[Expression | Term] = [axiom.condition for axiom in schema.axioms if axiom.predicate == name]
    parts += schema.computed[name].reads if name in schema.computed else ()
    return sorted({one for part in parts for one in names_of(part)} - {name, *schema.types})


def require_verdict(verdict: object, plan: Plan, foresight: Foresight) -> None:
    """Raise `InputError` with the place of the method unless a foresight has returned a `Validation` of the plan."""
    wrong = _mistake(verdict, len(plan.steps))
    if wrong is not None:
        raise InputError(wrong, place=place_of(type(foresight).foresee))


def _mistake(verdict: object, steps: int) -> str | None:
    if not isinstance(verdict, Validation):
        return f"a foresight returns a Validation, not {shown(verdict)[:60]}"
    if verdict.valid not in (True, False):
        return f"`valid` of a Validation is True or False, not {shown(verdict.valid)[:60]}"
    if not isinstance(verdict.why, str):
        return f"`why` of a Validation is text, not {shown(verdict.why)[:60]}"
    for name in ("failing_step", "costliest_step"):
        number = getattr(verdict, name)
        if number is not None and not (isinstance(number, int) and 0 <= number < steps):
            return f"a foresight names a step by its number from 0 to {steps - 1}: `{name}={shown(number)}`"
    cost: object = verdict.cost
    if cost is not None and (isinstance(cost, bool) or not isinstance(cost, int | float) or not math.isfinite(cost)):
        return f"the cost of a plan is a finite number, not {shown(cost)}"
    return None

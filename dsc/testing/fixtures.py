"""Fixtures of tests: world models in one or two lines of PDDL, and stub plots that only end."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Any

from dsc.events import DONE
from dsc.model.declarations import PlotVariable
from dsc.model.plot import ActionPlot
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.facts import Delta
from knowledge_base.language.evaluation.evaluator import apply_effect
from knowledge_base.language.evaluation.terms import Bindings
from knowledge_base.language.syntax.text import parse_effect
from knowledge_base.pddl.domain_text import read_domain
from knowledge_base.pddl.problem_text import read_problem
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema import Schema

EMPTY = Schema()
"""Schema of a world without declared names."""


def world(domain: Schema | Path | str = EMPTY, objects: str = "", facts: str = "") -> KnowledgeBase:
    """Return a knowledge base with these objects and facts, as in a PDDL problem.

    Args:
        domain: a schema, a PDDL domain file, or its text.
        objects: text as after `:objects`, e.g. `"cup1 cup2 - cup table - surface"`.
        facts: text as after `:init`, e.g. `"(on cup1 table) (= (failures cup1) 2)"`.

    Raises:
        InputError: a name is not declared, or a text is not PDDL.
    """
    schema = domain if isinstance(domain, Schema) else Schema.from_text(read_domain(domain))
    problem = f"(define (problem test) (:domain test) (:objects {objects}) (:init {facts}))"
    knowledge = KnowledgeBase(schema)
    knowledge.apply(read_problem(problem, schema, "world").delta(), "test")
    return knowledge


def change_of(what: Delta | str, knowledge: KnowledgeBase, bindings: Bindings | None = None) -> Delta:
    """Return a change as a value; a PDDL effect such as `(not (on ?item table))` applies to the present world.

    Raises:
        InputError: the text is not an effect, or refers to an undeclared or unbound element.
    """
    if isinstance(what, Delta):
        return what
    return apply_effect(parse_effect(what), knowledge.snapshot(), bindings or {})


def ends_with(
    original: ActionPlot,
    outcome: str = DONE,
    attributes: Mapping[str, Any] | None = None,
    *,
    tell: str | None = None,
    after: float = 0.0,
) -> ActionPlot:
    """Return a plot that only ends, with the interface and role of the original; for `Library.substitute`.

    Args:
        original: the plot to replace.
        outcome: one of its outcome events, or `done`.
        attributes: the event's attributes as in a plot: constants, or `?name` for a parameter. With `done`, they are
            values of its outputs.
        tell: a PDDL effect on the knowledge base, instead of the original's actions.
        after: seconds until the plot ends.

    Raises:
        UnknownNameError: the original has no such outcome, or the outcome no such attribute.
        InputError: an attribute is missing.
    """
    given = dict(attributes or {})
    _check(original, outcome, given)
    ending: dict[str, Any] = {"to": "ended", "tell": tell}
    ending |= {"assign": given} if outcome == DONE else {"emit": outcome, "with": given}
    wait = {"after": {"seconds": after, **ending}} if after > 0 else {"always": ending}
    about = f"Stands in for '{original.name}' and ends with '{outcome}'."
    return ActionPlot.model_validate(
        {
            "plot": original.name,
            "about": about,
            "parameters": original.parameters,
            "emits": original.emits,
            "outputs": {name: _output(output) for name, output in original.outputs.items()},
            "when": original.when,
            **original.scores(),
            "implements": original.implements,
            "effects": original.effects,
            "confirm": original.confirm,
            "states": {"standing_in": wait, "ended": {"final": True}},
        }
    )


def _output(output: PlotVariable) -> dict[str, Any]:
    """Return an output that always has an initial value; the value is only read if the outcome is `done`."""
    nothing = 0 if output.type == "number" else "nothing"
    return {"type": output.type, "initial": nothing if output.initial is None else output.initial}


def _check(original: ActionPlot, outcome: str, given: Mapping[str, Any]) -> None:
    if outcome == DONE:
        required = [name for name, output in original.outputs.items() if output.initial is None]
        require_attributes(original.name, outcome, original.outputs, given, required)
    elif outcome in original.emits:
        require_attributes(original.name, outcome, original.emits[outcome] or {}, given)
    else:
        raise UnknownNameError(
            f"plot '{original.name}' does not end with '{outcome}'", place=original.place(("emits",)),
            found=outcome, valid=(DONE, *original.emits),
        )  # fmt: skip


def require_attributes(
    owner: str, outcome: str, declared: Collection[str], given: Collection[str], required: Iterable[str] | None = None
) -> None:
    """Require that an outcome of a plot or skill has its attributes.

    Args:
        owner: name of the plot or skill.
        outcome: the outcome event.
        declared: names of all attributes.
        given: names of the attributes to validate.
        required: names of the required attributes; by default all.

    Raises:
        UnknownNameError: an attribute is not declared.
        InputError: an attribute is missing.
    """
    for name in given:
        if name not in declared:
            message = f"the outcome '{outcome}' of '{owner}' has no attribute '{name}'"
            raise UnknownNameError(message, found=name, valid=declared)
    for name in declared if required is None else required:
        if name not in given:
            raise InputError(f"the outcome '{outcome}' of '{owner}' needs its attribute '{name}'")

r"""From plan to plot: every step a dynamic state over the plots that carry it out (S0.12, S1.5, S2.7).

    before -> step_1 -> after_1 -> step_2 -> after_2 -> ... -> finished
                            \-> replan, if what a step needs does not hold

`after_n` waits until the step's effects are observed and looks at what the next step needs, so that no step
begins on a wrong premise. Outcomes that no inherited rule answers lead to `replan`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dsc.dynamic.rules import GAVE_UP_STATE, REPLAN_STATE
from dsc.events import GAVE_UP
from dsc.model.plot import ActionPlot, Rule
from dsc.validation.structure import RESPONSES
from knowledge_base.errors import UnknownNameError
from knowledge_base.language.effect import Add, AllOf, Delete, Effect, substitute_effect
from knowledge_base.language.expression import And, Atom, Expression, Not, substitute, substitute_term

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from dsc.dynamic.library import Library
    from knowledge_base.facts import Value
    from planning.domain import PlanningDomain
    from planning.plan import Plan, PlanStep

REPLAN = "replan"
"""Outcome of a generated plot: the plan no longer fits the world."""

FINISHED = "finished"


def plot_from_plan(
    plan: Plan, domain: PlanningDomain, library: Library, rules: Sequence[Rule] = (), name: str = "plan"
) -> ActionPlot:
    """The action plot that carries out a plan.

    Args:
        plan: its steps, to be done in order.
        domain: gives each step's precondition and effects.
        library: has the plots that implement the planning actions.
        rules: the contingency rules it inherits.
        name: the plot's name.

    Raises:
        UnknownNameError: no plot implements a step's action.
    """
    states: dict[str, Any] = {"before": {"always": _onward(1, plan, domain, And(()))}}
    for number, step in enumerate(plan.steps, start=1):
        states |= _step_states(number, step, plan, domain, library, name)
    states |= {
        FINISHED: {"final": True},
        REPLAN_STATE: {"final": True, "emit": REPLAN, "with": {"reason": "?reason"}},
        GAVE_UP_STATE: {"final": True, "emit": GAVE_UP, "with": {"reason": "?reason"}},
    }
    return ActionPlot.model_validate(
        {
            "plot": name,
            "about": f"made from a plan of {len(plan.steps)} steps",
            "variables": {"reason": {"type": "text", "initial": "unknown"}},
            "emits": {REPLAN: {"reason": "text"}, GAVE_UP: {"reason": "text"}},
            "states": states,
            "initial": "before",
        "rules": [rule for rule in rules if _concerns(rule, plan, library)],
            "generated": True,
        }
    )


def implementing(step: PlanStep, library: Library) -> tuple[ActionPlot, ...]:
    """The plots that carry out a step's action; raises `UnknownNameError` if there is none."""
    found = library.implementing(step.action)
    if not found:
        known = [plot.implements for plot in library if plot.implements]
        raise UnknownNameError(
            f"no plot implements the planning action '{step.action}'", found=step.action, valid=known
        )
    return found


def _step_states(
    number: int, step: PlanStep, plan: Plan, domain: PlanningDomain, library: Library, name: str
) -> dict[str, Any]:
    candidates = implementing(step, library)
    bindings = domain.bindings(step)
    effect = domain.action(step).effect
    observed = any(plot.effects == "observed" for plot in candidates)
    taken = {name for plot in candidates for name in plot.parameters}
    after = f"after_{number}"
    done: dict[str, Any] = {"to": after}
    if not observed:
        done["tell"] = substitute_effect(effect, bindings)
    expected = expectation(effect, bindings) if observed else And(())
    confirm = max(plot.confirm for plot in candidates)
    late = {"seconds": confirm, "to": REPLAN_STATE, "assign": {"reason": f"not observed: {step}"}}
    return {
        f"step_{number}": {
            "about": str(step),
            "entry": {"set": f"planner.{name}", "to": number},
            "dynamic": [plot.name for plot in candidates],
            "with": {name: value for name, value in bindings.items() if name in taken},
            "on": {"done": done},
        },
        after: {
            "always": _onward(number + 1, plan, domain, expected),
            **({"after": late} if observed else {}),
        },
    }


def _onward(number: int, plan: Plan, domain: PlanningDomain, expected: Expression) -> list[dict[str, Any]]:
    """To step `number` if it is applicable, else back to planning; both only once `expected` holds."""
    if number > len(plan.steps):
        return [{"to": FINISHED, "when": expected}]
    step = plan.steps[number - 1]
    needed = substitute(domain.action(step).precondition, domain.bindings(step))
    parts = dict.fromkeys((*_parts(expected), *_parts(needed)))
    otherwise = {"to": REPLAN_STATE, "assign": {"reason": f"not applicable: {step}"}}
    return [
        {"to": f"step_{number}", "when": And(tuple(parts))},
        {**otherwise, "when": expected} if _parts(expected) else otherwise,
    ]


def _parts(e: Expression) -> tuple[Expression, ...]:
    return e.parts if isinstance(e, And) else (e,)


def expectation(effect: Effect, bindings: Mapping[str, Value]) -> Expression:
    """What holds after an effect, as far as that does not depend on what held before."""
    added = [_ground(part.atom, bindings) for part in _literals(effect) if isinstance(part, Add)]
    deleted = [_ground(part.atom, bindings) for part in _literals(effect) if isinstance(part, Delete)]
    return And((*added, *(Not(atom) for atom in deleted if atom not in added)))


def _literals(effect: Effect) -> list[Add | Delete]:
    if isinstance(effect, AllOf):
        return [literal for part in effect.parts for literal in _literals(part)]
    return [effect] if isinstance(effect, Add | Delete) else []


def _ground(atom: Atom, bindings: Mapping[str, Value]) -> Atom:
    return Atom(atom.predicate, tuple(substitute_term(arg, bindings) for arg in atom.args))


def _concerns(rule: Rule, plan: Plan, library: Library) -> bool:
    """Whether any step could end with the event the rule answers.

    A rule for named states of its plot, or with a way to one, is about that plot alone.
    """
    if rule.of or rule.do.then not in RESPONSES:
        return False
    plots = {plot.name: plot for step in plan.steps for plot in implementing(step, library)}
    return any(rule.on in plot.emits for plot in plots.values())

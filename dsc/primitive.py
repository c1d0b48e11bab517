"""The smallest useful plot: one skill as a plot (S0.9), for skills that need nothing designed around them."""

from __future__ import annotations

from typing import Any, Literal

from dsc.model.plot import ActionPlot
from dsc.skills import SkillSignature, refuse_reserved
from knowledge_base.errors import UnknownNameError


def primitive_plot(
    skill: SkillSignature,
    *,
    done: str,
    name: str | None = None,
    implements: str | None = None,
    when: str | None = None,
    effects: Literal["observed", "assumed"] = "observed",
) -> ActionPlot:
    """A plot that triggers the skill, is done after the outcome `done`, and emits every other outcome.

    A skill that raises or takes too long leaves it where it is; as a step of a plan, it has failed.

    Args:
        skill: the skill's signature, e.g. `arm.skills()["grasp"]`.
        done: the outcome that completes the plot.
        name: the plot's name; the skill's if left out.
        implements: the planning action it carries out; its parameters must be named as the action's.
        when: as a candidate, the condition under which it fits.
        effects: whether the action's effects are observed by the skill or assumed after `done`.

    Raises:
        UnknownNameError: the skill has no outcome `done`.
        SchemaError: an outcome of the skill has the name of an event that only the executive fires.
    """
    refuse_reserved(f"{skill.component}.{skill.name}", skill.outcomes)
    if done not in skill.outcomes:
        raise UnknownNameError(f"skill '{skill.name}' has no outcome '{done}'", found=done, valid=skill.outcomes)
    others = {event: attributes for event, attributes in skill.outcomes.items() if event != done}
    on: dict[str, Any] = {done: "completed"}
    for event, attributes in others.items():
        on[event] = {"to": "ended", "emit": event, "with": {key: f"?event.{key}" for key in attributes}}
    parameters = {key: _parameter(skill, key) for key in skill.parameters if _can_be_given(skill, key)}
    trigger = {"trigger": f"{skill.component}.{skill.name}", "with": {key: f"?{key}" for key in parameters}}
    states: dict[str, Any] = {"execute": {"entry": trigger, "on": on}, "completed": {"final": True}}
    if others:
        states["ended"] = {"final": True}
    return ActionPlot.model_validate(
        {
            "plot": name or skill.name,
            "parameters": parameters,
            "emits": {event: {key: kind or "symbol" for key, kind in a.items()} for event, a in others.items()},
            "implements": implements,
            "when": when,
            "effects": effects,
            "states": states,
        }
    )


def _can_be_given(skill: SkillSignature, key: str) -> bool:
    """A default that no plot can say (a list, `None`) is left to the skill."""
    return key not in skill.defaults or isinstance(skill.defaults[key], str | int | float | bool)


def _parameter(skill: SkillSignature, key: str) -> dict[str, Any]:
    declared = {"type": skill.parameters[key] or "symbol"}
    return {**declared, "default": skill.defaults[key]} if key in skill.defaults else declared

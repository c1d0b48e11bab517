"""Soundness of a robot program, checked before a run: types of the parts; agreement of plots, skills and domain."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from itertools import pairwise
from operator import is_
from pathlib import Path

from dsc.components.component import Component
from dsc.components.interface import Interface
from dsc.components.ports import messages
from dsc.components.value_conditions import WATCH
from dsc.dynamic.library import Library
from dsc.errors import Finding
from dsc.sensing.condition_handler import ConditionHandler
from dsc.skills import SkillSignature, signatures
from dsc.validation import raise_findings, validate_library
from knowledge_base.errors import SchemaError, UnknownNameError
from knowledge_base.language.checking.inputs import require, require_able
from knowledge_base.owner_cache import cache_on_owner
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema import Schema
from planning.execution.planning_component import PlanningComponent
from planning.model.domain import PlanningDomain

RUN_COMPONENTS: tuple[type[Component], ...] = (PlanningComponent, ConditionHandler)
"""The components that each run adds to those of its robot. (Classes are hashable, which mypy does not know.)"""
IMPLEMENTED = "every-action-has-a-plot"
"""The rule of a finding about a planning action without a plot."""


def check_implementations(library: Library, domain: PlanningDomain) -> Iterator[Finding]:
    """Yield a finding for each disagreement between plots and planning actions.

    A plot may implement an unknown action or have a parameter that its action lacks. An action may lack a plot.

    All plots of one action must declare equal `effects`, either `observed` or `assumed`. A generated plot exists before
    one of these plots is chosen. With different effects it might wait for effects that no skill reports.

    A domain without any implemented action is valid, because a program may use the domain without a planner.
    """
    implemented = set()
    for plot in library:
        if plot.implements is None:
            continue
        implemented.add(plot.implements)
        action = domain.actions.get(plot.implements)
        if action is None:
            unknown = UnknownNameError(
                f"the domain '{domain.name}' has no planning action '{plot.implements}'",
                place=plot.place(("implements",)), found=plot.implements, valid=domain.actions,
            )  # fmt: skip
            yield Finding(unknown, "known-planning-action")
            continue
        names = [parameter.name for parameter in action.parameters]
        for name, parameter in plot.parameters.items():
            if name not in names and parameter.required:
                missing = UnknownNameError(
                    f"planning action '{action.name}' has no parameter '?{name}' to give to the plot",
                    place=plot.place(("parameters", name)), found=name, valid=names,
                )  # fmt: skip
                yield Finding(missing, "parameters-of-the-action")
    for name, action in domain.actions.items():
        yield from _mixed_effects(name, library)
        if implemented and name not in implemented:
            error = SchemaError(f"no plot implements the planning action '{name}'", place=action.place, found=name)
            yield Finding(error, IMPLEMENTED, f"add a plot with `implements: {name}`")


def _mixed_effects(action: str, library: Library) -> Iterator[Finding]:
    for first, plot in pairwise(library.implementing(action)):
        if plot.effects != first.effects:
            error = SchemaError(
                f"the plots '{first.name}' and '{plot.name}' implement '{action}', but only one says"
                " `effects: assumed`",
                place=plot.place(("effects",)) or plot.place(("implements",)),
            )
            yield Finding(error, "effects-of-the-action", "say the same in all plots of an action")


@cache_on_owner
def _last_sound(domain: PlanningDomain) -> list[object]:  # noqa: ARG001  its owner
    """Return the list of all parts of the domain's last sound robot; empty before the first one."""
    return []


def interfaces(components: Iterable[Component]) -> dict[str, Interface]:
    """Return the interfaces by name of a robot's components, and of those that each run adds."""
    own = {kind.name: Interface(messages=messages(kind, kind.name)) for kind in RUN_COMPONENTS}  # type: ignore[arg-type]
    return {**own, **{one.name: one.interface() for one in components}}


def run_skills() -> list[SkillSignature]:
    """Return the skills of the components that each run adds to those of its robot."""
    found = [skill for kind in RUN_COMPONENTS for skill in signatures(kind, kind.name).values()]  # type: ignore[arg-type]
    return [skill for skill in found if skill.name != WATCH]  # none has push ports


def require_sound(
    library: Library,
    domain: PlanningDomain,
    schema: Schema,
    skills: Collection[SkillSignature],
    declared: Mapping[str, Interface],
) -> None:
    """Raise `PlotError` with the findings of the validator; a combination that passed before is not checked again."""
    shared = [
        part
        for one in declared.values()
        for part in (one.parameters, one.modes, one.messages, one.requires, one.pushes)
    ]
    parts = (schema, *library, *skills, *declared, *shared)
    last = _last_sound(domain)
    if len(last) == len(parts) and all(map(is_, last, parts)):
        return
    findings = validate_library(library, schema, skills, declared)
    raise_findings([*findings, *check_implementations(library, domain)])
    last[:] = parts


def require_parts(knowledge: object, planner: object, store: object) -> None:
    """Raise `InputError` if a part is not `None` and lacks its declared type."""
    if knowledge is not None:
        require(knowledge, KnowledgeBase, "the knowledge is a KnowledgeBase")
    if store is not None:
        require(store, (str, Path), "a store is named by a text or a Path")
    require_able(planner, "solve", "a planner")

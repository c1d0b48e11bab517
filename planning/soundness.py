"""Whether plots, skills and planning domain fit together, before anything runs."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from dsc.components.parameters import Parameter
from dsc.dynamic.library import Library
from dsc.skills import SkillSignature
from dsc.validation import raise_findings, validate_library
from knowledge_base.world.schema import Schema
from planning.domain import PlanningDomain
from planning.implementations import check_implementations

_sound: dict[tuple[int, ...], tuple[object, ...]] = {}
"""What was found to be sound together, by identity, and kept alive so that no identity is ever another's."""
_MOST_SOUND = 16


def require_sound(
    library: Library,
    domain: PlanningDomain,
    schema: Schema,
    skills: Collection[SkillSignature],
    declared: Mapping[str, Mapping[str, Parameter]],
) -> None:
    """Raise `PlotError` for what the validator finds; what is the same as before is not looked through again."""
    parts = (domain, schema, *library, *skills, *declared, *declared.values())
    key = tuple(map(id, parts))
    if key in _sound:
        return
    findings = validate_library(library, schema, skills, declared)
    raise_findings([*findings, *check_implementations(library, domain)])
    if len(_sound) >= _MOST_SOUND:
        _sound.clear()
    _sound[key] = parts

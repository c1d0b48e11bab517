"""Review of the types of skills: warnings about unknown types that look like a declared type."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from dsc.data_types import data_type, names_in
from dsc.errors import Finding
from dsc.skills import SkillSignature
from dsc.validation.type_checks import FREE_TYPES, TypeChecker
from knowledge_base.errors import Place, UnknownNameError
from knowledge_base.world.schema import Schema


def review_types(skills: Iterable[SkillSignature], schema: Schema) -> Iterator[Finding]:
    """Yield a warning for each unknown type of a skill's parameter or attribute that looks like a declared type.

    Any other unknown type may be a name for Python alone, whose values have no further check.
    """
    for skill in skills:
        file, _, line = skill.place.rpartition(":")
        types, valid = TypeChecker(schema, skill.records), {*FREE_TYPES, *schema.types, *skill.records}
        for name, kind in dict.fromkeys(_named_types(skill)):
            message = f"'{name}' of skill '{skill.component}.{skill.name}' is of the unknown type '{kind}'"
            error = UnknownNameError(message, place=Place(file, int(line)) if file else None, found=kind, valid=valid)
            if not types.knows(kind) and error.nearest is not None:
                yield Finding(error, "known-type", level="warning")


def _named_types(skill: SkillSignature) -> Iterator[tuple[str, str]]:
    """Yield the name of each parameter and attribute with each name in its type."""
    for group in (skill.parameters, *skill.outcomes.values()):
        for name, text in group.items():
            yield from () if text is None else ((name, kind) for kind in names_in(data_type(text)))

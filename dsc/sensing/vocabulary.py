"""The names that a condition over several components and the knowledge may use."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from dsc.components.checks import LIBRARY
from dsc.components.interface import Interface
from dsc.components.value_vocabulary import ValueVocabulary


def vocabulary_of(
    interfaces: Mapping[str, Interface], variables: Collection[str] | None, functions: Collection[str]
) -> ValueVocabulary:
    """Return the names of a condition.

    Args:
        interfaces: the interfaces of the components by name.
        variables: the variables that have values; `None` if they are unknown.
        functions: the functions of the knowledge base.
    """
    ports = {f"{name}.{port}": one.gives for name, face in interfaces.items() for port, one in face.pushes.items()}
    own = [face.checks for face in interfaces.values()]
    checks = {name: check for known in own if known is not None for name, check in known.items()}
    return ValueVocabulary(
        ports, {**checks, **LIBRARY}, variables, "no component pushes a value", functions, any_check=None in own
    )

"""The names that a condition over several components and the knowledge may use."""

from __future__ import annotations

from collections.abc import Mapping

from dsc.components.checks import LIBRARY
from dsc.components.interface import Interface
from dsc.components.value_vocabulary import ValueVocabulary, kind_of_type
from knowledge_base.language.checking.vocabulary import Signature


def vocabulary_of(
    interfaces: Mapping[str, Interface], variables: Mapping[str, str] | None, functions: Mapping[str, Signature]
) -> ValueVocabulary:
    """Return the names of a condition.

    Args:
        interfaces: the interfaces of the components by name.
        variables: the kinds of the variables by name; `None` if they are unknown.
        functions: the functions of the knowledge base.
    """
    ports = {f"{name}.{port}": one.gives for name, face in interfaces.items() for port, one in face.pushes.items()}
    own = [face.checks for face in interfaces.values()]
    checks = {name: check for known in own if known is not None for name, check in known.items()}
    knowledge = {name: kind_of_type(one.result) for name, one in functions.items()}
    return ValueVocabulary(
        ports, {**LIBRARY, **checks}, variables, "no component pushes a value", knowledge, any_check=None in own
    )

"""Read-only relations: predicates whose facts a running program provides, e.g. the active states of a run.

The name of a relation has a namespace and a colon: `dsc:active`. All schemas know all declared relations, so that texts
are checked without the program. No store, change or planning problem contains their facts.
"""

from __future__ import annotations

from collections.abc import Mapping

from knowledge_base.errors import Place, SchemaError
from knowledge_base.language.checking.vocabulary import ROOT_TYPE, VALUE_TYPES, Signature
from knowledge_base.language.syntax.expression import TypedVariable

_declared: dict[str, Signature] = {}


def declare_relations(relations: Mapping[str, str]) -> None:
    """Declare relations for all schemas: their names, each with the names of its arguments.

    Arguments have any type; a name without quotes is also a text.
    """
    for name, arguments in relations.items():
        parameters = tuple([TypedVariable(one, (ROOT_TYPE, *VALUE_TYPES)) for one in arguments.split()])
        _declared[name] = Signature(name, parameters, live=True)


def relation(name: str) -> Signature | None:
    """Return the declared relation of that name, or `None`."""
    return _declared.get(name)


def relation_names() -> tuple[str, ...]:
    """Return the names of the declared relations."""
    return tuple(_declared)


def require_fact(name: str, place: Place | None = None) -> None:
    """Raise `SchemaError` if the name denotes a relation, which no change may contain."""
    if name in _declared:
        raise SchemaError(f"'{name}' is read-only: the running program provides its facts", place=place)

"""Conditions of bindings with the types of the variables, so that only objects of these types are found (S4.3)."""

from __future__ import annotations

from collections.abc import Mapping

from dsc.data_types import ANY, WORDS, DataType, Records, data_type
from dsc.model.actions import Bind
from knowledge_base.language.syntax.expression import And, Atom, Variable


def with_types(bind: Bind, types: Mapping[str, str], records: Records) -> Bind:
    """Return the binding with a condition that finds only objects of the variables' types, e.g. `(cup ?x)`."""
    kinds = {name: element_type(data_type(types[name]), every=bind.every) for name in bind.names if name in types}
    own = {*WORDS, ANY, *records}
    atoms = [
        Atom(kind.name, (Variable(name),))
        for name, kind in kinds.items()
        if kind.kind == "name" and kind.name not in own
    ]
    return bind if not atoms else bind.model_copy(update={"condition": And((bind.condition, *atoms))})


def element_type(kind: DataType, *, every: bool) -> DataType:
    """Return the type of the values that a condition finds for a variable of this type."""
    for wrapper in ("optional", "list") if every else ("optional",):
        if kind.kind == wrapper and kind.inner is not None:
            kind = kind.inner
    return kind

"""Facts, changes, worlds and schemas as plain JSON values and back; nothing is lost, the order neither.

A fact is `["on", "cup1", "table"]`, a value `["weight", "cup1", 0.2]`, in which a geometry is a list. JSON tells
`1`, `1.0` and `true` apart, so values keep their Python types. Reading trusts its input: a wrong form gives a
`FORM_ERRORS`.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from typing import Any

from knowledge_base.facts import Content, Delta, Fact
from knowledge_base.language.expression import TypedVariable
from knowledge_base.language.vocabulary import Signature
from knowledge_base.world.schema import Schema
from knowledge_base.world.state import WorldState

Form = dict[str, Any]
FORM_ERRORS = (AttributeError, IndexError, KeyError, TypeError, ValueError, RecursionError)
"""What reading something that is not of the form can raise, JSON's own errors included."""


def compact(form: Form) -> str:
    """JSON text without spaces, in ASCII: the shortest that every reader agrees about."""
    return json.dumps(form, separators=(",", ":"), allow_nan=False)


def delta_form(delta: Delta) -> Form:
    """A change; parts that say nothing are left out."""
    form: Form = {
        "nodes": dict(delta.nodes),
        "removed_nodes": list(delta.removed_nodes),
        "removed": _fact_forms(delta.removed),
        "added": _fact_forms(delta.added),
        "values": _value_forms(delta.values),
        "replaced": _fact_forms(delta.replaced),
    }
    return {part: said for part, said in form.items() if said}


def delta_of(form: Form) -> Delta:
    """The change that `delta_form` made it from."""
    return Delta(
        nodes=form.get("nodes", {}),
        removed=tuple(_facts(form.get("removed", ()))),
        added=tuple(_facts(form.get("added", ()))),
        values=_values(form.get("values", ())),
        removed_nodes=tuple(form.get("removed_nodes", ())),
        replaced=tuple(_facts(form.get("replaced", ()))),
    )


def world_form(state: WorldState) -> Form:
    """All things (constants too), facts and values."""
    return {"nodes": dict(state.nodes), "facts": _fact_forms(state.facts), "values": _value_forms(state.values)}


def world_of(form: Form, schema: Schema) -> WorldState:
    """The world that `world_form` made it from, or one made with a schema that `schema` extends."""
    return WorldState.of(schema, form["nodes"], _facts(form["facts"]), _values(form["values"]))


def schema_form(schema: Schema) -> Form:
    """All declarations, without their places."""
    return {
        "types": dict(schema.types),
        "constants": dict(schema.constants),
        "predicates": {name: _parameters(signature) for name, signature in schema.predicates.items()},
        "functions": {name: [f.result, *_parameters(f)] for name, f in schema.functions.items()},
        "functional": sorted(schema.functional),
    }


def schema_of(form: Form) -> Schema:
    """The schema that `schema_form` made it from.

    Raises:
        SchemaError: the declarations contradict each other.
    """
    return Schema(
        types=form["types"],
        constants=form["constants"],
        predicates={name: _signature(name, parameters) for name, parameters in form["predicates"].items()},
        functions={name: _signature(name, rest, result) for name, (result, *rest) in form["functions"].items()},
        functional=frozenset(form["functional"]),
    )


def schema_hash(schema: Schema) -> str:
    """SHA-256 of the declarations, in whatever order they were made."""
    text = json.dumps(schema_form(schema), sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def _fact_forms(facts: Iterable[Fact]) -> list[list[Any]]:
    return [[f.predicate, *f.args] for f in facts]


def _facts(forms: Iterable[list[Any]]) -> Iterable[Fact]:
    return (Fact(form[0], tuple(form[1:])) for form in forms)


def _value_forms(values: Mapping[Fact, Content]) -> list[list[Any]]:
    return [[f.predicate, *f.args, content] for f, content in values.items()]


def _values(forms: Iterable[list[Any]]) -> dict[Fact, Content]:
    return {Fact(form[0], tuple(form[1:-1])): _content(form[-1]) for form in forms}


def _content(form: Any) -> Content:
    """JSON has no tuples: a geometry is a list there."""
    return tuple(form) if isinstance(form, list) else form


def _parameters(signature: Signature) -> list[list[Any]]:
    return [[p.name, *p.types] for p in signature.parameters]


def _signature(name: str, parameters: list[list[Any]], result: str | None = None) -> Signature:
    return Signature(name, tuple(TypedVariable(p[0], tuple(p[1:])) for p in parameters), result)

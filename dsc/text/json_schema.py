"""JSON Schema of plot files: the model's own schema with long forms, extended by the short forms."""

from __future__ import annotations

from typing import Any

from dsc.model.plot import ActionPlot

_SINGLE = frozenset({
    "entry", "exit", "on_break", "before", "after", "of", "every", "always", "choice", "clear", "command",
})  # fmt: skip
"""Lists whose only element may replace the list; the transitions of an event are such lists too."""
_BY_NAME = frozenset({"Transition", "PlotParameter", "PlotVariable"})
"""Values with a short form: only their target or type."""


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of plot files, for editors; it accepts every spelling of every plot."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "action plot",
        **_short(ActionPlot.model_json_schema(by_alias=True)),
    }


def _short(node: Any) -> Any:
    """Return the schema with short forms as alternatives to the long ones."""
    if isinstance(node, list):
        return [_short(one) for one in node]
    if not isinstance(node, dict):
        return node
    if str(node.get("$ref", "")).rsplit("/", 1)[-1] in _BY_NAME:
        return {"anyOf": [node, {"type": "string"}]}
    # Distinctive keys determine the kind; a form without one matches several of the alternatives.
    schema = {"anyOf" if key == "oneOf" else key: _short(value) for key, value in node.items()}
    if isinstance(schema.get("properties"), dict):
        schema["properties"] = {name: _property(name, one) for name, one in schema["properties"].items()}
    return schema


def _property(name: str, schema: dict[str, Any]) -> dict[str, Any]:
    inner = schema.get("additionalProperties")
    if name in _SINGLE:
        return _alone(schema)
    if name == "on" and isinstance(inner, dict):
        return {**schema, "additionalProperties": _alone(inner)}
    if name == "states" and isinstance(inner, dict):  # `over:` without a value is a simple state
        return {**schema, "additionalProperties": {"anyOf": [inner, {"type": "null"}]}}
    return schema


def _alone(schema: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of a list, or of its only element."""
    return {"anyOf": [schema, schema["items"]]} if "items" in schema else schema

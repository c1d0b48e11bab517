"""The JSON Schema of plot files: the model's own, which knows the long forms only, and the short ones people write."""

from __future__ import annotations

from typing import Any

from dsc.model.plot import ActionPlot

_SINGLE = frozenset({
    "entry", "exit", "on_break", "before", "after", "of", "every", "always", "choice", "clear", "command",
})  # fmt: skip
"""Lists of which the only element may stand alone; the transitions of an event are such lists too."""
_BY_NAME = frozenset({"Transition", "PlotParameter", "PlotVariable"})
"""Values that may be written as their target or type alone."""


def json_schema() -> dict[str, Any]:
    """The JSON Schema of plot files, for editors: what it refuses is no plot, whatever spelling is used."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "action plot",
        **_short(ActionPlot.model_json_schema(by_alias=True)),
    }


def _short(node: Any) -> Any:
    """The schema with short forms beside the long ones."""
    if isinstance(node, list):
        return [_short(one) for one in node]
    if not isinstance(node, dict):
        return node
    if str(node.get("$ref", "")).rsplit("/", 1)[-1] in _BY_NAME:
        return {"anyOf": [node, {"type": "string"}]}
    # The kinds follow from telling keys; a form with none fits more than one of the alternatives.
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
    if name == "states" and isinstance(inner, dict):  # `over:` with nothing behind it is a simple state
        return {**schema, "additionalProperties": {"anyOf": [inner, {"type": "null"}]}}
    return schema


def _alone(schema: dict[str, Any]) -> dict[str, Any]:
    """A list, or its only element."""
    return {"anyOf": [schema, schema["items"]]} if "items" in schema else schema

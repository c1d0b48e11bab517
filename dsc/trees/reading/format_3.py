"""Format 3: its names and attributes, replaced by those of format 4 before the nodes are read."""

from __future__ import annotations

from collections.abc import Mapping

from dsc.scxml.document import Element
from dsc.trees.kinds import SCRIPTS
from knowledge_base.errors import InputError

FORMER_KINDS: Mapping[str, str] = {
    "SequenceStar": "SequenceWithMemory",
    "RetryUntilSuccesful": "RetryUntilSuccessful",
    "SubTreePlus": "SubTree",
}
"""Kinds of format 3, and their names in format 4."""
_FORMER_PORTS: Mapping[str, Mapping[str, str]] = {
    "Parallel": {
        "threshold": "success_count",
        "success_threshold": "success_count",
        "failure_threshold": "failure_count",
    },
}
_SINCE_4 = frozenset({
    "AsyncSequence",
    "AsyncFallback",
    "SequenceWithMemory",
    "ParallelAll",
    "RunOnce",
    "Precondition",
    "Sleep",
    "Script",
    "ScriptCondition",
    "UnsetBlackboard",
})  # fmt: skip
_EXPLICIT = frozenset({"Action", "Condition", "Control", "Decorator"})
_REMEDY = 'write BTCPP_format="4" into <root> if the file has format 4'


def as_format_4(tree: Element) -> None:
    """Replace the names of format 3 in all elements of a tree.

    Raises:
        InputError: an element or attribute exists only since format 4.
    """
    for element in tree.walk():
        explicit = element.attributes.get("ID", "") if element.name in _EXPLICIT else ""
        kind = explicit or element.name
        if kind in _SINCE_4:
            raise InputError(f"<{kind}> exists since format 4: {_REMEDY}", place=element.place, found=kind)
        script = next((name for name in SCRIPTS if name in element.attributes), None)
        if script is not None:
            message = f"<{element.name}>: '{script}' exists since format 4: {_REMEDY}"
            raise InputError(message, place=element.place, found=script)
        former = _FORMER_PORTS.get(kind, {})
        attributes = {former.get(name, name): text for name, text in element.attributes.items()}
        if element.name in {"SubTree", "SubTreePlus"}:
            attributes = _remap(element.name, attributes)
        if explicit in FORMER_KINDS:
            attributes["ID"] = FORMER_KINDS[explicit]
        element.name = FORMER_KINDS.get(element.name, element.name)
        element.attributes = attributes


def _remap(kind: str, attributes: Mapping[str, str]) -> dict[str, str]:
    """Return the attributes of a subtree in format 4; `SubTree` of format 3 has keys without braces."""
    found: dict[str, str] = {}
    for name, text in attributes.items():
        if name in {"__shared_blackboard", "__autoremap"}:
            found["_autoremap"] = {"1": "true", "0": "false"}.get(text, text.lower())
        elif name in {"ID", "name"} or name.startswith("_"):
            found[name] = text
        else:
            braces = kind == "SubTree" and not text.strip().startswith("{")
            found[name] = f"{{{text.strip()}}}" if braces else text
    return found

"""Findings about a file of behaviour trees: its mistakes, and leaves that `TreeNodesModel` does not declare."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from dsc.errors import Finding
from dsc.trees.kinds import KINDS
from dsc.trees.model import TreeFile
from dsc.trees.reading.reader import load_trees
from knowledge_base.errors import InputError, UnknownNameError, collecting, nearest


def check_trees(path: Path | str) -> list[Finding]:
    """Return the findings about a file, in the order of their lines.

    Raises:
        InputError: the file cannot be read as a text.
    """
    file: TreeFile | None = None
    with collecting() as errors:
        try:
            file = load_trees(path)
        except InputError as error:
            if error.place is None or error.place.line is None:
                raise
            errors.append(error)
    found = [Finding(error, "behaviour-tree") for error in errors]
    refused = {error.place for error in errors}
    found += [] if file is None else [one for one in _warnings(file) if one.place not in refused]
    return sorted(found, key=lambda one: (one.place and one.place.line) or 0)


def _warnings(file: TreeFile) -> Iterator[Finding]:
    """Yield a warning for each leaf that the declarations of the file lack."""
    if not file.models:
        return
    leaves = [name for name, model in file.models.items() if model.role in {"action", "condition"}]
    for tree in file.trees.values():
        for node in tree.root.walk():
            if node.kind in KINDS or node.kind in file.models:
                continue
            message = f"{node.element} is not declared in TreeNodesModel"
            meant = nearest(node.kind, [*leaves, *KINDS])
            error = UnknownNameError(message, place=node.place, found=node.kind, valid=[meant] if meant else [])
            yield Finding(error, "declared-leaf", level="warning")

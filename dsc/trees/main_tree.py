"""The tree of a file that runs."""

from __future__ import annotations

from dsc.trees.model import TreeFile
from knowledge_base.errors import UnknownNameError


def main_tree(file: TreeFile, name: str | None = None) -> str:
    """Return the name of the tree that runs: `name`, or the main tree of the file.

    Raises:
        UnknownNameError: no tree has this name, or the file names no main tree.
    """
    wanted = name or file.main
    if wanted is None:
        raise UnknownNameError("the file has several trees and names no main tree", valid=file.trees)
    if wanted not in file.trees:
        raise UnknownNameError(f"the file has no tree '{wanted}'", found=wanted, valid=file.trees)
    return wanted

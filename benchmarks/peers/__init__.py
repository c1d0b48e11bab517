"""The contenders of `make bench-engine`, one file each, behind one interface."""

from importlib import import_module
from importlib.util import find_spec

from peers.contender import Contender

FILES = {
    "loop": "", "floor": "", "dsc": "", "sismic": "sismic", "statemachine": "statemachine",
    "transitions": "transitions", "xstate": "xstate_statemachine",
}  # fmt: skip
"""File -> the package it needs, in the order of the table's columns."""


def contenders() -> list[Contender]:
    """Return the installed contenders."""
    return [
        import_module(f"peers.{file}").CONTENDER for file, package in FILES.items() if not package or find_spec(package)
    ]

"""The contenders of `make bench-kb`: ways to keep facts, one file each, behind one interface."""

from importlib import import_module
from importlib.util import find_spec

from knowledge.contender import Contender

FILES = {"floor": "", "own": "", "graph": "networkx", "rdf": "rdflib", "oxigraph": "pyoxigraph", "sql": ""}
"""File -> the package it needs, in the order of the table's columns."""


def contenders() -> list[type[Contender]]:
    """Return the installed contenders."""
    return [
        import_module(f"knowledge.{file}").CONTENDER
        for file, package in FILES.items()
        if not package or find_spec(package)
    ]

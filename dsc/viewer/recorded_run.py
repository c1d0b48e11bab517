"""The plots and active states of a run from its trace records, as rows of relations (S1.13, S1.17)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache, partial
from typing import Any

from dsc.dynamic.library import Library
from dsc.model.plot import ActionPlot
from dsc.model.relations import COMPONENTS
from dsc.reflection import Running, configuration_rows, design_rows
from knowledge_base.errors import InputError
from knowledge_base.facts import Value
from knowledge_base.world.live_rows import Rows

TYPES = frozenset({"world", "plot", "step"})
"""The types of records that describe plots and active states."""


class RecordedRun:
    """The active states and the plots of a run after some of its records."""

    def __init__(self) -> None:
        self._active: dict[str, None] = {}
        self._running: dict[str, str] = {}  # digests of plots by the paths of their states
        self._forms: dict[str, Mapping[str, Any]] = {}  # by digest

    def copy(self) -> RecordedRun:
        """Return an equal, independent object."""
        twin = RecordedRun()
        twin._active, twin._running, twin._forms = {**self._active}, {**self._running}, {**self._forms}
        return twin

    def take(self, record: Mapping[str, Any]) -> None:
        """Take the next record of one of `TYPES`: its type with its data."""
        if record["type"] == "world":  # the start of a run
            self._active, self._running, self._forms = {}, {}, {}
        elif record["type"] == "plot":
            self._forms[record["hash"]] = record["plot"]
        else:
            for microstep in record["microsteps"]:
                self._follow(microstep)

    def _follow(self, microstep: Mapping[str, Any]) -> None:
        for path in microstep["exited"]:
            self._active.pop(path, None)
            self._running.pop(path, None)
        self._active.update(dict.fromkeys(microstep["entered"]))
        self._running.update({one["state"]: one["hash"] for one in microstep.get("bound", ()) if one["state"]})

    def rows(self) -> dict[str, Rows]:
        """Return the providers of all relations; those of components raise `InputError`, as no record has them."""

        @cache
        def plots() -> dict[str, ActionPlot]:
            return {digest: ActionPlot.model_validate(form) for digest, form in self._forms.items()}

        @cache
        def library() -> Library:
            return Library({plot.name: plot for plot in plots().values()}.values())

        def running() -> Iterator[Running]:
            return ((path, plots()[digest]) for path, digest in self._running.items())

        rows = {**design_rows(library), **configuration_rows(lambda: self._active, running, library)}
        return {**rows, **{name: partial(_refuse, name) for name in COMPONENTS}}


def _refuse(name: str) -> Iterator[tuple[Value, ...]]:
    raise InputError(f"the records of a run do not contain '{name}'; only the running program has its rows")

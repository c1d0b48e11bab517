"""What the table asks of everyone: load a chart, start a machine, send events, say where it is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from importlib.metadata import version
from typing import Any, ClassVar

from peers.charts import Chart


class Contender(ABC):
    """One way to run a chart. The loops are everyone's own: a common one would slow down the fast more than the slow.

    Attributes:
        name: the column of the table.
        package: the distribution whose version is printed; empty for code of our own.
    """

    name: ClassVar[str]
    package: ClassVar[str] = ""

    @property
    def version(self) -> str:
        """The installed version; empty for code of our own."""
        return version(self.package) if self.package else ""

    @property
    def is_peer(self) -> bool:
        """Whether somebody else wrote it."""
        return self.package not in {"", "dynamic-state-charts"}

    @abstractmethod
    def write(self, chart: Chart) -> Any:
        """The chart as data in the contender's own form."""

    @abstractmethod
    def load(self, data: Any) -> Any:
        """From data, used once, to whatever all machines of the chart share."""

    @abstractmethod
    def start(self, loaded: Any) -> Any:
        """A machine that has entered its first state."""

    @abstractmethod
    def where(self, machine: Any) -> frozenset[str]:
        """The names of the innermost active states."""

    @abstractmethod
    def run(self, machine: Any, event: str, times: int) -> None:
        """Send the event again and again, and run each to completion."""

    @abstractmethod
    def run_each(self, machines: Sequence[Any], event: str) -> None:
        """Send the event to one machine after the other, and run each to completion."""

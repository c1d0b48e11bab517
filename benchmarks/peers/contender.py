"""The interface of contenders: load a chart, start a machine, send events, return its configuration."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from importlib.metadata import version
from typing import Any, ClassVar

from peers.charts import Chart


class Contender(ABC):
    """One way to run a chart, with its own loops: a shared loop would slow down fast contenders more than slow ones.

    Attributes:
        name: the column of the table.
        package: the distribution with the version to print; empty for this project's code.
    """

    name: ClassVar[str]
    package: ClassVar[str] = ""

    @property
    def version(self) -> str:
        """The installed version; empty for this project's code."""
        return version(self.package) if self.package else ""

    @property
    def is_peer(self) -> bool:
        """Whether another project wrote it."""
        return self.package not in {"", "dynamic-state-charts"}

    @abstractmethod
    def write(self, chart: Chart) -> Any:
        """Return the chart as data in the contender's own form."""

    @abstractmethod
    def load(self, data: Any) -> Any:
        """Return the part that all machines of a chart share; the data are used once."""

    @abstractmethod
    def start(self, loaded: Any) -> Any:
        """Return a machine that has entered its first state."""

    @abstractmethod
    def where(self, machine: Any) -> frozenset[str]:
        """Return the names of the innermost active states."""

    @abstractmethod
    def run(self, machine: Any, event: str, times: int) -> None:
        """Send the event a number of times, and run each to completion."""

    @abstractmethod
    def run_each(self, machines: Sequence[Any], event: str) -> None:
        """Send the event to one machine after the other, and run each to completion."""

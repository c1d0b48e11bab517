"""The interface of contenders: insert objects and arcs, answer five queries, move an object."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from importlib.metadata import version
from typing import Any, ClassVar

from knowledge.arcs import Arc

Answers = list[dict[str, Any]]
"""A dictionary from variable to value for each answer, as `KnowledgeBase.query` returns them."""


class Contender(ABC):
    """One way to keep facts, initially empty.

    Its methods take and return names in its own form (`term`); the conversion is not timed.

    Attributes:
        name: the column of the table.
        package: the distribution with the version to print; empty for this project's and Python's code.
        most: maximum number of objects, because more take too long.
    """

    name: ClassVar[str]
    package: ClassVar[str] = ""
    most: ClassVar[int] = 1_000_000

    @classmethod
    def version(cls) -> str:
        """Return the installed version; empty for this project's code."""
        return version(cls.package) if cls.package else ""

    @classmethod
    def is_peer(cls) -> bool:
        """Return whether another project wrote it."""
        return cls.name not in {"floor", "this engine"}

    def term(self, name: str) -> Any:
        """Return the name as an argument and in answers."""
        return name

    def name_of(self, term: Any) -> str:
        """Return the name of a term."""
        return str(term)

    @abstractmethod
    def insert(self, things: Iterable[str], arcs: Iterable[Arc]) -> None:
        """Insert all of them in one transaction."""

    @abstractmethod
    def point(self, item: Any, place: Any) -> bool:
        """Answer `(on item place)`."""

    @abstractmethod
    def pattern(self, place: Any) -> Answers:
        """Answer `(on ?x place)`."""

    @abstractmethod
    def rare(self, hall: Any) -> Answers:
        """Answer `(opens ?x hall)`: one match, while the hall has many arcs of another kind."""

    @abstractmethod
    def inside(self, hall: Any, item: Any) -> Answers:
        """Answer `(and (in ?x hall) (near ?x item))`: few of the many objects in the hall."""

    @abstractmethod
    def join(self, place: Any) -> Answers:
        """Answer `(and (on ?x place) (near ?x ?y))`."""

    @abstractmethod
    def move(self, item: Any, old: Any, new: Any) -> None:
        """Replace `(on item old)` by `(on item new)`, in one transaction."""

"""What is asked of everyone: take in things and arcs, answer five questions, move a thing."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from importlib.metadata import version
from typing import Any, ClassVar

from knowledge.arcs import Arc

Answers = list[dict[str, Any]]
"""A dictionary from variable to value for each answer, as `KnowledgeBase.query` gives them."""


class Contender(ABC):
    """One way to keep facts, empty when it is made.

    Names are given to it and come back as it wants to have them (`term`), which is not timed.

    Attributes:
        name: the column of the table.
        package: the distribution whose version is printed; empty for code of our own and Python's.
        most: how many objects it is asked to hold at most, because more take too long.
    """

    name: ClassVar[str]
    package: ClassVar[str] = ""
    most: ClassVar[int] = 1_000_000

    @classmethod
    def version(cls) -> str:
        """The installed version; empty for code of our own."""
        return version(cls.package) if cls.package else ""

    @classmethod
    def is_peer(cls) -> bool:
        """Whether somebody else wrote it."""
        return cls.name not in {"floor", "this engine"}

    def term(self, name: str) -> Any:
        """The name as an argument and in answers."""
        return name

    def name_of(self, term: Any) -> str:
        """The name that a term stands for."""
        return str(term)

    @abstractmethod
    def insert(self, things: Iterable[str], arcs: Iterable[Arc]) -> None:
        """All of that in one transaction."""

    @abstractmethod
    def point(self, item: Any, place: Any) -> bool:
        """`(on item place)`?"""

    @abstractmethod
    def pattern(self, place: Any) -> Answers:
        """`(on ?x place)`."""

    @abstractmethod
    def rare(self, hall: Any) -> Answers:
        """`(opens ?x hall)`, one match, when the hall has many arcs of another kind."""

    @abstractmethod
    def inside(self, hall: Any, item: Any) -> Answers:
        """`(and (in ?x hall) (near ?x item))`: few of the many things in the hall."""

    @abstractmethod
    def join(self, place: Any) -> Answers:
        """`(and (on ?x place) (near ?x ?y))`."""

    @abstractmethod
    def move(self, item: Any, old: Any, new: Any) -> None:
        """`(on item old)` gives way to `(on item new)`, in one transaction."""

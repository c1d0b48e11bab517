"""The plans that are on their way, by name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from knowledge_base.errors import UnknownNameError
from planning.execution.carried import Carried

if TYPE_CHECKING:
    from collections.abc import Mapping

    from planning.problem.derived import Settled

MOST_UNWATCHED = 64
"""Plans that nobody watches are kept, since new ones may have to take their places; but of those that were left for
good, nobody says so, and only as many."""


class Plans:
    """Those that have a plot and are not over."""

    def __init__(self) -> None:
        self._carried: dict[str, Carried] = {}
        self._named = 0

    def new_name(self) -> str:
        """One that no plan of the run has had."""
        self._named += 1
        return f"plan_{self._named}"

    def get(self, name: str) -> Carried | None:
        """The plan of that name, if there is one."""
        return self._carried.get(name)

    def required(self, name: str) -> Carried:
        """The plan of that name; raises `UnknownNameError`."""
        if name not in self._carried:
            raise UnknownNameError(f"there is no plan '{name}'", found=name, valid=self._carried)
        return self._carried[name]

    def carry(self, plan: Carried) -> None:
        """It will be carried out."""
        unwatched = [name for name, one in self._carried.items() if one.begun is None]
        for name in unwatched[:-MOST_UNWATCHED]:
            del self._carried[name]
        self._carried[plan.name] = plan

    def over(self, name: str) -> None:
        """It is over, or another has taken its place."""
        self._carried.pop(name, None)

    def remember(self) -> dict[str, Any]:
        """As plain data."""
        return {"plans": self._named, "carried": [one.to_json() for one in self._carried.values()]}

    def recall(self, memory: Mapping[str, Any], now: Settled) -> None:
        """The inverse of `remember`, with conditions written for the present state of the world."""
        self._named = memory["plans"]
        self._carried = {form["name"]: Carried.from_json(form, now) for form in memory["carried"]}

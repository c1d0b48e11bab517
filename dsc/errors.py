"""Errors of plots: findings in their text, failures of a run, and forms that another language cannot express."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from knowledge_base.errors import InputError, Place


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing wrong with a plot: where, which rule of the profile, and what to do.

    A `warning` is about what is allowed and hardly meant; a plot with warnings runs.
    """

    error: InputError
    rule: str
    fix: str = ""
    level: Literal["error", "warning"] = "error"

    @property
    def place(self) -> Place | None:
        """Its place in the text."""
        return self.error.place

    def __str__(self) -> str:
        """One line for people."""
        text = f"{self.error}" + (f" ({self.fix})" if self.fix else "")
        return text if self.level == "error" else f"{text} [{self.level}]"


class PlotError(InputError):
    """A plot that cannot be used; carries all findings, and prints them one a line."""

    def __init__(self, findings: Sequence[Finding]) -> None:
        first = findings[0].error
        super().__init__(first.message, place=first.place, found=first.found, valid=first.valid)
        self.findings = tuple(findings)

    def __str__(self) -> str:
        """All findings, one a line."""
        return "\n".join(map(str, self.findings))


class RunawayError(Exception):
    """A macrostep does not come to rest; carries the states it keeps entering."""

    def __init__(self, problem: str, trail: Sequence[str]) -> None:
        super().__init__(f"{problem}: {' -> '.join(trail)}")
        self.trail = tuple(trail)


class UncertainActionError(Exception):
    """An action may or may not have happened before a restart, and must not be done again unseen."""


class ChangedError(InputError):
    """A run cannot be resumed with other plots, or another domain, than it was begun with.

    Attributes:
        differences: one sentence each.
    """

    def __init__(self, differences: Sequence[str], *, place: Place | None = None) -> None:
        more = f"; and {len(differences) - 3} more" if len(differences) > 3 else ""
        super().__init__(f"the run was begun with others: {'; '.join(differences[:3])}{more}", place=place)
        self.differences = tuple(differences)


class NotExpressibleError(InputError):
    """Something has no counterpart in the other form; `element` is what it is, for counting."""

    def __init__(self, element: str, why: str, *, place: Place | None = None) -> None:
        super().__init__(f"{element}: {why}", place=place, found=element)
        self.element = element

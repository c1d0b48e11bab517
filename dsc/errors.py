"""Errors of plots: mistakes in their text, failures of a run, and forms that another language cannot express."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from knowledge_base.errors import DscError, InputError, Place


@dataclass(frozen=True, slots=True)
class Finding:
    """A mistake of a project: its place, its code (one of `dsc.codes`), and a remedy.

    A finding of level `warning` concerns a form that is allowed, but rarely intended. A plot with warnings can run.
    """

    error: InputError
    code: str
    fix: str = ""
    level: Literal["error", "warning"] = "error"

    @property
    def place(self) -> Place | None:
        """Place of the mistake in the text; `None` if unknown."""
        return self.error.place

    @property
    def text(self) -> str:
        """The error with its remedy, without its place."""
        return self.error.text + (f" ({self.fix})" if self.fix else "")

    def __str__(self) -> str:
        """Return one line for people: place, error, remedy and, for a warning, the level."""
        text = self.text if self.place is None else f"{self.place}: {self.text}"
        return text if self.level == "error" else f"{text} [{self.level}]"


class PlotError(InputError):
    """An error about an unusable plot; `findings` lists the mistakes, and the message has one line for each."""

    def __init__(self, findings: Sequence[Finding]) -> None:
        first = findings[0].error
        super().__init__(first.message, place=first.place, found=first.found, valid=first.valid)
        self.findings = tuple(findings)

    @property
    def text(self) -> str:
        """All findings, one per line, the first one without its place."""
        first, *others = self.findings
        return "\n".join([first.text, *map(str, others)])

    def __str__(self) -> str:
        """Return all findings, one per line."""
        return "\n".join(map(str, self.findings))


class RunawayError(DscError):
    """A macrostep that does not end; `trail` lists the states that it enters repeatedly."""

    def __init__(self, problem: str, trail: Sequence[str]) -> None:
        super().__init__(f"{problem}: {' -> '.join(trail)}")
        self.trail = tuple(trail)


class SkillError(DscError):
    """A failure of a device or of the infrastructure, but not of code: a skill that raises it ends with `skill_error`.

    In a hook such as `start`, it leads to FatalError.
    """


class NotAliveError(SkillError):
    """A required component is not alive; the message has the reason."""


class NoAnswerError(SkillError):
    """No answer arrived in time: the other endpoint has ended, is late, or is unreachable."""


class NotWiredError(SkillError):
    """A required port has no provider, or its wire was cut during a call."""


class RefusedError(SkillError):
    """The other endpoint could not execute a call; the message has its reason."""


class LostDataError(SkillError):
    """Data by reference cannot be read: they were deleted, or their file was changed."""


class PreemptedError(SkillError):
    """A skill with a higher priority, which `by` names, has taken the component at its host."""

    def __init__(self, by: str) -> None:
        super().__init__(f"{by} has taken the component")
        self.by = by


class ProgrammingError(DscError):
    """An undeclared exception of user code; the message has the hook or skill, the exception, the file and the line."""

    def __str__(self) -> str:
        """Return the message on one line."""
        return " ".join(super().__str__().split())


class UncertainActionError(SkillError):
    """An action with unknown effect before a restart, which must not be repeated without an observation."""


class ChangedError(InputError):
    """A resumed run has other plots, or another domain, than at its start.

    Attributes:
        differences: one sentence for each difference.
    """

    def __init__(self, differences: Sequence[str], *, place: Place | None = None) -> None:
        more = f"; and {len(differences) - 3} more" if len(differences) > 3 else ""
        choices = "resume it with the earlier version, or end it: Robot.discard() or `dsc runs end`"
        said = f"the run was begun with others: {'; '.join(differences[:3])}{more}; {choices}"
        super().__init__(said, place=place)
        self.differences = tuple(differences)


class NotExpressibleError(InputError):
    """An element without a counterpart in the other language; `element` is its kind, for statistics."""

    def __init__(self, element: str, why: str, *, place: Place | None = None) -> None:
        super().__init__(f"{element}: {why}", place=place, found=element)
        self.element = element

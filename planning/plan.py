"""Plans and planning outcomes: values, since "no plan" is an answer and not an error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from knowledge_base.errors import InputError


@dataclass(frozen=True, slots=True)
class PlanStep:
    """A planning action with its arguments, in the order of the action's parameters."""

    action: str
    args: tuple[str, ...] = ()

    def __str__(self) -> str:
        """PDDL: `(pick-up cup1 table)`."""
        return "(" + " ".join((self.action, *self.args)) + ")"

    def to_json(self) -> list[str]:
        """Return the name of the action, then its arguments."""
        return [self.action, *self.args]

    @classmethod
    def from_json(cls, form: Sequence[str]) -> PlanStep:
        """Return the step of a form; the inverse of `to_json`."""
        action, *args = form
        return cls(action, tuple(args))


@dataclass(frozen=True, slots=True)
class Timing:
    """Start of a step, in seconds from the plan's beginning, and its duration in seconds."""

    start: float
    duration: float = 0.0

    @property
    def end(self) -> float:
        """The end, in seconds from the plan's beginning."""
        return self.start + self.duration


@dataclass(frozen=True, slots=True)
class Plan:
    """Steps in order; empty if the goal already holds.

    Attributes:
        steps: the steps; with a schedule in the order of their starts.
        schedule: the times of the steps, from an engine that plans with durations; otherwise empty.
    """

    steps: tuple[PlanStep, ...] = ()
    schedule: tuple[Timing, ...] = ()

    def __post_init__(self) -> None:
        starts = [timing.start for timing in self.schedule]
        if starts and (len(starts) != len(self.steps) or starts != sorted(starts)):
            raise InputError(f"a schedule has a time for each of the {len(self.steps)} steps, by start; found {starts}")

    @property
    def seconds(self) -> float:
        """The makespan of the schedule in seconds; 0 without one."""
        return max((timing.end for timing in self.schedule), default=0.0)

    def __str__(self) -> str:
        """One step a line, as planners write plans."""
        return "\n".join(map(str, self.steps))


@dataclass(frozen=True, slots=True)
class PlanFound:
    """A plan that solves the problem.

    Attributes:
        plan: its steps.
        engine: the engine that found it.
        seconds: real time of the search; differs from run to run.
        simulated_seconds: simulated time of the search; depends on the problem only.
        reproducible: whether no limit in real time influenced it, so that the same problem gives the same plan.
        cost: the total cost of its actions, by default their number; with a schedule, its makespan in seconds.
        from_cache: whether a cache answered.
        failures: the failures of other engines asked as well.
        translated: the part of `seconds`, in processor time, for the translation into the engine's input.
    """

    plan: Plan
    engine: str
    seconds: float
    simulated_seconds: float
    reproducible: bool = True
    cost: float = 0.0
    from_cache: bool = False
    failures: tuple[EngineFailed, ...] = ()
    translated: float = 0.0


@dataclass(frozen=True, slots=True)
class ProvenUnsolvable:
    """Proof that there is no plan, with its known `reason`. For `failures` see `PlanFound`."""

    engine: str
    reason: str
    failures: tuple[EngineFailed, ...] = ()


@dataclass(frozen=True, slots=True)
class NoneFound:
    """Proof that there is no plan of a narrower kind, which `reason` names. For `failures` see `PlanFound`."""

    engine: str
    reason: str
    failures: tuple[EngineFailed, ...] = ()


@dataclass(frozen=True, slots=True)
class TimedOut:
    """The engine was stopped after `seconds` of real time; nothing is known. For `failures` see `PlanFound`."""

    engine: str
    seconds: float
    failures: tuple[EngineFailed, ...] = ()


@dataclass(frozen=True, slots=True)
class EngineFailed:
    """The engine crashed, gave unreadable output, or gave a plan that does not solve the problem."""

    engine: str
    message: str


@dataclass(frozen=True, slots=True)
class NobodyCan:
    """No engine was asked, since no permitted engine supports the problem's features.

    Attributes:
        engine: the only engine permitted; empty if all installed ones are.
        needs: the features of the problem, see `planning.strips.FEATURES`.
        could: engines that support them, each with the step that makes it usable; empty if its name suffices.
    """

    engine: str
    needs: tuple[str, ...]
    could: tuple[tuple[str, str], ...]

    @property
    def who(self) -> str:
        """The missing support and the engines that have it, in words."""
        nobody = f"{self.engine} cannot do that" if self.engine else "no installed engine can do that"
        others = ", ".join(f"{name} could ({how or 'name it as the planner'})" for name, how in self.could)
        return f"{nobody}, {others or 'nor can any engine known here'}"

    @property
    def message(self) -> str:
        """One line: `the problem needs numeric; no installed engine can do that, enhsp could (pip install ...)`."""
        return f"the problem needs {', '.join(self.needs) or 'STRIPS'}; {self.who}"


PlanningOutcome = PlanFound | ProvenUnsolvable | NoneFound | TimedOut | EngineFailed | NobodyCan
"""The outcome of a planning request."""

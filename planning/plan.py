"""Plans and what may come of asking for one: values, since "no plan" is an answer and not an error."""

from __future__ import annotations

from dataclasses import dataclass

from knowledge_base.errors import InputError


@dataclass(frozen=True, slots=True)
class PlanStep:
    """A planning action with its arguments, in the order of the action's parameters."""

    action: str
    args: tuple[str, ...] = ()

    def __str__(self) -> str:
        """In PDDL: `(pick-up cup1 table)`."""
        return "(" + " ".join((self.action, *self.args)) + ")"


@dataclass(frozen=True, slots=True)
class Timing:
    """When a step begins, in seconds from the beginning of the plan, and how long it takes."""

    start: float
    duration: float = 0.0

    @property
    def end(self) -> float:
        """When it is over."""
        return self.start + self.duration


@dataclass(frozen=True, slots=True)
class Plan:
    """Steps to be taken in order; no steps when the goal already holds.

    Attributes:
        steps: the steps; with a schedule in the order of their starts.
        schedule: when an engine that plans with durations has each of them begin; empty if nobody says.
    """

    steps: tuple[PlanStep, ...] = ()
    schedule: tuple[Timing, ...] = ()

    def __post_init__(self) -> None:
        starts = [timing.start for timing in self.schedule]
        if starts and (len(starts) != len(self.steps) or starts != sorted(starts)):
            raise InputError(f"a schedule has a time for each of the {len(self.steps)} steps, by start; found {starts}")

    def __str__(self) -> str:
        """One step a line, as planners write plans."""
        return "\n".join(map(str, self.steps))


@dataclass(frozen=True, slots=True)
class PlanFound:
    """A plan that solves the posed problem.

    Attributes:
        plan: its steps.
        engine: who found it.
        seconds: how long that took in real time; differs from run to run.
        simulated_seconds: how long it takes in simulated time; depends on the problem only.
        reproducible: whether no limit of real time had a part in it, so that the same problem gives it again.
    """

    plan: Plan
    engine: str
    seconds: float
    simulated_seconds: float
    reproducible: bool = True


@dataclass(frozen=True, slots=True)
class ProvenUnsolvable:
    """There is no plan; `reason` says what is known about why."""

    engine: str
    reason: str


@dataclass(frozen=True, slots=True)
class TimedOut:
    """The engine was stopped after `seconds` of real time; nothing is known."""

    engine: str
    seconds: float


@dataclass(frozen=True, slots=True)
class EngineFailed:
    """The engine crashed, answered rubbish or gave a plan that does not solve the problem."""

    engine: str
    message: str


PlanningOutcome = PlanFound | ProvenUnsolvable | TimedOut | EngineFailed
"""What comes of asking for a plan."""

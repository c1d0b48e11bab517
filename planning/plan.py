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

    @property
    def seconds(self) -> float:
        """When all of it is done, by the schedule; 0 without one."""
        return max((timing.end for timing in self.schedule), default=0.0)

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
        cost: what its actions cost together; their number, if nobody says what each costs; with a schedule, the
            seconds until all of it is done.
        from_cache: whether it was found for the same problem before.
        failures: what happened to other engines that were asked as well.
    """

    plan: Plan
    engine: str
    seconds: float
    simulated_seconds: float
    reproducible: bool = True
    cost: float = 0.0
    from_cache: bool = False
    failures: tuple[EngineFailed, ...] = ()


@dataclass(frozen=True, slots=True)
class ProvenUnsolvable:
    """There is no plan; `reason` says what is known about why. For `failures` see `PlanFound`."""

    engine: str
    reason: str
    failures: tuple[EngineFailed, ...] = ()


@dataclass(frozen=True, slots=True)
class NoneFound:
    """There is no plan of a narrower kind than was asked for (`reason` says of which); `failures` as in `PlanFound`."""

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
    """The engine crashed, answered rubbish or gave a plan that does not solve the problem."""

    engine: str
    message: str


PlanningOutcome = PlanFound | ProvenUnsolvable | NoneFound | TimedOut | EngineFailed
"""What comes of asking for a plan."""

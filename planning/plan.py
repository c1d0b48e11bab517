"""Plans and what may come of asking for one: values, since "no plan" is an answer and not an error."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PlanStep:
    """A planning action with its arguments, in the order of the action's parameters."""

    action: str
    args: tuple[str, ...] = ()

    def __str__(self) -> str:
        """In PDDL: `(pick-up cup1 table)`."""
        return "(" + " ".join((self.action, *self.args)) + ")"


@dataclass(frozen=True, slots=True)
class Plan:
    """Steps to be taken in order; no steps when the goal already holds."""

    steps: tuple[PlanStep, ...] = ()

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

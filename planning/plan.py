"""Plans and what may come of asking for one: values, since "no plan" is an answer and not an error."""

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
        """In PDDL: `(pick-up cup1 table)`."""
        return "(" + " ".join((self.action, *self.args)) + ")"

    def to_json(self) -> list[str]:
        """The name of the action, then its arguments."""
        return [self.action, *self.args]

    @classmethod
    def from_json(cls, form: Sequence[str]) -> PlanStep:
        """The inverse of `to_json`."""
        action, *args = form
        return cls(action, tuple(args))


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
        translated: how much of the `seconds`, in processor time, its process took to put the problem into its words.
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


@dataclass(frozen=True, slots=True)
class NobodyCan:
    """No engine was asked, since none that may be can do what the problem needs.

    Attributes:
        engine: who alone may be asked; empty if all that are installed may.
        needs: the features of the problem, see `planning.strips.FEATURES`.
        could: engines that can do that, each with what to do before it can be used; nothing if it only has to be named.
    """

    engine: str
    needs: tuple[str, ...]
    could: tuple[tuple[str, str], ...]

    @property
    def who(self) -> str:
        """Who could, in words."""
        nobody = f"{self.engine} cannot do that" if self.engine else "no installed engine can do that"
        others = ", ".join(f"{name} could ({how or 'name it as the planner'})" for name, how in self.could)
        return f"{nobody}, {others or 'nor does anybody known here'}"

    @property
    def message(self) -> str:
        """One line: `the problem needs numeric; no installed engine can do that, enhsp could (pip install ...)`."""
        return f"the problem needs {', '.join(self.needs) or 'STRIPS'}; {self.who}"


PlanningOutcome = PlanFound | ProvenUnsolvable | NoneFound | TimedOut | EngineFailed | NobodyCan
"""What comes of asking for a plan."""

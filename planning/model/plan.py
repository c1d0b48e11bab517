"""Plans and outcomes of planning requests.

A missing plan is an outcome too, and not an error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from knowledge_base.errors import InputError
from knowledge_base.notebook import table
from knowledge_base.spelling import number_text


@dataclass(frozen=True, slots=True)
class PlanStep:
    """A planning action with arguments, which are in the order of the action's parameters."""

    action: str
    args: tuple[str, ...] = ()

    def __str__(self) -> str:
        """Return the step in PDDL, e.g. `(pick-up cup1 table)`."""
        return "(" + " ".join((self.action, *self.args)) + ")"

    def to_json(self) -> list[str]:
        """Return a list of the action's name and the arguments."""
        return [self.action, *self.args]

    @classmethod
    def from_json(cls, form: Sequence[str]) -> PlanStep:
        """Return the step that `to_json` wrote as `form`."""
        action, *args = form
        return cls(action, tuple(args))


@dataclass(frozen=True, slots=True)
class Timing:
    """Start of a step, in seconds from the plan's beginning, and duration of the step in seconds."""

    start: float
    duration: float = 0.0

    @property
    def end(self) -> float:
        """The end of the step, in seconds from the plan's beginning."""
        return self.start + self.duration


@dataclass(frozen=True, slots=True)
class Plan:
    """Sequence of plan steps; empty if the goal already holds.

    Attributes:
        steps: the steps; a plan with a schedule lists them in the order of their starts.
        schedule: the timing of each step, from an engine that plans with durations; otherwise empty.
    """

    steps: tuple[PlanStep, ...] = ()
    schedule: tuple[Timing, ...] = ()

    def __post_init__(self) -> None:
        starts = [timing.start for timing in self.schedule]
        if starts and (len(starts) != len(self.steps) or starts != sorted(starts)):
            raise InputError(f"a schedule has a time for each of the {len(self.steps)} steps, by start; found {starts}")

    @property
    def seconds(self) -> float:
        """The makespan of the schedule in seconds; 0 if the plan has no schedule."""
        return max((timing.end for timing in self.schedule), default=0.0)

    def __str__(self) -> str:
        """Return the plan as planners write it, one step per line."""
        return "\n".join(map(str, self.steps))

    def _repr_html_(self) -> str:
        numbered = enumerate(self.steps, start=1)
        if not self.schedule:
            return table(f"plan, {number_text(len(self.steps), 'step')}", ("", "step"), numbered)
        times = [(f"{timing.start:g} s", f"{timing.duration:g} s") for timing in self.schedule]
        rows = [(*step, *time) for step, time in zip(numbered, times, strict=True)]
        return table(
            f"plan, {number_text(len(self.steps), 'step')}, {self.seconds:g} s", ("", "step", "start", "duration"), rows
        )


@dataclass(frozen=True, slots=True)
class PlanFound:
    """A plan that solves the problem, and the measurements of the search.

    Attributes:
        plan: the plan.
        engine: the name of the engine that found the plan.
        seconds: real time of the search; differs between runs.
        simulated_seconds: simulated time of the search; depends on the problem only.
        reproducible: whether equal problems lead to equal plans, because no limit in real time influenced the search.
        cost: the total cost of the plan's actions, by default their number; with a schedule, the makespan in seconds.
        from_cache: whether a cache provided the plan.
        failures: the failures of other engines that received the same problem.
        translated: processor time of the translation into the engine's input, in seconds; a part of `seconds`.
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

    def _repr_html_(self) -> str:
        return self.plan._repr_html_()


@dataclass(frozen=True, slots=True)
class ProvenUnsolvable:
    """Proof that the problem has no plan.

    Attributes:
        engine: the name of the engine that found the proof.
        reason: the explanation of the proof.
        failures: as in `PlanFound`.
    """

    engine: str
    reason: str
    failures: tuple[EngineFailed, ...] = ()


@dataclass(frozen=True, slots=True)
class NoneFound:
    """Proof that the problem has no plan of a restricted kind, e.g. without concurrent actions.

    Attributes:
        engine: the name of the engine that found the proof.
        reason: the restriction, and the explanation of the proof.
        failures: as in `PlanFound`.
    """

    engine: str
    reason: str
    failures: tuple[EngineFailed, ...] = ()


@dataclass(frozen=True, slots=True)
class TimedOut:
    """End of a search without a result: the time limit stopped the engine.

    Attributes:
        engine: the name of the engine.
        seconds: real time of the search.
        failures: as in `PlanFound`.
    """

    engine: str
    seconds: float
    failures: tuple[EngineFailed, ...] = ()


@dataclass(frozen=True, slots=True)
class EngineFailed:
    """Failure of an engine: it crashed, wrote unreadable output, or returned a plan that does not solve the problem."""

    engine: str
    message: str


@dataclass(frozen=True, slots=True)
class Unsupported:
    """Refusal of a problem: no permitted engine supports the problem's features, so no engine received the problem.

    Attributes:
        engine: the only permitted engine; empty if all installed engines are permitted.
        needs: the features of the problem, see `planning.model.problem.FEATURES`.
        could: engines that support these features, each with the step that makes the engine usable, e.g. an
            installation. The step is empty if the caller only needs to select the engine.
    """

    engine: str
    needs: tuple[str, ...]
    could: tuple[tuple[str, str], ...]

    @property
    def who(self) -> str:
        """The missing support, and the engines that provide it, as text."""
        permitted = "permitted" if any(not how for _, how in self.could) else "installed"
        cannot = f"{self.engine} cannot do that" if self.engine else f"no {permitted} engine can do that"
        others = ", ".join(f"{name} could ({how or 'it is installed: permit or name it'})" for name, how in self.could)
        return f"{cannot}, {others or 'nor can any engine known here'}"

    @property
    def message(self) -> str:
        """The message on one line: `the problem needs numeric; no installed engine can do that, enhsp could ...`."""
        return f"the problem needs {', '.join(self.needs) or 'STRIPS'}; {self.who}"


PlanningOutcome = PlanFound | ProvenUnsolvable | NoneFound | TimedOut | EngineFailed | Unsupported
"""The outcome of a planning request."""

"""Search asks for plans until one holds in the present world, without steps that failed before.

However a planner behaves, an answer comes within a bound of real time. Only a plan that leads to the goal counts.
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from knowledge_base.errors import InputError
from planning.cancellable_work import WorkLimit, WorkLimitError, aside
from planning.engines.registry import timing
from planning.execution.plan_progress import local_repair
from planning.execution.planner_call import Answer, Improvements, PlannerCalls
from planning.explanation import why_unsolvable
from planning.ordering.causal_tracing import deordered
from planning.ordering.partial_order import PartialOrder
from planning.plan import EngineFailed, NobodyCan, NoneFound, Plan, PlanFound, PlanStep, ProvenUnsolvable, TimedOut
from planning.problem.construction import build_problem
from planning.problem.relevance import why_no_engine
from planning.validation import Validation, validate

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Collection, Iterable

    from dsc.sequencer.clock import LoopClock
    from knowledge_base.language.evaluation.world import World
    from knowledge_base.language.syntax.expression import Expression
    from knowledge_base.store import KnowledgeBase
    from knowledge_base.world.state import WorldState
    from planning.domain import PlanningDomain
    from planning.engines.planner import Planner
    from planning.execution.plan_progress import PlanProgress
    from planning.execution.plan_records import PlanRecords
    from planning.strips import Problem


class Foresight(Protocol):
    """A simulation that knows more than the planning domain does, e.g. the physics of a ready world (S1.10)."""

    def foresee(self, plan: Plan, world: World) -> Validation:
        """Simulate the plan from `world`, the world that the robot believes in.

        The search rejects a plan that is not valid, and omits its failing step from the next one. The call runs in its
        own thread; it must end and change nothing.
        """
        ...


_Result = TypeVar("_Result")

EXCLUDED_SECONDS = 120.0
"""Seconds of run time for which new plans omit a step that failed repeatedly."""
MAX_ATTEMPTS = 3
"""The number of searches for one plan while the world changes."""
MAX_REJECTED = 5
"""The number of plans that the simulation may reject."""
_IN_CONCERT = "the only plan has concurrent steps that need each other, which no plot executes yet"
LOCAL_REPAIR_SECONDS = 2.0
"""Bound of real time for a local repair."""


@dataclass(frozen=True, slots=True)
class Found:
    """A plan that leads to the goal from the present.

    Attributes:
        answer: the plan, and where it comes from.
        kept: the number of last steps that it shares with the plan before.
        better: better plans of the planner; the caller closes them.
        order: its partial order, computed by the validation; `None` for a plan with a schedule.
        version: of the knowledge that it was validated on.
    """

    answer: PlanFound
    kept: int = 0
    better: Improvements | None = None
    order: PartialOrder | None = None
    version: int = -1

    @property
    def steps(self) -> tuple[PlanStep, ...]:
        """The plan's steps."""
        return self.answer.plan.steps

    def known_order(self, steps: tuple[PlanStep, ...], version: int) -> PartialOrder | None:
        """The order, if the plan has these steps, at this version of the knowledge."""
        return self.order if self.version == version and self.steps == steps else None

    async def close(self) -> None:
        """Close the better plans."""
        if self.better is not None:
            await self.better.aclose()


@dataclass(frozen=True, slots=True)
class NotFound:
    """No plan: `kind` is `unsolvable`, `timed_out` or `failed`, `reason` says more."""

    kind: str
    reason: str


class Search:
    """Finds plans for goals, and remembers the excluded steps.

    Args:
        domain, knowledge, planner, clock: as in the planning component.
        records: receives excluded, readmitted and rejected steps.
        foresight: has to agree with a plan before it counts.
    """

    def __init__(
        self,
        domain: PlanningDomain,
        knowledge: KnowledgeBase,
        planner: Planner,
        clock: LoopClock,
        records: PlanRecords,
        foresight: Foresight | None = None,
    ) -> None:
        self._domain = domain
        self._knowledge = knowledge
        self._planner = PlannerCalls(planner, clock)
        self._clock = clock
        self._records = records
        self._foresight = foresight
        self._excluded: dict[PlanStep, float] = {}

    def exclude(self, step: PlanStep, why: str) -> None:
        """Exclude a step from new plans for some seconds."""
        self._excluded[step] = self._clock.now() + EXCLUDED_SECONDS
        self._records.excluded(step, EXCLUDED_SECONDS, why)

    def remember(self) -> list[Any]:
        """The excluded steps and the ends of their exclusion, as plain data."""
        return [[step.to_json(), until] for step, until in self._excluded.items()]

    def recall(self, memory: Iterable[Any]) -> None:
        """The inverse of `remember`."""
        self._excluded = {PlanStep.from_json(step): until for step, until in memory}

    async def plan(
        self, goal: Expression, seconds: float, before: PlanProgress | None, sleep: Callable[[float], Awaitable[None]]
    ) -> Found | NotFound:
        """Return a plan for the goal that is valid in the present world when it is found.

        Args:
            goal: a condition.
            seconds: real time for one search.
            before: the plan that it replaces, and that a local repair may keep in part.
            sleep: passes the simulated time of a search; an interrupted search has begun earlier.

        Raises:
            InputError: the goal names a missing object, or needs more than any engine supports.
        """
        rejected: dict[PlanStep, str] = {}
        changed = 0
        while True:
            version, snapshot = self._knowledge.version, self._knowledge.snapshot()
            found = await self._in_time(self._found(goal, seconds, before, rejected, snapshot), seconds)
            if isinstance(found, NotFound):
                return found
            if self._clock.simulated:
                await sleep(found.answer.simulated_seconds)
            verdict, order = self._judged(found.answer.plan, goal)
            if verdict.valid:
                if found.answer.plan.schedule:
                    alone = validate(Plan(found.steps), self._domain, self._knowledge, goal)
                    if not alone.valid:
                        await found.close()
                        return NotFound("failed", f"{_IN_CONCERT}: {alone.why} ({found.answer.engine})")
                found = replace(found, order=order, version=self._knowledge.version)
                verdict = await self._foreseen(found)
                if verdict.valid:
                    return found
                await found.close()
                before = None
                if verdict.failing_step is None or len(rejected) == MAX_REJECTED:
                    return NotFound("failed", f"the simulation foresees that it fails: {verdict.why}")
                rejected[found.steps[verdict.failing_step]] = verdict.why
                continue
            await found.close()
            changed += 1
            if version == self._knowledge.version:
                wrong = f"the plan found does not lead to the goal: {verdict.why} ({found.answer.engine})"
                return NotFound("failed", wrong)
            if changed == MAX_ATTEMPTS:
                return NotFound("failed", f"the world changes faster than plans are made: {verdict.why}")

    def _judged(self, plan: Plan, goal: Expression) -> tuple[Validation, PartialOrder | None]:
        """Validate the plan and compute its order, in one pass over its steps."""
        world = self._knowledge.snapshot()  # its reads need no lock
        if not plan.schedule:
            with contextlib.suppress(InputError):
                return Validation(valid=True), deordered(plan, self._domain, world, goal)
        return validate(plan, self._domain, world, goal), None

    async def _in_time(self, finding: Awaitable[Found | NotFound], seconds: float) -> Found | NotFound:
        try:
            async with self._planner.give_up_at(seconds):
                return await finding
        except TimeoutError:
            return NotFound("timed_out", f"no plan within {seconds:g} s, nor soon after ({self._planner.name})")

    async def _found(
        self,
        goal: Expression,
        seconds: float,
        before: PlanProgress | None,
        rejected: dict[PlanStep, str],
        snapshot: WorldState,
    ) -> Found | NotFound:
        """Return a plan for the world of the snapshot."""
        budget = WorkLimit(seconds)
        repaired = None if before is None else await self._repaired(goal, seconds / 2, before, snapshot)
        if isinstance(repaired, Found):
            return repaired
        patience, durations = WorkLimit(budget.left), not self._clock.simulated and bool(timing())
        try:
            problem = await self._aside(
                lambda: build_problem(self._domain, snapshot, goal, durations=durations, patience=patience), patience
            )
        except WorkLimitError as error:
            return NotFound("timed_out", f"no plan within {seconds:g} s (while {error.doing})")
        answer, better = await self._answer(problem, budget.left, rejected)
        if isinstance(answer, PlanFound):
            reproducible = answer.reproducible and repaired is None
            return Found(replace(answer, reproducible=reproducible), better=better)
        if not isinstance(answer, ProvenUnsolvable):
            return _unknown(answer, self._domain, goal, seconds)
        if rejected:
            reasons = "; ".join(f"{step}: {why}" for step, why in rejected.items())
            return NotFound("unsolvable", f"the simulation foresees that every plan fails: {reasons}")
        missing: tuple[str, ...] = ()
        left = WorkLimit(budget.left)
        with contextlib.suppress(WorkLimitError):  # the search for the missing conditions takes too long
            missing = await self._aside(lambda: why_unsolvable(self._domain, snapshot, goal, left), left)
        return NotFound("unsolvable", "; ".join(missing) or answer.reason)

    async def _aside(self, work: Callable[[], _Result], patience: WorkLimit | None = None) -> _Result:
        """Do the work in a thread, so that a cancellation ends the wait; simulated time does not pass meanwhile."""
        with self._clock.hold():
            return await aside(work, patience)

    async def _answer(self, problem: Problem, seconds: float, rejected: Collection[PlanStep]) -> Answer:
        """Return the planner's answer, without the excluded steps if a plan without them exists."""
        excluded, patience = self._excluded_now(), WorkLimit(seconds)
        answer, better = await self._planner.solve(without(problem, {*excluded, *rejected}), seconds)
        if isinstance(answer, ProvenUnsolvable) and excluded and not problem.unreachable:
            self._excluded.clear()
            self._records.readmitted(excluded)
            return await self._planner.solve(without(problem, rejected), patience.left)
        return answer, better

    async def _repaired(
        self, goal: Expression, seconds: float, before: PlanProgress, snapshot: WorldState
    ) -> Found | TimedOut | None:
        """Return the local repair of the plan before; `TimedOut` at a limit of real time."""
        excluded, patience = self._excluded_now(), WorkLimit(seconds)
        try:
            how = await self._aside(
                lambda: local_repair(before, excluded, self._domain, snapshot, goal, patience), patience
            )
        except WorkLimitError:
            return TimedOut("local repair", seconds)
        if how is None:
            return None
        seconds = min(patience.left / 4, LOCAL_REPAIR_SECONDS)
        answer, _ = await self._planner.solve(without(how.problem, excluded), seconds, going_on=False)
        if not isinstance(answer, PlanFound):
            return answer if isinstance(answer, TimedOut) else None
        plan = how.repaired(answer.plan, before.remaining_steps, self._domain, snapshot, goal)
        return None if plan is None else Found(replace(answer, plan=plan), kept=len(how.end))

    def _excluded_now(self) -> set[PlanStep]:
        now = self._clock.now()
        self._excluded = {step: until for step, until in self._excluded.items() if until > now}
        return set(self._excluded)

    async def _foreseen(self, found: Found) -> Validation:
        foresight = self._foresight
        if foresight is None:
            return Validation(valid=True)
        world, plan = self._knowledge.snapshot(), found.answer.plan
        verdict = await self._aside(lambda: foresight.foresee(plan, world))
        if not verdict.valid:
            step = None if verdict.failing_step is None else plan.steps[verdict.failing_step]
            self._records.rejected(step, verdict.why, found.answer.engine)
        return verdict


def _unknown(
    answer: NoneFound | TimedOut | EngineFailed | NobodyCan, domain: PlanningDomain, goal: Expression, seconds: float
) -> NotFound:
    """Describe an answer without a plan and without a proof."""
    match answer:
        case NoneFound(reason=reason):
            return NotFound("unsolvable", reason)
        case TimedOut(engine=engine):
            return NotFound("timed_out", f"no plan within {seconds:g} s ({engine})")
        case EngineFailed(engine=engine, message=message):
            return NotFound("failed", f"{engine}: {message}")
        case NobodyCan():
            return NotFound("failed", why_no_engine(domain, goal, answer))


def without(problem: Problem, steps: Collection[PlanStep]) -> Problem:
    """Return the problem of reaching the goal without any of these steps."""
    if not steps:
        return problem
    allowed = tuple(action for action in problem.actions if action.step not in steps)
    unsliced = problem.unsliced
    timed = None if problem.timed is None else without(problem.timed, steps)
    whole = None if unsliced is None else lambda: without(unsliced(), steps)
    return replace(problem, actions=allowed, unsliced=whole, timed=timed)

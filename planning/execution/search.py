"""Search for a plan that is valid in the present world and contains no excluded step.

The search ends within a bound of real time, even if the planner does not end. The search returns only plans that lead
to the goal.
"""

from __future__ import annotations

import contextlib
import itertools
import math
from collections import deque
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, TypeVar

from dsc.components.hooks import contained
from knowledge_base.errors import InputError
from knowledge_base.facts import Delta
from knowledge_base.world.overlay import Overlay
from planning.analysis.explanation import why_unsolvable
from planning.analysis.validation import Validation, validate
from planning.engines.registry import timing
from planning.execution.foresight import Foresight, names_read, require_verdict
from planning.execution.foresight_world import ForesightWorld
from planning.execution.plan_ends import leads_to
from planning.execution.plan_progress import PlanProgress, local_repair
from planning.execution.planner_call import Answer, PlannerCalls
from planning.execution.search_results import Found, NotFound
from planning.model.cancellable_work import WorkLimit, WorkLimitError, aside
from planning.model.plan import (
    EngineFailed,
    NoneFound,
    Plan,
    PlanFound,
    PlanStep,
    ProvenUnsolvable,
    TimedOut,
    Unsupported,
)
from planning.model.problem import WrongPlan
from planning.ordering.causal_tracing import deordered
from planning.ordering.partial_order import in_sequence
from planning.problem.construction import build_problem
from planning.problem.derived import derivation
from planning.problem.relevance import why_no_engine

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Collection, Iterable, Sequence

    from dsc.sequencer.clock import LoopClock
    from knowledge_base.language.evaluation.world_protocol import World
    from knowledge_base.language.syntax.expression import Expression
    from knowledge_base.store import KnowledgeBase
    from planning.engines.planner import Planner
    from planning.execution.plan_records import PlanRecords
    from planning.execution.step_costs import StepCosts
    from planning.model.domain import PlanningDomain
    from planning.model.problem import Problem


_Result = TypeVar("_Result")

EXCLUDED_SECONDS = 120.0
"""Seconds of run time for which new plans omit a step that failed repeatedly."""
_REMEDY = "a longer `budget: {seconds: ...}` or another engine may find one"
MAX_ATTEMPTS = 3
"""The number of searches that the world overtakes, after which the last executable plan begins without the goal.

Without an executable plan, the search ends after the same number of time limits.
"""
MAX_REJECTED = 5
"""The maximum number of plans that the simulation may reject, and of wrong plans that are followed by another."""
_IN_CONCERT = "the only plan has concurrent steps that need each other, which no plot executes yet"
_SHORT = 30
"""The number of steps up to which the monitor computes the causal links itself, in a few milliseconds.

A robot with a short plan then begins sooner; a long plan would block the event loop.
"""
LOCAL_REPAIR_SECONDS = 2.0
"""The limit of real time for a local repair, in seconds."""


@dataclass(slots=True)
class _Refused:
    """Steps and plans that one search has refused.

    Attributes:
        steps: the steps at which the simulation foresees a failure, with the reasons.
        plans: the plans that do not lead to the goal, although the world has not changed.
    """

    steps: dict[PlanStep, str] = field(default_factory=dict)
    plans: list[WrongPlan] = field(default_factory=list)


class Search:
    """Search for plans, with a list of excluded steps.

    Args:
        domain, knowledge, planner, clock: see `PlanningComponent`.
        records: receives a record of each excluded, readmitted and rejected step, and of each wrong plan.
        costs: the costs of plan steps.
        foresight: simulates each plan; the search returns only plans that the simulation accepts.
    """

    def __init__(
        self,
        domain: PlanningDomain,
        knowledge: KnowledgeBase,
        planner: Planner,
        clock: LoopClock,
        records: PlanRecords,
        costs: StepCosts,
        foresight: Foresight | None = None,
    ) -> None:
        self._domain = domain
        self._knowledge = knowledge
        self._planner = PlannerCalls(planner, clock)
        self._clock = clock
        self._records = records
        self.costs = costs
        self._foresight = foresight
        self._excluded: dict[PlanStep, float] = {}

    def exclude(self, step: PlanStep, why: str) -> None:
        """Exclude a step from new plans for `EXCLUDED_SECONDS` of run time, and record the reason `why`."""
        self._excluded[step] = self._clock.now() + EXCLUDED_SECONDS
        self._records.excluded(step, EXCLUDED_SECONDS, why)

    def remember(self) -> list[Any]:
        """Return the excluded steps and the times at which their exclusions end, as plain data."""
        return [[step.to_json(), until] for step, until in self._excluded.items()]

    def recall(self, memory: Iterable[Any]) -> None:
        """Restore the excluded steps from the data that `remember` returned."""
        self._excluded = {PlanStep.from_json(step): until for step, until in memory}

    async def plan_during(
        self, goal: Expression, seconds: float, before: PlanProgress, sleep: Callable[[float], Awaitable[None]]
    ) -> Found | NotFound:
        """Return a plan for which the running steps of `before` continue, unless a plan without them costs less.

        The running steps count as done in that comparison, since an interruption wastes the time that they took. For
        arguments and errors see `plan`.
        """
        found: Found | NotFound = await self.plan(goal, seconds, before, sleep)
        running, later = self._running(before), found
        if isinstance(found, Found):
            await found.close()
            first = _running_first(found.steps, running)
            if first is not None and leads_to(first, before.domain, self._knowledge.snapshot(), before.goal):
                return found if first == found.steps else found.with_steps(first)
        while running:
            later = await self.plan(goal, seconds, before.after_running(), sleep, running)
            if isinstance(later, Found):
                await later.close()
            searched, running = running, self._running(before)
            if searched == running:
                break
        if isinstance(found, NotFound) or isinstance(later, NotFound):
            return found if isinstance(later, NotFound) else later
        world = self._knowledge.snapshot()
        ahead = _ahead(running, self._domain, world)
        if ahead is None or not leads_to(found.steps, before.domain, world, before.goal):
            return later  # the world changed during the second search
        then = later.steps[len(running) :]
        cost = self.costs.total
        return later if cost(then, before.domain, ahead) <= cost(found.steps, before.domain, world) else found

    def _running(self, progress: PlanProgress) -> tuple[PlanStep, ...]:
        """Return the running steps that are applicable; the others are done, or cannot be completed."""
        steps = progress.steps_of(progress.running)
        return tuple([step for step in steps if _ahead((step,), progress.domain, self._knowledge) is not None])

    async def plan(
        self,
        goal: Expression,
        seconds: float,
        before: PlanProgress | None,
        sleep: Callable[[float], Awaitable[None]],
        running: tuple[PlanStep, ...] = (),
    ) -> Found | NotFound:
        """Return a plan that is valid in the world at the end of the search.

        If the simulation tells the cost of a plan, plans without the costliest steps are compared while time is left
        (S1.20).

        Args:
            goal: the condition to reach.
            seconds: real time for one search.
            before: the plan to replace; a local repair may keep some of its steps.
            sleep: waits for the simulated duration of a search. After an interruption it counts from the first start.
            running: the first steps of the plan; the search begins in the world after them.

        Raises:
            InputError: the goal contains a missing object, or needs a feature that no engine supports.
        """
        refused, limit = _Refused(), WorkLimit(seconds)
        best = latest = await self._valid_plan(goal, seconds, before, sleep, running, refused)
        while (
            isinstance(best, Found) and isinstance(latest, Found) and len(refused.steps) < MAX_REJECTED and limit.left
        ):
            step = latest.costliest_step
            if step is None or step in running:
                break
            refused.steps[step] = f"the plan costs {latest.cost:g}"
            latest = await self._valid_plan(goal, limit.left, None, sleep, running, refused)
            best = await self._compare(best, latest, step)
        if isinstance(best, Found) and best.cost < math.inf and best.version != self._knowledge.version:
            return await self._valid_plan(goal, seconds, best.progress, sleep, running, _Refused())
        return best

    async def _compare(self, best: Found, other: Found | NotFound, without: PlanStep) -> Found:
        """Return the plan of the lower cost, and close the other one."""
        if isinstance(other, NotFound):
            return best
        self._records.comparison(best.cost, other.cost, without, other.answer.engine)
        dearer, cheaper = (best, other) if other.cost < best.cost else (other, best)
        await dearer.close()
        return cheaper

    async def _valid_plan(
        self,
        goal: Expression,
        seconds: float,
        before: PlanProgress | None,
        sleep: Callable[[float], Awaitable[None]],
        running: tuple[PlanStep, ...],
        refused: _Refused,
    ) -> Found | NotFound:
        """Return a plan that is valid in the world at the end of the search, and that the simulation accepts.

        A search during which the world changed is repeated; then a local repair may keep steps of the plan found. After
        `MAX_ATTEMPTS` such searches, a robot without running steps begins with the last plan that can be executed.
        After a wrong plan the planner is asked again, with the reason in `Problem.wrong`, while time is left.
        """
        limit = WorkLimit(seconds)
        changed, begun = 0, self._clock.now()
        overtaken: deque[Found] = deque(maxlen=MAX_ATTEMPTS)
        while True:
            version, snapshot = self._knowledge.version, self._knowledge.snapshot()
            found = await self._found_after(running, goal, seconds, before, refused, snapshot)
            if isinstance(found, NotFound):
                return found
            if self._clock.simulated:
                await sleep(found.answer.simulated_seconds)
            try:
                verdict, found = await self._validate(found, goal, seconds)
            except WorkLimitError:
                await found.close()
                return NotFound("timed_out", f"the plan found was not validated within {seconds:g} s")
            if verdict.valid:
                accepted = await self._accept(found, goal, refused.steps)
                if accepted is not None:
                    return accepted
                before = None
                continue
            await found.close()
            if version == self._knowledge.version:
                self._refuse(found, verdict, refused.plans)
                if len(refused.plans) > MAX_REJECTED or not limit.left:
                    return _only_wrong(refused.plans, found)
                continue
            changed += 1
            limit = WorkLimit(seconds)
            overtaken.append(found)
            latest = self._executable(overtaken) if changed >= MAX_ATTEMPTS and not running else None
            if latest is not None:
                self._records.overtaken(changed, verdict.why)
                return latest
            if changed >= MAX_ATTEMPTS and self._clock.now() - begun > MAX_ATTEMPTS * seconds:
                return NotFound("failed", f"the world changes faster than plans are made: {verdict.why}")
            if not found.answer.plan.schedule:
                now = derivation(self._domain).at(self._knowledge)
                before = PlanProgress(found.steps[len(running) :], now.domain, now.condition(goal))

    def _refuse(self, found: Found, verdict: Validation, refused: list[WrongPlan]) -> None:
        step = None if verdict.failing_step is None else found.steps[verdict.failing_step]
        reason = verdict.why if step is None else f"{step}: {verdict.why}"
        self._records.wrong(step, reason, found.answer.engine)
        refused.append(WrongPlan(found.answer.plan, reason))

    def _executable(self, plans: Sequence[Found]) -> Found | None:
        """Return the last of the plans whose steps can still be executed."""
        for found in reversed(plans):
            plan = found.answer.plan
            if plan.steps and not plan.schedule and _ahead(plan.steps, self._domain, self._knowledge) is not None:
                order = in_sequence(plan)
                return replace(found, order=order, version=self._knowledge.version, better=None, overtaken=True)
        return None

    async def _found_after(
        self,
        running: tuple[PlanStep, ...],
        goal: Expression,
        seconds: float,
        before: PlanProgress | None,
        refused: _Refused,
        snapshot: World,
    ) -> Found | NotFound:
        """Return the running steps and a plan from the world after them."""
        world = _ahead(running, self._domain, snapshot)
        if world is None:
            return NotFound("failed", "a running step is no longer applicable")
        found = await self._in_time(self._search(goal, seconds, before, refused, world), seconds)
        return found.with_steps((*running, *found.steps)) if running and isinstance(found, Found) else found

    async def _accept(self, found: Found, goal: Expression, rejected: dict[PlanStep, str]) -> Found | NotFound | None:
        """Return the valid plan if the simulation accepts it; `None` after adding the step it rejects to `rejected`."""
        if found.answer.plan.schedule:
            alone = validate(Plan(found.steps), self._domain, self._knowledge, goal)
            if not alone.valid:
                await found.close()
                return NotFound("failed", f"{_IN_CONCERT}: {alone.why} ({found.answer.engine})")
        verdict = await self._foreseen(found)
        if verdict.valid:
            if verdict.cost is not None:  # a better plan of the engine may be a worse one for the simulation
                await found.close()
                found = replace(found, better=None)
            return replace(found, foreseen=verdict)
        await found.close()
        if verdict.failing_step is None or len(rejected) == MAX_REJECTED:
            return NotFound("failed", f"the simulation foresees that it fails: {verdict.why}")
        rejected[found.steps[verdict.failing_step]] = verdict.why
        return None

    async def _validate(self, found: Found, goal: Expression, seconds: float) -> tuple[Validation, Found]:
        """Validate the plan found on the present world in a thread, again while the world changes meanwhile.

        Raises:
            WorkLimitError: the validation takes longer than `seconds`.
        """
        for _ in range(MAX_ATTEMPTS):
            version, snapshot = self._knowledge.version, self._knowledge.snapshot()
            work = partial(self._validate_and_order, found, goal, snapshot, version)
            validated = await self.aside(work, WorkLimit(seconds))
            if version == self._knowledge.version:
                return validated
        return self._validate_and_order(found, goal, self._knowledge.snapshot(), self._knowledge.version)

    def _validate_and_order(
        self, found: Found, goal: Expression, world: World, version: int
    ) -> tuple[Validation, Found]:
        """Validate the plan, and compute its partial order and the needs of its steps."""
        plan, order, found = found.answer.plan, None, replace(found, version=version)
        if not plan.schedule:
            with contextlib.suppress(InputError):
                order = deordered(plan, self._domain, world, goal)
        verdict = Validation(valid=True) if order is not None else validate(plan, self._domain, world, goal)
        if not verdict.valid:
            return verdict, found
        now = derivation(self._domain).at(world)
        progress = PlanProgress(plan.steps, now.domain, now.condition(goal))
        if len(plan.steps) > _SHORT:
            progress.needed()
        return verdict, replace(found, order=order, progress=progress)

    async def _in_time(self, finding: Awaitable[Found | NotFound], seconds: float) -> Found | NotFound:
        try:
            async with self._planner.abandon_at(seconds):
                return await finding
        except TimeoutError:
            return NotFound("timed_out", f"no plan within {seconds:g} s, nor soon after ({self._planner.name})")

    async def _search(
        self,
        goal: Expression,
        seconds: float,
        before: PlanProgress | None,
        refused: _Refused,
        snapshot: World,
    ) -> Found | NotFound:
        """Search for a plan in the world of the snapshot, first by local repair, then by a planner call."""
        budget = WorkLimit(seconds)
        before = None if refused.plans else before
        repaired = None if before is None else await self._repair(goal, seconds / 2, before, snapshot)
        if isinstance(repaired, Found):
            return repaired
        patience, durations = WorkLimit(budget.left), not self._clock.simulated and bool(timing())
        try:
            problem = await self.aside(
                lambda: build_problem(self._domain, snapshot, goal, durations=durations, patience=patience), patience
            )
        except WorkLimitError as error:
            return NotFound("timed_out", f"no plan within {seconds:g} s (while {error.doing})")
        problem = replace(problem, wrong=tuple(refused.plans)) if refused.plans else problem
        answer, better = await self._answer(self.costs.price(problem), budget.left, refused.steps)
        if isinstance(answer, PlanFound):
            reproducible = answer.reproducible and repaired is None
            return Found(replace(answer, reproducible=reproducible), better=better)
        if not isinstance(answer, ProvenUnsolvable):
            return _unknown(answer, self._domain, goal, seconds)
        if refused.steps:
            reasons = "; ".join(f"{step}: {why}" for step, why in refused.steps.items())
            return NotFound("unsolvable", f"the simulation foresees that every plan fails: {reasons}")
        missing: tuple[str, ...] = ()
        left = WorkLimit(budget.left)
        with contextlib.suppress(WorkLimitError):  # the explanation takes too long; the reason of the planner suffices
            missing = await self.aside(lambda: why_unsolvable(self._domain, snapshot, goal, left), left)
        return NotFound("unsolvable", "; ".join(missing) or answer.reason)

    async def aside(self, work: Callable[[], _Result], patience: WorkLimit | None = None) -> _Result:
        """Call `work` in a thread; a cancellation ends the wait, and simulated time stops during the call."""
        with self._clock.hold():
            return await aside(work, patience)

    async def _answer(self, problem: Problem, seconds: float, rejected: Collection[PlanStep]) -> Answer:
        """Return the planner's outcome for the problem without excluded steps; readmit them if no such plan exists."""
        excluded, patience = self._excluded_now(), WorkLimit(seconds)
        answer, better = await self._planner.solve(without(problem, {*excluded, *rejected}), seconds)
        if isinstance(answer, ProvenUnsolvable) and excluded and not problem.unreachable:
            self._excluded.clear()
            self._records.readmitted(excluded)
            return await self._planner.solve(without(problem, rejected), patience.left)
        return answer, better

    async def _repair(
        self, goal: Expression, seconds: float, before: PlanProgress, snapshot: World
    ) -> Found | TimedOut | None:
        """Return a local repair of the plan `before`; `TimedOut` at the time limit, or `None` without a repair."""
        excluded, patience = self._excluded_now(), WorkLimit(seconds)
        try:
            how = await self.aside(
                lambda: local_repair(before, excluded, self._domain, snapshot, goal, patience), patience
            )
        except WorkLimitError:
            return TimedOut("local repair", seconds)
        if how is None:
            return None
        seconds = min(patience.left / 4, LOCAL_REPAIR_SECONDS)
        answer, _ = await self._planner.solve(without(how.problem, excluded), seconds, improving=False)
        if not isinstance(answer, PlanFound):
            return answer if isinstance(answer, TimedOut) else None
        plan = await self.aside(lambda: how.repaired(answer.plan, before.remaining_steps, self._domain, snapshot, goal))
        return None if plan is None else Found(replace(answer, plan=plan), kept=_equal_at_end(plan.steps, how.end))

    def _excluded_now(self) -> set[PlanStep]:
        now = self._clock.now()
        self._excluded = {step: until for step, until in self._excluded.items() if until > now}
        return set(self._excluded)

    @property
    def reads(self) -> frozenset[str]:
        """The predicates and functions that the simulation reads."""
        return names_read(self._foresight)

    async def foresee_coming(self, progress: PlanProgress) -> Validation:
        """Simulate the coming steps of a running plan, from the world after its running steps.

        Raises:
            ProgrammingError: the simulation fails, or returns another value than a `Validation`.
        """
        ahead = _ahead(self._running(progress), self._domain, self._knowledge.snapshot())
        if ahead is None:
            return Validation(valid=True)
        return await self._foresee(Plan(progress.coming()), ahead.delta if isinstance(ahead, Overlay) else Delta())

    async def _foresee(self, plan: Plan, expected: Delta) -> Validation:
        """Simulate a plan in the present world with the expected changes."""
        foresight = self._foresight
        if foresight is None:
            return Validation(valid=True)
        world = ForesightWorld(self._domain, self._knowledge, expected)
        with contained(f"{type(foresight).__name__}.foresee"):
            verdict = await self.aside(lambda: foresight.foresee(plan, world))
            require_verdict(verdict, plan, foresight)
        return verdict

    async def _foreseen(self, found: Found) -> Validation:
        plan = found.answer.plan
        verdict = await self._foresee(plan, Delta())
        if not verdict.valid:
            step = None if verdict.failing_step is None else plan.steps[verdict.failing_step]
            self._records.rejected(step, verdict.why, found.answer.engine)
        return verdict


def _only_wrong(plans: Sequence[WrongPlan], found: Found) -> NotFound:
    number = f", the last of {len(plans)} wrong plans" if len(plans) > 1 else ""
    reason = f"the plan found does not lead to the goal: {plans[-1].reason} ({found.answer.engine}{number})"
    return NotFound("failed", reason)


def _running_first(steps: tuple[PlanStep, ...], running: tuple[PlanStep, ...]) -> tuple[PlanStep, ...] | None:
    """Return the steps in an order that begins with the running steps; `None` if a running step is missing."""
    rest = list(steps)
    for step in running:
        if step not in rest:
            return None
        rest.remove(step)
    return (*running, *rest)


def _equal_at_end(one: Iterable[PlanStep], other: Iterable[PlanStep]) -> int:
    """Return the number of last steps that two plans share."""
    pairs = zip(reversed(tuple(one)), reversed(tuple(other)), strict=False)
    return sum(1 for _ in itertools.takewhile(lambda pair: pair[0] == pair[1], pairs))


def _ahead(running: Collection[PlanStep], domain: PlanningDomain, world: World) -> World | None:
    """Return the world after the running steps; `None` if a step is not applicable."""
    ahead = Overlay(world)
    with contextlib.suppress(InputError):  # an object is missing, or a value cannot be computed
        for step in running:
            if not domain.applicable(step, ahead):
                return None
            ahead.apply(domain.effects(step, ahead))
        return ahead if running else world
    return None


def _unknown(
    answer: NoneFound | TimedOut | EngineFailed | Unsupported, domain: PlanningDomain, goal: Expression, seconds: float
) -> NotFound:
    """Convert an outcome without a plan and without a proof of unsolvability."""
    match answer:
        case NoneFound(reason=reason):
            return NotFound("unsolvable", reason)
        case TimedOut(engine=engine):
            return NotFound("timed_out", f"no plan within {seconds:g} s ({engine}); {_REMEDY}")
        case EngineFailed(engine=engine, message=message):
            return NotFound("failed", f"{engine}: {message}")
        case Unsupported():
            return NotFound("failed", why_no_engine(domain, goal, answer))


def without(problem: Problem, steps: Collection[PlanStep]) -> Problem:
    """Return the problem without the ground actions of these steps."""
    if not steps:
        return problem
    allowed = tuple(action for action in problem.actions if action.step not in steps)
    unsliced = problem.unsliced
    timed = None if problem.timed is None else without(problem.timed, steps)
    whole = None if unsliced is None else lambda: without(unsliced(), steps)
    return replace(problem, actions=allowed, unsliced=whole, timed=timed)

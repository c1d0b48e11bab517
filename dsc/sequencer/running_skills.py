"""Running skills: their answers, their deadlines, and the clean-up of cancelled skills."""

from __future__ import annotations

import asyncio
import math
import threading
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from typing import Protocol

from dsc.blocking import DeadlineError
from dsc.calls import OBSERVED, Reports
from dsc.components.hooks import GRACE, Classes, abandon_after, cancel_once, is_own, programming_error
from dsc.components.turns import Claim
from dsc.engine.steps import NO_CHANGE, Start
from dsc.errors import PreemptedError, ProgrammingError
from dsc.events import PREEMPTED, PROGRAMMING_ERROR, SKILL_ERROR
from dsc.messages import SkillMessage
from dsc.outcomes import Outcome
from dsc.run_log import run_logger
from dsc.sequencer.clock import LoopClock, ScheduledCall
from dsc.sequencer.message_checks import failed, faulty, late, validated
from dsc.sequencer.outbox import Configuring
from dsc.skills import SkillSignature
from knowledge_base.tracebacks import waits_at
from knowledge_base.user_objects import described, has_type

_LOG = run_logger(__package__)


@dataclass(frozen=True, slots=True)
class InterruptedSkill:
    """An action that was started before the restart.

    Attributes:
        asked: second of run time at which the chart started the action.
        began: second at which the action got the turn of its component; `None` if it was still waiting.
        reports: the number of the action's reports that were handled.
    """

    asked: float
    began: float | None
    reports: int


class WaitObserver(Protocol):
    """Observer of the skills that wait for their components."""

    def asker(self, activation: int) -> str:
        """Return the state of an activation as the end of a phrase, as ` of state 'look'`; empty if it was left."""
        ...

    def note_wait(self, start: Start, holder: str) -> None:
        """Record that a skill waits for the end of the skill `holder`."""
        ...

    def note_turn(self, start: Start) -> bool:
        """Record that a skill gets its turn after a wait, and return whether the skill may begin."""
        ...


class RunningSkill:
    """An execution of a skill, which posts the skill's reports and, one time, its end.

    At second `due`, a timer posts `timed_out` and cancels the task, so that the chart does not wait for the clean-up.
    Observations that follow the end are still posted, since they are true.

    Args:
        start: the start of the skill.
        signature: the skill's signature.
        raises: the exceptions that the component declares.
        within: maximum duration, in seconds.
        since: second of run time of the start; a resumed skill has that of its first start.
        clock: run time.
        post: receives the messages of the skill.
        fault: receives a fault of the run.
        observer: names the state of a skill, and records which skills wait.

    Attributes:
        task: the execution.
        reports: the reports; `None` before the first.
        stopped: whether the chart has cancelled the skill.
        answered: whether the end was posted.
        configuring: deliveries of parameters and modes that end before the skill begins.
        claim: the claim to the component; `None` if the component is concurrent.
        since: second of run time of the start.
        due: second of run time of the deadline; `math.inf` means no deadline.
        begun: whether the skill may begin, since it has the turn of its component.
        credible: whether observations after the end are posted; false after an invalid report.
        waits_for: returns, as text, the component that the given skill waits for; empty if it waits for none.
    """

    task: asyncio.Task[None]

    def __init__(
        self,
        start: Start,
        signature: SkillSignature,
        raises: Classes,
        within: float,
        since: float,
        clock: LoopClock,
        post: Callable[[SkillMessage], None],
        fault: Callable[[str], None],
        observer: WaitObserver,
    ) -> None:
        self.start = start
        self.signature = signature
        self.within = within
        self.since = since
        self.due = since + within
        self.reports: Reports | None = None
        self.stopped = False
        self.answered = False
        self.configuring: Configuring = {}
        self.claim: Claim | None = None
        self.begun = True
        self.credible = True
        self.waits_for: Callable[[RunningSkill], str] = lambda _: ""
        self._turn: asyncio.Future[None] | None = None
        self._clock = clock
        self._post = post
        self._fault = fault
        self._observer = observer
        self._raises = raises
        self._thread = threading.get_ident()
        self._holder: str | None = None
        self._timer: ScheduledCall | None = None

    # -- answers -----------------------------------------------------------------------------------------

    def report(self, outcome: Outcome) -> None:
        """Post an intermediate event; after the end of the skill, only the observations.

        Raises:
            ProgrammingError: the call comes from another thread than the event loop's; the skill then fails, too.
        """
        if threading.get_ident() != self._thread:
            skill = f"{self.start.component}.{self.start.skill}"
            bug = ProgrammingError(f"{skill}: it reports from another thread; declare it `blocking`")
            self.task.get_loop().call_soon_threadsafe(self._report_misuse, bug)
            raise bug
        if self.stopped or self.answered:
            if self.task.done():
                _LOG.warning("skill '%s.%s' reports after its end", self.start.component, self.start.skill)
            self._post_observed(validated(outcome, self.start, self.signature))
        else:
            self.reports = self.reports or Reports(self._post_report)
            self.reports.put(validated(outcome, self.start, self.signature))

    def _report_misuse(self, bug: ProgrammingError) -> None:
        if self.answered:
            self._fault(str(bug))
            return
        programming_error(bug, "")
        self.answer(faulty(self.start, str(bug)))
        cancel_once(self.task)

    def _post_report(self, report: Outcome, conflated: int) -> None:
        ends = report.event in {SKILL_ERROR, PROGRAMMING_ERROR}
        declared = None if ends else self.signature.outcomes.get(report.event)
        activated = self.signature.pattern == "event" and not ends
        self._post(SkillMessage(self.start, report, ends, ends, conflated, declared, activated))

    def _post_observed(self, outcome: Outcome) -> None:
        if outcome.observed is not NO_CHANGE and self.credible:
            self._post(SkillMessage(self.start, Outcome(OBSERVED, observed=outcome.observed), final=False))

    def answer(self, outcome: Outcome, *, continues: bool = False) -> None:
        """Post the end, one time, and stop the timer of the deadline; post only the observations of a later outcome.

        Args:
            outcome: the end.
            continues: whether the task still executes; the sequencer then cancels it.
        """
        if self.answered:
            self._post_observed(outcome)
            return
        if self.reports is not None:
            self.reports.flush()
        declared = self.signature.outcomes.get(outcome.event) if outcome.attributes else None
        self._post(SkillMessage(self.start, outcome, final=True, continues=continues, declared=declared))
        self.answered = True
        self.end_limit()

    def disbelieve(self) -> None:
        """Ignore the later answers of a skill that failed by an invalid report."""
        if not self.answered:
            self.answered, self.credible = True, False

    def ended(self, task: asyncio.Task[None]) -> None:
        """Post a failure for a task that has ended without an answer, unless the skill was stopped."""
        why = asyncio.CancelledError("its task was cancelled") if task.cancelled() else task.exception()
        if why is not None and not self.stopped and not self.answered:
            self.answer(self._outcome_of(why))

    def failed(self, error: BaseException) -> Outcome | None:
        """Return the outcome of a skill that raised an error; `None` if its task was cancelled from outside."""
        if not is_own(error, self.task):
            return None
        if has_type(error, DeadlineError) or (self.is_late and has_type(error, TimeoutError)):
            return late(self.start, self.within)
        outcome = self._outcome_of(error)
        return late(self.start, self.within) if self.is_late and outcome.event == SKILL_ERROR else outcome

    def _outcome_of(self, error: BaseException) -> Outcome:
        if type(error) is PreemptedError:
            return self._preemption(error.by)
        bug = programming_error(error, f"{self.start.component}.{self.start.skill}", self._raises)
        return failed(self.start, described(error)) if bug is None else faulty(self.start, str(bug))

    # -- the turn of the component -------------------------------------------------------------------------

    def describe(self) -> str:
        """Return the skill with its state, as text for people."""
        return f"{self.start.component}.{self.start.skill}{self._observer.asker(self.start.activation)}"

    def begin(self, *, waited: bool) -> None:
        """Begin with the turn of the component."""
        if waited and not self._observer.note_turn(self.start):
            return
        self.begun = True
        if self._turn is not None and not self._turn.done():
            self._turn.set_result(None)

    def wait(self, holder: str) -> None:
        """Note the skill whose end this skill waits for."""
        self._observer.note_wait(self.start, holder)

    def held(self, holder: str) -> None:
        """Note the skill of another program that the component executes first; empty when this skill begins."""
        if self.answered or self.stopped:
            return
        if holder:
            self._observer.note_wait(self.start, holder)
        else:
            self._observer.note_turn(self.start)
        self._holder = holder or None

    @property
    def missing(self) -> str:
        """The component that the skill waits for, as text; empty if it waits for none."""
        return self.waits_for(self)

    @property
    def holder(self) -> str | None:
        """The skill whose end this skill waits for; empty if the component is free, and `None` without a wait."""
        if self.begun or self.claim is None:
            return self._holder
        claim = self.claim.turns.holder
        return "" if claim is None or claim is self.claim else claim.claimant.describe()

    def lose(self, taker: str) -> None:
        """Post `preempted`, since a skill with a higher priority takes the component; the task is then cancelled."""
        self.answer(self._preemption(taker), continues=True)

    def _preemption(self, taker: str) -> Outcome:
        return Outcome(PREEMPTED, {"skill": f"{self.start.component}.{self.start.skill}", "by": taker})

    async def turn(self) -> None:
        """Wait until `begun`."""
        self._turn = asyncio.get_running_loop().create_future()
        await self._turn

    # -- time --------------------------------------------------------------------------------------------

    @property
    def is_late(self) -> bool:
        """Whether the skill blocked the loop until after its deadline; a deadline that gives way waits for outcomes."""
        if self._clock.simulated or (self._timer is not None and self._timer.gives_way):
            return False
        return self._clock.now() > self.due

    def begin_limit(self) -> None:
        """Schedule the end at second `due`."""
        if math.isfinite(self.due):
            self._timer = self._clock.call_at(self.due, self._expire)

    def end_limit(self) -> None:
        """Stop the timer: the skill has ended, and `PendingCleanups` bounds a clean-up."""
        if self._timer is not None:
            self._timer.cancel()

    def _expire(self) -> None:
        missing, place = self.missing, waits_at(self.task.get_coro())
        waited = f"for {missing}" if missing else f"at {place}" if place else ""
        self.answer(late(self.start, self.within, waited), continues=True)
        cancel_once(self.task)

    def abandon(self) -> None:
        """Report as a fault that the skill ignored its cancellation."""
        skill, place = f"{self.start.component}.{self.start.skill}", waits_at(self.task.get_coro())
        where = f"; it waits at {place}" if place else ""
        self._fault(f"skill '{skill}' ignored its cancellation for {GRACE:g} s and was abandoned{where}")


class PendingCleanups:
    """Register of cancelled tasks until they have stopped.

    A task that ignores its cancellation is abandoned after `GRACE` seconds.

    Args:
        say: receives the component's name when one of its tasks has stopped or was abandoned.

    Attributes:
        pending: by component, the cancelled tasks that have not stopped.
    """

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self.pending: dict[str, set[asyncio.Task[None]]] = {}

    def add(self, skill: RunningSkill) -> None:
        """Add the cancelled task of a skill; the skill then leaves its claim, and reports if the task is abandoned."""
        component, task = skill.start.component, skill.task
        of_component = self.pending.setdefault(component, set())
        of_component.add(task)

        def end(_: asyncio.Task[None]) -> None:
            if task in of_component:
                of_component.remove(task)
                if not of_component:
                    del self.pending[component]
                if skill.claim is not None:
                    skill.claim.leave()
                    skill.claim = None  # it refers to the skill
                _forget_cancellation(task)
                self._say(component)

        def abandon() -> None:
            end(task)
            skill.abandon()

        task.add_done_callback(end)
        abandon_after(task, GRACE, abandon)

    def tasks(self) -> Iterable[asyncio.Task[None]]:
        """Return the tasks that have not stopped."""
        return [task for of_component in self.pending.values() for task in of_component]


def _forget_cancellation(task: asyncio.Task[None]) -> None:
    """Take the error out of a cancelled task: its traceback has the frames of the skill, which refer to the task."""
    if task.cancelled():
        with suppress(asyncio.CancelledError):
            task.exception()

"""One simulated run of the clean-up table with seeded faults and crashes, and the check of its promises."""

from __future__ import annotations

import asyncio
import signal
import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from soak_judge import (
    AFTER_STOP,
    FALSE_CLAIM,
    HANGS,
    HISTORY,
    NO_REPORT,
    STOPPED,
    TWICE,
    ended_stopped,
    invariants,
    said_by_others,
    wrong_report,
)

from domains.clean_up_table.bringup import bundle, deploy, world_of
from domains.clean_up_table.durable_world import DurableWorld, beside
from domains.clean_up_table.scenario import Scenario, Table
from dsc.chance import choose, uniform
from dsc.dynamic.library import Library
from dsc.engine.steps import Step
from dsc.events import Event
from dsc.runs.archive import has_run
from dsc.sequencer.sequencer import Sequencer
from dsc.testing.crashes import Crashes
from dsc.testing.faults import USUAL, Fault, Faults, Interleaving
from dsc.testing.invariants import executed_once, kept_run
from knowledge_base.errors import DamagedStoreError, InputError
from planning import PlannerProcess, Robot, resume
from planning.engines.race import CachingPlanner
from planning.robot.report import Report
from planning.testing import FaultyPlanner

MOST_STEPS = 5_000
"""Maximum number of macrosteps of one life."""
A_HANG = 120
"""Seconds of real time after which a run counts as hanging."""
DEFAULT_EVERY = 100
"""One table in this number is the default one; the others are small."""
INTERLEAVED = 0.5
"""Share of the runs with a shuffled order of simultaneous messages."""
RESTARTS = 0.5
"""Share of the runs in which the operator lets the robot continue after a stop."""
CRASHES = 0.015
"""Chance of a crash at each boundary."""
UNTIL_RESTART = 60.0
"""Seconds from a stop until the operator lets the robot continue."""
REMEMBERED = 2_000
"""Number of problems with cached plans: small tables are alike."""
PLAIN = frozenset({Fault.KNOWLEDGE_CHANGED, Fault.ANSWER_LATE, Fault.ANSWER_TWICE, Fault.INTERRUPTED})
"""Faults that keep the robot from no goal."""

_TABLES: tuple[tuple[int, int, tuple[str, ...]], ...] = (
    (1, 0, ()), (1, 0, ()), (1, 0, ()), (0, 1, ()), (0, 1, ()), (0, 0, ("small",)), (2, 0, ()), (2, 0, ()), (1, 1, ()),
    (0, 1, ("small",)), (0, 1, ("large",)), (1, 1, ("small",)), (2, 1, ()), (0, 2, ("large",)), (2, 1, ("small",)),
)  # fmt: skip
"""Cups, cans and crisp cans; small tables come more often."""


class HangError(SystemExit):
    """A run that hangs; asyncio does not catch a `SystemExit`, so that it ends the run."""


@dataclass(slots=True)
class Outcome:
    """The result of a run.

    Attributes:
        seed: the seed of everything in it.
        how: `goal reached`, `something left`, `stopped` or `ended early`; `no report` without a report.
        lives: number of starts of the program.
        steps: number of macrosteps.
        faults: number of times that each fault fired.
        crashes: number of crashes at each boundary.
        wrong: the violations, each as promise and finding.
    """

    seed: int
    how: str = "no report"
    lives: int = 0
    steps: int = 0
    faults: Counter[str] = field(default_factory=Counter)
    crashes: Counter[str] = field(default_factory=Counter)
    wrong: list[tuple[str, str]] = field(default_factory=list)


class Planners:
    """A warm planner for the running program, and one for the program that replaces it meanwhile."""

    def __init__(self) -> None:
        self._first = CachingPlanner(PlannerProcess(), REMEMBERED)
        self._second = CachingPlanner(PlannerProcess(), REMEMBERED)

    def mine(self) -> CachingPlanner:
        return self._first if threading.current_thread() is threading.main_thread() else self._second

    def close(self) -> None:
        self._first.kill()
        self._second.kill()


class Trial:
    """A run from its seed.

    Args:
        seed: seed of table, faults, crashes and, in half of the runs, the order of simultaneous messages.
        chance: chance of a fault per skill call.
        planners: the planners of this process.
        folder: for the files.
        replayed: whether the run is replayed as well, which takes half as long as the run.
        interleaved: whether the order is shuffled; by default the seed decides.
    """

    def __init__(
        self, seed: int, chance: float, planners: Planners, folder: Path, *,
        replayed: bool = True, interleaved: bool | None = None,
    ) -> None:  # fmt: skip
        self.outcome = Outcome(seed)
        self._seed = seed
        self._chance = chance
        self._planners = planners
        self._replayed = replayed
        self._interleaved = uniform(seed, "run", "interleaved") < INTERLEAVED if interleaved is None else interleaved
        self._library: Library | None = None
        self._faults = Faults(seed, chance / 4, USUAL if seed % 2 else PLAIN)
        self._crashes: Crashes[Report | None] = Crashes(folder, seed, chance=CRASHES)
        self._stop = ObeyedStop()
        self._turned = 0
        self._hung: str | None = None

    def run(self) -> Outcome:
        outcome = self.outcome
        try:
            with no_longer_than(A_HANG):
                report = self._crashes.survive(self._live)
                if self._hung is None:
                    self._judge(report)
                else:
                    outcome.wrong.append((HANGS, self._hung))
        except HangError as error:
            outcome.wrong.append((HANGS, str(error)))
        except DamagedStoreError as error:  # without injected damage, two programs have written two histories
            outcome.wrong.append((HISTORY, str(error)))
        except Exception as error:  # noqa: BLE001  any error makes the seed notable
            outcome.wrong.append((NO_REPORT, f"{type(error).__name__}: {error}"))
        outcome.wrong += [(TWICE, problem) for problem in self._crashes.problems]
        outcome.wrong += [(AFTER_STOP, problem) for problem in self._stop.problems]
        outcome.lives = self._crashes.life + 1
        outcome.faults += self._faults.counts() + Counter(turned=self._turned)
        outcome.crashes += self._crashes.fired
        return outcome

    def _live(self, folder: Path) -> Report | None:
        """Start or resume the run; return `None` if it is over and only its report was lost."""
        store, planner = folder / "run.kb", FaultyPlanner(self._planners.mine(), self._faults, self._crashes.reached)
        if not has_run(store):
            table = deploy(scenario(self._seed), self._seed, self._chance, planner, store=store)
        else:
            with kept_run(store) as run:  # as the crashed program left it
                self.outcome.wrong += [(TWICE, wrong) for wrong in executed_once(done(store))(run)]
                if run.ended is not None:
                    return None
                self._stop.resumed(run.steps[-1].configuration)
            table = resume(bundle(), store, planner=planner)
        with table:
            self._library = table.library
            for component in table.components:
                self._crashes.inject(self._faults.inject(component))
            return table.report(prepare=lambda sequencer: self._prepare(table, sequencer))

    def _prepare(self, table: Robot, sequencer: Sequencer) -> None:
        steps = 0

        def count(_: Step) -> None:
            nonlocal steps
            steps += 1
            if steps > MOST_STEPS:
                self._hung = f"more than {MOST_STEPS} macrosteps"
                raise InputError(self._hung)

        sequencer.listen(count)
        if self._interleaved:
            interleaving = Interleaving(self._seed)
            interleaving.attach(sequencer)
            sequencer.listen(lambda _: self._note_turns(interleaving))
        self._faults.meddle(sequencer, lambda: said_by_others(world_of(table), sequencer))
        self._faults.interrupt(sequencer, Event("stop"))
        self._stop.watch(sequencer, table, restarts=uniform(self._seed, "stop", "restarts") < RESTARTS)
        self._crashes.watch(sequencer)

    def _note_turns(self, interleaving: Interleaving) -> None:
        self._turned += interleaving.turned
        interleaving.turned = 0

    def _judge(self, report: Report | None) -> None:
        """Compare the files after the last life with the world."""
        outcome, store = self.outcome, self._crashes.folder / "run.kb"
        world = DurableWorld.open(beside(store))
        world.close()
        outcome.faults += Counter(f"{one.kind}{' (permanent)' if one.permanent else ''}" for one in world.fired)
        with kept_run(store) as run:
            for promise, invariant in invariants(world, self._library, replayed=self._replayed):
                outcome.wrong += [(promise, wrong) for wrong in invariant(run)]
            outcome.steps = len(run.steps)
            stopped = ended_stopped(run)
            if run.ended is not None:
                left = "stopped" if stopped else "goal reached" if world.goal_reached else "something left"
                outcome.how = left if run.ended["problem"] is None else "ended early"
        self._stop.judge(set(world.done))
        if report is not None:
            plain = self._faults.kinds == PLAIN
            wrong = wrong_report(report, world, stopped=stopped, plain=plain)
            outcome.wrong += [(FALSE_CLAIM, one) for one in wrong]


class ObeyedStop:
    """Checks that the robot executes no action during the operator's stop.

    Attributes:
        problems: actions executed during a stop.
    """

    def __init__(self) -> None:
        self.problems: list[str] = []
        self._done: set[str] | None = None
        self._life = object()

    def resumed(self, configuration: tuple[str, ...]) -> None:
        """Resume after a crash; uncommitted changes of the crashed program do not count."""
        if configuration != STOPPED:
            self._done = None

    def watch(self, sequencer: Sequencer, table: Robot, *, restarts: bool) -> None:
        """Check each macrostep; an operator who `restarts` lets the robot continue after a while."""
        life = self._life = object()

        def look(_: Step) -> None:
            if life is not self._life:
                return  # another program has replaced this one
            is_valid = sequencer.machine.state.configuration() == STOPPED
            world_of(table).catch_up()
            if not is_valid:
                self.judge(set(world_of(table).done))
                self._done = None
            elif self._done is None:
                self._done = set(world_of(table).done)
                if restarts:
                    asyncio.get_running_loop().call_later(UNTIL_RESTART, sequencer.post, Event("restart"))

        sequencer.listen(look)

    def judge(self, done: set[str]) -> None:
        """Compare the executed actions with those at the stop."""
        if self._done is not None and done > self._done:
            self.problems.append(f"{', '.join(sorted(done - self._done))} were executed after the stop")


def scenario(seed: int) -> Scenario:
    """Return the table of a seed."""
    if seed % DEFAULT_EVERY == 0:
        return Scenario.default()
    cups, cans, crisp_cans = choose(seed, "table", "items", _TABLES)
    return Scenario(table=Table(cups=cups, cans=cans, crisp_cans=crisp_cans))


def done(store: Path) -> list[str]:
    """Return the ids of the executed actions."""
    world = DurableWorld.open(beside(store))
    world.close()
    return list(world.done)


@contextmanager
def no_longer_than(seconds: int) -> Iterator[None]:
    """Raise `HangError` in the block after `seconds` of real time; only in a process's main thread."""

    def hang(*_: object) -> None:
        raise HangError(f"it still runs after {seconds} s")

    before = signal.signal(signal.SIGALRM, hang)
    signal.setitimer(signal.ITIMER_REAL, seconds, seconds / 10)  # again, if an error handler caught the first one
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)

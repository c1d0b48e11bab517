"""One simulated run of the clean-up table with faults and crashes, drawn from its seed, and what must hold of it."""

from __future__ import annotations

import signal
import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from domains.clean_up_table.deployment import CleanUpTable, deploy, resumed
from domains.clean_up_table.faults import ITEM_MOVED
from domains.clean_up_table.items import HAND
from domains.clean_up_table.places import SURFACES
from domains.clean_up_table.report import Report
from domains.clean_up_table.scenario import Scenario, Table
from domains.clean_up_table.world import World
from domains.clean_up_table.world_file import LastingWorld, beside
from dsc.chance import choose
from dsc.dynamic.library import Library
from dsc.engine.steps import Step
from dsc.sequencer.run_tables import has_run
from dsc.sequencer.sequencer import Sequencer
from dsc.testing.crashes import Crashes
from dsc.testing.faults import USUAL, Fault, Faults
from dsc.testing.invariants import (
    Invariant,
    KeptRun,
    claims_nothing_false,
    comes_to_an_end,
    executed_once,
    kept_run,
    knows,
    one_history,
    replays,
)
from knowledge_base.facts import Delta, Fact, fact
from knowledge_base.store import KnowledgeBase
from planning import PlannerProcess
from planning.engines.cache import CachingPlanner
from planning.testing import FaultyPlanner

LONGEST = 6 * 3600.0
"""Seconds of run time that a table may take."""
MOST_STEPS = 5_000
"""Macrosteps of one life."""
A_HANG = 120
"""Seconds of real time after which a run is one."""
DEFAULT_EVERY = 100
"""One table in so many is the default one; the others are small."""
CRASHES = 0.015
"""Chance of a crash at each boundary."""
REPLAYED_EVERY = 3
"""One run in so many is replayed, which takes as long as the run."""
REMEMBERED = 2_000
"""Problems whose plans are: small tables are alike."""
PLAIN = frozenset({Fault.KNOWLEDGE_CHANGED, Fault.ANSWER_LATE, Fault.ANSWER_TWICE})
"""What does not keep the robot from anything."""
PREDICATES = ("robot-at", "hand-free", "holding", "inside", "lies-at", "disposed")

_TABLES: tuple[tuple[int, int, tuple[str, ...]], ...] = (
    (1, 0, ()), (1, 0, ()), (1, 0, ()), (0, 1, ()), (0, 1, ()), (0, 0, ("small",)), (2, 0, ()), (2, 0, ()), (1, 1, ()),
    (0, 1, ("small",)), (0, 1, ("large",)), (1, 1, ("small",)), (2, 1, ()), (0, 2, ("large",)), (2, 1, ("small",)),
)  # fmt: skip
"""Cups, cans and crisp cans; what is small comes more often."""
_PLACES = {"lies-at", "inside"}


class HangError(SystemExit):
    """A run goes on and on; asyncio lets this out of whatever is at work, and nobody catches it on the way."""


@dataclass(slots=True)
class Outcome:
    """What came of a run.

    Attributes:
        seed: of everything in it.
        how: `goal reached`, `something left` or `ended early`; `no report` if there is none.
        lives: how often the program was begun.
        steps: macrosteps.
        faults: how often each fault fired.
        crashes: how often the program died where.
        wrong: what must not be, as (which promise, what was seen).
    """

    seed: int
    how: str = "no report"
    lives: int = 0
    steps: int = 0
    faults: Counter[str] = field(default_factory=Counter)
    crashes: Counter[str] = field(default_factory=Counter)
    wrong: list[tuple[str, str]] = field(default_factory=list)


class Planners:
    """A warm planner for the program that runs, and one for the program that takes over from it meanwhile."""

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
        seed: of table, faults and crashes.
        chance: of a fault per skill call.
        planners: of this process.
        folder: for the files.
    """

    def __init__(self, seed: int, chance: float, planners: Planners, folder: Path) -> None:
        self.outcome = Outcome(seed)
        self._seed = seed
        self._chance = chance
        self._planners = planners
        self._library: Library | None = None
        kinds = USUAL if seed % 2 else PLAIN
        self._faults = Faults(seed, chance / 4, kinds)
        self._crashes: Crashes[Report | None] = Crashes(folder, seed, chance=CRASHES)

    def run(self) -> Outcome:
        outcome = self.outcome
        try:
            with no_longer_than(A_HANG):
                report = self._crashes.survive(self._live)
                self._judge(report)
        except HangError as error:
            outcome.wrong.append(("hangs", str(error)))
        except Exception as error:  # noqa: BLE001  whatever it is, the seed is worth a look
            outcome.wrong.append(("no report", f"{type(error).__name__}: {error}"))
        outcome.wrong += [("executed twice", problem) for problem in self._crashes.problems]
        outcome.lives = self._crashes.life + 1
        outcome.faults += self._faults.counts()
        outcome.crashes += self._crashes.fired
        return outcome

    def _live(self, folder: Path) -> Report | None:
        """Begin the run, or go on with it; `None` if it is over and only its report has not been heard."""
        store, planner = folder / "run.kb", FaultyPlanner(self._planners.mine(), self._faults, self._crashes.reached)
        if not has_run(store):
            table = deploy(scenario(self._seed), self._seed, self._chance, planner, store=store)
        else:
            with kept_run(store) as run:  # as it was left by a program that has died
                self._must(run, "executed twice", executed_once(done(store)))
                if run.ended is not None:
                    return None
            table = resumed(store, planner)
        with table:
            self._library = table.executive.library
            for component in table.executive.components:
                self._crashes.inject(self._faults.inject(component))
            return table.run(prepare=lambda sequencer: self._prepare(table, sequencer))

    def _prepare(self, table: CleanUpTable, sequencer: Sequencer) -> None:
        steps = 0

        def count(_: Step) -> None:
            nonlocal steps
            steps += 1
            if steps > MOST_STEPS:
                raise HangError(f"more than {MOST_STEPS} macrosteps")

        sequencer.listen(count)
        self._faults.meddle(sequencer, lambda: moved(table.world, sequencer.knowledge))
        self._crashes.watch(sequencer)

    def _judge(self, report: Report | None) -> None:
        """What is in the files after the last life, against what has become of the world."""
        outcome, store = self.outcome, self._crashes.folder / "run.kb"
        world = LastingWorld.open(beside(store))
        world.close()
        outcome.faults += Counter(f"{one.kind}{' (permanent)' if one.permanent else ''}" for one in world.fired)
        with kept_run(store) as run:
            cleared = all(item.disposed for item in world.items if item.seen)
            self._must(run, "no report", comes_to_an_end(LONGEST))
            self._must(run, "executed twice", executed_once(world.done))
            self._must(run, "another history", one_history)
            if self._seed % REPLAYED_EVERY == 0:
                self._must(run, "another history", replays(self._library))
            self._must(run, "knowledge is not so", knows(truth(world, run.knowledge), PREDICATES))
            self._must(run, "false claim", claims_nothing_false(says_all_is_clear, reached=cleared))
            outcome.steps = len(run.steps)
            if run.ended is not None:
                left = "goal reached" if world.goal_reached else "something left"
                outcome.how = left if run.ended["problem"] is None else "ended early"
        if report is not None and report.goal_reached and not world.goal_reached:
            outcome.wrong.append(("false claim", "the report says that the goal is reached"))
        if self._faults.kinds == PLAIN and report is not None:
            outcome.wrong += [("false claim", wrong) for wrong in dishonest(world, report)]

    def _must(self, run: KeptRun, promise: str, invariant: Invariant) -> None:
        self.outcome.wrong += [(promise, wrong) for wrong in invariant(run)]


def scenario(seed: int) -> Scenario:
    """The table of a seed."""
    if seed % DEFAULT_EVERY == 0:
        return Scenario.default()
    cups, cans, crisp_cans = choose(seed, "table", "items", _TABLES)
    return Scenario(table=Table(cups=cups, cans=cans, crisp_cans=crisp_cans))


def dishonest(world: World, report: Report) -> Iterator[str]:
    """The report against the world, where nothing but what is permanent keeps the robot from anything."""
    left = {one.item for one in report.left}
    if report.problem is not None:
        yield f"the run ended early: {report.problem}"
    if left != world.touched():
        yield f"left are {sorted(left)}, and permanent faults have touched {sorted(world.touched())}"


def done(store: Path) -> list[str]:
    """What the robot has executed, by action id."""
    world = LastingWorld.open(beside(store))
    world.close()
    return list(world.done)


def moved(world: World, knowledge: KnowledgeBase) -> list[Delta]:
    """What somebody who saw it could say: where an item is now that somebody has moved."""
    names = {name for fault in world.fired if fault.kind == ITEM_MOVED for name in fault.items}
    items = [world.items[name] for name in sorted(names) if knowledge.type_of(name) is not None]
    return [_lies(item.name, item.where) for item in items if item.where in SURFACES]


def _lies(item: str, where: str) -> Delta:
    elsewhere = (fact("lies-at", item, other) for other in SURFACES if other != where)
    return Delta(removed=(fact("missing", item), *elsewhere), added=(fact("lies-at", item, where),))


def truth(world: World, knowledge: KnowledgeBase) -> Iterator[Fact]:
    """What the robot should know: how it is itself, and of each item that it knows where it is.

    Of what somebody moved, and of what the robot itself says that it does not find, it may believe what it likes.
    """
    believed = knowledge.snapshot()
    excused = {name for fault in world.fired if fault.kind == ITEM_MOVED for name in fault.items}
    excused |= {str(one.args[0]) for one in believed.facts if one.predicate == "missing"}
    yield fact("robot-at", world.robot_at)
    if world.items.held is None:
        yield fact("hand-free")
    for item in world.items:
        if knowledge.type_of(item.name) is None:
            continue
        if item.disposed:
            yield fact("disposed", item.name)
        if item.name in excused:
            yield from (one for one in believed.facts if one.predicate in _PLACES and one.args[0] == item.name)
        elif item.where == HAND:
            yield fact("holding", item.name)
        elif item.where in SURFACES:
            yield fact("lies-at", item.name, item.where)
        elif not item.disposed:
            yield fact("inside", item.name, item.where)


def says_all_is_clear(run: KeptRun) -> bool:
    """Whether the robot has told the operator so."""
    return any(one.data["chosen"] == "announce_success" for one in run.records if one.type == "decision")


@contextmanager
def no_longer_than(seconds: int) -> Iterator[None]:
    """Raises `HangError` inside when it takes longer, of real time; in a process's main thread."""

    def hang(*_: object) -> None:
        raise HangError(f"it still goes on after {seconds} s")

    before = signal.signal(signal.SIGALRM, hang)
    signal.setitimer(signal.ITIMER_REAL, seconds, seconds / 10)  # again, if somebody did not hear it
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)

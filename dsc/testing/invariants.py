"""Invariants of every kept run, checked in its store, also during the run."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from collections.abc import Set as AbstractSet
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dsc.dynamic.library import Library
from dsc.runs.archive import StepRow, archive
from dsc.sequencer.replay import replay
from dsc.trace import Record
from knowledge_base.errors import DamagedStoreError, InputError
from knowledge_base.facts import Fact
from knowledge_base.store import KnowledgeBase


@dataclass(frozen=True, slots=True)
class KeptRun:
    """The last run of a store.

    Attributes:
        path: the store.
        ended: `finished` and `problem` of the run's end; `None` before the end.
        steps: the run's macrosteps.
        knowledge: the present knowledge; read only.
    """

    path: Path
    ended: Mapping[str, Any] | None
    steps: tuple[StepRow, ...]
    knowledge: KnowledgeBase

    @property
    def records(self) -> Iterator[Record]:
        """The records of the run's trace, in order."""
        return (record for step in self.steps for record in step.records)

    @property
    def started(self) -> list[str]:
        """The ids of the started actions, in order, up to the last commit."""
        return [one.data["id"] for one in self.records if one.type == "action" and one.data["action"] == "start"]


Invariant = Callable[[KeptRun], Iterable[str]]
"""Function that yields a message for each violation."""


@contextmanager
def kept_run(store: Path) -> Iterator[KeptRun]:
    """Yield the last run of a store; raise `StoreError` if the store has no run."""
    with archive(store) as runs:
        run = runs.run()
        steps = tuple(runs.steps(run.number))
    with KnowledgeBase.open(None, store, read_only=True) as knowledge:
        yield KeptRun(store, run.ended, steps, knowledge)


def violations(store: Path, invariants: Iterable[Invariant]) -> list[str]:
    """Return all violations in the last run of a store, or the store's damage; raise `StoreError` without a run."""
    try:
        with kept_run(store) as run:
            return [wrong for invariant in invariants for wrong in invariant(run)]
    except DamagedStoreError as error:
        return [error.message]


def comes_to_an_end(seconds: float) -> Invariant:
    """Require that the run ends within `seconds` of run time."""

    def invariant(run: KeptRun) -> Iterable[str]:
        last = run.steps[-1].time
        if run.ended is None:
            yield f"the run has not come to its end at second {last:g}"
        if last > seconds:
            yield f"the run has lasted {last:g} s, more than {seconds:g} s"

    return invariant


def executed_once(executed: Iterable[str]) -> Invariant:
    """Require that each executed action was committed before its execution, and executed one time.

    Args:
        executed: the action id of each execution.

    Raises:
        InputError: `executed` is a mapping or a set, which cannot contain an id twice.
    """
    if isinstance(executed, Mapping | AbstractSet):
        raise InputError(f"executions form a sequence, with repeated ones; a {type(executed).__name__} has an id once")
    counts = Counter(executed)

    def invariant(run: KeptRun) -> Iterable[str]:
        started = Counter(run.started)
        for action_id, times in counts.items():
            if times > 1:
                yield f"the action {action_id} was executed {times} times"
            if action_id not in started:
                yield f"the action {action_id} was executed, and nothing is kept of its start"
        for action_id, times in started.items():
            if times > 1:
                yield f"the action id {action_id} was given out {times} times"

    return invariant


def knows(facts: Iterable[Fact], predicates: Iterable[str]) -> Invariant:
    """Require that the known facts of these predicates equal `facts`, which are true in the world."""
    true, compared = frozenset(facts), frozenset(predicates)

    def invariant(run: KeptRun) -> Iterable[str]:
        believed = {one for one in run.knowledge.snapshot().facts if one.predicate in compared}
        for wrong in sorted(map(str, believed - true)):
            yield f"it is known that {wrong}, which is not so"
        for missing in sorted(map(str, true - believed)):
            yield f"it is not known that {missing}, which is so"

    return invariant


def claims_nothing_false(claims: Callable[[KeptRun], bool], *, reached: bool) -> Invariant:
    """Require that the run claims its goal only if the world has reached the goal."""

    def invariant(run: KeptRun) -> Iterable[str]:
        if claims(run) and not reached:
            yield "the goal is claimed, and not reached"

    return invariant


def one_history(run: KeptRun) -> Iterable[str]:
    """Require that the run's macrosteps are consecutive: no other program has added any."""
    numbers = [step.number for step in run.steps]
    if numbers != list(range(1, len(numbers) + 1)):
        yield f"its macrosteps are numbered {numbers}"


def replays(library: Library | None = None) -> Invariant:
    """Require that a replay of the messages has equal results.

    Args:
        library: the plots at the start of the run; by default those of the store.
    """

    def invariant(run: KeptRun) -> Iterable[str]:
        divergence = replay(run.path, library=library).divergence
        if divergence is not None:
            yield f"its replay: {divergence}"

    return invariant

"""Learning of experience from the trace records of runs (S0.14)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from dsc.dynamic.experience import Experience, Key, Situation, Tries, situation_of
from dsc.events import DONE
from dsc.runs.archive import archive
from dsc.trace import Record


def learn(stores: Iterable[Path | str]) -> Experience:
    """Return the experience of all runs in stores, which are only read.

    Raises:
        StoreError: a file is not a store, or cannot be read.
    """
    experience = Experience()
    for store in stores:
        with archive(Path(store)) as runs:
            for run in runs.runs():
                experience = experience.plus(tries_in(runs.records(run.number)))
    return experience


class _Try(NamedTuple):
    """A candidate that a dynamic state has chosen at second `at`."""

    plot: str
    candidate: str
    situation: Situation
    at: float


def tries_in(records: Iterable[Record]) -> Iterator[tuple[Key, Tries]]:
    """Yield each try in the records of a run; a try that a surrounding state has ended does not count."""
    open_tries: dict[str, _Try] = {}
    for record in records:
        if record.type == "decision":
            data = record.data
            if data.get("chosen") is not None and "situation" in data:
                situation = situation_of(data["situation"])
                open_tries[data["state"]] = _Try(data["plot"], data["chosen"], situation, record.t)
        elif record.type == "step":
            for microstep in record.data["microsteps"]:
                triggers = {one["from"]: one["on"] for one in microstep["taken"]}
                for path in microstep["exited"]:
                    tried = open_tries.pop(path, None)
                    if tried is not None and path in triggers:
                        done = int(triggers[path] == DONE)
                        yield (tried.plot, tried.candidate, tried.situation), Tries(1, done, record.t - tried.at)

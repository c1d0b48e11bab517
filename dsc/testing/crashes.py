"""Runs with a store that are killed where it makes a difference, and gone on with until they end.

What `kill -9` leaves are the files as they are at that moment. So they are copied at the boundary, the program that
wrote them is abandoned, and a new one goes on with the copy.
"""

from __future__ import annotations

import asyncio
import shutil
import threading
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Generic, TypeVar

from dsc.calls import Outcome, SkillCall
from dsc.chance import choose, uniform
from dsc.components.component import Component
from dsc.runs.archive import archive
from dsc.runs.writer import Boundary
from dsc.sequencer.sequencer import Sequencer
from knowledge_base.errors import StoreError

KILLED = "killed"
DISK_FULL = "disk full"
OVERTAKEN = "overtaken"
_AFTER_COMMIT = (KILLED, KILLED, DISK_FULL, OVERTAKEN, OVERTAKEN)
"""What may happen between commit and dispatch, as often as that."""
_REACHED = (KILLED, OVERTAKEN)
"""What may happen where nothing is being committed."""
_Result = TypeVar("_Result")
_Component = TypeVar("_Component", bound=Component)


class Killed(SystemExit):
    """The program has died here."""


class Crashes(Generic[_Result]):
    """Lives a run, life after life, until it has ended.

    Boundaries are: before and after each commit (after it nothing has left yet), when a component has acted and its
    answer is not kept, and whatever else says that it is `reached`. After a commit the disk may be full from then on,
    which SQLite itself says. Anywhere but before a commit, another program may take the run over, where locks do not
    work, and live it to its end, while this one then goes on as if nothing had been.

    Args:
        folder: each life has a folder of its own inside.
        seed: of all draws.
        chance: of a crash at each boundary, in [0, 1].
        most: crashes of a run, so that it comes to an end.

    Attributes:
        fired: how often what happened where, as `killed after commit`.
        problems: what an old program did that had been overtaken.
        life: the number of the life that is being lived, from 0.
    """

    def __init__(self, folder: Path, seed: int, chance: float = 0.02, most: int = 3) -> None:
        self.fired: Counter[str] = Counter()
        self.problems: list[str] = []
        self.life = 0
        self._root = folder
        self._seed = seed
        self._chance = chance
        self._most = most
        self._passed = 0
        self._calm = False
        self._disk_full = False
        self._live: Callable[[Path], _Result] | None = None
        self._heir: _Heir[_Result] | None = None
        self._store: Path | None = None

    @property
    def folder(self) -> Path:
        """Where the present life finds what the one before has left, and keeps all that shall outlive it."""
        return self._root / f"life{self.life}"

    def survive(self, live: Callable[[Path], _Result]) -> _Result:
        """What comes of it in the end.

        Args:
            live: begins the run in that folder or, if one is there, goes on with it, and runs it to its end. What
                outlives the program, e.g. a simulated world, has to be in files there.

        Raises:
            StoreError: not because of a crash of ours.
        """
        self._live = live
        self.folder.mkdir()
        while True:
            self._passed = 0
            self._calm = self._disk_full = False
            try:
                result = live(self.folder)
            except Killed:
                self.life += 1
            except StoreError:
                if self._heir is not None:
                    return self._heir.result(self.problems)
                if not self._disk_full:
                    raise
                self._leave_behind()
                self.life += 1
            else:
                return result if self._heir is None else self._heir.result(self.problems)

    def watch(self, sequencer: Sequencer) -> None:
        """Let crashes happen around the commits of this run; to be called before it starts or is resumed."""
        store = sequencer.store
        assert store is not None  # noqa: S101  without one there is nothing to be resumed
        self._store = store.path

        def boundary(what: Boundary) -> None:
            happens = self._drawn(what, (KILLED,) if what == "before commit" else _AFTER_COMMIT)
            if happens == KILLED:
                self._leave_behind()
                raise Killed
            if happens == DISK_FULL:
                self._disk_full = self._calm = True
                with sequencer.knowledge.together() as connection:
                    connection.execute("PRAGMA max_page_count = 1")  # not less than it has now
            if happens == OVERTAKEN:
                self._overtake()

        store.writing.listen(boundary)

    def inject(self, component: _Component) -> _Component:
        """Let crashes happen when this component has done something, before its answer is kept; returns it."""
        execute = component.execute

        async def carried_out(skill_name: str, call: SkillCall, arguments: Mapping[str, Any]) -> Outcome:
            outcome = await execute(skill_name, call, arguments)
            await self.reached("after an action")
            return outcome

        component.execute = carried_out  # type: ignore[method-assign]
        return component

    async def reached(self, boundary: str) -> None:
        """The program may die here, or be overtaken."""
        happens = self._drawn(boundary, _REACHED)
        if happens == OVERTAKEN:
            self._overtake()
        if happens == KILLED:
            self._leave_behind()
            loop = asyncio.get_running_loop()
            loop.call_soon(_die)  # not from here: that of a task would be heard of only later
            await loop.create_future()

    def _drawn(self, boundary: str, possible: tuple[str, ...]) -> str | None:
        self._passed += 1
        where = f"{self.life} {self._passed}"
        if self._calm or self.life >= self._most or uniform(self._seed, where, "crash") >= self._chance:
            return None
        what = choose(self._seed, where, "how", possible)
        self.fired[f"{what} {boundary}"] += 1
        return what

    def _overtake(self) -> None:
        assert self._store is not None  # noqa: S101  somebody watches
        self._calm = True
        self._heir = _Heir(self._store, self._live, self.folder)

    def _leave_behind(self) -> None:
        """What the next life finds; nothing happens any more to the program that dies."""
        self._calm = True
        _copy(self.folder, self._root / f"life{self.life + 1}")


class _Heir(Generic[_Result]):
    """Another program that has gone on with a run to its end, while the first still believes that it is its own."""

    def __init__(self, store: Path, live: Callable[[Path], _Result] | None, folder: Path) -> None:
        assert live is not None  # noqa: S101  somebody is living
        self._store = store
        self._results: list[_Result] = []
        for lock in folder.glob("*-lock"):
            lock.unlink()  # as on a file system that knows no locks
        thread = threading.Thread(target=lambda: self._results.append(live(folder)), daemon=True)
        thread.start()
        thread.join()
        self._left = _told(store)

    def result(self, problems: list[str]) -> _Result:
        """What came of it; it is a problem if anything was written since."""
        if _told(self._store) != self._left:
            problems.append("an old sequencer went on writing a run that another had taken over")
        if not self._results:
            raise StoreError("the run that was taken over has not come to its end")
        return self._results[0]


def _told(store: Path) -> list[tuple[int, int]]:
    with archive(store) as runs:
        return [(run.number, sum(1 for _ in runs.steps(run.number))) for run in runs.runs()]


def _copy(folder: Path, to: Path) -> None:
    to.mkdir()
    for file in folder.iterdir():
        if not file.name.endswith(("-lock", "-shm")):
            shutil.copy(file, to)


def _die() -> None:
    raise Killed

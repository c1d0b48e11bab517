"""Crashes of runs with a store at critical points, and their recovery until the run ends.

`kill -9` leaves the files in their present state. A simulated crash therefore copies the files and abandons the old
program; a new program resumes the run from the copy.
"""

from __future__ import annotations

import asyncio
import shutil
import threading
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Generic, TypeVar

from dsc.calls import SkillCall
from dsc.chance import choose, uniform
from dsc.components.component import Component
from dsc.outcomes import Outcome
from dsc.runs.archive import archive
from dsc.runs.store import Boundary
from dsc.sequencer.sequencer import Sequencer
from knowledge_base.errors import StoreError

KILLED = "killed"
DISK_FULL = "disk full"
OVERTAKEN = "overtaken"
_AFTER_COMMIT = (KILLED, KILLED, DISK_FULL, OVERTAKEN, OVERTAKEN)
"""Faults between commit and dispatch; repeated entries are more probable."""
_REACHED = (KILLED, OVERTAKEN)
"""Faults outside a commit."""
_Result = TypeVar("_Result")
_Component = TypeVar("_Component", bound=Component)


class Killed(SystemExit):
    """The simulated end of the program."""


class Crashes(Generic[_Result]):
    """Executor of a program with crashes, which restarts the program until its run has ended.

    A crash may happen at these boundaries:

    - before each commit, and after it, when nothing is dispatched yet;
    - after a component's action, when its answer is not committed yet;
    - at every call of `reached`.

    After a commit, the disk may become full; SQLite then reports an error when the file grows. At each boundary other
    than a commit's beginning, another program may take over the run, as on a file system without locks. That program
    runs to the end, while the old program continues to write.

    Args:
        folder: parent of the folders of all program executions.
        seed: the seed of all draws.
        chance: probability of a crash at each boundary, in [0, 1].
        most: maximum number of crashes of a run, so that the run ends.

    Attributes:
        fired: number of each fault at each boundary, with keys such as `killed after commit`.
        problems: descriptions of writes by an old program after the takeover.
        life: the number of the present program execution, from 0.
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
        """Folder of the present program execution, with the files of the execution before."""
        return self._root / f"life{self.life}"

    def survive(self, live: Callable[[Path], _Result]) -> _Result:
        """Execute `live` repeatedly until the run ends, and return the final result.

        Args:
            live: starts or resumes the run in the folder that it receives, and executes the run to its end. Data that
                outlast the program, e.g. a simulated world, must be in files of that folder.

        Raises:
            StoreError: a store failed without a simulated crash.
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
        """Enable crashes around the commits of this run; call this method before the run starts or is resumed."""
        store = sequencer.store
        assert store is not None  # noqa: S101  a run without a store cannot be resumed
        self._store = store.path

        def boundary(what: Boundary) -> None:
            happens = self._draw(what, (KILLED,) if what == "before commit" else _AFTER_COMMIT)
            if happens == KILLED:
                self._leave_behind()
                raise Killed
            if happens == DISK_FULL:
                self._disk_full = self._calm = True
                with sequencer.knowledge.together() as connection:
                    connection.execute("PRAGMA max_page_count = 1")  # SQLite keeps at least the present size
            if happens == OVERTAKEN:
                self._overtake()

        store.writing.listen(boundary)

    def inject(self, component: _Component) -> _Component:
        """Enable crashes after this component's actions, before their answers are committed; return the component."""
        execute = component.execute

        async def executed(skill_name: str, call: SkillCall[Any], arguments: Mapping[str, Any]) -> Outcome:
            outcome = await execute(skill_name, call, arguments)
            await self.reached("after an action")
            return outcome

        component.execute = executed  # type: ignore[method-assign]
        return component

    async def reached(self, boundary: str) -> None:
        """Kill the program at this boundary, or let another program take over, if the draw decides so."""
        happens = self._draw(boundary, _REACHED)
        if happens == OVERTAKEN:
            self._overtake()
        if happens == KILLED:
            self._leave_behind()
            loop = asyncio.get_running_loop()
            loop.call_soon(_die)  # an exception in a task would surface only later
            await loop.create_future()

    def _draw(self, boundary: str, possible: tuple[str, ...]) -> str | None:
        self._passed += 1
        where = f"{self.life} {self._passed}"
        if self._calm or self.life >= self._most or uniform(self._seed, where, "crash") >= self._chance:
            return None
        what = choose(self._seed, where, "how", possible)
        self.fired[f"{what} {boundary}"] += 1
        return what

    def _overtake(self) -> None:
        assert self._store is not None  # noqa: S101  `watch` has set it
        self._calm = True
        self._heir = _Heir(self._store, self._live, self.folder)

    def _leave_behind(self) -> None:
        """Copy the files for the next program execution; the present execution has no further crashes."""
        self._calm = True
        _copy(self.folder, self._root / f"life{self.life + 1}")


class _Heir(Generic[_Result]):
    """A second program that has executed a run to its end, while the first program still writes as its owner."""

    def __init__(self, store: Path, live: Callable[[Path], _Result] | None, folder: Path) -> None:
        assert live is not None  # noqa: S101  `survive` has set it
        self._store = store
        self._results: list[_Result] = []
        for lock in folder.glob("*-lock"):
            lock.unlink()  # as on a file system without locks
        thread = threading.Thread(target=lambda: self._results.append(live(folder)), daemon=True)
        thread.start()
        thread.join()
        self._left = _count_steps(store)

    def result(self, problems: list[str]) -> _Result:
        """Return the second program's result; add a problem if the first program has written since."""
        if _count_steps(self._store) != self._left:
            problems.append("an old sequencer has written to a run that another had taken over")
        if not self._results:
            raise StoreError("the run that was taken over has not come to its end")
        return self._results[0]


def _count_steps(store: Path) -> list[tuple[int, int]]:
    with archive(store) as runs:
        return [(run.number, sum(1 for _ in runs.steps(run.number))) for run in runs.runs()]


def _copy(folder: Path, to: Path) -> None:
    to.mkdir()
    for file in folder.iterdir():
        if not file.name.endswith(("-lock", "-shm")):
            shutil.copy(file, to)


def _die() -> None:
    raise Killed

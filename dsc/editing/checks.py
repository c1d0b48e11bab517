"""Checks while a person writes: of the text soon, of its project later, and only of the latest texts."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from dsc.editing.diagnostics import Diagnostic, FileFinding, by_file, diagnostics, on_same_lines
from dsc.editing.project_facts import ProjectFacts
from dsc.editing.projects import Examined, Project
from dsc.editing.quick_check import QuickCheck
from knowledge_base.errors import InputError
from knowledge_base.pddl.unsaved_texts import readable_text, unsaved_texts

TEXT_S, PROJECT_S = 0.08, 0.4
"""Times in seconds without a change, after which a text and its project are checked."""
Publish = Callable[[Path, int | None, list[Diagnostic]], None]
"""Receives file, version of the text (`None` if it is not open) and diagnostics; an empty list clears them."""
Examine = Callable[[Project, Mapping[Path, str]], Awaitable[Examined]]


@dataclass(frozen=True, slots=True)
class Buffer:
    """The text of an open file in the editor, and its version."""

    text: str
    version: int


@dataclass(slots=True)
class _Desk:
    """The state of one project: the facts of its latest robot, and its findings.

    Attributes:
        facts: the facts of the latest robot that could be made.
        marked: the files with diagnostics.
        extra: by file, a text and those of its findings that only the examination makes.
    """

    facts: ProjectFacts = field(default_factory=ProjectFacts)
    marked: set[str] = field(default_factory=set)
    extra: dict[Path, tuple[str, list[FileFinding]]] = field(default_factory=dict)


class Checks:
    """The checks of an editor's open texts and of their projects.

    Args:
        find: returns the project around a file.
        examine: examines a project.
        publish: receives the diagnostics.
        report: receives a line about an examination that failed.
        pause: waits for a number of seconds.
    """

    def __init__(
        self,
        find: Callable[[Path], Project | None],
        examine: Examine,
        publish: Publish,
        report: Callable[[str], None],
        pause: Callable[[float], Awaitable[None]] = asyncio.sleep,
    ) -> None:
        self._find = find
        self._examine = examine
        self._publish = publish
        self._report = report
        self._pause = pause
        self._text_check = QuickCheck()
        self._buffers: dict[Path, Buffer] = {}
        self._projects: dict[Path, Project | None] = {}
        self._desks: dict[Project | None, _Desk] = {}
        self._tasks: dict[Path | Project, asyncio.Task[None]] = {}

    def change(self, file: Path, text: str, version: int) -> None:
        """Check a text that was opened or changed, and later its project."""
        self._buffers[file] = Buffer(text, version)
        self._schedule(file, self._check_text(file))
        self.examine(file)

    def close(self, file: Path) -> None:
        """Check the file on disk again in place of the closed text."""
        self._buffers.pop(file, None)
        self._stop(file)
        if self.project(file) is None:
            self._publish(file, None, [])
        self.examine(file)

    def examine(self, file: Path) -> None:
        """Examine the project around a file, e.g. after the file was saved."""
        project = self.project(file)
        if project is not None:
            self._schedule(project, self._check_project(project))

    def project(self, file: Path) -> Project | None:
        """Return the project around a file."""
        if file not in self._projects:
            self._projects[file] = self._find(file)
        return self._projects[file]

    def facts(self, file: Path) -> ProjectFacts:
        """Return the latest facts of the project around a file."""
        return self._desk(self.project(file)).facts

    @property
    def texts(self) -> dict[Path, str]:
        """The texts of the open files."""
        return {file: buffer.text for file, buffer in self._buffers.items()}

    async def settle(self) -> None:
        """Wait until no check is pending."""
        while tasks := [one for one in self._tasks.values() if not one.done()]:
            await asyncio.wait(tasks)

    async def stop(self) -> None:
        """Cancel all checks."""
        for key in [*self._tasks]:
            self._stop(key)
        await self.settle()

    def _desk(self, project: Project | None) -> _Desk:
        return self._desks.setdefault(project, _Desk())

    def _schedule(self, key: Path | Project, work: Awaitable[None]) -> None:
        self._stop(key)
        self._tasks[key] = asyncio.ensure_future(work)

    def _stop(self, key: Path | Project) -> None:
        if key in self._tasks:
            self._tasks[key].cancel()

    async def _check_text(self, file: Path) -> None:
        await self._pause(TEXT_S)
        buffer, desk = self._buffers[file], self._desk(self.project(file))
        found = await self._quick(file, buffer.text, desk.facts)
        if self._buffers.get(file) is buffer:
            before, extra = desk.extra.get(file, ("", []))
            found += on_same_lines(extra, before, buffer.text)
            desk.marked.add(str(file))
            self._publish(file, buffer.version, diagnostics(found, buffer.text))

    async def _quick(self, file: Path, text: str, facts: ProjectFacts) -> list[FileFinding]:
        texts = {**self.texts, file: text}

        def check() -> list[FileFinding]:
            with unsaved_texts(texts):
                return [FileFinding.of(one, file) for one in self._text_check.findings(file, text, facts)]

        return await asyncio.to_thread(check)

    async def _check_project(self, project: Project) -> None:
        await self._pause(PROJECT_S)
        buffers = dict(self._buffers)
        try:
            examined = await self._examine(project, {file: one.text for file, one in buffers.items()})
        except InputError as error:
            self._report(str(error))
            return
        desk = self._desk(project)
        desk.facts = examined.facts if examined.facts.schema is not None else desk.facts
        found = by_file(examined.findings, project.home)
        for source in sorted(found.keys() | desk.marked):
            file = Path(source)
            buffer = buffers.get(file)
            if self._buffers.get(file) is buffer:
                self._stop(file)  # a check of the text without the new facts
                await self._publish_examined(file, buffer, found.get(source, []), desk)
        desk.marked = {*found}

    async def _publish_examined(
        self, file: Path, buffer: Buffer | None, found: Iterable[FileFinding], desk: _Desk
    ) -> None:
        """Publish the findings about a file, and store those that the check of its text does not make."""
        found = list(found)
        text = buffer.text if buffer is not None else readable_text(file)
        if buffer is not None:
            quick = {(one.line, one.code, one.text) for one in await self._quick(file, text, desk.facts)}
            desk.extra[file] = text, [one for one in found if (one.line, one.code, one.text) not in quick]
        if self._buffers.get(file) is buffer:
            self._publish(file, None if buffer is None else buffer.version, diagnostics(found, text))

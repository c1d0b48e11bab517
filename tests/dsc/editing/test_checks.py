"""The order of checks: only results about the latest texts are published."""

from __future__ import annotations

import asyncio
from pathlib import Path

from dsc.editing.checks import PROJECT_S, TEXT_S, Checks
from dsc.editing.diagnostics import FileFinding
from dsc.editing.project_facts import ProjectFacts
from dsc.editing.projects import Examined, Project
from knowledge_base.errors import InputError
from knowledge_base.world.schema import Schema

GOOD = "plot: go\nstates:\n  a: {on: {done: b}}\n  b: {final: true}\n"
BAD = GOOD.replace("done: b", "done: bb")


class Desk:
    """A desk with fake time and a fake examiner, whose results a test chooses."""

    def __init__(self, root: Path, project: bool = True) -> None:
        self.root, self.file = root, root / "go.yaml"
        self.other = root / "other.yaml"
        for one in (self.file, self.other, root / "robot.py"):
            one.write_text(GOOD)
        home = Project(root, root / "robot.py", str(root)) if project else None
        self.told: list[tuple[str, int | None, list[str]]] = []
        self.reports: list[str] = []
        self.asked: list[dict[Path, str]] = []
        self.result = Examined()
        self.error: InputError | None = None
        self.gate: asyncio.Event | None = None
        self.news = asyncio.Event()
        self.pauses: list[float] = []
        self.checks = Checks(lambda _: home, self.examine, self.publish, self.reports.append, self.pause)

    async def until(self, holds):
        async with asyncio.timeout(30):
            while not holds():
                self.news.clear()
                await self.news.wait()

    async def pause(self, seconds: float) -> None:
        self.pauses.append(seconds)
        await asyncio.sleep(0)

    async def examine(self, project, texts):
        self.asked.append(dict(texts))
        self.news.set()
        if self.gate is not None:
            await self.gate.wait()
        if self.error is not None:
            raise self.error
        return self.result

    def publish(self, file, version, found):
        self.told.append((file.name, version, [one.text for one in found]))
        self.news.set()

    def finding(self, file: Path, line: int, text: str) -> FileFinding:
        return FileFinding(str(file), line, 1, text, "goal", "warning")


def run(work):
    asyncio.run(work)


def test_a_changed_text_is_checked_soon_and_its_project_later(tmp_path):
    async def work():
        desk = Desk(tmp_path)
        desk.checks.change(desk.file, BAD, 1)
        await desk.checks.settle()
        assert desk.pauses == [TEXT_S, PROJECT_S]
        assert desk.asked == [{desk.file: BAD}]
        name, version, (said,) = desk.told[0]
        assert (name, version, "'bb'" in said) == ("go.yaml", 1, True)

    run(work())


def test_a_text_that_changes_before_its_check_is_checked_only_in_its_last_version(tmp_path):
    async def work():
        desk = Desk(tmp_path, project=False)
        for version in range(1, 5):
            desk.checks.change(desk.file, BAD if version < 4 else GOOD, version)
        await desk.checks.settle()
        assert desk.told == [("go.yaml", 4, [])]

    run(work())


def test_an_examination_of_older_texts_is_dropped(tmp_path):
    async def work():
        desk = Desk(tmp_path)
        desk.gate = asyncio.Event()
        desk.result = Examined((desk.finding(desk.file, 1, "stale"),))
        desk.checks.change(desk.file, GOOD, 1)
        await desk.until(lambda: desk.asked)
        desk.checks.change(desk.file, GOOD + "# new\n", 2)
        desk.result = Examined((desk.finding(desk.file, 1, "fresh"),))
        desk.gate.set()
        await desk.checks.settle()
        assert ("go.yaml", 2, ["fresh"]) in desk.told
        assert not any("stale" in said for _, _, said in desk.told)

    run(work())


def test_findings_of_all_files_are_published_and_later_cleared(tmp_path):
    async def work():
        desk = Desk(tmp_path)
        folder = FileFinding(str(tmp_path), None, None, "no bundle", "readable", "error")
        desk.result = Examined((desk.finding(desk.other, 1, "unused"), folder))
        desk.checks.change(desk.file, GOOD, 1)
        await desk.checks.settle()
        assert ("other.yaml", None, ["unused"]) in desk.told
        assert ("robot.py", None, ["no bundle"]) in desk.told
        desk.result = Examined()
        desk.checks.examine(desk.file)
        await desk.checks.settle()
        assert desk.told[-2:] == [("other.yaml", None, []), ("robot.py", None, [])]

    run(work())


def test_findings_that_only_the_project_has_stay_while_their_line_is_unchanged(tmp_path):
    async def work():
        desk = Desk(tmp_path)
        desk.result = Examined((desk.finding(desk.file, 1, "unused plot"), desk.finding(desk.file, 3, "turns")))
        desk.checks.change(desk.file, GOOD, 1)
        await desk.checks.settle()
        desk.gate = asyncio.Event()  # the next examination does not end
        desk.told.clear()
        desk.checks.change(desk.file, GOOD.replace("done: b", "done:  b"), 2)
        await desk.until(lambda: desk.told)
        assert desk.told == [("go.yaml", 2, ["unused plot"])]
        await desk.checks.stop()

    run(work())


def test_a_failed_examination_is_reported_and_hides_nothing(tmp_path):
    async def work():
        desk = Desk(tmp_path)
        desk.error = InputError("the check of the project failed: killed")
        desk.checks.change(desk.file, BAD, 1)
        await desk.checks.settle()
        assert desk.reports == ["the check of the project failed: killed"]
        assert len(desk.told) == 1
        assert "'bb'" in desk.told[0][2][0]

    run(work())


def test_facts_stay_while_the_robot_cannot_be_made(tmp_path):
    async def work():
        desk = Desk(tmp_path)
        schema = Schema.parse("(define (domain d))")
        desk.result = Examined((), ProjectFacts(plots={"go": ""}, schema=schema))
        desk.checks.change(desk.file, GOOD, 1)
        await desk.checks.settle()
        desk.result = Examined()
        desk.checks.examine(desk.file)
        await desk.checks.settle()
        assert desk.checks.facts(desk.file).plots == {"go": ""}

    run(work())


def test_a_closed_text_without_a_project_has_no_diagnostics(tmp_path):
    async def work():
        desk = Desk(tmp_path, project=False)
        desk.checks.change(desk.file, BAD, 1)
        await desk.checks.settle()
        desk.checks.close(desk.file)
        await desk.checks.settle()
        assert desk.told[-1] == ("go.yaml", None, [])
        assert desk.checks.texts == {}

    run(work())

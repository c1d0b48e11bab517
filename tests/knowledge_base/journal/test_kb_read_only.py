"""Stores on a medium that nobody can write, and of somebody else: read with every commit, and nothing is left there."""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hostile_files import picture
from typer.testing import CliRunner

from dsc import Event, Library, Sequencer, parse_plot
from dsc.cli.runs import app as runs
from dsc.runs.store import RunStore
from dsc.sequencer.clock import LoopClock
from dsc.viewer.record_sources import records_of
from knowledge_base import Delta, KnowledgeBase, Schema, StoreError, fact
from knowledge_base.cli import app as kb
from knowledge_base.journal import file as store_file
from knowledge_base.journal.archive import Archive
from knowledge_base.journal.file import connect

SCHEMA = Schema.parse("(define (domain d) (:types cup) (:predicates (clean ?c - cup)) (:constants c1 - cup))")
LAMP = parse_plot("""
plot: lamp
receives: {press: null}
states:
  dark: {on: {press: bright}}
  bright: {on: {press: end}}
  end: {final: true}
""")
NOBODY = 65534
FILES = {
    "closed": ["s.kb"],
    "killed": ["s.kb", "s.kb-wal", "s.kb-shm", "s.kb-lock"],
    "killed and copied": ["s.kb", "s.kb-wal"],
    "closed, with an empty log": ["s.kb", "s.kb-wal"],
}
COMMANDS = (
    (kb, "show", "--json"),
    (kb, "query", "(clean ?c)", "--json"),
    (kb, "history", "--json"),
    (kb, "at", "1", "--json"),
    (runs, "list", "--json"),
    (runs, "show", "--json"),
    (runs, "replay", "--json"),
)


async def _lamp(world: KnowledgeBase, path: Path) -> None:
    run = Sequencer(Library([LAMP]), world, [], LoopClock(), store=RunStore(world, path), open_ended=True)
    run.post(Event("press"))
    run.post(Event("press"))
    await run.run("lamp")


def _write(path: Path, *, dies: bool) -> None:
    """A change, a run, and another change; by a process of its own."""
    child = os.fork()
    if child == 0:
        world = KnowledgeBase.open(SCHEMA, path)
        world.apply(Delta(added=(fact("clean", "c1"),)), "me")
        asyncio.run(_lamp(world, path))
        world.apply(Delta(nodes={"c2": "cup"}, added=(fact("clean", "c2"),)), "me")
        if not dies:
            world.close()
        os._exit(0)
    assert os.waitpid(child, 0)[1] == 0


@pytest.fixture(scope="module")
def kept(tmp_path_factory) -> dict[bool, Path]:
    """A store whose writer closed it, and one whose writer died."""
    found = {dies: tmp_path_factory.mktemp("kept") / "s.kb" for dies in (False, True)}
    for dies, path in found.items():
        _write(path, dies=dies)
    return found


@pytest.fixture
def folder() -> Iterator[Path]:
    """One that everybody may look into, unlike pytest's."""
    with tempfile.TemporaryDirectory() as name:
        Path(name).chmod(0o755)
        yield Path(name)


@pytest.fixture(scope="module")
def expected(kept, tmp_path_factory) -> dict[bool, list[object]]:
    """The answers in a folder that can be written, as ever."""
    found = {}
    for dies, path in kept.items():
        usual = tmp_path_factory.mktemp("usual")
        shutil.copytree(path.parent, usual, dirs_exist_ok=True)
        found[dies] = answers(usual / "s.kb")
    return found


def medium_with(state: str, kept: dict[bool, Path], folder: Path) -> Path:
    """The store as it is on the medium."""
    there = folder / "there"
    there.mkdir()
    for name in FILES[state]:
        (there / name).touch()
        if (found := kept["killed" in state].with_name(name)).exists():
            shutil.copy(found, there)
    return there / "s.kb"


def answers(path: Path) -> list[object]:
    """Those of each command that looks, of the viewer, and from Python."""
    found: list[object] = []
    for app, command, *rest in COMMANDS:
        result = CliRunner().invoke(app, [command, str(path), *rest])
        assert result.exit_code == 0, result
        found.append(json.loads(result.output))
    with records_of(path) as log:
        found.append([log.line(number) for number in range(1, len(log) + 1)])
    with KnowledgeBase.open(SCHEMA, path, read_only=True) as world:
        found.append([world.version, world.refresh(), sorted(map(str, world.facts()))])
    return found


@pytest.mark.parametrize("state", FILES)
def test_a_medium_that_cannot_be_written(state, kept, expected, folder) -> None:
    left = medium_with(state, kept, folder)
    medium = left.parent.with_name("medium")
    medium.mkdir()
    if subprocess.run(["mount", "--bind", left.parent, medium], check=False, capture_output=True).returncode:  # noqa: S607
        pytest.skip("this machine lets nobody mount a folder")
    try:
        subprocess.run(["mount", "-o", "remount,ro,bind", medium], check=True)  # noqa: S607
        with pytest.raises(OSError, match="Read-only"):
            (medium / "x").touch()
        before = picture(medium)
        found = answers(medium / "s.kb")
        assert picture(medium) == before
        with pytest.raises(StoreError, match=r"cannot (write|open) .*s.kb-lock"):
            KnowledgeBase.open(None, medium / "s.kb")
    finally:
        store_file._forget()
        subprocess.run(["umount", medium], check=True)  # noqa: S607
    assert found == expected["killed" in state]


def as_nobody(answer: Callable[[], object]) -> object:
    """The answer of a process that has no right to anything."""
    if os.geteuid():
        pytest.skip("only root can become somebody else")
    ear, mouth = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.setgroups([])
            os.setgid(NOBODY)
            os.setuid(NOBODY)
            said = json.dumps(answer())
        except BaseException as error:  # noqa: BLE001  it is told to the other process
            said = json.dumps(repr(error))
        os.write(mouth, said.encode())
        store_file._forget()
        os._exit(0)
    os.close(mouth)
    with os.fdopen(ear) as heard:
        said = heard.read()
    os.waitpid(child, 0)
    return json.loads(said)


@pytest.mark.parametrize(
    ("state", "mode"), [("closed", 0o755), *((state, 0o1777) for state in FILES), ("killed and copied", 0o755)]
)
def test_a_store_of_somebody_else(state, mode, kept, expected, folder) -> None:
    """In his own folder, or in one like /tmp: a file left there would keep its owner from writing."""
    left = medium_with(state, kept, folder)
    left.parent.chmod(mode)
    before = picture(left.parent)
    found = as_nobody(lambda: answers(left))
    assert picture(left.parent) == before
    assert found == expected["killed" in state]


@pytest.mark.parametrize("state", ["closed", "killed and copied"])
def test_a_file_that_its_owner_made_read_only(state, kept, expected, folder) -> None:
    left = medium_with(state, kept, folder)
    left.parent.chmod(0o777)
    for file in left.parent.iterdir():
        os.chown(file, NOBODY, NOBODY)
        file.chmod(0o444)
    before = picture(left.parent)
    found = as_nobody(lambda: answers(left))
    assert picture(left.parent) == before
    assert found == expected["killed" in state]


def test_a_store_that_another_user_is_writing(folder) -> None:
    with KnowledgeBase.open(SCHEMA, folder / "s.kb") as world:
        for number in range(3):
            world.apply(Delta(nodes={f"c{number}x": "cup"}), "me")
            assert as_nobody(lambda: _version(folder / "s.kb")) == number + 1
    assert as_nobody(lambda: _version(folder / "s.kb")) == 3


def _version(path: Path) -> int:
    with KnowledgeBase.open(None, path, read_only=True) as world:
        return world.version


def test_a_store_that_is_written_while_it_is_read_without_locks_is_not_believed(kept, tmp_path, monkeypatch) -> None:
    shutil.copy(kept[False], tmp_path)
    monkeypatch.setattr("knowledge_base.journal.file.is_still", lambda path: True)
    with KnowledgeBase.open(None, tmp_path / "s.kb", read_only=True) as world:
        assert isinstance(world._history, Archive)
        newest = world._history._last

        def late(connection):
            with KnowledgeBase.open(None, tmp_path / "s.kb") as other:
                other.apply(Delta(nodes={"c3": "cup"}), "other")
            return newest(connection)

        monkeypatch.setattr(world._history, "_last", late)
        with pytest.raises(StoreError, match="was written while it was read"):
            world.refresh()
        monkeypatch.undo()
        assert world.refresh() == 3


def test_a_copy_is_made_once_and_again_when_the_store_was_written(kept, tmp_path, monkeypatch) -> None:
    for ending in ("", "-wal"):
        shutil.copy(kept[True].with_name(f"s.kb{ending}"), tmp_path)
    monkeypatch.setattr("knowledge_base.journal.file.is_still", lambda path: True)
    copied = []
    copyfile = shutil.copyfile

    def copying(*which):
        copied.append(which)
        return copyfile(*which)

    monkeypatch.setattr(shutil, "copyfile", copying)
    with KnowledgeBase.open(None, tmp_path / "s.kb", read_only=True) as world:
        assert (world.version, world.oldest, len(copied)) == (2, 0, 2)
        with connect(tmp_path / "s.kb", "rw") as other:
            other.execute("DELETE FROM changes WHERE version = 2")
        other.close()
        os.utime(tmp_path / "s.kb")
        with pytest.raises(StoreError, match="damaged: version 2 is missing"):
            world.changes()
    folder = store_file._copies[0].folder if store_file._copies else None
    store_file._forget()
    assert folder is None or not folder.exists()

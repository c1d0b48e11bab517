"""A store and the files beside it: nobody's own file of such a name is lost, whatever it is."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from hostile_files import LINKS_TO_TEXT, STRANGERS, picture

from dsc.runs.archive import has_run
from dsc.runs.archive import records_of as run_records
from knowledge_base import Delta, InputError, KnowledgeBase, Schema, StoreError, fact
from knowledge_base.cli.changes import new
from knowledge_base.journal.journal import Journal
from knowledge_base.journal.sidecar_files import ENDINGS, WriterLock, is_database, store_owning

SCHEMA = Schema.parse("(define (domain d) (:types cup) (:predicates (clean ?c - cup)) (:constants c1 - cup))")
CLEAN = Delta(added=(fact("clean", "c1"),))
OTHER = "import sqlite3, sys; c = sqlite3.connect(sys.argv[1]); c.execute('SELECT 1 FROM changes'); c.close()"


@pytest.fixture
def store(tmp_path: Path) -> Path:
    with KnowledgeBase.open(SCHEMA, tmp_path / "s.kb") as kb:
        kb.apply(CLEAN, "me")
    return tmp_path / "s.kb"


@pytest.mark.parametrize("ending", ["", *ENDINGS, "-world-wal", "-world-shm"])
def test_a_store_owns_itself_and_the_names_beside_it(store, tmp_path, ending) -> None:
    assert store_owning(tmp_path / f"s.kb{ending}") == store
    assert store_owning(tmp_path / f"new.kb{ending}", [tmp_path / "new.kb"]) == tmp_path / "new.kb"
    assert store_owning(tmp_path / f"new.kb{ending}") is None


def test_links_lead_to_the_store(store, tmp_path) -> None:
    (tmp_path / "soft").symlink_to(store)
    (tmp_path / "hard").hardlink_to(store)
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    assert store_owning(tmp_path / "soft") == store
    assert store_owning(tmp_path / "hard") == tmp_path / "hard"
    assert store_owning(tmp_path / "sub" / ".." / "s.kb-wal") == store
    assert store_owning(tmp_path / "loop") is None


@pytest.mark.parametrize("size", [16, 100, 4096])
def test_the_rest_of_a_damaged_store_is_one_still(tmp_path, size) -> None:
    (tmp_path / "rest").write_bytes(b"SQLite format 3\0".ljust(size, b"\0"))
    assert store_owning(tmp_path / "rest") == tmp_path / "rest"


def test_a_path_that_is_no_database_belongs_to_no_store(tmp_path) -> None:
    (tmp_path / "text").write_text("SQLite format 3\n" * 100, encoding="utf-8")
    (tmp_path / "empty").touch()
    (tmp_path / "short").write_text("x", encoding="utf-8")  # SQLite takes it for an empty database
    os.mkfifo(tmp_path / "fifo")  # to open it would wait for a writer
    for name in ("text", "empty", "short", "fifo", "fifo-wal", "missing", ".", "-wal", "n" * 300, "nul\0", "/dev/full"):
        assert store_owning(tmp_path / name) is None


def test_asking_for_the_owner_changes_nothing_and_keeps_sqlites_locks(store, tmp_path) -> None:
    with KnowledgeBase.open(None, store) as kb:
        before = sorted(file.name for file in tmp_path.iterdir())
        assert is_database(store)
        assert sorted(file.name for file in tmp_path.iterdir()) == before
        subprocess.run([sys.executable, "-c", OTHER, store], check=True)
        assert (tmp_path / "s.kb-wal").exists()  # the other one would have deleted it, had it been the last one
        kb.apply(Delta(removed=(fact("clean", "c1"),)), "me")
    with KnowledgeBase.open(None, store, read_only=True) as kb:
        assert kb.version == 2


# --- strangers: each is refused by name, and everything stays as it was


@pytest.fixture(autouse=True)
def _root_makes_devices(request) -> None:
    if "stranger" in request.fixturenames and request.getfixturevalue("stranger") == "device" and os.geteuid():
        pytest.skip("only root makes a device")


def refused(folder: Path, action, *, name: str) -> StoreError:
    before = picture(folder)
    with pytest.raises(StoreError) as caught:
        action()
    assert picture(folder) == before
    assert name in str(caught.value)
    assert "\n" not in str(caught.value)
    return caught.value


OPENINGS: dict[str, Callable[[Path], object]] = {
    "write": lambda path: KnowledgeBase.open(SCHEMA, path),
    "lasting": lambda path: KnowledgeBase.open(SCHEMA, path, durability="power"),
    "new": lambda path: KnowledgeBase.open(SCHEMA, path, new=True),
    "read": lambda path: KnowledgeBase.open(None, path, read_only=True),
    "run": run_records,
    "has run": has_run,
}


@pytest.mark.parametrize("opening", OPENINGS)
@pytest.mark.parametrize("stranger", STRANGERS)
def test_a_path_that_is_no_store_is_refused_and_unchanged(tmp_path, stranger, opening) -> None:
    STRANGERS[stranger](tmp_path / "mine")
    refused(tmp_path, lambda: OPENINGS[opening](tmp_path / "mine"), name="mine" if "pipe" not in stranger else "")


@pytest.mark.parametrize("opening", OPENINGS)
@pytest.mark.parametrize("ending", ["", "-wal", "-shm", "-journal"])
def test_an_empty_file_is_no_store_and_what_is_beside_it_is_kept(tmp_path, opening, ending) -> None:
    (tmp_path / "mine").touch()
    (tmp_path / f"mine{ending}").write_bytes(b"x" * 5 if ending else b"")
    refused(tmp_path, lambda: OPENINGS[opening](tmp_path / "mine"), name=f"'mine{ending}'")


@pytest.mark.parametrize("opening", OPENINGS)
@pytest.mark.parametrize("main", ["empty", "gone"])
def test_commits_of_a_store_whose_file_is_empty_or_gone_are_kept(tmp_path, opening, main) -> None:
    with KnowledgeBase.open(SCHEMA, tmp_path / "s.kb") as kb:
        kb.apply(CLEAN, "me")
        shutil.copytree(tmp_path, tmp_path / "died", ignore=shutil.ignore_patterns("*-shm", "*-lock"))
    died = tmp_path / "died" / "s.kb"
    died.unlink() if main == "gone" else os.truncate(died, 0)
    refused(died.parent, lambda: OPENINGS[opening](died), name="'s.kb-wal'")


@pytest.mark.parametrize("ending", ["-wal", "-shm", "-journal", "-lock"])
@pytest.mark.parametrize("stranger", STRANGERS | LINKS_TO_TEXT)
@pytest.mark.parametrize("there", [True, False])
def test_a_strangers_file_beside_a_store_stays_as_it_is(store, tmp_path, stranger, ending, there) -> None:
    if not there:
        store.unlink()
    (STRANGERS | LINKS_TO_TEXT)[stranger](tmp_path / f"s.kb{ending}")
    for opening in ("write", "lasting", "read", "run", "has run"):
        if ending == "-lock" and opening in ("read", "run", "has run"):
            continue  # whoever reads needs no lock
        refused(tmp_path, lambda opening=opening: OPENINGS[opening](store), name=f"'s.kb{ending}'")


def test_an_empty_lock_is_somebody_elses(store, tmp_path) -> None:
    (tmp_path / "s.kb-lock").touch()  # `flock s.kb-lock ...` makes one
    refused(tmp_path, lambda: OPENINGS["write"](store), name="'s.kb-lock'")


@pytest.mark.parametrize("length", [0, 3, 4096, 7 * 4096, 32768, 9 * 4096])
def test_an_index_that_another_process_creates_is_accepted(tmp_path, length) -> None:
    with KnowledgeBase.open(SCHEMA, tmp_path / "s.kb") as kb:
        kb.apply(CLEAN, "me")
        shutil.copytree(tmp_path, tmp_path / "died", ignore=shutil.ignore_patterns("*-lock"))
    os.truncate(tmp_path / "died" / "s.kb-shm", length)
    with KnowledgeBase.open(None, tmp_path / "died" / "s.kb") as kb:
        assert kb.holds("clean", ("c1",))


@pytest.mark.parametrize("length", [5, 100, 4097])
def test_a_file_with_another_length_is_no_index(tmp_path, length) -> None:
    with KnowledgeBase.open(SCHEMA, tmp_path / "s.kb") as kb:
        kb.apply(CLEAN, "me")
        shutil.copytree(tmp_path, tmp_path / "died", ignore=shutil.ignore_patterns("*-lock"))
    died = tmp_path / "died"
    os.truncate(died / "s.kb-shm", length)
    refused(died, lambda: OPENINGS["write"](died / "s.kb"), name="'s.kb-shm'")


def test_an_index_without_a_log_is_judged_by_its_content(store, tmp_path) -> None:
    index = tmp_path / "s.kb-shm"
    index.write_bytes(b"my own" * 32768)
    refused(tmp_path, lambda: OPENINGS["write"](store), name="'s.kb-shm'")
    index.write_bytes(bytes(32768))
    KnowledgeBase.open(None, store).close()
    assert [file.name for file in tmp_path.iterdir()] == ["s.kb"]


def test_a_store_made_long_ago_beside_which_somebody_keeps_mission_new(tmp_path) -> None:
    for ending in ("-new", "-new-wal", "-new-shm"):
        (tmp_path / f"s.kb{ending}").write_text("mine", encoding="utf-8")
    before = picture(tmp_path)
    KnowledgeBase.open(SCHEMA, tmp_path / "s.kb").close()
    (tmp_path / "s.kb").unlink()
    assert picture(tmp_path) == before


@pytest.mark.parametrize("ending", ["-wal", "-shm", "-journal", "-lock", "-world"])
def test_no_store_is_made_under_the_name_of_another_ones_file(store, tmp_path, ending) -> None:
    refused(tmp_path, lambda: KnowledgeBase.open(SCHEMA, tmp_path / f"s.kb{ending}"), name=f"'s.kb{ending}'")


def test_somebody_elses_log_is_not_put_into_his_database(tmp_path) -> None:
    """As SQLite does whenever the last connection to a database is closed."""
    died = tmp_path / "died"
    died.mkdir()
    STRANGERS["database"](tmp_path / "app.db")
    code = "import sqlite3, os, sys; c = sqlite3.connect(sys.argv[1]); c.execute('DELETE FROM world'); c.commit(); os._exit(9)"
    subprocess.run([sys.executable, "-c", code, tmp_path / "app.db"], check=False)
    for ending in ("", "-wal"):
        shutil.copy(tmp_path / f"app.db{ending}", died)
    for opening in ("write", "lasting", "read", "run", "has run"):
        refused(died, lambda opening=opening: OPENINGS[opening](died / "app.db"), name="no knowledge store")


# --- names


NAMES = {
    "": "path is text or a Path",
    "nul\0.kb": "path is text or a Path|null byte",
    ":memory:": "has a meaning to SQLite",
    "file:s.kb?mode=rwc": "has a meaning to SQLite",
    "folder/": "names a folder",
    ".": "is a folder",
    "n" * 250: "File name too long",
    "n" * 300: "File name too long",
    "/".join(["f" * 100] * 6): "more than 500 bytes",
}


@pytest.mark.parametrize("name", NAMES, ids=lambda name: repr(name[:10]))
@pytest.mark.parametrize("read_only", [True, False])
def test_names_that_no_store_has(tmp_path, monkeypatch, name, read_only) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "/".join(["f" * 100] * 5)).mkdir(parents=True)
    monkeypatch.chdir(tmp_path)
    before = picture(tmp_path)
    with pytest.raises(InputError, match=NAMES[name]) as caught:
        KnowledgeBase.open(SCHEMA, name, read_only=read_only)
    assert "\n" not in str(caught.value)
    assert picture(tmp_path) == before


@pytest.mark.parametrize(
    "name", [b"a?mode=memory", b"a#b%20c%00", b"two\nlines", b"\xff\xfe.kb", "\u00fc\u4e2d".encode(), b"-wal"]
)
def test_odd_names_are_taken_literally(tmp_path, name) -> None:
    path = tmp_path / os.fsdecode(name)
    with KnowledgeBase.open(SCHEMA, path) as kb:
        kb.apply(CLEAN, "me")
        assert kb.at(version=1).ask("(clean c1)")
    assert os.listdir(os.fsencode(tmp_path)) == [name]  # noqa: PTH208
    with KnowledgeBase.open(None, path, read_only=True) as kb:
        assert kb.version == 1


def test_a_link_to_a_store_is_that_store(store, tmp_path) -> None:
    link = tmp_path / "link"
    link.symlink_to(store)
    with KnowledgeBase.open(None, link), pytest.raises(StoreError, match="another writer"):
        KnowledgeBase.open(None, store)


def test_a_store_with_two_names_is_only_read(store, tmp_path) -> None:
    (tmp_path / "other.kb").hardlink_to(store)
    refused(tmp_path, lambda: OPENINGS["write"](store), name="2 names (hard links)")
    with KnowledgeBase.open(None, tmp_path / "other.kb", read_only=True) as kb:
        assert kb.version == 1


# --- several processes


def _make(path: Path, go, made) -> None:
    go.wait()
    try:
        with KnowledgeBase.open(SCHEMA, path, new=True) as kb:
            kb.apply(CLEAN, str(os.getpid()))
            made.put(os.getpid())
    except StoreError as error:
        made.put(str(error))


def test_of_several_that_make_a_store_at_once_one_does(tmp_path) -> None:
    fork = multiprocessing.get_context("fork")
    for number in range(8):
        folder = tmp_path / f"{number}"
        folder.mkdir()
        go, made = fork.Event(), fork.SimpleQueue()
        makers = [fork.Process(target=_make, args=(folder / "s.kb", go, made)) for _ in range(3)]
        for maker in makers:
            maker.start()
        go.set()
        said = [made.get() for _ in makers]
        for maker in makers:
            maker.join()
        (winner,) = [one for one in said if isinstance(one, int)]
        assert all("there already" in one or "another writer" in one for one in said if one != winner)
        with KnowledgeBase.open(None, folder / "s.kb", read_only=True) as kb:
            assert [change.author for change in kb.changes()] == [str(winner)]


def test_the_lock_of_a_dead_process_is_taken_over(store, tmp_path) -> None:
    child = os.fork()
    if child == 0:
        WriterLock(store)
        os._exit(9)
    os.waitpid(child, 0)
    assert (tmp_path / "s.kb-lock").exists()
    with KnowledgeBase.open(None, store), pytest.raises(StoreError, match=f"process {os.getpid()}"):
        KnowledgeBase.open(None, store)
    assert [file.name for file in tmp_path.iterdir()] == ["s.kb"]


# --- moved or deleted while it is open


def test_a_store_that_is_moved_while_it_is_open_has_all_that_was_acknowledged(store, tmp_path) -> None:
    with KnowledgeBase.open(None, store) as kb:
        kb.apply(Delta(removed=(fact("clean", "c1"),)), "me")
        store.rename(tmp_path / "moved.kb")
        with pytest.raises(StoreError, match="moved or deleted while it is open"):
            kb.apply(CLEAN, "me")
        assert not kb.ask("(clean c1)")
    assert [file.name for file in tmp_path.iterdir()] == ["moved.kb"]
    with KnowledgeBase.open(None, tmp_path / "moved.kb", read_only=True) as kb:
        assert kb.version == 2


def test_a_store_that_takes_the_place_of_an_open_one_is_left_alone(store, tmp_path) -> None:
    kb = KnowledgeBase.open(None, store)
    for file in list(tmp_path.iterdir()):
        file.unlink()  # the lock, too
    with KnowledgeBase.open(SCHEMA, store) as other:
        other.apply(CLEAN, "other")
        with pytest.raises(StoreError, match="moved or deleted while it is open"):
            kb.apply(Delta(removed=(fact("clean", "c1"),)), "me")
        kb.close()
        other.apply(Delta(removed=(fact("clean", "c1"),)), "other")
    with KnowledgeBase.open(None, store, read_only=True) as again:
        assert [change.author for change in again.changes()] == ["other", "other"]


def test_the_command_makes_no_store_where_one_is(store, tmp_path) -> None:
    (tmp_path / "d.pddl").write_text("(define (domain d) (:types cup))", encoding="utf-8")
    refused(tmp_path, lambda: new(store, tmp_path / "d.pddl"), name="'s.kb' is there already")


@pytest.mark.parametrize("read_only", [True, False])
def test_a_store_into_which_the_log_was_being_put_has_all_of_it(tmp_path, read_only) -> None:
    """Its head says already that it is longer than it is."""
    path = tmp_path / "s.kb"
    with KnowledgeBase.open(SCHEMA, path) as kb:
        for number in range(200):
            kb.apply(Delta(nodes={f"c{number}x": "cup"}), "me" * 200)
        assert isinstance(kb._history, Journal)
        kb._history._connection.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchall()
        died = tmp_path / "died"
        died.mkdir()
        for ending in ("", "-wal"):
            shutil.copy(tmp_path / f"s.kb{ending}", died)
    os.truncate(died / "s.kb", (died / "s.kb").stat().st_size - 5 * 4096)
    with KnowledgeBase.open(None, died / "s.kb", read_only=read_only) as kb:
        assert kb.version == 200

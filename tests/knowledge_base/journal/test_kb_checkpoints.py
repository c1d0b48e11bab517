"""A store's log: who tidies it up, that nothing is left beside a closed store, and what is laid out for the disk."""

from __future__ import annotations

import shutil
import sqlite3
import threading

import pytest
from kb_worlds import Ticks

from knowledge_base import Delta, Fact, KnowledgeBase, Schema
from knowledge_base.journal import journal, write_transaction
from knowledge_base.journal.write_transaction import CHECKPOINTS

SCHEMA = Schema.parse("(define (domain d) (:predicates (quiet)))")
CHANGES = (Delta(added=(Fact("quiet"),)), Delta(removed=(Fact("quiet"),)))


@pytest.fixture
def path(tmp_path):
    return tmp_path / "world.kb"


def opened(path, **how) -> KnowledgeBase:
    return KnowledgeBase.open(SCHEMA, path, clock=Ticks(), **how)


def commit(kb, times):
    for number in range(times):
        kb.apply(CHANGES[number % 2], author="me")


def in_file(path):
    """How many changes the file itself has, without its log."""
    alone = path.with_name(f"alone-{path.name}")
    shutil.copy(path, alone)
    try:
        with sqlite3.connect(alone) as connection:
            return connection.execute("SELECT count(*) FROM changes").fetchone()[0]
    except sqlite3.OperationalError:  # not even the tables
        return 0


def test_files_are_tidied_up_while_their_writers_go_on(path, monkeypatch):
    monkeypatch.setattr(write_transaction, "TIDY_UP_AFTER", 20)
    by = set()
    tidy_up = write_transaction._tidy_up

    def tidied_up(path):
        by.add(threading.current_thread())
        return tidy_up(path)

    monkeypatch.setattr(write_transaction, "_tidy_up", tidied_up)
    with opened(path) as one, opened(path.with_name("other.kb")) as other:
        for _ in range(3):
            commit(one, 10)
            commit(other, 10)
        CHECKPOINTS.settle()
        assert in_file(path) >= 19  # and what opening it wrote
        assert in_file(path.with_name("other.kb")) >= 19
        assert threading.current_thread() not in by
        assert one.version == other.version == 30
    with opened(path) as kb:
        assert kb.version == 30


def test_nothing_stays_beside_a_closed_store_that_is_to_be_tidied_up(path, monkeypatch):
    monkeypatch.setattr(write_transaction, "TIDY_UP_AFTER", 2)
    for _ in range(20):
        with opened(path) as kb:
            commit(kb, 6)
        assert [file.name for file in path.parent.iterdir()] == [path.name]


def test_a_store_that_cannot_be_tidied_up_loses_nothing(path, monkeypatch):
    monkeypatch.setattr(write_transaction, "TIDY_UP_AFTER", 5)

    def broken(_):
        raise sqlite3.OperationalError("disk I/O error")

    monkeypatch.setattr(write_transaction, "to_tidy_up", broken)
    with opened(path) as kb:
        commit(kb, 11)
        CHECKPOINTS.settle()
        assert in_file(path) == 0
    with opened(path) as kb:
        assert kb.version == 11


def test_a_log_that_grows_faster_than_it_is_tidied_up_is_kept_short_by_its_writer(path, monkeypatch):
    monkeypatch.setattr(write_transaction, "TIDY_UP_AFTER", 10)
    monkeypatch.setattr(write_transaction, "MOST_IN_LOG", 30)
    tidy_up = write_transaction._tidy_up
    monkeypatch.setattr(write_transaction, "_tidy_up", lambda path: tidy_up(path) and 31)  # he is never done
    with opened(path) as kb:
        for _ in range(100):
            commit(kb, 10)
            CHECKPOINTS.settle()
        assert path.with_name("world.kb-wal").stat().st_size < 200 * 4120
        assert kb.version == 1000


def test_an_empty_transaction_requests_no_checkpoint(path, monkeypatch):
    monkeypatch.setattr(write_transaction, "TIDY_UP_AFTER", 1)
    asked = []

    def asking(path):
        asked.append(path)
        return 0

    monkeypatch.setattr(write_transaction, "_tidy_up", asking)
    with opened(path) as kb:
        CHECKPOINTS.settle()
        before = len(asked)
        for _ in range(5):
            with kb.together():
                pass
        CHECKPOINTS.settle()
        assert len(asked) == before
        commit(kb, 1)
        CHECKPOINTS.settle()
        assert len(asked) == before + 1


def test_the_log_of_a_store_for_power_cuts_is_as_long_from_the_beginning_as_it_will_be(path):
    log = path.with_name("world.kb-wal")
    with opened(path, durability="power") as kb:
        length = log.stat().st_size
        commit(kb, 1500)
        assert log.stat().st_size == length
        kb.compact(kb.version - 1)
        assert log.stat().st_size == length
        died = path.with_name("died.kb")
        shutil.copy(path, died)
        shutil.copy(log, died.with_name("died.kb-wal"))
    with opened(died, durability="power") as kb:
        assert kb.version == 1500
        assert died.with_name("died.kb-wal").stat().st_size == length
        commit(kb, 3)
    with opened(died) as kb:
        assert kb.version == 1503


def test_a_change_is_not_called_failed_because_no_thread_can_tidy_up_after_it(path, monkeypatch):
    class NoMore(threading.Thread):
        def start(self):
            raise RuntimeError("can't start new thread")

    monkeypatch.setattr(write_transaction, "TIDY_UP_AFTER", 2)
    monkeypatch.setattr(write_transaction, "Thread", NoMore)
    with opened(path) as kb:
        commit(kb, 50)
        assert kb.version == 50
        assert in_file(path) >= 15  # the writer has done it himself
    with opened(path) as kb:
        assert kb.version == 50


def test_a_change_is_not_called_failed_because_its_writer_cannot_tidy_up(path, monkeypatch):
    def no_checkpoints(action, what, *_):
        refused = (action, what) == (sqlite3.SQLITE_PRAGMA, "wal_checkpoint")
        return sqlite3.SQLITE_DENY if refused else sqlite3.SQLITE_OK

    def writing(path, durability):
        connection = really_writing(path, durability)
        connection.set_authorizer(no_checkpoints)
        return connection

    really_writing = write_transaction.writing
    monkeypatch.setattr(journal, "writing", writing)
    monkeypatch.setattr(write_transaction, "TIDY_UP_AFTER", 2)
    monkeypatch.setattr(CHECKPOINTS, "is_behind", lambda _: True)
    with opened(path) as kb:
        commit(kb, 9)
        assert kb.version == 9
    with opened(path) as kb:
        assert kb.version == 9

"""A knowledge store in the viewer: its past as records, asked at any version, and followed while others write it."""

from __future__ import annotations

import threading

import pytest

from dsc.viewer.queries import PageQueries
from dsc.viewer.record_sources import records_of
from knowledge_base import InputError, KnowledgeBase, Schema

DOMAIN = """(define (domain kitchen) (:types cup surface - object)
  (:predicates (on ?c - cup ?s - surface) (clean ?c - cup)) (:functions (weight ?c - cup)))"""


@pytest.fixture
def store(tmp_path):
    """A cup comes, is weighed, moves; five seconds lie between two changes."""
    path = tmp_path / "kitchen.db"
    times = iter(range(1000, 2000, 5))
    with KnowledgeBase.open(Schema.parse(DOMAIN), path, clock=lambda: float(next(times))) as kb:
        with kb.transaction(author="eye") as tx:
            tx.add_node("table", "surface")
            tx.add_node("cup", "cup")
            tx.tell("on", "cup", "table")
        with kb.transaction(author="scale") as tx:
            tx.set("weight", "cup", 0.2)
        with kb.transaction(author="arm") as tx:
            tx.retract("on", "cup", "table")
    return path


def test_the_past_of_a_store_is_records_with_version_author_and_time(store):
    with records_of(store) as log:
        world, *changes = [log.record(seq) for seq in range(1, len(log) + 1)]
        assert (world["type"], world["version"], world["facts"]) == ("world", 0, [])
        assert [(r["version"], r["author"], r["t"]) for r in changes] == [
            (1, "eye", 0.0),
            (2, "scale", 5.0),
            (3, "arm", 10.0),
        ]
        assert [r["removed"] for r in changes if "removed" in r] == [[["on", "cup", "table"]]]
        assert (log.header["store"], log.header["run"]) == (True, "kitchen.db")


def test_any_version_is_asked(store):
    with records_of(store) as log, KnowledgeBase.open(None, store, read_only=True) as kb:
        answers = PageQueries(log)
        for seq in range(1, len(log) + 1):
            then = kb.at(version=log.record(seq)["version"])
            said = answers.query({"seq": seq, "expression": "(on ?c ?s)"})
            assert (said["answers"], said["version"]) == (then.query("(on ?c ?s)"), then.version)


def test_a_store_that_was_compacted_begins_where_it_is_known(store):
    with KnowledgeBase.open(None, store) as kb:
        kb.compact(keep_since=2)
    with records_of(store) as log:
        assert [log.record(seq)["version"] for seq in range(1, len(log) + 1)] == [2, 3]
        assert log.record(1)["values"] == [["weight", "cup", 0.2]]


def test_changes_by_another_writer_are_followed(store):
    with records_of(store) as log:
        before, more = len(log), threading.Event()
        log.on_more(more.set)
        with KnowledgeBase.open(None, store) as kb, kb.transaction(author="dishwasher") as tx:
            tx.tell("clean", "cup")
        assert log.live
        assert more.wait(timeout=20)
        added = log.record(before + 1)
        assert (added["author"], added["version"], added["added"]) == ("dishwasher", 4, [["clean", "cup"]])
    assert not log.live


def test_an_empty_store_is_a_world_without_facts(tmp_path):
    KnowledgeBase.open(Schema.parse(DOMAIN), tmp_path / "empty.db").close()
    with records_of(tmp_path / "empty.db") as log:
        assert [log.record(seq)["type"] for seq in range(1, len(log) + 1)] == ["world"]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"SQLite format 3\0" + bytes(100), "no store|not a database|malformed|cannot be read"),
        (b"hello\n", "neither a store nor a trace"),
        (None, "there is no file"),
    ],
)
def test_a_file_that_is_neither_a_trace_nor_a_store_is_refused(tmp_path, content, said):
    file = tmp_path / "thing"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(InputError, match=said), records_of(file):
        pass

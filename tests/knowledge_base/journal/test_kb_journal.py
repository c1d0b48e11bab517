"""The past of a knowledge base, in memory and in a file: it agrees with the world at every version, and lasts."""

from __future__ import annotations

import contextlib
import shutil
import sqlite3
from random import Random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kb_strategies import SCHEMA, THINGS, deltas, removals
from kb_worlds import PROPERTY, Ticks, everything, graph_content, unordered

from knowledge_base import (
    Change,
    ConflictError,
    DamagedStoreError,
    Delta,
    Fact,
    HistoryError,
    InputError,
    KnowledgeBase,
    StoreError,
    fact,
)
from knowledge_base.journal import history, journal

QUIET = Delta(added=(Fact("quiet"),))
LOUD = Delta(removed=(Fact("quiet"),))


def opened(path, **how) -> KnowledgeBase:
    return KnowledgeBase.open(SCHEMA, path, clock=Ticks(), **how)


@pytest.fixture(params=["memory", "file"])
def kb(request, tmp_path):
    with opened(None if request.param == "memory" else tmp_path / "world.kb") as kb:
        kb.apply(Delta(nodes=THINGS), author="test")
        yield kb


@pytest.fixture
def path(tmp_path):
    return tmp_path / "world.kb"


def commit(kb: KnowledgeBase, changes, number: int) -> None:
    """A transaction of several changes; one that is not to stay fails at its end."""
    parts, stays = changes
    with contextlib.nullcontext() if stays else pytest.raises(InputError), kb.transaction(f"author {number}") as tx:
        tx.apply(Delta(nodes=THINGS))
        for part in parts:
            tx.apply(part)
        if not stays:
            tx.tell("on", "ghost", "shelf")


transactions = st.lists(
    st.tuples(st.lists(deltas() | removals(), min_size=1, max_size=3), st.booleans() | st.just(True)), max_size=8
)


@settings(PROPERTY, max_examples=50)
@given(transactions, st.integers(0, 400))
def test_index_graph_and_journal_agree_at_every_version_and_reopening_is_equal(tmp_path_factory, all_changes, size):
    path = tmp_path_factory.mktemp("kb") / "world.kb"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(journal, "SNAPSHOT_AFTER", size)  # snapshots at any distance
        seen: list[Change] = []
        past: dict[int, Any] = {}
        with opened(path) as kb:
            kb.subscribe(seen.append)
            past[0] = everything(kb)
            for number, changes in enumerate(all_changes):
                commit(kb, changes, number)
                past[kb.version] = everything(kb)
                assert graph_content(kb.graph) == (kb.nodes(), set(kb.facts()), kb.values())
            assert kb.changes() == seen
        with opened(path) as again:
            assert everything(again) == past[again.version]
            assert again.changes() == seen
            assert graph_content(again.graph) == (again.nodes(), set(again.facts()), again.values())
            assert {v: everything(again.at(version=v)) for v in past} == past


@PROPERTY
@given(transactions)
def test_a_world_in_memory_is_what_it_was_at_every_version(all_changes):
    kb, past = opened(None), {}
    past[0] = unordered(kb)
    for number, changes in enumerate(all_changes):
        commit(kb, changes, number)
        past[kb.version] = unordered(kb)
    assert {v: unordered(kb.at(version=v)) for v in past} == past


# --- the past


def test_a_past_world_is_asked_like_the_present_one(kb):
    kb.apply(Delta(added=(fact("on", "cup1", "shelf"),), values={fact("weight", "cup1"): 2}), author="a")
    kb.apply(Delta(removed=(fact("on", "cup1", "shelf"),), removed_nodes=("cup1",)), author="b")
    past = kb.at(version=2)
    assert past.version == 2
    assert past.query("(and (on ?i shelf) (cup ?i))") == [{"i": "cup1"}]
    assert past.ask("(= (weight cup1) 2)")
    assert past.explain("(on cup1 shelf)").text == "(on cup1 shelf)"
    assert past.graph.has_edge("cup1", "shelf", key="on")
    assert past.overlay().holds("on", ("cup1", "shelf"))
    assert not kb.ask("(exists (?i - cup) (on ?i shelf))")


def test_the_world_at_a_time_is_that_of_the_last_change_until_then(kb):
    first = kb.apply(QUIET, author="a")
    second = kb.apply(LOUD, author="b")
    assert first.time < second.time
    assert kb.at(time=first.time).ask("(quiet)")
    assert kb.at(time=(first.time + second.time) / 2).version == first.version
    assert not kb.at(time=second.time + 100).ask("(quiet)")
    with pytest.raises(HistoryError, match=r"time -1\.0 is before the oldest kept version, 0"):
        kb.at(time=-1.0)


def test_time_never_runs_backwards(tmp_path):
    now = [5.0]
    with KnowledgeBase.open(SCHEMA, tmp_path / "world.kb", clock=lambda: now[0]) as kb:
        kb.apply(QUIET, author="a")
        now[0] = 3.0
        assert kb.apply(LOUD, author="a").time == 5.0
    with KnowledgeBase.open(SCHEMA, tmp_path / "world.kb", clock=lambda: now[0]) as kb:
        assert kb.apply(QUIET, author="a").time == 5.0
        assert [c.time for c in kb.changes()] == [5.0, 5.0, 5.0]


def test_changes_since_a_version_come_in_order_with_author_and_delta(kb):
    made = [kb.apply(QUIET, author="a"), kb.apply(LOUD, author="b"), kb.apply(QUIET, author="c")]
    assert kb.changes(since=1) == made
    assert kb.changes(since=2, until=3) == made[1:2]
    assert kb.changes(since=4) == []


@pytest.mark.parametrize(
    ("ask", "means"),
    [
        (lambda kb: kb.at(version=9), "version 9 is in the future; the newest is 1"),
        (lambda kb: kb.changes(since=9), "version 9 is in the future; the newest is 1"),
        (lambda kb: kb.compact(keep_since=9), "version 9 is in the future; the newest is 1"),
        (lambda kb: kb.at(version=-1), "version -1 is no longer kept; the oldest kept is 0"),
        (lambda kb: kb.changes(since=-1), "version -1 is no longer kept; the oldest kept is 0"),
        (lambda kb: kb.compact(keep_since=-1), "version -1 is no longer kept; the oldest kept is 0"),
        (lambda kb: kb.changes(1, 0), "from 1 to 0"),
        (lambda kb: kb.changes(0, -1), "version -1 is no longer kept; the oldest kept is 0"),
        (lambda kb: kb.at(), "takes a version or a time"),
        (lambda kb: kb.at(version=1, time=1.0), "takes a version or a time"),
    ],
)
def test_an_invalid_version_or_range_of_the_history_is_refused(kb, ask, means):
    with pytest.raises(InputError, match=means):
        ask(kb)


@pytest.mark.parametrize("version", [1.0, 1.5, True, "1", (1,), 10**30, -(10**30), pytest.param(10**5000, id="digits")])
def test_a_version_is_a_whole_number(kb, version):
    asked = [
        lambda: kb.at(version=version),
        lambda: kb.changes(version),
        lambda: kb.changes(0, version),
        lambda: kb.compact(version),
    ]
    for ask in asked:
        with pytest.raises(InputError, match=r"^a version is a whole number, 0 or more, not [^\n]*$"):
            ask()
    assert kb.oldest == 0


@pytest.mark.parametrize(
    "time", [True, "x", (1,), float("nan"), float("inf"), 10**400, pytest.param(10**5000, id="digits")]
)
def test_a_time_is_a_finite_number(kb, time):
    with pytest.raises(InputError, match=r"^a time is a finite number of seconds, not [^\n]*$"):
        kb.at(time=time)


def test_a_whole_number_is_a_time_too(kb):
    assert kb.at(time=10**40).version == kb.version


def test_compaction_forgets_what_was_before_and_nothing_else(kb):
    for number in range(6):
        kb.apply(LOUD if number % 2 else QUIET, author=f"a{number}")
    before = everything(kb)
    later = kb.changes(since=4)
    kb.compact(keep_since=4)
    assert everything(kb) == before
    assert kb.changes(since=4) == later
    assert [kb.at(version=v).ask("(quiet)") for v in (4, 5, 6)] == [True, False, True]
    for ask in (lambda: kb.at(version=3), lambda: kb.changes(since=3)):
        with pytest.raises(HistoryError, match="version 3 is no longer kept; the oldest kept is 4"):
            ask()
    kb.compact()
    assert kb.changes(since=kb.version) == []
    assert everything(kb.at(version=kb.version)) == before


def test_a_snapshot_before_a_change_of_nothing_is_that_of_its_version(path, monkeypatch):
    monkeypatch.setattr(journal, "SNAPSHOT_AFTER", 1)
    with opened(path) as kb:
        kb.apply(QUIET, author="a")
        kb.apply(LOUD, author="a")
        past = [everything(kb.at(version=version)) for version in range(3)]
        kb.apply(Delta(), author="a", key="k")
        kb.apply(Delta(nodes={"late": "cup"}), author="a")
        assert [everything(kb.at(version=version)) for version in range(3)] == past


def test_compaction_makes_the_file_smaller_and_keeps_it_whole(path):
    with opened(path) as kb:
        for number in range(2000):
            kb.apply(LOUD if number % 2 else QUIET, author="test")
        kb.compact()
        small, before = path.stat().st_size, everything(kb)
        assert small < 60_000
    with opened(path) as kb:
        assert everything(kb) == before
        kb.apply(QUIET, author="test")
        assert kb.version == 2001


def test_in_memory_only_the_last_changes_are_kept(monkeypatch):
    monkeypatch.setattr(history, "MOST_KEPT", 3)
    kb = opened(None)
    for number in range(5):
        kb.apply(LOUD if number % 2 else QUIET, author="test")
    assert len(kb.changes(since=2)) == 3
    assert kb.at(version=3).ask("(quiet)")
    assert not kb.at(version=2).ask("(quiet)")
    with pytest.raises(HistoryError, match="version 1 is no longer kept; the oldest kept is 2"):
        kb.at(version=1)


# --- expected versions and idempotency keys


def test_a_change_for_another_version_is_refused_and_both_are_named(kb):
    kb.apply(QUIET, author="a", expect=1)
    before = everything(kb)
    with pytest.raises(ConflictError, match="version 1 is expected, but the world is at version 2"):
        kb.apply(LOUD, author="b", expect=1)
    with pytest.raises(ConflictError, match="version 1"), kb.transaction(author="b", expect=1):
        pytest.fail("the block must not run")
    assert everything(kb) == before
    with kb.transaction(author="b", expect=2) as tx:
        tx.retract("quiet")
    assert tx.change == kb.changes(since=2)[0]


def test_a_repeated_key_gives_the_first_change_and_changes_nothing(kb):
    first = kb.apply(QUIET, author="a", expect=1, key="action 7")
    kb.apply(LOUD, author="b")
    before = everything(kb)
    assert kb.apply(QUIET, author="a", expect=1, key="action 7") == first
    assert everything(kb) == before


def test_a_repeated_transaction_has_no_effect_even_where_it_would_fail_now(kb):
    for repeated in (False, True):
        with kb.transaction(author="a", key="throw away") as tx:
            assert (tx.change is not None) == repeated
            tx.remove_node("cup1")
            tx.add_node("cup1", "can")
            tx.tell("on", "cup1", "shelf")
            tx.remove_node("cup2")
        kb.apply(Delta(removed_nodes=("shelf",)), author="b")
        assert tx.change.version == 2
    assert (kb.version, kb.type_of("cup1"), kb.facts()) == (3, "can", [])


def test_a_key_of_what_changed_nothing_counts_too(kb):
    kb.apply(QUIET, author="a")
    assert not kb.apply(QUIET, author="a", key="again").delta
    kb.apply(LOUD, author="b")
    repeated = kb.apply(QUIET, author="a", key="again")
    assert (repeated.version, bool(repeated.delta), kb.ask("(quiet)")) == (2, False, False)


def test_a_key_of_what_failed_is_free(kb):
    with pytest.raises(InputError):
        kb.apply(Delta(added=(fact("on", "ghost", "shelf"),)), author="a", key="k")
    assert kb.apply(QUIET, author="a", key="k").delta == QUIET


@pytest.mark.parametrize("compact", [False, True])
def test_a_key_outlives_a_restart_and_compaction(path, compact):
    with opened(path) as kb:
        first = kb.apply(QUIET, author="a", key="k")
        kb.apply(QUIET, author="a", key="nothing new")
        kb.apply(LOUD, author="b")
        if compact:
            kb.compact()
    with opened(path) as kb:
        assert kb.apply(QUIET, author="a", key="k") == first
        assert kb.apply(QUIET, author="a", key="nothing new").version == 1
        assert (kb.version, kb.ask("(quiet)")) == (2, False)


def test_a_key_whose_text_was_damaged_is_not_taken_for_a_new_one(path):
    with opened(path) as kb:
        kb.apply(QUIET, author="a", key="k")
        kb.apply(LOUD, author="b", key="l")
    with contextlib.closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("UPDATE keys SET key = 'j' WHERE key = 'k'")
    with opened(path) as kb:
        assert kb.apply(LOUD, author="b", key="l").version == 2
        with pytest.raises(DamagedStoreError, match="key 1"):
            kb.apply(QUIET, author="a", key="k")
        assert kb.version == 2


# --- writing fails


def test_when_the_disk_is_full_nothing_is_changed_and_it_is_said(path):
    with opened(path) as kb:
        kb.apply(Delta(nodes=THINGS), author="a")
        before = everything(kb)
        heard: list[Change] = []
        kb.subscribe(heard.append)
        kb.apply(Delta(), author="a", along=lambda c: c.execute("PRAGMA max_page_count = 1"))
        large = Delta(nodes={f"cup-{n}": "cup" for n in range(5000)})
        with pytest.raises(StoreError, match=r"world\.kb: cannot write the store: database or disk is full"):
            kb.apply(large, author="a")
        assert (everything(kb), heard) == (before, [])
        kb.apply(Delta(), author="a", along=lambda c: c.execute("PRAGMA max_page_count = 1000000"))
        kb.apply(large, author="a")
        assert kb.version == 2
    with opened(path) as kb:
        assert (kb.version, len(kb.objects("cup"))) == (2, 5002)


def test_when_somebody_locks_the_file_nothing_is_changed_and_it_is_said(path, monkeypatch):
    monkeypatch.setattr("knowledge_base.journal.file.PATIENCE_S", 0)
    with opened(path) as kb:
        other = sqlite3.connect(path, isolation_level=None)
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(StoreError, match="cannot write the store: database is locked"):
            kb.apply(QUIET, author="a")
        assert (kb.version, kb.ask("(quiet)")) == (0, False)
        other.close()
        assert kb.apply(QUIET, author="a").version == 1


@pytest.mark.parametrize(
    "change",
    [
        lambda kb: kb.apply(LOUD, author="a"),
        lambda kb: kb.apply(Delta(), author="a"),
        lambda kb: kb.transaction(author="a").__enter__(),
        lambda kb: kb.bind_source("weight", "cup1", reference="scale"),
        lambda kb: kb.compact(),
        lambda kb: kb.install("(quiet)"),
        lambda kb: kb.watch(),
        lambda kb: kb.refresh(),
    ],
)
def test_a_closed_knowledge_base_is_asked_but_not_changed(kb, change):
    kb.apply(QUIET, author="a")
    kb.close()
    kb.close()
    before = everything(kb)
    with pytest.raises(StoreError, match=r"^the knowledge base is closed; it only answers questions$"):
        change(kb)
    assert everything(kb) == before
    assert kb.ask("(quiet)")
    assert not kb.at(version=1).ask("(quiet)")
    assert len(kb.changes()) == 2


def test_closing_inside_a_transaction_drops_it(kb):
    transaction = kb.transaction(author="a")
    transaction.__enter__().tell("quiet")
    kb.close()
    with pytest.raises(StoreError, match="closed"):
        transaction.__exit__(None, None, None)
    assert not kb.ask("(quiet)")


def test_an_author_or_key_with_a_lone_surrogate_is_refused(path):
    with opened(path) as kb:
        wrong: list[dict[str, Any]] = [{"author": "\ud800"}, {"author": "a", "key": "\ud800"}]
        for how in wrong:
            with pytest.raises(InputError, match="not a text that can be written"):
                kb.apply(QUIET, **how)
        assert kb.version == 0


# --- one writer, many readers


def test_a_second_writer_is_refused_and_a_reader_is_not(path):
    with opened(path) as kb:
        kb.apply(QUIET, author="a")
        with pytest.raises(StoreError, match=r"world\.kb: another writer has it open \(process \d+\)"):
            opened(path)
        with opened(path, read_only=True) as reader:
            kb.apply(LOUD, author="b")
            assert reader.ask("(quiet)")
            assert [c.author for c in reader.changes()] == ["a"]
            with pytest.raises(ConflictError, match="read_only"):
                reader.apply(LOUD, author="c")
            with pytest.raises(ConflictError, match="read_only"):
                reader.compact()
            assert reader.ask("(quiet)")
    with opened(path) as kb:
        assert not kb.ask("(quiet)")


def test_a_reader_of_a_store_that_is_not_there_is_told_so_and_makes_none(path):
    (path.parent / "world2.kb").touch()
    with pytest.raises(StoreError, match=r"no store 'world\.kb'; did you mean 'world2\.kb'\?"):
        opened(path, read_only=True)
    assert not path.exists()


# --- others write along in the same transaction


def rows(path):
    with sqlite3.connect(path) as connection:
        found = connection.execute("SELECT what FROM runs").fetchall()
    connection.close()
    return [what for (what,) in found]


def test_others_write_along_or_not_at_all(path):
    with opened(path) as kb:
        kb.apply(Delta(), author="runs", along=lambda c: c.execute("CREATE TABLE runs (what TEXT)"))
        assert kb.version == 0
        kb.apply(QUIET, author="runs", along=lambda c: c.execute("INSERT INTO runs VALUES ('with a change')"), key="k")
        kb.apply(QUIET, author="runs", along=lambda c: c.execute("INSERT INTO runs VALUES ('repeated')"), key="k")
        with kb.transaction(author="runs", along=lambda c: c.execute("INSERT INTO runs VALUES ('alone')")):
            pass

        def fail(connection):
            connection.execute("INSERT INTO runs VALUES ('never')")
            raise RuntimeError("no")

        with pytest.raises(RuntimeError):
            kb.apply(LOUD, author="runs", along=fail)
        assert (kb.version, kb.ask("(quiet)")) == (1, True)
        with pytest.raises(StoreError, match="no such table"):
            kb.apply(LOUD, author="runs", along=lambda c: c.execute("INSERT INTO walks VALUES (1)"))
        assert (kb.version, kb.ask("(quiet)")) == (1, True)
    assert rows(path) == ["with a change", "alone"]


@pytest.mark.parametrize(
    "along",
    [
        lambda c: c.commit(),
        lambda c: c.rollback(),
        lambda c: c.execute("COMMIT"),
        lambda c: c.execute("ROLLBACK"),
        lambda c: c.execute("BEGIN"),
        lambda c: c.execute("SAVEPOINT s"),
        lambda c: c.executescript("CREATE TABLE runs (what TEXT)"),
    ],
)
def test_rows_written_along_with_a_change_cannot_end_its_transaction(path, along):
    with opened(path) as kb:
        with pytest.raises(StoreError, match="rows written along with a change neither begin nor end a transaction"):
            kb.apply(QUIET, author="runs", along=along)
        assert (kb.version, kb.ask("(quiet)")) == (0, False)
        assert kb.apply(QUIET, author="a").version == 1
    with opened(path) as again:
        assert [change.author for change in again.changes()] == ["a"]


def test_a_suppressed_attempt_to_commit_does_not_prevent_the_change(path):
    def stubborn(connection):
        with contextlib.suppress(sqlite3.Error):
            connection.commit()

    with opened(path) as kb:
        assert kb.apply(QUIET, author="a", along=stubborn).version == 1
    with opened(path) as again:
        assert again.ask("(quiet)")


def test_in_memory_nobody_can_write_along():
    kb = opened(None)
    with pytest.raises(StoreError, match="no file"):
        kb.apply(QUIET, author="a", along=lambda c: None)
    assert kb.version == 0


# --- what the file is


@pytest.mark.parametrize(("durability", "synchronous"), [("process", 1), ("power", 2)])
def test_durability_is_what_sqlite_is_told(path, durability, synchronous):
    told = []
    with opened(path, durability=durability) as kb:
        kb.apply(Delta(), author="a", along=lambda c: told.extend(c.execute("PRAGMA synchronous").fetchone()))
        kb.apply(Delta(), author="a", along=lambda c: told.extend(c.execute("PRAGMA journal_mode").fetchone()))
    assert told == [synchronous, "wal"]


@pytest.mark.parametrize(
    "how", [{"path": None, "durability": "power"}, {"path": None, "read_only": True}, {"durability": "memory"},
            {"path": None, "schema": None}, {"schema": None}],
)  # fmt: skip
def test_contradictions_in_opening_are_refused(path, how):
    with pytest.raises(InputError):
        KnowledgeBase.open(**{"schema": SCHEMA, "path": path, **how})
    assert not path.exists()


def test_a_torn_tail_costs_only_what_was_torn(path):
    torn, past, random = path.with_name("torn.kb"), {}, Random(4)  # noqa: S311
    with opened(path) as kb:
        past[0] = everything(kb)
        for number in range(8):
            kb.apply(Delta(nodes={f"cup-{number}-{n}": "cup" for n in range(100)}), author="a")
            past[kb.version] = everything(kb)
        shutil.copy(path, torn)
        log = path.with_name("world.kb-wal").read_bytes()
    whole, reached = torn.read_bytes(), set()
    for _ in range(20):
        torn.write_bytes(whole)
        torn.with_name("torn.kb-wal").write_bytes(log[: random.randrange(len(log) // 2, len(log))])
        with opened(torn) as kb:
            assert everything(kb) == past[kb.version]
            reached.add(kb.version)
            kb.apply(QUIET, author="a")
            assert [c.version for c in kb.changes()] == list(range(1, kb.version + 1))
    assert len(reached) > 3


def test_a_declaration_that_is_no_text_any_more_is_damage(path):
    with opened(path) as kb:
        kb.apply(QUIET, author="a")
    path.write_bytes(path.read_bytes().replace(b"key TEXT NOT NULL UNIQUE", b"key TEXT N\xffT NULL UNIQUE"))
    with pytest.raises(DamagedStoreError):
        opened(path)

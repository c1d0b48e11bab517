"""Files that are opened as stores: with another schema, of another kind, of another program, damaged."""

from __future__ import annotations

import fcntl
import os
import sqlite3

import pytest

from knowledge_base import (
    Delta,
    KnowledgeBase,
    Schema,
    SchemaMismatchError,
    StoreError,
    fact,
)
from knowledge_base.journal.sidecar_files import WriterLock

TYPES = "item place - object cup - item"
PREDICATES = "(on ?i - item ?p - place) (clean ?i - item)"
FUNCTIONS = "(weight ?i - item)"


def schema(types=TYPES, constants="home - place", predicates=PREDICATES, functions=FUNCTIONS) -> Schema:
    return Schema.parse(
        f"(define (domain d) (:types {types}) (:constants {constants}) (:predicates {predicates})"
        f" (:functions {functions}))"
    )


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "world.kb"
    with KnowledgeBase.open(schema(), path) as kb:
        kb.apply(Delta(nodes={"cup1": "cup", "tray": "place"}, added=(fact("on", "cup1", "home"),)), author="a")
        kb.apply(Delta(added=(fact("clean", "cup1"),), values={fact("weight", "cup1"): 0.2}), author="b")
    return path


# --- schemas


def test_a_store_knows_its_own_schema(path):
    with KnowledgeBase.open(None, path) as kb:
        assert kb.query("(and (on ?c home) (cup ?c))") == [{"c": "cup1"}]
        assert kb.schema.constants == {"home": "place"}


@pytest.mark.parametrize(
    ("given", "difference"),
    [
        ({"types": "item place - object mug - item"}, r"the type 'cup' is missing"),
        ({"types": "item place - object cups - item"}, r"the type 'cup' is missing \(nearest: 'cups'\)"),
        ({"types": "item place cup"}, "the type 'cup' was declared 'item', now it is 'object'"),
        ({"constants": "hme - place"}, r"the constant 'home' is missing \(nearest: 'hme'\)"),
        ({"constants": "home - item"}, "the constant 'home' was declared 'place', now it is 'item'"),
        ({"predicates": "(on ?i - item ?p - place)"}, "the predicate 'clean' is missing"),
        ({"predicates": "(clean ?i - item) (onn ?i - item ?p - place)"}, r"'on' is missing \(nearest: 'onn'\)"),
        ({"predicates": "(clean ?i - item) (on ?i - item)"}, "the predicate 'on' was declared 'on item place', now it is 'on item'"),
        ({"functions": ""}, "the function 'weight' is missing"),
        ({"functions": "(weight ?i - cup)"}, "the function 'weight' was declared 'weight item', now it is 'weight cup'"),
        ({"constants": "home - place cup1 - place"}, "the constant 'cup1' is an object of type 'cup' there, not 'place'"),
    ],
)  # fmt: skip
def test_another_schema_is_refused_with_what_differs(path, given, difference):
    with pytest.raises(SchemaMismatchError, match=rf"world\.kb: the schema is another one: .*{difference}") as caught:
        KnowledgeBase.open(schema(**given), path)
    assert caught.value.differences
    with KnowledgeBase.open(schema(), path) as kb:  # nothing was changed, and nobody holds it
        assert kb.version == 2


def test_many_differences_are_counted(path):
    with pytest.raises(SchemaMismatchError, match="; and 2 more") as caught:
        KnowledgeBase.open(schema("item place", "", "", ""), path)
    assert len(caught.value.differences) == 5


@pytest.mark.parametrize("read_only", [False, True])
def test_a_store_of_another_domain_is_called_that(path, read_only):
    other = Schema.parse("(define (domain e) (:types lamp) (:predicates (one ?l - lamp)))")
    said = r"world\.kb: it is about another domain: the type 'item' is missing"
    with pytest.raises(SchemaMismatchError, match=said) as caught:
        KnowledgeBase.open(other, path, read_only=read_only)
    assert len(caught.value.differences) == 7
    assert "nearest" not in str(caught.value)


def test_more_declarations_are_accepted_and_recorded(path):
    more = schema(
        TYPES + " can - item", "home shelf tray - place", PREDICATES + " (full ?c - can)", FUNCTIONS + " (age)"
    )
    with KnowledgeBase.open(more, path) as kb:
        assert (kb.version, kb.changes(since=2)[0].author) == (3, "schema")
        assert kb.changes(since=2)[0].delta == Delta(nodes={"shelf": "place"})  # there is a tray already
        assert kb.at(version=2).type_of("shelf") is None
        kb.apply(Delta(nodes={"can1": "can"}, added=(fact("full", "can1"), fact("on", "can1", "shelf"))), author="c")
    with KnowledgeBase.open(None, path) as kb:
        assert kb.ask("(and (full can1) (on can1 shelf))")
        assert kb.schema.functions.keys() == {"weight", "age"}
    with pytest.raises(SchemaMismatchError, match="the type 'can' is missing"):
        KnowledgeBase.open(schema(), path)
    with KnowledgeBase.open(more, path) as kb:
        assert kb.version == 4


def test_renamed_parameters_are_no_difference(path):
    with KnowledgeBase.open(schema(functions="(weight ?thing - item)"), path) as kb:
        assert kb.value("weight", ("cup1",)) == 0.2


# --- other files


def database(path, *statements):
    connection = sqlite3.connect(path, isolation_level=None)
    for statement in statements:
        connection.execute(statement)
    connection.close()


def scribble(path):
    """Overwrite all pages but the first."""
    page = 4096
    content = path.read_bytes()
    path.write_bytes(content[:page] + bytes(range(256)) * ((len(content) - page) // 256))


FOREIGN = {
    "text": (lambda p: p.write_text("(define (domain d))\n" * 100), "file is not a database"),
    "other database": (lambda p: (p.unlink(), database(p, "CREATE TABLE t (x)")), "no knowledge store"),
    "other application": (lambda p: (p.unlink(), database(p, "PRAGMA application_id = 7")), "no knowledge store"),
    "later format": (lambda p: database(p, "PRAGMA user_version = 9"), "format 9, this program reads format 3"),
    "folder": (lambda p: (p.unlink(), p.mkdir()), "'world.kb' is a folder, not a regular file"),
    "schema": (lambda p: database(p, "UPDATE schemas SET declarations = '[1]'"), "schema 1 is not what was written"),
    "change": (lambda p: database(p, "UPDATE changes SET delta = '{' WHERE version = 2"), "the change to version 2 is not what was written"),
    "change of nothing known": (
        lambda p: database(p, """UPDATE changes SET delta = '{"removed_nodes": ["ghost"]}' WHERE version = 2"""),
        "the change to version 2 is not what was written",
    ),
    "gap": (lambda p: database(p, "DELETE FROM changes WHERE version = 1"), "version 1 is missing"),
    "snapshot": (lambda p: database(p, "UPDATE snapshots SET world = '{}'"), "the snapshot of version 0 is not what was written"),
    "pages": (scribble, "cannot read the store: database disk image is malformed|cannot (open|read) the store"),
}  # fmt: skip


@pytest.mark.parametrize("read_only", [False, True])
@pytest.mark.parametrize("kind", FOREIGN)
def test_a_foreign_or_damaged_store_is_refused_with_a_message_of_one_line(path, kind, read_only):
    spoil, message = FOREIGN[kind]
    spoil(path)
    with pytest.raises(StoreError, match=message) as caught:
        KnowledgeBase.open(schema(), path, read_only=read_only)
    assert "world.kb" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("read_only", [False, True])
def test_a_store_in_no_folder_is_refused(tmp_path, read_only):
    with pytest.raises(StoreError, match=r"there is no folder '.*nowhere' for a store to be in"):
        KnowledgeBase.open(schema(), tmp_path / "nowhere" / "world.kb", read_only=read_only)


# --- the lock file


def test_the_lock_file_goes_with_the_lock(path):
    with KnowledgeBase.open(None, path), pytest.raises(StoreError, match=f"process {os.getpid()}"):
        KnowledgeBase.open(None, path)
    scribble(path)
    with pytest.raises(StoreError):
        KnowledgeBase.open(schema(), path)
    assert [one.name for one in path.parent.iterdir() if one.name.endswith("-lock")] == []


def test_a_lock_that_is_given_back_while_another_takes_it_is_held_by_one(path, monkeypatch):
    """The other has opened the file already when it is taken away."""
    first = WriterLock(path)
    flock = fcntl.flock

    def late(file, operation):
        first.release()
        flock(file, operation)

    monkeypatch.setattr("knowledge_base.journal.sidecar_files.fcntl.flock", late)
    second = WriterLock(path)
    monkeypatch.undo()
    with pytest.raises(StoreError, match="another writer"):
        WriterLock(path)
    second.release()
    WriterLock(path).release()


def test_a_lock_that_was_taken_over_is_not_given_back_for_the_other(path):
    first = WriterLock(path)
    path.with_name("world.kb-lock").unlink()  # as on a file system that knows no locks
    second = WriterLock(path)
    first.release()
    with pytest.raises(StoreError, match="another writer"):
        WriterLock(path)
    second.release()


def test_odd_names_of_files_are_taken_literally(tmp_path):
    path = tmp_path / "100% ?mode=ro&x#y.kb"
    with KnowledgeBase.open(schema(), path) as kb:
        kb.apply(Delta(nodes={"cup1": "cup"}), author="a")
        assert kb.at(version=1).objects("cup") == ["cup1"]
    assert path.exists()

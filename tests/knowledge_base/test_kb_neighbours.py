"""The files beside a store: each name is known as the store's, and nobody's own file of such a name is lost."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from knowledge_base import Delta, KnowledgeBase, Schema, fact
from knowledge_base.journal.neighbours import ENDINGS, is_database, store_owning

SCHEMA = Schema.parse("(define (domain d) (:types cup) (:predicates (clean ?c - cup)) (:constants c1 - cup))")
CLEAN = Delta(added=(fact("clean", "c1"),))
OTHER = "import sqlite3, sys; c = sqlite3.connect(sys.argv[1]); c.execute('SELECT 1 FROM changes'); c.close()"


@pytest.fixture
def store(tmp_path) -> Path:
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


def test_what_is_no_database_belongs_to_no_store(tmp_path) -> None:
    (tmp_path / "text").write_text("SQLite format 3\n" * 100, encoding="utf-8")
    (tmp_path / "empty").touch()
    os.mkfifo(tmp_path / "fifo")  # to open it would wait for a writer
    for name in ("text", "empty", "fifo", "fifo-wal", "missing", ".", "-wal", "n" * 300, "nul\0", "/dev/full"):
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

"""A store is there as a whole or not at all, whenever the program that makes it dies."""

from __future__ import annotations

import os
import sys
from itertools import count

import pytest

from dsc.sequencer.run_tables import has_run
from knowledge_base import Delta, InputError, KnowledgeBase, Schema, fact
from knowledge_base.errors import StoreError
from knowledge_base.journal import journal, making

SCHEMA = Schema.parse("(define (domain d) (:types cup) (:predicates (clean ?c - cup)) (:constants c1 - cup))")
CLEAN = Delta(added=(fact("clean", "c1"),))


def dies_at(line: int, path) -> bool:
    """Whether a program died that makes a store, at that line of those which make it; else it has made one."""
    child = os.fork()
    if child == 0:
        lines = count()

        def trace(frame, happens, _):
            if frame.f_code.co_filename not in (making.__file__, journal.__file__):
                return None
            if happens == "line" and next(lines) == line:
                os._exit(9)
            return trace

        sys.settrace(trace)
        KnowledgeBase.open(SCHEMA, path)
        os._exit(0)
    _, status = os.waitpid(child, 0)
    return os.waitstatus_to_exitcode(status) == 9


def test_whenever_its_maker_dies_the_next_one_makes_it(tmp_path):
    deaths = 0
    for line in count():
        (folder := tmp_path / f"{line}").mkdir()
        path = folder / "s.kb"
        died = dies_at(line, path)
        assert not has_run(path)
        with KnowledgeBase.open(SCHEMA, path) as kb:
            kb.apply(CLEAN, "me")
            assert kb.nodes() == {"c1": "cup"}
        assert [file.name for file in folder.iterdir()] == ["s.kb"]
        if not died:
            break
        deaths += 1
    assert deaths > 20


def test_a_file_without_content_is_no_store_yet(tmp_path):
    path = tmp_path / "s.kb"
    path.touch()
    assert not has_run(path)
    with pytest.raises(InputError, match="there is no store"):
        KnowledgeBase.open(None, path)
    with pytest.raises(StoreError, match="there is no store"):
        KnowledgeBase.open(SCHEMA, path, read_only=True)
    with KnowledgeBase.open(SCHEMA, path) as kb:
        assert kb.nodes() == {"c1": "cup"}


def test_what_is_left_of_an_earlier_store_does_not_come_back(tmp_path):
    path = tmp_path / "s.kb"
    with KnowledgeBase.open(SCHEMA, path) as kb:
        kb.apply(CLEAN, "me")
        log = (tmp_path / "s.kb-wal").read_bytes()
    path.unlink()
    (tmp_path / "s.kb-wal").write_bytes(log)
    with KnowledgeBase.open(SCHEMA, path) as kb:
        assert not kb.ask("(clean c1)")
        assert kb.version == 0


def test_what_cannot_be_made_leaves_nothing(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(making.Path, "rename", full)
    with pytest.raises(StoreError, match=r"cannot make the store '.*s.kb': No space left on device"):
        KnowledgeBase.open(SCHEMA, tmp_path / "s.kb")
    assert list(tmp_path.iterdir()) == []

"""A store is there as a whole or not at all, whenever the program that makes it dies."""

from __future__ import annotations

import os
import sys
from itertools import count

import pytest

from dsc.runs.archive import has_run
from knowledge_base import Delta, KnowledgeBase, Schema, fact
from knowledge_base.errors import StoreError
from knowledge_base.journal import file, journal, sidecar_files

SCHEMA = Schema.parse("(define (domain d) (:types cup) (:predicates (clean ?c - cup)) (:constants c1 - cup))")
CLEAN = Delta(added=(fact("clean", "c1"),))


def dies_at(line: int, path) -> bool:
    """Whether a program died that makes a store, at that line of those which make it; else it has made one."""
    child = os.fork()
    if child == 0:
        lines = count()

        def trace(frame, happens, _):
            if frame.f_code.co_filename not in {part.__file__ for part in (journal, file, sidecar_files)}:
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
    for line in count(step=2):  # each second line: a statement of several lines is one action of the system
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


def test_a_system_without_nameless_files_makes_it_under_another_name_first(tmp_path, monkeypatch):
    monkeypatch.delattr(os, "O_TMPFILE")
    with KnowledgeBase.open(SCHEMA, tmp_path / "s.kb", durability="power") as kb:
        kb.apply(CLEAN, "me")
    assert [file.name for file in tmp_path.iterdir()] == ["s.kb"]
    (tmp_path / "x").touch()
    with pytest.raises(FileExistsError):
        sidecar_files.place(tmp_path / "x", b"new")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["s.kb", "x"]


def test_a_store_that_cannot_be_created_leaves_no_file(tmp_path, monkeypatch):
    link = os.link

    def full(source, target, **how):
        if target.name == "s.kb":
            raise OSError(28, "No space left on device")
        link(source, target, **how)

    monkeypatch.setattr(os, "link", full)
    with pytest.raises(StoreError, match=r"cannot make the store '.*s.kb': No space left on device"):
        KnowledgeBase.open(SCHEMA, tmp_path / "s.kb")
    assert list(tmp_path.iterdir()) == []

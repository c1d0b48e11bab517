"""Every reader ends: what is too large, silent or without end is refused by name, and reading is linear."""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

from knowledge_base import KnowledgeBase
from knowledge_base.cli import app
from knowledge_base.errors import InputError, ParseError, SchemaError
from knowledge_base.journal.sidecar_files import is_database
from knowledge_base.pddl import files
from knowledge_base.pddl.domain_text import MOST_IMPLIED, parse_domain
from knowledge_base.world.schema import MAX_TYPE_DEPTH, MAX_TYPES, Schema

DOMAIN = "(define (domain d) (:types item - object) (:predicates (clean ?x - item)))"
PROBLEM = "(define (problem p) (:domain d) (:objects cup1 - item) (:init (clean cup1)) (:goal (clean cup1)))"


def steps_of(work) -> int:
    """Lines of Python that the work takes: a measure of time that no other program disturbs."""
    lines = 0

    def count(_frame, event, _arg):
        nonlocal lines
        lines += event == "line"
        return count

    sys.settrace(count)
    try:
        work()
    except InputError:
        pass
    finally:
        sys.settrace(None)
    return lines


@pytest.mark.parametrize("read", [Schema.from_pddl, KnowledgeBase.from_json])
def test_a_device_without_end_is_refused_at_the_bound(read, monkeypatch):
    monkeypatch.setattr(files, "MAX_BYTES", 1000)
    monkeypatch.setattr("knowledge_base.exchange.MAX_WORLD_BYTES", 1000)
    with pytest.raises(InputError, match="/dev/zero: the text has 1001 bytes; at most 1000 are read"):
        read(Path("/dev/zero"))


def test_a_file_beyond_the_bound_is_refused_and_one_at_the_bound_is_read(tmp_path):
    file = tmp_path / "d.pddl"
    file.write_text(DOMAIN)
    assert files.read_text(file, most=len(DOMAIN)) == DOMAIN
    with pytest.raises(InputError, match=rf"the text has {len(DOMAIN)} bytes; at most {len(DOMAIN) - 1} are read"):
        files.read_text(file, most=len(DOMAIN) - 1)


def test_a_pipe_that_nobody_writes_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "WRITER_S", 0.05)
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(
        InputError, match=r"cannot read the file: it is a pipe, and no process wrote into it for 0\.05 s"
    ):
        files.read_text(pipe)


def test_a_pipe_whose_writer_stays_silent_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "SILENCE_S", 0.05)
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    writer = os.open(pipe, os.O_RDWR)
    os.write(writer, b"(define")
    with pytest.raises(InputError, match=r"cannot read the file: nothing came for 0\.05 s"):
        files.read_text(pipe)
    os.close(writer)


def test_a_pipe_is_read_once_as_a_file_is(tmp_path):
    """Formerly the command looked for a store in it first, and what it read there was gone."""
    (tmp_path / "domain.pddl").write_text(DOMAIN)
    for content, kind in ((PROBLEM, "pddl"), (KnowledgeBase(Schema.parse(DOMAIN)).to_json(), "json")):
        pipe = tmp_path / f"pipe.{kind}"
        os.mkfifo(pipe)
        assert not is_database(pipe)
        writer = threading.Thread(target=pipe.write_text, args=(content,))
        writer.start()
        result = CliRunner().invoke(app, ["show", str(pipe), "--json"])
        writer.join()
        assert result.exit_code == 0, result.output
        assert "objects" in json.loads(result.stdout)


def test_a_mark_of_byte_order_says_nothing(tmp_path):
    (tmp_path / "domain.pddl").write_text(DOMAIN)
    world = tmp_path / "w.json"
    world.write_text(KnowledgeBase(Schema.parse(DOMAIN)).to_json(), encoding="utf-8-sig")
    assert CliRunner().invoke(app, ["show", str(world)]).exit_code == 0


def test_lines_are_read_one_by_one_each_with_a_bound(tmp_path):
    file = tmp_path / "lines"
    file.write_bytes(b"one\ntwo\n\nfour")
    assert list(files.read_lines(file, most=100, longest=4)) == ["one", "two", "", "four"]
    (tmp_path / "empty").write_bytes(b"")
    assert list(files.read_lines(tmp_path / "empty", most=100, longest=4)) == [""]
    with pytest.raises(InputError, match="lines:4: a line has at most 3 bytes"):
        list(files.read_lines(file, most=100, longest=3))
    with pytest.raises(InputError, match="/dev/zero:1: a line has at most 5 bytes"):
        list(files.read_lines(Path("/dev/zero"), most=1 << 40, longest=5))
    file.write_bytes(b"one\ntw\xff\n")
    with pytest.raises(ParseError, match="lines:2:3: the file is not UTF-8: it cannot have the byte 0xff here"):
        list(files.read_lines(file, most=100, longest=4))


def test_a_repeated_name_in_json_is_found_in_one_pass():
    names = [f'"o{one}": 1' for one in range(10_000)]
    before = time.process_time()
    with pytest.raises(ParseError, match="'o9999' is there twice"):
        KnowledgeBase.from_json("{" + ", ".join([*names, names[-1]]) + "}")
    assert time.process_time() - before < 1  # comparing each with each took over three seconds


def _types(number: int) -> str:
    written = " ".join(f"t{one} - u{one}" for one in range(number))
    return f"(define (domain d) (:types {written}))"


def test_undeclared_types_are_compared_with_the_declared_only_while_they_are_few():
    assert len(parse_domain(_types(MOST_IMPLIED)).implied_types()) == MOST_IMPLIED
    assert not parse_domain(_types(MOST_IMPLIED + 1)).implied_types()
    assert steps_of(lambda: Schema.parse(_types(400))) < 2.5 * steps_of(lambda: Schema.parse(_types(200)))


def test_types_are_bounded_in_number_and_depth():
    chain = " ".join(f"t{one} - t{one + 1}" for one in range(MAX_TYPE_DEPTH + 1))
    with pytest.raises(SchemaError, match=f"is more than {MAX_TYPE_DEPTH} levels below 'object'"):
        Schema.parse(f"(define (domain d) (:types {chain} t{MAX_TYPE_DEPTH + 1} - object))")
    with pytest.raises(SchemaError, match=f"a schema has at most {MAX_TYPES}"):
        Schema(types={f"t{one}": "object" for one in range(MAX_TYPES + 1)})


TEXTS = {
    "objects": lambda n: PROBLEM.replace("cup1 - item", " ".join(f"o{one}" for one in range(n)) + " cup1 - item"),
    "repeated objects": lambda n: PROBLEM.replace("cup1 - item", "cup1 " * n + "- item"),
    "facts": lambda n: PROBLEM.replace("(clean cup1)) (:goal", "(clean cup1) " * n + ") (:goal"),
    "a goal": lambda n: PROBLEM.replace(":goal (clean cup1)", ":goal (and " + "(clean cup1) " * n + ")"),
    "a word": lambda n: PROBLEM.replace("cup1 - item", "x" * n + " cup1 - item"),
    "dashes": lambda n: PROBLEM.replace("cup1 - item", "- item " * n + "cup1 - item"),
    "comments": lambda n: PROBLEM + ";\n" * n,
    "parentheses": lambda n: PROBLEM + "(" * n,
    "quotes": lambda n: PROBLEM + '"a' * n,
}


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS.keys())
def test_reading_a_problem_takes_time_in_proportion(text):
    from knowledge_base.pddl import parse_problem

    schema = Schema.parse(DOMAIN)
    one, two = (steps_of(lambda n=n: parse_problem(text(n), schema)) for n in (150, 300))
    assert two < 2.3 * one

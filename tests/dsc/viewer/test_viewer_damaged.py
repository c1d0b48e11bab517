"""Traces that are damaged: what can be read is shown, what cannot is named with its line, and nothing is passed over."""

from __future__ import annotations

import json

import pytest

pytest.importorskip("starlette", reason="the extra `viewer` is not installed")
pytest.importorskip("uvicorn", reason="the extra `viewer` is not installed")

from typer.testing import CliRunner

from dsc.trace import header
from dsc.viewer.queries import PageQueries
from dsc.viewer.records import RecordLog, read_trace
from knowledge_base import InputError

HEADER = header(run="test")
LINES = [f'{{"seq": {seq}, "t": {seq / 2}, "type": "log", "cause": null, "text": "note {seq}"}}' for seq in range(1, 8)]


def read(tmp_path, *lines: str | bytes, end: str = "\n"):
    path = tmp_path / "run.jsonl"
    path.write_bytes(b"\n".join(one if isinstance(one, bytes) else one.encode() for one in lines) + end.encode())
    return read_trace(path)


def shown(log) -> list[str]:
    """What each record says, `-` for one that is damaged."""
    found = [json.loads(log.line(seq)) for seq in range(1, len(log) + 1)]
    assert [one["seq"] for one in found] == list(range(1, len(log) + 1))
    return ["-" if one["type"] == "damaged" else one["text"].removeprefix("note ") for one in found]


def swapped(line: str, number: int, seq: int) -> str:
    return line.replace(f'"seq": {number},', f'"seq": {seq},')


DAMAGES = {
    "noise": "\x00\x07garbage",
    "no UTF-8": LINES[2].encode().replace(b"note", b"n\xffte"),
    "half": LINES[2][:30],
    "the other half": LINES[2][30:],
    "another value": "[3]",
    "no number": '{"seq": "3", "t": 1.0}',
    "truth for a number": '{"seq": true, "t": 1.0}',
    "a flipped digit": swapped(LINES[2], 3, 97),
    "a number before": swapped(LINES[2], 3, 1),
}


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_the_rest_is_shown_and_the_damaged_record_named_with_its_line(tmp_path, damage) -> None:
    log = read(tmp_path, HEADER, *LINES[:2], damage, *LINES[3:])
    assert shown(log) == ["1", "2", "-", "4", "5", "6", "7"]
    (complaint,) = log.complaints
    assert "run.jsonl:4: record 3 is damaged: it " in complaint
    record = log.record(3)
    assert (record["t"], record["cause"], record["line"]) == (1.0, None, 4)
    assert record["why"] in complaint


def test_a_record_broken_in_two_or_told_twice_does_not_hide_those_after_it(tmp_path) -> None:
    log = read(tmp_path, HEADER, *LINES[:2], LINES[2][:20], LINES[2][20:], *LINES[3:])
    assert (shown(log), len(log.complaints)) == (["1", "2", "-", "4", "5", "6", "7"], 2)
    log = read(tmp_path, HEADER, *LINES[:3], LINES[2], "", *LINES[3:])
    assert (shown(log), len(log.complaints)) == (["1", "2", "3", "4", "5", "6", "7"], 1)


def test_a_last_line_that_was_cut_is_said_and_the_rest_is_there(tmp_path) -> None:
    for size in (1, 20, len(LINES[-1]) - 1):
        log = read(tmp_path, HEADER, *LINES[:-1], LINES[-1][:size], end="")
        assert shown(log)[-2:] == ["6", "-"]
        assert "record 7 is damaged: it ends in the middle" in log.complaints[0]
    assert read(tmp_path, HEADER, *LINES, end="").complaints == []


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ([], "run.jsonl:1: the file is empty"),
        ([""] * 3, "run.jsonl:1: the file is empty"),
        ([HEADER[:-3], *LINES], "run.jsonl:1: the first line of this trace is damaged"),
        (['{"format": "dsc-trace", "version": 9}', *LINES], "run.jsonl:1: a trace of version 9; this program reads version 2"),
        (['{"format": "dsc-trace"}', *LINES], "a trace of version null"),
        (['{"format": "dsc-trace", "version": ' + "[" * 100_000, *LINES], "the first line of this trace is damaged"),
        (LINES, "neither a store nor a trace"),
        ([HEADER, LINES[0], *LINES[2:]], "run.jsonl:3: this is not record 2 of a trace"),
        ([HEADER, *reversed(LINES)], "this is not record"),
        ([HEADER, *LINES[:3], "junk", *LINES[5:]], "this is not record"),
    ],
)  # fmt: skip
def test_a_damaged_trace_is_refused_with_its_line(tmp_path, lines, message) -> None:
    with pytest.raises(InputError) as refused:
        read(tmp_path, *lines)
    assert message in str(refused.value)


def test_the_command_names_what_is_damaged(tmp_path, monkeypatch) -> None:
    from dsc.cli import view
    from planning.cli.command import app

    path = tmp_path / "run.jsonl"
    monkeypatch.setattr(view, "until_interrupt", lambda _viewer: None)
    path.write_text("\n".join([HEADER, *(line[:-1] for line in LINES)]))
    said = CliRunner().invoke(app, ["view", str(path), "--no-open"])
    assert (said.exit_code, said.stderr.count("is damaged: it ends in the middle")) == (0, 5)
    assert f"{path}: 2 more records are damaged" in said.stderr
    path.write_text(HEADER)
    assert "there are no records" in CliRunner().invoke(app, ["view", str(path), "--no-open"]).stderr


@pytest.mark.parametrize(
    "damage",
    [
        '"added": [["on"',
        '"version": 2, "added": 7}',
        '"version": 2, "added": [[]]}',
        '"version": 2, "nodes": [1]}',
    ],
)
def test_a_question_about_what_a_damaged_record_changed_is_refused_with_its_number(damage) -> None:
    lines = [LINES[0], f'{{"seq": 2, "t": 1.0, "type": "knowledge", "cause": null, {damage}', LINES[2]]
    answers = PageQueries(RecordLog(HEADER, lines))
    assert answers.facts({"seq": 1})["facts"] == []
    with pytest.raises(InputError, match="record 2 is damaged"):
        answers.facts({"seq": 3})

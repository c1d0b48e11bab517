"""What the viewer reads and answers is bounded, and what it is told by a browser costs a run little."""

from __future__ import annotations

from pathlib import Path

import pytest

from dsc.trace import header
from dsc.viewer.answers import Answers
from dsc.viewer.records import RecordLog, read_trace
from knowledge_base import InputError


def test_a_trace_is_read_no_further_than_its_bounds(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("dsc.viewer.records.MAX_LINE_BYTES", 1000)
    with pytest.raises(InputError, match="/dev/zero:1: a line has at most 1000 bytes"):
        read_trace(Path("/dev/zero"))
    path = tmp_path / "run.jsonl"
    path.write_text(header() + "\n" + '{"seq": 1, "t": 0, "type": "end", "cause": null}\n', encoding="utf-8")
    assert len(read_trace(path)) == 1
    monkeypatch.setattr("dsc.viewer.records.MAX_TRACE_BYTES", path.stat().st_size - 1)
    with pytest.raises(InputError, match="bytes; at most"):
        read_trace(path)


@pytest.mark.parametrize("said", ['"schema": 7', '"version": 1, "schema": ' + "[" * 10_000, '"schema": {"types": {}}'])
def test_a_damaged_record_is_named_by_who_asks_about_the_knowledge(said) -> None:
    log = RecordLog(lines=[f'{{"seq": 1, "t": 0.0, "type": "world", "cause": null, {said}}}'])
    with pytest.raises(InputError, match="record 1 is damaged"):
        Answers(log).facts({"seq": 1})

"""What the viewer reads and answers is bounded, and what a browser asks for costs a run little."""

from __future__ import annotations

import asyncio
import socket
import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("starlette", reason="the extra `viewer` is not installed")
pytest.importorskip("uvicorn", reason="the extra `viewer` is not installed")

from dsc.trace import Record, header
from dsc.viewer import queries
from dsc.viewer.access import PageAddress
from dsc.viewer.control import MOST_BREAKS, MOST_STATEMENTS, MOST_WORK, Control
from dsc.viewer.queries import PageQueries
from dsc.viewer.records import RecordLog, read_trace
from dsc.viewer.server import Viewer
from knowledge_base import Delta, InputError, KnowledgeBase, Schema
from knowledge_base.exchange import schema_form, world_form

DOMAIN = """(define (domain d) (:types item - object)
    (:predicates (clean ?x - item)) (:functions (weight ?x - item)))"""
CARTESIAN = "(and (item ?a) (item ?b) (item ?c) (item ?d) (not (= ?a ?b)))"
NEST = "(exists (?a ?b ?c ?d - item) (not (= ?d ?d)))"


def known(items: int) -> KnowledgeBase:
    kb = KnowledgeBase(Schema.parse(DOMAIN))
    kb.apply(Delta(nodes={f"o{number}": "item" for number in range(items)}), author="test")
    return kb


@pytest.fixture(scope="module")
def log():
    kb, log = known(100), RecordLog()
    world = {"version": kb.version, "schema": schema_form(kb.schema), **world_form(kb.snapshot())}
    log.receive(Record(1, 0.0, "world", None, world))
    return log


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


def test_a_browser_gets_so_many_answers_and_learns_that_there_are_more(log, monkeypatch) -> None:
    monkeypatch.setattr(queries, "MOST_ANSWERS", 7)
    said = PageQueries(log).query({"seq": 1, "expression": CARTESIAN})
    assert len(said["answers"]) == 7
    assert said["more"]
    assert "more" not in PageQueries(log).query({"seq": 1, "expression": "(and (item ?a) (= ?a o3))"})
    facts = PageQueries(log).facts({"seq": 1})
    assert len(facts["things"]) == 7
    assert facts["more"]


def test_a_question_of_a_browser_is_given_up_after_some_seconds(log, monkeypatch) -> None:
    monkeypatch.setattr(queries, "MOST_SECONDS", 0.05)
    with pytest.raises(InputError, match=r"takes longer than 0\.05 s"):
        PageQueries(log).query({"seq": 1, "expression": NEST})


def test_an_answer_without_its_reason_is_an_answer(log, monkeypatch) -> None:
    monkeypatch.setattr(queries, "MOST_EXPLAINED", -1.0)
    said = PageQueries(log).query({"seq": 1, "expression": "(item o3)"})
    assert said["holds"]
    assert said["why"]["truth"]
    assert "takes longer than" in said["why"]["detail"]


def test_an_expression_of_a_browser_is_no_longer_than_its_bound(log, monkeypatch) -> None:
    monkeypatch.setattr(queries, "MOST_TEXT", 10)
    with pytest.raises(InputError, match="'expression' has 12 characters; a browser may send 10"):
        PageQueries(log).query({"seq": 1, "expression": "(clean o333)"})


def test_a_question_ends_when_its_browser_leaves(log, monkeypatch) -> None:
    """Formerly it went on in the thread that it had been given."""
    begun, ended = threading.Event(), threading.Event()
    real = PageQueries.query

    def query(self, asked, left):
        begun.set()
        try:
            return real(self, asked, left)
        finally:
            ended.set()

    monkeypatch.setattr(PageQueries, "query", query)
    viewer = Viewer(log, PageAddress.on())
    viewer.start()
    try:
        body = f'{{"seq": 1, "expression": "{NEST}"}}'
        with socket.create_connection(("127.0.0.1", viewer.port)) as browser:
            browser.sendall(
                f"POST /query?token={viewer.token} HTTP/1.1\r\nHost: 127.0.0.1:{viewer.port}\r\n"
                f"Origin: http://127.0.0.1:{viewer.port}\r\nContent-Type: application/json\r\n"
                f"Content-Length: {len(body)}\r\n\r\n{body}".encode()
            )
            assert begun.wait(10)
            assert not ended.is_set()
        assert ended.wait(queries.MOST_SECONDS - 1)
    finally:
        viewer.close()


def controlled(kb, act) -> Control:
    """A control whose run is nothing but its knowledge; `act` is called in the browser's thread."""

    async def run() -> Control:
        control = Control(lambda: None)
        listeners: list[Any] = []
        control.attach(SimpleNamespace(  # type: ignore[arg-type]
            knowledge=kb, listen=listeners.append, wait_before_events=lambda _: None,
            change=lambda delta, author: kb.apply(delta, author=author),
        ))  # fmt: skip
        await asyncio.to_thread(act, control, listeners[0])
        return control

    return asyncio.run(run())


@pytest.fixture
def step():
    return SimpleNamespace(microsteps=())


def test_a_condition_that_costs_too_much_is_no_breakpoint(step) -> None:
    def act(control, after_step) -> None:
        with pytest.raises(InputError, match=f"visits more than {MOST_WORK} facts and objects"):
            control.obey({"do": "break", "on": {"condition": NEST}})
        assert control.obey({"do": "breaks"}) == {"ok": True, "breaks": []}
        after_step(step)

    controlled(known(100), act)


def test_a_condition_that_comes_to_cost_too_much_is_dropped_and_the_run_goes_on(step) -> None:
    kb = known(2)

    def act(control, after_step) -> None:
        control.obey({"do": "break", "on": {"condition": NEST}})
        control.obey({"do": "break", "on": {"condition": "(clean o1)"}})
        after_step(step)
        kb.apply(Delta(nodes={f"more{number}": "item" for number in range(100)}), author="test")
        after_step(step)
        assert control.paused is None
        said = control.obey({"do": "breaks"})
        assert [one["on"] for one in said["breaks"]] == ["condition (clean o1)"]
        (dropped,) = said["dropped"]
        assert f"condition {NEST}: the query visits more than {MOST_WORK}" in dropped
        control.obey({"do": "tell", "statements": ["(clean o1)"]})
        after_step(step)
        assert control.paused == "condition (clean o1)"

    controlled(kb, act)


@pytest.mark.parametrize("said", [
    ["(forall (?a ?b ?c ?d - item) (when (= ?a ?d) (clean ?b)))"], [f"(when {NEST} (clean o1))"], ["(clean o1)"] * (MOST_STATEMENTS + 1),
    [f"(and {'(clean o1) ' * 1000})"],
])  # fmt: skip
def test_an_effect_of_a_browser_that_costs_too_much_changes_nothing(said) -> None:
    kb = known(100)

    def act(control, _) -> None:
        with pytest.raises(InputError, match=r"visits more than|a browser may send"):
            control.obey({"do": "tell", "statements": said})

    controlled(kb, act)
    assert kb.version == 1


def test_there_are_only_so_many_breakpoints() -> None:
    def act(control, _) -> None:
        for number in range(MOST_BREAKS):
            control.obey({"do": "break", "on": {"state": f"s{number}"}})
        with pytest.raises(InputError, match=f"there are {MOST_BREAKS} breakpoints"):
            control.obey({"do": "break", "on": {"state": "more"}})

    controlled(known(1), act)

"""The page of a live run, in a process of its own: it is told everything, and nothing that happens to it stops the run."""

from __future__ import annotations

import json
import os
import signal
import threading
from typing import Any

import pytest

pytest.importorskip("starlette", reason="the extra `viewer` is not installed")
pytest.importorskip("uvicorn", reason="the extra `viewer` is not installed")
httpx = pytest.importorskip("httpx", reason="the extra `viewer` is not installed")
websockets = pytest.importorskip("websockets.sync.client", reason="the extra `viewer` is not installed")

from websockets.exceptions import ConnectionClosed  # noqa: E402

from domains.clean_up_table.bringup import deploy  # noqa: E402
from domains.clean_up_table.scenario import Scenario  # noqa: E402
from dsc.trace import Record, header  # noqa: E402
from dsc.viewer.access import PageAddress  # noqa: E402
from dsc.viewer.live import LivePage  # noqa: E402

MUCH = 2000
LONG = "x" * 1000
"""Together they are far more than a pipe or a socket holds."""


@pytest.fixture
def live():
    page = LivePage(header(run="test"), PageAddress.on())
    page.start()
    yield page
    page.close()


def socket(page: LivePage):
    return websockets.connect(
        f"ws://127.0.0.1:{page.port}/socket?token={page.token}", origin=f"http://127.0.0.1:{page.port}", open_timeout=60
    )


def said(connection) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(connection.recv(timeout=60))
    return found


def received(connection, last: int) -> list[dict[str, Any]]:
    connection.send(json.dumps({"want": 1}))
    records: list[dict[str, Any]] = []
    while len(records) < last:
        records += said(connection).get("records", [])
    return records


def until(connection, **how) -> None:
    """Wait until the run is said to be so."""
    while not how.items() <= said(connection).items():
        pass


def note(seq: int, text: str = "x") -> Record:
    return Record(seq, 0.0, "log", None, {"text": text})


def test_all_that_a_run_says_gets_there_as_its_trace_has_it(live):
    texts = ["äöü ☂ 🤖", "two\nlines\u2028or\x85three", '{"seq": ', "half a character: \ud83e", ""]
    heard = [note(seq, text) for seq, text in enumerate(texts, 1)]
    for record in [*heard, Record(len(texts) + 1, 0.5, "end", None)]:
        live.receive(record)
    with socket(live) as connection:
        hello = said(connection)
        assert (hello["header"]["run"], hello["control"]) == ("test", False)
        *notes, end = received(connection, len(texts) + 1)
        assert [record["text"] for record in notes] == texts
        assert end == {"seq": len(texts) + 1, "t": 0.5, "type": "end", "cause": None}


def test_the_end_of_a_live_run_is_sent_to_the_page(live):
    with socket(live) as connection:
        live.end()
        until(connection, ended=True, live=False)


def test_a_page_that_stands_still_does_not_make_the_run_wait_and_misses_nothing(live):
    with socket(live) as connection:
        said(connection)
        os.kill(live._process.pid, signal.SIGSTOP)
        for seq in range(1, MUCH + 1):  # it would never end if it had to wait
            live.receive(note(seq, LONG))
        os.kill(live._process.pid, signal.SIGCONT)
        assert [record["seq"] for record in received(connection, MUCH)] == list(range(1, MUCH + 1))


def test_a_run_goes_on_without_its_page(live):
    live._process.kill()
    live.wait()
    for seq in range(1, MUCH + 1):
        live.receive(note(seq, LONG))
    for thread in live._threads:
        thread.join(timeout=60)
    before = live._lines.qsize()
    live.receive(note(MUCH + 1))
    assert live._lines.qsize() == before  # nothing is kept for nobody


def test_a_page_ends_with_the_program_that_it_belongs_to(live):
    process = live._process
    live.receive(note(1))
    with socket(live) as connection:
        received(connection, 1)
        live.close()
        assert process.returncode == 0
        with pytest.raises(ConnectionClosed):
            until(connection, type="nothing of the kind")


def test_a_page_that_nobody_started_gives_its_address_back():
    entrance = PageAddress.on()
    port = entrance.port
    LivePage(header(), entrance).close()
    PageAddress.on(port).listening.close()


@pytest.fixture
def held():
    """A run that stands still before its first event, and a browser that may change it."""
    page = LivePage(header(), PageAddress.on(), control=True)
    page.start()
    table = deploy(Scenario.parse("table: {cups: 1}"), 1, 0.0, listener=page.receive)
    page.control._steps = 0

    def run() -> None:
        with table:
            table.report(prepare=page.control.attach)
        page.end()

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    origin = f"http://127.0.0.1:{page.port}"
    with httpx.Client(base_url=origin, headers={"Origin": origin}, params={"token": page.token}, timeout=60) as client:
        yield page, lambda **command: client.post("/control", json=command)
    page.close()
    thread.join(timeout=60)


def test_commands_get_to_the_run_and_what_it_says_to_them_back(held):
    page, command = held
    with socket(page) as connection:
        assert said(connection)["control"] is True
        until(connection, paused="on request")
        answer = command(do="break", on={"event": "plan_found"})
        assert answer.json() == {"ok": True, "breaks": [{"number": 1, "on": "event plan_found"}]}
        command(do="resume")
        until(connection, paused="event plan_found")
        wrong = command(do="tell", statements=["(onn a b)"])
        assert (wrong.status_code, "there is no predicate 'onn'" in wrong.json()["error"]) == (400, True)
        assert command(do="event", attributes=7).status_code == 400  # whatever is wrong with it
        command(do="unbreak", number=1)
        command(do="resume")
        until(connection, ended=True)
        over = command(do="pause")
        assert (over.status_code, over.json()) == (400, {"error": "the run is over, or has not begun"})

"""The viewer over real sockets on this machine: who is let in, what is sent, what is answered."""

from __future__ import annotations

import json
from importlib import import_module
from typing import Any

import pytest

pytest.importorskip("starlette", reason="the extra `viewer` is not installed")
pytest.importorskip("uvicorn", reason="the extra `viewer` is not installed")
httpx = pytest.importorskip("httpx", reason="the extra `viewer` is not installed")
websockets = pytest.importorskip("websockets.sync.client", reason="the extra `viewer` is not installed")

from domains.clean_up_table.bringup import deploy  # noqa: E402
from domains.clean_up_table.scenario import Scenario  # noqa: E402
from dsc.trace import header  # noqa: E402
from dsc.viewer.access import PageAddress  # noqa: E402
from dsc.viewer.records import RecordLog, read_trace  # noqa: E402
from dsc.viewer.server import Viewer  # noqa: E402
from knowledge_base import InputError  # noqa: E402

SCENARIO = "table: {cups: 2}\n"


@pytest.fixture(scope="module")
def run():
    """A recorded run, its knowledge at the end, and what the knowledge was at each version."""
    log = RecordLog(header(run="test"), live=True)
    table = deploy(Scenario.parse(SCENARIO), seed=1, faults=0.0, listener=log.receive)
    with table as robot:
        table.report()
    log.end()
    return log, robot.knowledge


@pytest.fixture(scope="module")
def viewer(run):
    viewer = Viewer(run[0], PageAddress.on())
    viewer.start()
    yield viewer
    viewer.close()


@pytest.fixture
def page(viewer):
    """A browser that has opened the address: it has the cookie."""
    with httpx.Client(base_url=f"http://127.0.0.1:{viewer.port}", headers=origin(viewer)) as client:
        client.get("/", params={"token": viewer.token})
        yield client


def origin(viewer) -> dict[str, str]:
    return {"Origin": f"http://127.0.0.1:{viewer.port}"}


def socket(viewer, **how):
    how = {"origin": origin(viewer)["Origin"], **how}
    return websockets.connect(f"ws://127.0.0.1:{viewer.port}/socket?token={viewer.token}", **how)


def received(connection, last: int) -> list[dict[str, Any]]:
    records: list[dict[str, Any]] = []
    while not records or records[-1]["seq"] < last:
        said = json.loads(connection.recv(timeout=10))
        if said["type"] == "records":
            assert [r["seq"] for r in said["records"]] == list(range(said["from"], said["from"] + len(said["records"])))
            records += said["records"]
    return records


@pytest.mark.parametrize(
    ("token", "headers", "reason"),
    [
        ("wrong", {}, "token"),
        ("", {}, "token"),
        (None, {"Host": "evil.example"}, "Host"),
        (None, {"Host": "127.0.0.1:1"}, "Host"),
        (None, {"Origin": "http://evil.example"}, "Origin"),
        (None, {"Origin": "null"}, "Origin"),
    ],
)
def test_others_are_refused_with_a_reason(viewer, token, headers, reason) -> None:
    asked = {"token": viewer.token if token is None else token}
    for path in ("/", "/record/1"):
        answer = httpx.get(f"http://127.0.0.1:{viewer.port}{path}", params=asked, headers=headers)
        assert (answer.status_code, reason in answer.text) == (403, True)
    # A request to become a socket, by hand: the client library writes Host itself.
    upgrade = {"Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13",
               "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA=="}  # fmt: skip
    answer = httpx.get(
        f"http://127.0.0.1:{viewer.port}/socket", params=asked, headers={**origin(viewer), **upgrade, **headers}
    )
    assert answer.status_code == 403


def test_a_request_that_asks_something_and_a_socket_must_say_their_origin(viewer) -> None:
    url = f"http://127.0.0.1:{viewer.port}/query?token={viewer.token}"
    answer = httpx.post(url, json={"seq": 1, "expression": "(hand-free)"})
    assert answer.status_code == 403
    assert f"needs the header 'Origin: http://127.0.0.1:{viewer.port}'" in answer.text
    with pytest.raises(import_module("websockets.exceptions").InvalidStatus, match="403"):
        socket(viewer, origin=None)


def test_the_cookie_lets_in_and_every_answer_has_its_guards(page) -> None:
    answer = page.get("/record/1")
    assert answer.status_code == 200
    assert "script-src" not in answer.headers["content-security-policy"]  # so default-src 'self' holds: none inline
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert answer.headers["referrer-policy"] == "no-referrer"


def test_all_records_come_without_a_gap_from_where_they_are_wanted(run, viewer) -> None:
    log, _ = run
    with socket(viewer) as connection:
        hello = json.loads(connection.recv(timeout=10))
        assert (hello["type"], hello["last"], hello["live"], hello["control"]) == ("hello", len(log), False, False)
        connection.send(json.dumps({"want": 1}))
        assert received(connection, len(log)) == [log.record(seq) for seq in range(1, len(log) + 1)]
        connection.send(json.dumps({"want": len(log) - 2}))
        assert [r["seq"] for r in received(connection, len(log))][-3:] == [len(log) - 2, len(log) - 1, len(log)]


def test_new_records_follow_and_the_end_is_told() -> None:
    log = RecordLog(header(run="live"), ['{"seq": 1, "t": 0.0, "type": "log", "cause": null}'], live=True)
    viewer = Viewer(log, PageAddress.on())
    viewer.start()
    try:
        with socket(viewer) as connection:
            connection.send(json.dumps({"want": 1}))
            assert received(connection, 1)[0]["type"] == "log"
            log.append('{"seq": 2, "t": 1.0, "type": "end", "cause": 1}')
            log.end()
            said: list[dict[str, Any]] = []
            while not {"records", "status"} <= {one["type"] for one in said}:
                said.append(json.loads(connection.recv(timeout=10)))
            assert [r["type"] for one in said for r in one.get("records", ())] == ["end"]
            assert said[-1].get("ended", True)
    finally:
        viewer.close()


def test_the_knowledge_of_any_moment_is_asked(run, page) -> None:
    log, kb = run
    for seq in range(1, len(log) + 1, 7):
        said = page.post("/facts", json={"seq": seq}).json()
        then = kb.at(version=said["version"]) if said["version"] else None
        if then is not None:
            assert said["things"] == then.nodes()
            assert {tuple(f) for f in said["facts"]} == {(f.predicate, *f.args) for f in then.facts()}
    last = page.post("/query", json={"seq": len(log), "expression": "(robot-at ?p)"}).json()
    assert last["answers"] == kb.query("(robot-at ?p)")
    first = page.post("/query", json={"seq": 5, "expression": "(exists (?i - item) (tidy ?i))"}).json()
    assert (first["holds"], first["why"]["truth"]) == (False, False)


def test_facts_about_an_object_all_name_it(run, page) -> None:
    said = page.post("/facts", json={"seq": len(run[0]), "about": "cup1"}).json()
    assert said["facts"]
    assert all("cup1" in fact for fact in said["facts"])


@pytest.mark.parametrize(
    ("path", "asked", "message"),
    [
        ("/query", {"seq": 1}, "'expression' is a text"),
        ("/query", {"seq": 10**9, "expression": "(hand-free)"}, "there is no record 1000000000"),
        ("/query", {"seq": 9, "expression": "(hand-fre)"}, "did you mean 'hand-free'"),
        ("/query", {"seq": True, "expression": "(hand-free)"}, "'seq' is the number of a record"),
        ("/facts", {"seq": 9, "about": "nobody"}, "there is no object 'nobody'"),
        ("/query", [1], "a request is one JSON object"),
    ],
)
def test_an_invalid_request_is_answered_with_status_400_and_its_error(page, path, asked, message) -> None:
    answer = page.post(path, json=asked)
    assert (answer.status_code, message in answer.json()["error"]) == (400, True)


def test_control_is_refused_unless_it_was_allowed(page) -> None:
    assert page.post("/control", json={"do": "pause"}).status_code == 403


def test_a_port_that_is_taken_is_said(viewer) -> None:
    with pytest.raises(InputError, match=f"cannot listen on port {viewer.port}"):
        PageAddress.on(viewer.port)


def test_a_trace_file_is_read_and_a_damaged_one_refused_with_its_line(run, tmp_path) -> None:
    log, _ = run
    path = tmp_path / "run.jsonl"
    header, lines = json.dumps(log.header), [log.line(seq) for seq in range(1, len(log) + 1)]
    path.write_text("\n".join([header, *lines, ""]), encoding="utf-8")
    read = read_trace(path)
    assert [read.line(seq) for seq in range(1, len(read) + 1)] == lines
    path.write_text("\n".join([header, lines[0], lines[2]]), encoding="utf-8")
    with pytest.raises(InputError, match="jsonl:3: this is not record 2"):
        read_trace(path)
    path.write_text("{}\n", encoding="utf-8")
    with pytest.raises(InputError, match="jsonl:1: neither a store nor a trace"):
        read_trace(path)

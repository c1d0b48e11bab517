"""Malformed requests, frames and bytes: each is answered or closed on, none is a 500, and the terminal stays clean."""

from __future__ import annotations

import asyncio
import json
import socket as sockets
import struct
from contextlib import suppress

import pytest

pytest.importorskip("starlette", reason="the extra `viewer` is not installed")
pytest.importorskip("uvicorn", reason="the extra `viewer` is not installed")
httpx = pytest.importorskip("httpx", reason="the extra `viewer` is not installed")

from hypothesis import given, settings  # noqa: E402
from hypothesis import strategies as st  # noqa: E402

from dsc.events import Event  # noqa: E402
from dsc.trace import header  # noqa: E402
from dsc.viewer.access import PageAddress  # noqa: E402
from dsc.viewer.records import RecordLog  # noqa: E402
from dsc.viewer.server import Viewer  # noqa: E402
from knowledge_base import InputError  # noqa: E402

WORLD = {
    "version": 1,
    "schema": {"types": {"item": None, "place": None}, "predicates": {"on": [["a", "item"], ["b", "place"]]}},
    "nodes": {"cup": "item", "table": "place"},
    "facts": [["on", "cup", "table"]],
    "values": [],
}
DEEP = 100_000


class FakeHands:
    """A run that takes every command as `Control` does, and keeps what it was told."""

    paused = None

    def __init__(self) -> None:
        self.events: list[Event] = []

    def obey(self, command):
        if command.get("do") == "event":
            self.events.append(Event(str(command.get("name")), dict(command.get("attributes") or {})))
        elif command.get("do") == "unbreak":
            return {"ok": command.get("number") in {1: 1}}
        elif command.get("do") not in {"breaks": 1}:
            raise InputError(f"there is nothing to do called '{command.get('do')}'")
        return {"ok": True}


@pytest.fixture(scope="module")
def viewer():
    from knowledge_base import Schema
    from knowledge_base.exchange import schema_form

    schema = schema_form(
        Schema.parse("(define (domain d) (:types item place) (:predicates (on ?a - item ?b - place)))")
    )
    world = json.dumps({"seq": 1, "t": 0.0, "type": "world", "cause": None, **WORLD, "schema": schema})
    viewer = Viewer(RecordLog(header(), [world]), PageAddress.on(), FakeHands())
    viewer.start()
    yield viewer
    viewer.close()


class Page:
    """Requests to the application in this thread: a failure of it is raised here."""

    def __init__(self, viewer: Viewer) -> None:
        origin = f"http://127.0.0.1:{viewer.port}"
        transport = httpx.ASGITransport(app=viewer.application())
        self._client = httpx.AsyncClient(
            transport=transport, base_url=origin, headers={"Origin": origin}, params={"token": viewer.token}
        )
        self._runner = asyncio.Runner()

    def close(self) -> None:
        self._runner.run(self._client.aclose())
        self._runner.close()

    def get(self, path: str, **how):
        return self._runner.run(self._client.get(path, **how))

    def post(self, path: str, **how):
        return self._runner.run(self._client.post(path, **how))


@pytest.fixture(scope="module")
def page(viewer):
    page = Page(viewer)
    yield page
    page.close()


@pytest.fixture
def quiet(capfd):
    """Nothing is printed meanwhile."""
    capfd.readouterr()
    yield
    assert capfd.readouterr() == ("", "")


BODIES = {
    "nested arrays": b"[" * DEEP + b"]" * DEEP,
    "nested objects": b'{"a":' * DEEP + b"1" + b"}" * DEEP,
    "nested parameters": b'{"seq": 1, "expression": "(on ?x table)", "params": ' + b'{"a":' * 300 + b"1" + b"}" * 301,
    "an open array": b"[" * DEEP,
    "no UTF-8": b'{"seq": 1, "expression": "\xff\xfe"}',
    "half a character": b'{"seq": 1, "expression": "(on \\ud800 table)"}',
    "half a name": b'{"seq": 1, "expression": "(on ?x table)", "params": {"\\udfff": 1}}',
    "a huge number": b'{"seq": ' + b"9" * 10_000 + b', "expression": "(on ?x table)"}',
    "a great number": b'{"seq": 1e400, "expression": "(on ?x table)"}',
    "NaN": b'{"seq": NaN, "expression": "(on ?x table)"}',
    "Infinity": b'{"seq": -Infinity, "about": Infinity}',
    "nothing": b"",
    "null": b"null",
    "two objects": b"{}{}",
    "too much": b" " * ((1 << 20) + 1),
}


@pytest.mark.usefixtures("quiet")
@pytest.mark.parametrize("path", ["/query", "/facts", "/control"])
@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
def test_a_malformed_body_is_refused_in_a_line(page, path, body) -> None:
    answer = page.post(path, content=body)
    assert answer.status_code == 400, answer.text
    assert "\n" not in answer.json()["error"]


@pytest.mark.usefixtures("quiet")
@pytest.mark.parametrize(
    "text",
    [
        "(on \0 table)",
        "(not " * 100_000,
        "(" * 500_000,
        ")",
        "(on ?x table" + " " * 500_000,
        "(on ?" + "x" * 500_000 + " table",
        "\u202e",
    ],
)
def test_a_malformed_question_is_refused_in_a_line(page, text) -> None:
    answer = page.post("/query", json={"seq": 1, "expression": text})
    assert answer.status_code == 400, answer.text[:200]


ODD: list[object] = [
    None,
    True,
    -1,
    0,
    2**70,
    1.5,
    "",
    "x",
    [],
    [[]],
    {},
    {"a": {"b": []}},
    [1, "x"],
    {"state": 1},
    {"state": "x", "event": "y"},
]
FIELDS = {
    "/query": ("seq", "expression", "params"),
    "/facts": ("seq", "about"),
    "/control": ("do", "name", "attributes", "statements", "owner", "value", "on", "number"),
}
SOUND = {"seq": 1, "expression": "(on ?x table)", "do": "event", "name": "x"}


@pytest.mark.usefixtures("quiet")
@pytest.mark.parametrize(("path", "field"), [(path, field) for path, fields in FIELDS.items() for field in fields])
def test_a_field_of_another_type_is_refused_or_taken_never_a_failure(page, path, field) -> None:
    for value in ODD:
        for said in ({**SOUND, field: value}, {"do": "unbreak", field: value}):
            answer = page.post(path, json=said)
            assert answer.status_code in (200, 400), (said, answer.text)
            assert answer.status_code == 200 or set(answer.json()) == {"error"}


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(st.characters(codec=None), max_size=20),
    lambda inside: (
        st.lists(inside, max_size=4)
        | st.dictionaries(st.sampled_from(sum(FIELDS.values(), ())) | st.text(max_size=5), inside, max_size=4)
    ),
    max_leaves=12,
)


@settings(max_examples=20, deadline=None)
@given(path=st.sampled_from(list(FIELDS)), said=JSON | st.fixed_dictionaries(dict.fromkeys(SOUND, JSON)))
def test_any_json_is_answered(page, path, said) -> None:
    assert page.post(path, content=json.dumps(said)).status_code in (200, 400)


@settings(max_examples=20, deadline=None)
@given(path=st.sampled_from(list(FIELDS)), body=st.binary(max_size=60))
def test_any_bytes_are_answered(page, path, body) -> None:
    assert page.post(path, content=body).status_code == 400


@pytest.mark.usefixtures("quiet")
@pytest.mark.parametrize(
    "path",
    ["/record/0", "/record/" + "9" * 5000, "/record/-1", "/record/x", "/record/1.5", "/record/%00", "/record/²", "/%00",
     "/" + "x" * 5000, "/..%2f..%2fetc%2fpasswd", "/assets/%2e%2e/%2e%2e/server.py", "/%ff", "/\u2028"],
)  # fmt: skip
def test_an_address_that_leads_nowhere_is_said(page, path) -> None:
    assert page.get(path).status_code in (400, 404)


@pytest.mark.usefixtures("quiet")
@pytest.mark.parametrize("span", ["bytes=abc", "bytes=9-1", "bytes=0-0," * 500, "bytes=999999999999-", "x=1-2"])
def test_a_malformed_range_is_no_failure(page, span) -> None:
    assert page.get("/", headers={"Range": span}).status_code < 500


# --- bytes on a connection


def sent(viewer, data: bytes, then: bytes = b"", *, reset: bool = False, ends: bool = False) -> bytes:
    """What comes back on a connection for these bytes, and others after the first answer, until its end."""
    came = b""
    with sockets.create_connection(("127.0.0.1", viewer.port), timeout=10) as connection, suppress(OSError):
        connection.sendall(data)
        if then:
            came = connection.recv(65536)
            connection.sendall(then)
        if reset:
            connection.setsockopt(sockets.SOL_SOCKET, sockets.SO_LINGER, struct.pack("ii", 1, 0))
            return b""
        if ends:
            connection.shutdown(sockets.SHUT_WR)
        while (more := connection.recv(65536)) and closed_with(came := came + more) is None:
            pass
    return came


def head(viewer, line: str, *more: str) -> bytes:
    return "\r\n".join([line, f"Host: 127.0.0.1:{viewer.port}", *more, "", ""]).encode("latin-1")


def shaken(viewer, *more: str) -> bytes:
    """The request to become a socket."""
    origin = f"Origin: http://127.0.0.1:{viewer.port}"
    upgrade = ("Connection: Upgrade", "Upgrade: websocket", "Sec-WebSocket-Version: 13")
    key = "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA=="
    return head(viewer, f"GET /socket?token={viewer.token} HTTP/1.1", origin, *upgrade, key, *more)


def frame(opcode: int, data: bytes, *, fin: bool = True, masked: bool = True) -> bytes:
    mask = b"\0\0\0\0" if masked else b""
    size = len(data)
    length = (
        bytes([size])
        if size < 126
        else b"\x7e" + struct.pack("!H", size)
        if size < 65536
        else b"\x7f" + struct.pack("!Q", size)
    )
    return bytes([opcode | 0x80 * fin, length[0] | 0x80 * masked]) + length[1:] + mask + data


def closed_with(answer: bytes) -> int | None:
    """The code of the frame that closes a socket, the last one that came."""
    at = answer.rfind(b"\x88")
    return struct.unpack("!H", answer[at + 2 : at + 4])[0] if at >= 0 else None


def served(viewer) -> bool:
    """Whether the page still answers."""
    return sent(viewer, head(viewer, f"GET /record/1?token={viewer.token} HTTP/1.1", "Connection: close")).startswith(
        b"HTTP/1.1 200"
    )


TEXT, BINARY, CLOSE, PING = 1, 2, 8, 9
FINISHED = b"\x88\x82\0\0\0\0\x03\xe8"
"""The frame that closes a socket in order."""
FRAMES = {
    "no UTF-8": (frame(TEXT, b"\xff\xfe\xfd"), 1007),
    "binary": (frame(BINARY, b'{"want": 1}'), 1003),
    "no JSON": (frame(TEXT, b"hello"), 1003),
    "nested": (frame(TEXT, b"[" * 30_000), 1003),
    "no object": (frame(TEXT, b"[1]"), 1003),
    "not wanted": (frame(TEXT, b'{"want": true}'), 1003),
    "below zero": (frame(TEXT, b'{"want": -1}'), 1003),
    "not a number": (frame(TEXT, b'{"want": NaN}'), 1003),
    "too many digits": (frame(TEXT, b'{"want": ' + b"9" * 5000 + b"}"), 1003),
    "too large": (frame(TEXT, b" " * 70_000), 1009),
    "not masked": (frame(TEXT, b'{"want": 1}', masked=False), 1002),
    "a reserved opcode": (frame(5, b"x"), 1002),
    "a long ping": (frame(PING, b"x" * 200), 1002),
    "a malformed close": (frame(CLOSE, b"\x00"), 1002),
    "a continuation of nothing": (frame(0, b"x"), 1002),
}


@pytest.mark.usefixtures("quiet")
@pytest.mark.parametrize(("data", "code"), FRAMES.values(), ids=FRAMES)
def test_a_malformed_frame_closes_its_socket_with_a_code(viewer, data, code) -> None:
    answer = sent(viewer, shaken(viewer), data)
    assert answer.startswith(b"HTTP/1.1 101")
    assert closed_with(answer) == code


BYTES = {
    "nothing": b"",
    "noise": bytes(range(256)),
    "TLS": b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
    "no version": b"GET /\r\n\r\n",
    "no method": b" / HTTP/1.1\r\n\r\n",
    "an endless header": b"GET / HTTP/1.1\r\nX: " + b"x" * (2 << 20),
    "a negative length": b"POST /query HTTP/1.1\r\nContent-Length: -1\r\n\r\n",
    "half a request": b"GET / HTTP/1.1\r\nHost",
    "bytes in the address": b"GET /\xff\xfe HTTP/1.1\r\nHost: x\r\n\r\n",
    "bytes in a header": b"GET / HTTP/1.1\r\nHost: x\r\nX: \xff\xfe\x80\r\n\r\n",
    "two hosts": b"GET / HTTP/1.1\r\nHost: x\r\nHost: y\r\n\r\n",
    "a wrong chunk": b"POST /query HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\n",
    "another version": b"GET / HTTP/9.9\r\nHost: x\r\n\r\n",
}


@pytest.mark.usefixtures("quiet")
@pytest.mark.parametrize("data", BYTES.values(), ids=BYTES)
@pytest.mark.parametrize("reset", [False, True])
def test_bytes_that_are_no_request_print_nothing_and_the_page_goes_on(viewer, data, reset) -> None:
    answer = sent(viewer, data, reset=reset, ends=True)
    assert not answer or answer.startswith(b"HTTP/1.1 4")
    assert served(viewer)


HANDSHAKES = {
    "no key": ("Sec-WebSocket-Key: x", 400),
    "a wrong origin": ("Origin: http://evil.example", 400),
    "bytes": ("X: \xff\xfe", 101),
    "many headers": ("\r\n".join(f"X-{number}: 1" for number in range(500)), 400),
    "an extension": ("Sec-WebSocket-Extensions: permessage-deflate; \x7f", 400),
}


@pytest.mark.usefixtures("quiet")
@pytest.mark.parametrize(("more", "status"), HANDSHAKES.values(), ids=HANDSHAKES)
def test_a_malformed_handshake_is_refused(viewer, more, status) -> None:
    answer = sent(viewer, shaken(viewer, more), ends=True)
    assert not answer or answer.startswith((f"HTTP/1.1 {status}".encode(), b"HTTP/1.1 4"))


@pytest.mark.usefixtures("quiet")
def test_an_address_that_is_no_ascii_does_not_end_a_handshake_in_a_traceback(viewer) -> None:
    asked = shaken(viewer).replace(b"/socket?", b"/socket?\xc3\xbc=1&")
    assert not sent(viewer, asked, ends=True).startswith(b"HTTP/1.1 5")


@pytest.mark.usefixtures("quiet")
def test_sockets_and_requests_that_break_off_print_nothing(viewer) -> None:
    half = head(
        viewer,
        f"POST /query?token={viewer.token} HTTP/1.1",
        f"Origin: http://127.0.0.1:{viewer.port}",
        "Content-Length: 100",
    )
    for data in (
        shaken(viewer),
        shaken(viewer) + frame(TEXT, b'{"want": 1}'),
        half + b'{"seq"',
        head(viewer, f"GET /?token={viewer.token} HTTP/1.1"),
    ):
        for _ in range(5):
            sent(viewer, data, reset=True)
    sent(viewer, half + b'{"seq"', ends=True)
    assert served(viewer)


@pytest.mark.usefixtures("quiet")
@pytest.mark.parametrize("size", [9_000, 60_000, 500_000])
def test_the_page_and_its_socket_open_also_beside_huge_cookies(viewer, size) -> None:
    cookie = "Cookie: " + "; ".join(f"other{number}={'x' * 3000}" for number in range(size // 3000))
    opened = sent(viewer, head(viewer, f"GET /?token={viewer.token} HTTP/1.1", cookie, "Connection: close"))
    assert opened.startswith(b"HTTP/1.1 200")
    own = opened.lower().partition(b"set-cookie: ")[2].partition(b";")[0]
    exact = opened[opened.lower().find(own) :][: len(own)].decode()
    asked = shaken(viewer, f"{cookie}; {exact}").replace(f"?token={viewer.token}".encode(), b"")
    assert sent(viewer, asked, FINISHED).startswith(b"HTTP/1.1 101")


@settings(max_examples=30, deadline=None)
@given(data=st.binary(max_size=200))
def test_any_bytes_after_a_handshake_close_the_socket_or_are_frames(viewer, data) -> None:
    assert sent(viewer, shaken(viewer), data or b"x", ends=True).startswith(b"HTTP/1.1 101")


@settings(max_examples=30, deadline=None)
@given(line=st.binary(max_size=60), rest=st.binary(max_size=100))
def test_any_bytes_are_no_failure(viewer, line, rest) -> None:
    answer = sent(viewer, b"GET /" + line + b" HTTP/1.1\r\n" + rest + b"\r\n\r\n", ends=True)
    assert not answer or answer.startswith(b"HTTP/1.1 4")

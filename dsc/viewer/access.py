"""Address of a page, and access by token, one-time code or cookie; other requests receive `403` and a reason."""

from __future__ import annotations

import hmac
import secrets
import socket
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from knowledge_base.errors import InputError

MUST_HAVE_ORIGIN = frozenset({"POST", "PUT", "PATCH", "DELETE"})
CODE_LIFE_S = 60.0
"""Seconds for which the one-time code is valid, also for a browser that starts slowly."""
COOKIE = "dsc-view-"
"""Prefix of the cookie's name; the port follows, as browsers share cookies among the ports of a machine."""
MOST_WRONG_CODES = 20
"""Number of wrong codes after which the code expires.

Restored tabs send codes of ended programs; a larger number of wrong codes indicates guesses.
"""
MOST_PARAMETERS = 20
MISSING = "the token is missing or wrong; open the address that was printed"
USED = (
    f"this link is used up: it opens one browser, once, within {CODE_LIFE_S:.0f} seconds. Open the address that was "
    "printed. If no browser of yours has used the link, end the program: another user of this machine has"
)


@dataclass(frozen=True, slots=True)
class PageAddress:
    """A listening socket on 127.0.0.1, bound before the server starts, so that the address is known immediately.

    Attributes:
        listening: the socket; early connections wait for the server.
        token: a key that opens the page any number of times.
        code: a key that opens the page one time, soon after the server's start.
    """

    listening: socket.socket
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24), repr=False)
    code: str = field(default_factory=lambda: secrets.token_urlsafe(24), repr=False)

    @classmethod
    def on(cls, port: int = 0) -> PageAddress:
        """Listen on the port, with new keys; port 0 selects a free one.

        Raises:
            InputError: the port is in use, or this user may not listen on it.
        """
        made = socket.socket()
        made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            made.bind(("127.0.0.1", port))
            made.listen()
        except OSError as error:
            made.close()
            raise InputError(f"cannot listen on port {port}: {error.strerror}") from None
        return cls(made)

    @property
    def port(self) -> int:
        """Number of the port."""
        number: int = self.listening.getsockname()[1]
        return number

    @property
    def url(self) -> str:
        """The address for people; the address is valid any number of times."""
        return f"http://127.0.0.1:{self.port}/?token={self.token}"

    @property
    def one_time_url(self) -> str:
        """The address for a browser's command line, which other users can read; the address is valid one time."""
        return f"http://127.0.0.1:{self.port}/?code={self.code}"


class Keys:
    """The keys of one page: a token for people and programs, a code for one browser, a cookie for every browser.

    The code exists because every user of a machine can read command lines, and a browser receives the page's address in
    its command line.

    Args:
        token: opens the page any number of times.
        code: opens the page one time, within `CODE_LIFE_S` from now; `None` if no browser is opened.
        now: returns the seconds of a monotonic clock.

    Attributes:
        cookie: the value of the cookie, which differs from the token; the cookie opens the page any number of times.
    """

    def __init__(self, token: str, code: str | None, now: Callable[[], float] = time.monotonic) -> None:
        self.cookie = secrets.token_urlsafe(24)
        self._token, self._code, self._now = token, code, now
        self._ends = now() + CODE_LIFE_S
        self._wrong = 0

    def is_token(self, given: str) -> bool:
        """Return whether `given` is the token."""
        return _same(given, self._token)

    def is_cookie(self, given: str) -> bool:
        """Return whether `given` is the value of the cookie."""
        return _same(given, self.cookie)

    def redeem(self, given: str) -> bool:
        """Return whether `given` is the valid code; the code expires by use, and after `MOST_WRONG_CODES` errors."""
        alive = self._code is not None and self._now() < self._ends
        right = _same(given, self._code or "") and alive
        self._wrong += not right
        if right or self._wrong >= MOST_WRONG_CODES or not alive:
            self._code = None
        return right


class Access:
    """Check of key, Host and Origin before an application, for HTTP and WebSocket requests.

    A foreign web page can make a browser send requests to this server, also under another host name (DNS rebinding).
    Host and Origin are therefore checked besides the keys.
    """

    def __init__(self, app: ASGIApp, keys: Keys, port: int) -> None:
        self._app = app
        self._keys = keys
        self._hosts = (f"127.0.0.1:{port}", f"localhost:{port}")
        self._cookie = f"{COOKIE}{port}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request to the application, or refuse it."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        has_cookie = any(self._keys.is_cookie(value) for value in cookies(headers, self._cookie))
        reason = self._wrong_sender(scope, headers) or (None if has_cookie else self._wrong_key(scope))
        if reason is None:
            await self._app(scope, receive, self._with_headers(headers, send, with_cookie=not has_cookie))
        elif scope["type"] == "websocket":
            await receive()  # the connect message; a close before the accept is answered by 403
            await send({"type": "websocket.close", "code": 1008, "reason": reason})
        else:
            await _refuse(send, reason)

    def _wrong_sender(self, scope: Scope, headers: Headers) -> str | None:
        host, origin = headers.get("host", ""), headers.get("origin")
        if host not in self._hosts:
            return "this Host is not served"
        needs_origin = scope["type"] == "websocket" or scope["method"] in MUST_HAVE_ORIGIN
        if origin is None and needs_origin:
            return f"this request needs the header 'Origin: http://{host}'"
        if origin not in {None, f"http://{host}"}:
            return "this Origin is not served"
        return None

    def _wrong_key(self, scope: Scope) -> str | None:
        given = _parameters(scope)
        if any(self._keys.is_token(token) for token in given.get("token", ())):
            return None
        codes = given.get("code", ())
        if not codes:
            return MISSING
        is_page = scope["type"] == "http" and scope["method"] == "GET" and scope["path"] == "/"
        return None if is_page and self._keys.redeem(codes[0]) else USED

    def _with_headers(self, asked: Headers, send: Send, *, with_cookie: bool) -> Send:
        host = asked.get("host", "")
        policy = (
            f"default-src 'self'; connect-src 'self' ws://{host}; img-src 'self' data: blob:; "
            "style-src 'self' 'unsafe-inline'; worker-src 'self' blob:; frame-ancestors 'none'; base-uri 'none'"
        )

        async def sending(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers["Content-Security-Policy"] = policy
                headers["X-Content-Type-Options"] = "nosniff"
                headers["Referrer-Policy"] = "no-referrer"
                headers["Cache-Control"] = "no-store"
                if with_cookie:
                    cookie = f"{self._cookie}={self._keys.cookie}; HttpOnly; SameSite=Strict; Path=/"
                    headers.append("Set-Cookie", cookie)
            await send(message)

        return sending


def cookies(headers: Headers, name: str) -> Iterator[str]:
    """Yield every value of a cookie of that name, also those of other programs on this machine.

    Browsers send the cookies of all ports of a machine: a name may occur twice, and a value may be malformed.
    """
    for line in headers.getlist("cookie"):
        for part in line.split(";"):
            found, _, value = part.partition("=")
            if found.strip() == name:
                yield value.strip().strip('"')


def _parameters(scope: Scope) -> dict[str, list[str]]:
    try:
        return parse_qs(scope["query_string"].decode("latin-1"), max_num_fields=MOST_PARAMETERS)
    except ValueError:
        return {}


def _same(given: str, wanted: str) -> bool:
    """Compare in constant time, so that the duration does not reveal the position of a difference."""
    return hmac.compare_digest(given.encode(errors="replace"), wanted.encode())


async def _refuse(send: Send, reason: str) -> None:
    text = reason.encode()
    headers = [
        (b"content-type", b"text/plain; charset=utf-8"),
        (b"content-length", str(len(text)).encode()),
        (b"cache-control", b"no-store"),
        (b"referrer-policy", b"no-referrer"),
    ]
    await send({"type": "http.response.start", "status": 403, "headers": headers})
    await send({"type": "http.response.body", "body": text})

"""Who is let in: who has the token, on this machine, from the page itself. Everybody else gets `403` and a reason."""

from __future__ import annotations

import hmac
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

MUST_HAVE_ORIGIN = frozenset({"POST", "PUT", "PATCH", "DELETE"})


class Access:
    """Checks token, Host and Origin in front of an application, for HTTP and sockets alike.

    A page somewhere in the web can make a browser ask this program, also under another name (DNS rebinding):
    hence Host and Origin, besides a token that only who started the program knows.
    """

    def __init__(self, app: ASGIApp, token: str, port: int) -> None:
        self._app = app
        self._token = token
        self._hosts = (f"127.0.0.1:{port}", f"localhost:{port}")
        self._cookie = f"dsc-view-{port}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let the request pass, or refuse it."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        reason = self._reason_to_refuse(scope)
        if reason is None:
            await self._app(scope, receive, self._with_headers(scope, send))
        elif scope["type"] == "websocket":
            await receive()  # the request to connect; closing before accepting answers 403
            await send({"type": "websocket.close", "code": 1008, "reason": reason})
        else:
            await _refuse(send, reason)

    def _reason_to_refuse(self, scope: Scope) -> str | None:
        headers = Headers(scope=scope)
        host, origin = headers.get("host", ""), headers.get("origin")
        if host not in self._hosts:
            return "this Host is not served"
        needs_origin = scope["type"] == "websocket" or scope["method"] in MUST_HAVE_ORIGIN
        if origin != f"http://{host}" and (origin is not None or needs_origin):
            return "this Origin is not served"
        if not any(hmac.compare_digest(given.encode(), self._token.encode()) for given in self._given(scope, headers)):
            return "the token is missing or wrong; open the address that was printed"
        return None

    def _given(self, scope: Scope, headers: Headers) -> list[str]:
        """The tokens that come with the request: in its address, in its cookie."""
        found = parse_qs(scope["query_string"].decode("latin-1")).get("token", [])
        cookie: SimpleCookie = SimpleCookie()
        try:
            cookie.load(headers.get("cookie", ""))
        except CookieError:
            return found
        return [*found, *(morsel.value for name, morsel in cookie.items() if name == self._cookie)]

    def _with_headers(self, scope: Scope, send: Send) -> Send:
        host = Headers(scope=scope).get("host", "")
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
                headers.append("Set-Cookie", f"{self._cookie}={self._token}; HttpOnly; SameSite=Strict; Path=/")
            await send(message)

        return sending


async def _refuse(send: Send, reason: str) -> None:
    text = reason.encode()
    headers = [(b"content-type", b"text/plain; charset=utf-8"), (b"content-length", str(len(text)).encode())]
    await send({"type": "http.response.start", "status": 403, "headers": headers})
    await send({"type": "http.response.body", "body": text})

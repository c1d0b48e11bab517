"""Server side of PROTOCOL.md: one Starlette application for one run."""

from __future__ import annotations

import asyncio
import json
import logging
import sys
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import uvicorn
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect, Request
from starlette.responses import FileResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocket
from uvicorn.protocols.http.h11_impl import H11Protocol

from dsc.data_folder import SCHEME, name_in
from dsc.viewer.access import COOKIE, Access, Keys, PageAddress
from dsc.viewer.broadcast import Broadcast, BrowserStream
from dsc.viewer.control import Hands
from dsc.viewer.queries import CONTROL, FACTS, MOST_BYTES, QUERY, Fields, Left, PageQueries, asked
from dsc.viewer.records import RecordLog
from knowledge_base.errors import InputError

if TYPE_CHECKING:
    import h11

STATIC = Path(__file__).parent / "static"
MOST_HEADER_BYTES = 1 << 20
"""Maximum number of header bytes, as browsers send the cookies of all programs of this machine."""
MOST_DIGITS = 15
"""Maximum number of digits of a record number."""
COMPLAIN_EVERY_S = 10.0
"""Minimum number of seconds between two messages about failures."""


class Viewer:
    """Page of a run in the browser; it answers at `url` from `start` to `close`.

    Args:
        log: the records.
        entrance: the page's address, whose socket the viewer then owns.
        control: the run's control; `None` if the page may not change the run.
        data: the folder of the data that references in the records name.

    Attributes:
        url: the address for people.
        one_time_url: the address for a browser's command line.
        port: the port of the address.
        token: the permanent key in the address for people.
    """

    def __init__(
        self, log: RecordLog, entrance: PageAddress, control: Hands | None = None, data: Path | None = None
    ) -> None:
        self._log, self._control, self._socket, self._data = log, control, entrance.listening, data
        self.url, self.one_time_url = entrance.url, entrance.one_time_url
        self.port, self.token = entrance.port, entrance.token
        self._keys = Keys(entrance.token, entrance.code)
        self._answers = PageQueries(log)
        self._calm = Calm(self._route())
        self._rounds = Broadcast(log, self._status)
        config = uvicorn.Config(
            self.application(),
            lifespan="off",
            http=_Protocol,
            h11_max_incomplete_event_size=MOST_HEADER_BYTES,
            ws_max_size=1 << 16,
            ws_per_message_deflate=False,  # local transfer needs no compression
            log_config=None,
            log_level=logging.CRITICAL + 1,  # invalid requests of other programs must not appear on the terminal
            access_log=False,
        )
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def application(self) -> ASGIApp:
        """Return the application, which the access check protects."""
        return Access(self._calm, self._keys, self.port)

    def _route(self) -> ASGIApp:
        control = self._control
        controlled = self._forbidden if control is None else self._answer(lambda said, _: control.obey(said), CONTROL)
        routes = [
            Route("/", self._page),
            Route("/record/{seq:str}", self._record),
            Route("/data/{name:str}", self._datum),
            Route("/query", self._answer(self._answers.query, QUERY), methods=["POST"]),
            Route("/facts", self._answer(self._answers.facts, FACTS), methods=["POST"]),
            Route("/control", controlled, methods=["POST"]),
            WebSocketRoute("/socket", self._stream),
            Mount("/", StaticFiles(directory=STATIC, check_dir=False)),
        ]
        return Starlette(routes=routes)

    def start(self) -> None:
        """Start answering, in a separate thread."""
        self._thread.start()

    def wait(self) -> None:
        """Wait until the page is closed; a `KeyboardInterrupt` ends the wait."""
        while self._thread.is_alive():
            self._thread.join(timeout=0.5)

    def close(self) -> None:
        """Stop answering; the end of the socket notifies the browsers."""
        self._server.should_exit = True
        self._server.force_exit = True
        if self._thread.is_alive():
            self._thread.join(timeout=5)
        self._socket.close()

    def _report_failure(self, _: asyncio.AbstractEventLoop, context: Mapping[str, Any]) -> None:
        self._calm.complain(context.get("exception"))

    def _serve(self) -> None:
        asyncio.run(self._serve_quietly())

    async def _serve_quietly(self) -> None:
        asyncio.get_running_loop().set_exception_handler(self._report_failure)
        await self._server.serve(sockets=[self._socket])

    async def _page(self, _: Request) -> Response:
        page = STATIC / "index.html"
        if not page.exists():
            return PlainTextResponse("the page has not been built: make viewer", status_code=500)
        return FileResponse(page)

    async def _record(self, request: Request) -> Response:
        number = request.path_params["seq"]
        if not number.isdecimal() or len(number) > MOST_DIGITS:
            return _wrong(InputError("a record has a number"))
        try:
            return Response(self._log.line(int(number)), media_type="application/json")
        except InputError as error:
            return _wrong(error)

    async def _datum(self, request: Request) -> Response:
        name = name_in(SCHEME + request.path_params["name"])
        if self._data is None or name is None or not (self._data / name).is_file():
            return PlainTextResponse("no such data; --data FOLDER names their folder", status_code=404)
        return FileResponse(self._data / name)

    def _answer(self, answer: Callable[[Mapping[str, Any], Left], Any], form: Fields) -> Callable[[Request], Any]:
        async def answering(request: Request) -> Response:
            try:
                said = asked(await _body(request), form)
                return _json(await _while_there(request, answer, said))
            except InputError as error:
                return _wrong(error)
            except RecursionError:
                return _wrong(InputError("this is nested too deeply"))

        return answering

    async def _forbidden(self, _: Request) -> Response:
        return PlainTextResponse("this run may only be looked at; see --allow-control", status_code=403)

    async def _stream(self, socket: WebSocket) -> None:
        await socket.accept()
        await BrowserStream(socket, self._log, self._rounds, control=self._control is not None).serve()

    def _status(self) -> dict[str, Any]:
        return {"ended": not self._log.live, "paused": self._control.paused if self._control else None}


class Calm:
    """Wrapper of an application that contains its failures.

    A failure ends one request, and may print a line on the terminal, but never a traceback.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app
        self._complained = -COMPLAIN_EVERY_S

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request to the application; after a failure, the application has answered 500."""
        try:
            await self._app(scope, receive, send)
        except (ClientDisconnect, OSError):
            pass  # the browser has left
        except Exception as error:  # noqa: BLE001  uvicorn would print a traceback
            self.complain(error)

    def complain(self, error: BaseException | None) -> None:
        """Print a failure on one line, unless another one was printed in the last `COMPLAIN_EVERY_S` seconds."""
        if error is not None and time.monotonic() - self._complained >= COMPLAIN_EVERY_S:
            self._complained = time.monotonic()
            sys.stderr.write(f"the page: {type(error).__name__}: {error}"[:300].replace("\n", " ") + "\n")


class _Protocol(H11Protocol):
    """uvicorn's HTTP protocol, which also accepts sockets with large cookies of other programs."""

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        """Remove foreign cookies before the change to the socket protocol, which accepts lines of at most 8 KB."""
        self.headers = [(name, _own(value) if name == b"cookie" else value) for name, value in self.headers]
        super().handle_websocket_upgrade(event)


def _own(cookie: bytes) -> bytes:
    return b";".join(part for part in cookie.split(b";") if part.lstrip().startswith(COOKIE.encode()))


async def _while_there(
    request: Request, answer: Callable[[Mapping[str, Any], Left], Any], said: Mapping[str, Any]
) -> Any:
    """Return the result of `answer`, executed in a separate thread.

    The second argument of `answer` is a function that returns whether the browser has left.
    """
    left = threading.Event()

    async def watch() -> None:
        while (await request.receive())["type"] != "http.disconnect":
            pass
        left.set()

    watching = asyncio.create_task(watch())
    try:
        return await run_in_threadpool(answer, said, left.is_set)
    finally:
        watching.cancel()


async def _body(request: Request) -> bytes:
    body = bytearray()
    async for chunk in request.stream():
        body += chunk
        if len(body) > MOST_BYTES:
            raise InputError(f"a request has at most {MOST_BYTES} bytes")
    return bytes(body)


def _json(said: Any, status: int = 200) -> Response:
    """Return a response as JSON in ASCII, because UTF-8 lacks half surrogate pairs.

    Numbers that JSON lacks are written as in a trace.
    """
    return Response(json.dumps(said), status_code=status, media_type="application/json")


def _wrong(error: InputError) -> Response:
    return _json({"error": str(error)}, 400)

"""The program's side of PROTOCOL.md: one Starlette application for one run."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp
from starlette.websockets import WebSocket

from dsc.viewer.access import Access
from dsc.viewer.answers import Answers
from dsc.viewer.control import Hands
from dsc.viewer.entrance import Entrance
from dsc.viewer.records import RecordLog
from dsc.viewer.rounds import Rounds
from dsc.viewer.stream import Stream
from knowledge_base.errors import InputError

STATIC = Path(__file__).parent / "static"
MOST_ASKED = 1 << 20
"""Bytes of a request's body."""


class Viewer:
    """A run in the browser: made with its records, it answers at `url` from `start` to `close`.

    Args:
        log: the records.
        entrance: where it is to be had; it is given away.
        control: the run, if whoever looks may change it.

    Attributes:
        url: what to open.
        port: of the address.
        token: in the address, the only key.
    """

    def __init__(self, log: RecordLog, entrance: Entrance, control: Hands | None = None) -> None:
        self._log, self._control, self._socket = log, control, entrance.listening
        self.url, self.port, self.token = entrance.url, entrance.port, entrance.token
        self._answers = Answers(log)
        self._rounds = Rounds(log, self._status)
        config = uvicorn.Config(
            self.application(),
            lifespan="off",
            ws_max_size=1 << 16,
            ws_per_message_deflate=False,  # nothing leaves this machine, so that it would only cost
            log_level="error",
            access_log=False,
        )
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(target=self._server.run, kwargs={"sockets": [self._socket]}, daemon=True)

    def application(self) -> ASGIApp:
        """The application behind the check of who may come in."""
        routes = [
            Route("/", self._page),
            Route("/record/{seq:int}", self._record),
            Route("/query", self._asked(self._answers.query), methods=["POST"]),
            Route("/facts", self._asked(self._answers.facts), methods=["POST"]),
            Route("/control", self._controlled, methods=["POST"]),
            WebSocketRoute("/socket", self._stream),
            Mount("/", StaticFiles(directory=STATIC, check_dir=False)),
        ]
        return Access(Starlette(routes=routes), self.token, self.port)

    def start(self) -> None:
        """Answer from now on, in a thread of its own."""
        self._thread.start()

    def wait(self) -> None:
        """Until it is closed; an interrupt gets through."""
        while self._thread.is_alive():
            self._thread.join(timeout=0.5)

    def close(self) -> None:
        """Answer no longer; whoever looks is told by the end of the socket."""
        self._server.should_exit = True
        self._server.force_exit = True
        if self._thread.is_alive():
            self._thread.join(timeout=5)
        self._socket.close()

    async def _page(self, _: Request) -> Response:
        page = STATIC / "index.html"
        if not page.exists():
            return PlainTextResponse("the page has not been built: make viewer", status_code=500)
        return FileResponse(page)

    async def _record(self, request: Request) -> Response:
        try:
            return Response(self._log.line(request.path_params["seq"]), media_type="application/json")
        except InputError as error:
            return _wrong(error)

    def _asked(self, answer: Callable[[Mapping[str, Any]], Any]) -> Callable[[Request], Any]:
        async def asked(request: Request) -> Response:
            try:
                said = await run_in_threadpool(answer, await _body(request))
            except InputError as error:
                return _wrong(error)
            return JSONResponse(said)

        return asked

    async def _controlled(self, request: Request) -> Response:
        control = self._control
        if control is None:
            return PlainTextResponse("this run may only be looked at; see --allow-control", status_code=403)
        try:
            return JSONResponse(await run_in_threadpool(control.obey, await _body(request)))
        except InputError as error:
            return _wrong(error)

    async def _stream(self, socket: WebSocket) -> None:
        await socket.accept()
        await Stream(socket, self._log, self._rounds, control=self._control is not None).serve()

    def _status(self) -> dict[str, Any]:
        return {"ended": not self._log.live, "paused": self._control.paused if self._control else None}


async def _body(request: Request) -> Mapping[str, Any]:
    body = b""
    async for chunk in request.stream():
        body += chunk
        if len(body) > MOST_ASKED:
            raise InputError(f"a request has at most {MOST_ASKED} bytes")
    try:
        said = json.loads(body)
    except ValueError:
        said = None
    if not isinstance(said, dict):
        raise InputError("a request is one JSON object")
    return said


def _wrong(error: InputError) -> Response:
    return JSONResponse({"error": str(error)}, status_code=400)

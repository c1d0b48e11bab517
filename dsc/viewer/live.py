"""Page of a live run, served by a separate process, so that the run only transfers its records."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from queue import SimpleQueue
from threading import Thread
from typing import IO, TYPE_CHECKING, Any

from dsc.components.hooks import reason_of
from dsc.viewer.control import Control

if TYPE_CHECKING:
    from pathlib import Path

    from dsc.trace import Record
    from dsc.viewer.access import PageAddress

COMMAND = (sys.executable, "-P", "-m", "dsc.viewer.page_process")
TELL_EVERY_S = 1 / 30
"""Minimum number of seconds between two transfers of a run's lines, as a page shows no more."""
STOPPING_S = 5.0
_NO_MORE = ""


class LivePage:
    """Page of a live run in the browser: receives all records of the run, and answers at `url` from `start` to `close`.

    The run's thread converts records to lines. Stored record objects would cost more, because the garbage collector
    would scan them repeatedly. A separate thread writes the queued lines, so that the run never waits for the page.

    Args:
        first_line: the header of the run's trace.
        entrance: the page's address, whose socket this page then owns.
        control: whether the page may change the run.
        data: the folder of the data that references in the records name.

    Attributes:
        control: the control to attach to the run; `None` for a read-only page.
        url: the address for people.
        one_time_url: the address for a browser's command line.
        port: the port of the address.
        token: the permanent key in the address for people.
    """

    def __init__(
        self, first_line: str, entrance: PageAddress, *, control: bool = False, data: Path | None = None
    ) -> None:
        self.control = Control(self._tell_paused) if control else None
        self.url, self.one_time_url = entrance.url, entrance.one_time_url
        self.port, self.token = entrance.port, entrance.token
        self._entrance = entrance
        self._lines: SimpleQueue[str] = SimpleQueue()
        self._process: subprocess.Popen[str] | None = None
        self._threads: list[Thread] = []
        self._gone = False
        socket = entrance.listening.fileno()
        # Keys pass through the pipe: every user of the machine can read command lines.
        keys = {"token": entrance.token, "code": entrance.code}
        self._tell(
            {"begin": first_line, "socket": socket, **keys, "control": control, "data": data and str(data.resolve())}
        )

    def start(self) -> None:
        """Start answering; early connections wait for the process."""
        socket = self._entrance.listening
        self._process = subprocess.Popen(  # noqa: S603  a constant command
            COMMAND,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            pass_fds=[socket.fileno()],
            process_group=0,  # an interrupt from the terminal is for the run only
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            encoding="utf-8",
            errors="backslashreplace",  # JSON escapes half a surrogate pair in just this form; UTF-8 cannot encode it
        )
        socket.close()
        works = ((self._write, self._process.stdin), (self._obey, self._process.stdout))
        self._threads = [Thread(target=work, args=(stream,), name="viewer", daemon=True) for work, stream in works]
        for thread in self._threads:
            thread.start()

    def receive(self, record: Record) -> None:
        """Queue a record for the page; the method is a `Listener` of a trace."""
        if not self._gone:
            self._lines.put(record.to_line())

    def end(self) -> None:
        """Mark the end of the records."""
        self._tell({"end": True})

    def wait(self) -> None:
        """Wait until the page is closed; a `KeyboardInterrupt` ends the wait."""
        if self._process is not None:
            self._process.wait()

    def close(self) -> None:
        """Stop answering; all records are delivered, then the end of the socket notifies the browsers."""
        process, self._process = self._process, None
        if process is None:
            self._entrance.listening.close()
            return
        self._lines.put(_NO_MORE)
        try:
            process.wait(STOPPING_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        for thread in self._threads:
            thread.join(STOPPING_S)

    def _tell(self, said: dict[str, Any]) -> None:
        """Queue a message other than a record; a record begins with its number."""
        self._lines.put(json.dumps(said))

    def _tell_paused(self) -> None:
        if self.control is not None:
            self._tell({"paused": self.control.paused})

    def _write(self, to: IO[str]) -> None:
        """Write queued lines to the process until the end, or until the process has ended."""
        with suppress(OSError), to:
            more = True
            while more:
                lines = [self._lines.get()]
                time.sleep(TELL_EVERY_S)  # lines that arrive meanwhile are sent together
                while not self._lines.empty():
                    lines.append(self._lines.get())
                more = _NO_MORE not in lines
                to.writelines(f"{line}\n" for line in lines if line)
                to.flush()
        self._gone = True

    def _obey(self, commands: IO[str]) -> None:
        """Execute the page's commands; a command that waits for the run delays no other command."""
        with commands, ThreadPoolExecutor(thread_name_prefix="viewer") as hands:
            for line in commands:
                asked = json.loads(line)
                if self.control is not None:
                    doing = hands.submit(self.control.obey, asked["command"])
                    doing.add_done_callback(partial(self._answer, asked["number"]))

    def _answer(self, number: int, done: Future[dict[str, Any]]) -> None:
        error = done.exception()
        if error is None:
            self._tell({"answer": number, "said": done.result()})
        else:
            self._tell({"answer": number, "wrong": reason_of(error)})

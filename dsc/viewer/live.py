"""The page of a run that goes on. A process of its own serves it: the run pays for telling it what happens, no more."""

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

from dsc.viewer.control import Control
from knowledge_base.errors import InputError, described

if TYPE_CHECKING:
    from dsc.trace import Record
    from dsc.viewer.address import PageAddress

COMMAND = (sys.executable, "-P", "-m", "dsc.viewer.page_process")
TELL_EVERY_S = 1 / 30
"""Lines of a run go out together, no more often than a page may show something new."""
STOPPING_S = 5.0
_NO_MORE = ""


class LivePage:
    """A live run in the browser: hears its records from the beginning, answers at `url` from `start` to `close`.

    Records become lines in the run's thread: that is cheaper than to keep them for another thread, as the collector of
    garbage would look at them again and again. They wait in a queue for a thread that does nothing but write; nothing
    that happens to the page makes the run wait.

    Args:
        first_line: the header of the run's trace.
        entrance: where the page is to be had; it is given away.
        control: whether who looks may change the run.

    Attributes:
        control: the hands that the run is to be put in; `None` if it may only be looked at.
        url: the address for people.
        one_time_url: the address for a browser's command line.
        port: of the address.
        token: in the address for people, a key that stays.
    """

    def __init__(self, first_line: str, entrance: PageAddress, *, control: bool = False) -> None:
        self.control = Control(self._tell_paused) if control else None
        self.url, self.one_time_url = entrance.url, entrance.one_time_url
        self.port, self.token = entrance.port, entrance.token
        self._entrance = entrance
        self._lines: SimpleQueue[str] = SimpleQueue()
        self._process: subprocess.Popen[str] | None = None
        self._threads: list[Thread] = []
        self._gone = False
        socket = entrance.listening.fileno()
        # Keys go through the pipe: every user of the machine can read command lines.
        keys = {"token": entrance.token, "code": entrance.code}
        self._tell({"begin": first_line, "socket": socket, **keys, "control": control})

    def start(self) -> None:
        """Answer from now on; who comes at once waits until the process is there."""
        socket = self._entrance.listening
        self._process = subprocess.Popen(  # noqa: S603  the command is ours
            COMMAND,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            pass_fds=[socket.fileno()],
            process_group=0,  # an interrupt from the terminal is for the run
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            encoding="utf-8",
            errors="backslashreplace",  # half a character that UTF-8 cannot say: JSON can, by just that
        )
        socket.close()
        works = ((self._write, self._process.stdin), (self._obey, self._process.stdout))
        self._threads = [Thread(target=work, args=(stream,), name="viewer", daemon=True) for work, stream in works]
        for thread in self._threads:
            thread.start()

    def hear(self, record: Record) -> None:
        """Take in a record; a `Listener` of a trace."""
        if not self._gone:
            self._lines.put(record.to_line())

    def end(self) -> None:
        """There are no more records."""
        self._tell({"end": True})

    def wait(self) -> None:
        """Until it is closed; an interrupt gets through."""
        if self._process is not None:
            self._process.wait()

    def close(self) -> None:
        """Answer no longer; whoever looks is told by the end of the socket, after what there was to tell."""
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
        """Something that is no record: those begin with their number."""
        self._lines.put(json.dumps(said))

    def _tell_paused(self) -> None:
        if self.control is not None:
            self._tell({"paused": self.control.paused})

    def _write(self, to: IO[str]) -> None:
        """Tell the process what there is, until there is no more or it has ended."""
        with suppress(OSError), to:
            more = True
            while more:
                lines = [self._lines.get()]
                time.sleep(TELL_EVERY_S)  # what comes meanwhile goes with it
                while not self._lines.empty():
                    lines.append(self._lines.get())
                more = _NO_MORE not in lines
                to.writelines(f"{line}\n" for line in lines if line)
                to.flush()
        self._gone = True

    def _obey(self, commands: IO[str]) -> None:
        """Do what the page asks for; what must wait for the run keeps nothing else waiting."""
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
            self._tell({"answer": number, "wrong": described(error, named=not isinstance(error, InputError))})

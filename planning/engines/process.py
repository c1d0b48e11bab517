"""A worker process: start, search with a deadline in real time, and termination with all processes of the search."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import selectors
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import weakref
from collections.abc import AsyncGenerator, Callable, Iterable, Sequence
from typing import Any

_LONGEST_ANSWER = 1 << 26  # bytes; endless output must not exhaust the memory

_GRACE = 1.0  # seconds for a worker to report the end of a killed search

_MOST_PROCESSES = 1 << 31  # upper bound of process ids

_LONGEST_WAIT = 3600.0  # seconds; a selector does not support an infinite timeout


def worker(engine: str, megabytes: int | None = None) -> tuple[str, ...]:
    """Return the command of an engine's worker, optionally with the memory limit of a search."""
    limit = () if megabytes is None else (str(megabytes),)
    return (sys.executable, "-P", "-m", "planning.engines.worker", engine, *limit)


class OutOfTimeError(Exception):
    """Error: the deadline of a search or a start has passed."""


class EngineStoppedError(Exception):
    """Error: the search or its process ended, or its output is unreadable."""


class Deadline:
    """A deadline in real time, which any thread may shorten."""

    def __init__(self, seconds: float) -> None:
        """Set the deadline to `seconds` from now."""
        self._at = time.monotonic() + seconds

    @property
    def left(self) -> float:
        """The seconds until the deadline; zero or negative after the deadline."""
        return self._at - time.monotonic()

    def shorten(self, seconds: float) -> None:
        """Move the deadline to at most `seconds` from now."""
        self._at = min(self._at, time.monotonic() + seconds)


class EngineProcess:
    """One running worker process; see `planning.engines.worker` for the protocol.

    The worker leads a separate session, and each search has a separate process group, so that all processes of an
    engine can be killed. Their temporary folder is then deleted. Garbage collection of this object and the exit of the
    interpreter kill all processes. If the owner process is killed, the worker detects the end of its input and ends.
    """

    def __init__(self, command: Sequence[str]) -> None:
        """Start the process, and return without waiting until the process is ready.

        Raises:
            OSError: the command cannot be started.
        """
        its_input, self._to = os.pipe()
        self._from, its_output = os.pipe()
        self._woken, self._wake = os.pipe()
        weakref.finalize(self, _close, (self._to, self._from, self._woken, self._wake))
        folder = tempfile.mkdtemp(prefix="engine-")
        try:
            popen = subprocess.Popen(  # noqa: S603  the command is fixed, or belongs to a test
                command,
                stdin=its_input,
                stdout=its_output,
                stderr=subprocess.DEVNULL,
                env=_environment(folder),
                start_new_session=True,
            )
        except OSError:
            shutil.rmtree(folder, ignore_errors=True)
            raise
        finally:
            _close((its_input, its_output))
        for fd in (self._to, self._wake):
            os.set_blocking(fd, False)
        self._pid = popen.pid
        self._turn = threading.Lock()
        self._ready = False
        self._unsent = memoryview(b"")
        self._received = bytearray()
        self._searches: set[int] = set()
        self._end = weakref.finalize(self, _end, popen, self._searches, folder)

    @property
    def alive(self) -> bool:
        """Whether the process is still running."""
        return self._end.alive and _runs(self._pid)

    @property
    def idle(self) -> bool:
        """Whether the process is ready and handles no request."""
        return self._ready and not self._turn.locked()

    def kill(self) -> None:
        """Kill the process and all processes that it started; a second call has no effect."""
        self._end()
        self.wake()

    def wake(self) -> None:
        """Wake the thread that waits for an answer, so that it checks its deadline again."""
        with contextlib.suppress(BlockingIOError):  # the pipe is full, so the thread wakes in any case
            os.write(self._wake, b"!")

    def start(self, seconds: float) -> None:
        """Wait until the process is ready.

        Raises:
            OutOfTimeError: the process was not ready within `seconds`, and has been killed.
            EngineStoppedError: the process ended, was killed, or wrote unreadable output.
        """
        with self._turn:
            if not self._ready and "ready" not in self._in_time(Deadline(seconds)):
                self.kill()
                raise EngineStoppedError("it did not say that it is ready")
            self._ready = True

    def ask(self, request: bytes, deadline: Deadline, receive: Callable[[dict[str, Any]], object]) -> None:
        """Send a request to the worker, and return after the end of the search.

        Args:
            request: the problem, as a line of JSON.
            deadline: the deadline of the search.
            receive: called with each answer, in this thread.

        Raises:
            OutOfTimeError: the deadline has passed, and the search has been killed. The process has been killed too,
                unless it is ready again.
            EngineStoppedError: the search ended or was killed before an answer, or its answer is unreadable.
        """
        with self._turn:
            self._unsent = memoryview(request)
            answered = False
            while "ended" not in (said := self._in_time(deadline)):
                if "searching" in said:
                    self._follow(said["searching"])
                else:
                    answered = True
                    receive(said)
            self._searches.clear()
            if not answered:
                raise EngineStoppedError(f"the search {_ending(said['ended'])} without an answer")

    def _follow(self, group: object) -> None:
        """Store the process group of the search; raise `EngineStoppedError` for a group of another session."""
        with contextlib.suppress(ProcessLookupError):  # the search has ended with all its processes
            if not isinstance(group, int) or not 0 < group < _MOST_PROCESSES or os.getsid(group) != self._pid:
                self.kill()
                raise EngineStoppedError(f"no separate process group: {str(group)[:80]}")
            self._searches.add(group)

    def _in_time(self, deadline: Deadline) -> dict[str, Any]:
        """Return the next message; after the deadline or an unreadable message, kill the search or the process."""
        try:
            return self._next(deadline)
        except OutOfTimeError:
            self._abandon()
            raise
        except (OSError, ValueError, RecursionError) as error:  # a broken pipe, or output that is not JSON
            self.kill()
            raise EngineStoppedError(str(error)) from error

    def _abandon(self) -> None:
        """Kill the search; kill the process too if it does not soon report the end of the search."""
        if not self._searches:
            self.kill()
            return
        _kill_groups(self._searches)
        grace = Deadline(_GRACE)
        try:
            while "ended" not in self._next(grace):
                pass
        except (OSError, ValueError, RecursionError, OutOfTimeError):
            self.kill()
        self._searches.clear()

    def _next(self, deadline: Deadline) -> dict[str, Any]:
        while b"\n" not in self._received:
            self._exchange(deadline)
        line, _, rest = bytes(self._received).partition(b"\n")
        self._received = bytearray(rest)
        said = json.loads(line)
        if not isinstance(said, dict):
            raise ValueError(f"no answer: {line[:80]!r}")
        return said

    def _exchange(self, deadline: Deadline) -> None:
        """Send and receive as many bytes as the pipes allow without waiting."""
        with selectors.DefaultSelector() as selector:
            selector.register(self._woken, selectors.EVENT_READ)
            selector.register(self._from, selectors.EVENT_READ)
            if self._unsent:
                selector.register(self._to, selectors.EVENT_WRITE)
            if deadline.left <= 0:
                raise OutOfTimeError
            able = {key.fd for key, _ in selector.select(min(deadline.left, _LONGEST_WAIT))}
        if self._woken in able:
            os.read(self._woken, 4096)
        if self._to in able:
            with contextlib.suppress(BrokenPipeError):  # the process has ended; its output reports the end
                self._unsent = self._unsent[os.write(self._to, self._unsent[:65536]) :]
        if self._from in able:
            self._receive()

    def _receive(self) -> None:
        chunk = os.read(self._from, 65536)
        if not chunk:
            raise ValueError(f"the process {_ending(self._status())}")
        self._received += chunk
        if len(self._received) > _LONGEST_ANSWER:
            raise ValueError(f"no answer: over {_LONGEST_ANSWER} bytes without an end")

    def _status(self) -> int | None:
        """Return the exit status of the process; kill a process that only closed its output."""
        return self._end()


def _ending(status: object) -> str:
    if isinstance(status, int) and status < 0:
        return f"was killed by signal {-status}"
    return "was killed" if status is None else f"ended with status {status}"


def _environment(folder: str) -> dict[str, str]:
    """Return the environment of the worker.

    Fixed string hashes make plans repeatable. The module path equals the path of this interpreter.
    """
    modules = os.pathsep.join(filter(None, sys.path))
    return {**os.environ, "PYTHONHASHSEED": "0", "PYTHONPATH": modules, "TMPDIR": folder}


def _runs(pid: int) -> bool:
    """Return whether a child process is running; the test does not reap it, so its id stays reserved."""
    try:
        return os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None
    except ChildProcessError:
        return False


def _end(popen: subprocess.Popen[bytes], searches: set[int], folder: str) -> int:
    _kill_groups([*searches, popen.pid])
    status = popen.wait()
    shutil.rmtree(folder, ignore_errors=True)  # killed engines do not delete their files
    return status


def _kill_groups(groups: Iterable[int]) -> None:
    for group in groups:
        with contextlib.suppress(OSError):  # the group is empty
            os.killpg(group, signal.SIGKILL)


def _close(fds: Iterable[int]) -> None:
    for fd in fds:
        os.close(fd)


async def answers(process: EngineProcess, request: bytes, seconds: float) -> AsyncGenerator[dict[str, Any], None]:
    """Yield the answers of the process when they arrive; closing the generator ends the search.

    Raises:
        OutOfTimeError, EngineStoppedError: as for `EngineProcess.ask`.
    """
    loop, deadline = asyncio.get_running_loop(), Deadline(seconds)
    heard: asyncio.Queue[dict[str, Any] | Exception | None] = asyncio.Queue()

    def tell(what: dict[str, Any] | Exception | None) -> None:
        _call(loop, lambda: heard.put_nowait(what))

    def ask() -> None:
        try:
            process.ask(request, deadline, tell)
        except Exception as error:  # noqa: BLE001  the waiting task receives the error
            tell(error)
        else:
            tell(None)

    threading.Thread(target=ask, daemon=True).start()
    try:
        while (answer := await heard.get()) is not None:
            if isinstance(answer, Exception):
                raise answer
            yield answer
    finally:
        deadline.shorten(0)
        process.wake()


def _call(loop: asyncio.AbstractEventLoop, what: Callable[[], object]) -> None:
    """Call `what` in the loop; do nothing if the loop is closed, since then no task waits."""
    with contextlib.suppress(RuntimeError):
        loop.call_soon_threadsafe(what)

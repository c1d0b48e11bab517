"""A worker process as an object: ask, wait in real time, kill; for a thread that may block."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import threading
import weakref
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

COMMAND = (sys.executable, "-P", "-m", "planning.engines.worker")
_LONGEST_ANSWER = 1 << 26  # bytes; a worker that babbles must not fill our memory


class OutOfTimeError(Exception):
    """The process was killed because its time was up."""


class EngineStoppedError(Exception):
    """The process ended, or said something that is no answer; it is of no use any more."""


class EngineProcess:
    """One running worker (see `planning.engines.worker` for what is said); dies with its owner.

    When the object is forgotten, or the interpreter exits, the process is killed; should the owner itself be
    killed, the worker sees the end of its input.
    """

    def __init__(self, command: Sequence[str] = COMMAND) -> None:
        """Start the process without waiting for it.

        Raises:
            OSError: the command cannot be started.
        """
        self._popen = subprocess.Popen(  # noqa: S603  the command is ours or a test's
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=_environment(),
        )
        self._out_of_time = False
        self.kill = weakref.finalize(self, _end, self._popen)
        """End it now and take it off the process table; calling it again does nothing."""

    @property
    def alive(self) -> bool:
        """Whether it can still be asked."""
        return self.kill.alive and not self._out_of_time and self._popen.poll() is None

    def ask(self, request: Mapping[str, Any] | None, seconds: float) -> dict[str, Any]:
        """The answer to one request (`None`: just listen), within `seconds` of real time.

        Raises:
            OutOfTimeError: the time was up; the process is gone.
            EngineStoppedError: it ended by itself, was killed, or answered rubbish; the process is gone.
        """
        timer = threading.Timer(min(seconds, threading.TIMEOUT_MAX), self._expire)
        timer.daemon = True
        timer.start()
        try:
            return self._exchange(request)
        except (OSError, ValueError) as error:  # a broken pipe or a closed one, or no JSON
            self.kill()
            if self._out_of_time:
                raise OutOfTimeError from error
            raise EngineStoppedError(str(error)) from error
        finally:
            timer.cancel()

    def _exchange(self, request: Mapping[str, Any] | None) -> dict[str, Any]:
        into, out = self._popen.stdin, self._popen.stdout
        if into is None or out is None:
            raise ValueError("the process has no pipes")
        if request is not None:
            into.write(json.dumps(request).encode() + b"\n")
            into.flush()
        line = out.readline(_LONGEST_ANSWER)
        if not line:
            raise ValueError(f"the process ended with status {self._popen.wait()}")
        answer = json.loads(line)
        if not isinstance(answer, dict):
            raise ValueError(f"no answer: {line[:80]!r}")
        return answer

    def _expire(self) -> None:
        self._out_of_time = True
        self._popen.kill()  # the thread that waits for the answer sees its end


def _environment() -> dict[str, str]:
    """Our modules, wherever they were imported from, and fixed string hashes so that plans repeat."""
    return {**os.environ, "PYTHONHASHSEED": "0", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}


def _end(popen: subprocess.Popen[bytes]) -> None:
    popen.kill()
    popen.wait()
    for pipe in (popen.stdin, popen.stdout):
        if pipe is not None:
            with contextlib.suppress(OSError):  # unsent requests have nowhere to go
                pipe.close()

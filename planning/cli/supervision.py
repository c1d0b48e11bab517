"""The supervisor of a host: starts its program again after a crash or a hang, with growing delays (S2.12)."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from dsc.wire.service_manager import ADDRESS, WATCHDOG

SILENCE = 10.0
"""Seconds without a sign of life after which a program counts as hanging, and is killed."""
STARTING = 90.0
"""Seconds for the first sign of life, as a program may load for a long time."""
SHORTEST, LONGEST = 0.5, 30.0
"""Seconds before a restart: the first delay, which doubles with each crash, and the longest delay."""
SETTLED = 60.0
"""Seconds of life after which the next delay is again the shortest."""
_LOOK = 0.2
_MISTAKE = 2
"""Exit status of a program whose input has a mistake, which a restart would repeat."""


class Supervisor:
    """The supervisor of one program, which sends signs of life by the protocol of `ServiceManager`.

    Args:
        command: the program with its arguments.
        say: receives a line about each end and restart.
        silence: see `SILENCE`.
        shortest: see `SHORTEST`.
    """

    def __init__(
        self, command: Sequence[str], say: Callable[[str], None], silence: float = SILENCE, shortest: float = SHORTEST
    ) -> None:
        self._command = command
        self._say = say
        self._silence = silence
        self._shortest = shortest
        self._ends = False
        self._child: subprocess.Popen[bytes] | None = None

    def run(self) -> int:
        """Run the program until it ends by itself, or SIGINT or SIGTERM ends it; return its exit status."""
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._end)
        delay = self._shortest
        with tempfile.TemporaryDirectory() as folder, socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as receiver:
            address = Path(folder) / "signs"
            receiver.bind(str(address))
            receiver.settimeout(_LOOK)
            while True:
                began = time.monotonic()
                reason, status = self._run_once(receiver, address)
                if self._ends or status in {0, _MISTAKE}:
                    return 0 if self._ends else status
                if time.monotonic() - began > SETTLED:
                    delay = self._shortest
                self._say(f"{reason}; it starts again in {delay:g} s")
                self._wait(delay)
                delay = min(2 * delay, LONGEST)
                if self._ends:
                    return 0

    def _run_once(self, receiver: socket.socket, address: Path) -> tuple[str, int]:
        """Run the program one time; return the reason of its end as text, and its exit status."""
        watched = {ADDRESS: str(address), WATCHDOG: str(round(self._silence * 1e6))}
        self._child = child = subprocess.Popen(self._command, env={**os.environ, **watched})  # noqa: S603  # own command
        until = time.monotonic() + max(STARTING, self._silence)
        while child.poll() is None:
            if _receives_sign(receiver):
                until = time.monotonic() + self._silence
            elif time.monotonic() > until:
                child.kill()
                child.wait()
                return f"the program has not responded for {self._silence:g} s, and was killed", -signal.SIGKILL
        status = child.returncode
        how = f"by {signal.Signals(-status).name}" if status < 0 else f"with status {status}"
        return f"the program has ended {how}", status

    def _end(self, *_: object) -> None:
        self._ends = True
        if self._child is not None and self._child.poll() is None:
            with suppress(ProcessLookupError):
                self._child.send_signal(signal.SIGTERM)

    def _wait(self, seconds: float) -> None:
        until = time.monotonic() + seconds
        while not self._ends and (left := until - time.monotonic()) > 0:
            time.sleep(min(left, _LOOK))


def _receives_sign(receiver: socket.socket) -> bool:
    """Return whether the program sends a sign of life within `_LOOK` seconds."""
    with suppress(TimeoutError):
        receiver.recv(64)
        return True
    return False

"""Programs that host a robot on Zenoh, for tests that kill, stop and continue them.

`python wire_programs.py ENDPOINT` hosts `SuiteRobot` on the endpoint, and prints each entry of the robot's log as JSON.
"""

from __future__ import annotations

import asyncio
import json
import random
import signal
import socket
import subprocess
import sys
from contextlib import suppress
from typing import Self

from dsc.sequencer.clock import LoopClock
from dsc.testing.suite_components import SuiteRobot
from dsc.wire import Host, ZenohTransport


def free_endpoint() -> str:
    """Return an endpoint of this machine on which nobody listens."""
    while True:
        port = random.randint(20000, 32000)  # noqa: S311  # below the ports that the system gives to other sockets
        with suppress(OSError), socket.create_server(("127.0.0.1", port)):
            return f"tcp/127.0.0.1:{port}"


class HostProgram:
    """A program that hosts a robot; at the end of the block it is killed."""

    def __init__(self, endpoint: str) -> None:
        command = [sys.executable, __file__, endpoint]
        self._process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert self._process.stdout is not None
        self._lines = self._process.stdout
        assert self._lines.readline() == "ready\n"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._process.poll() is None:
            self.kill()
        self._lines.close()

    def kill(self) -> list[object]:
        """Kill the program without warning; return the robot's log."""
        self._process.kill()
        log = [json.loads(line) for line in self._lines]
        self._process.wait()
        return log

    def stop(self) -> None:
        """Stop the program, as if it hung."""
        self._process.send_signal(signal.SIGSTOP)

    def go_on(self) -> None:
        """Continue the program after `stop`."""
        self._process.send_signal(signal.SIGCONT)


class _PrintedLog(list[object]):
    def append(self, entry: object) -> None:
        print(json.dumps(entry), flush=True)  # noqa: T201
        super().append(entry)


async def _host(endpoint: str) -> None:
    with ZenohTransport(listen=[endpoint]) as transport:
        robot = SuiteRobot()
        robot.log = _PrintedLog()
        Host(robot, transport, LoopClock())
        print("ready", flush=True)  # noqa: T201
        await asyncio.Event().wait()


if __name__ == "__main__":
    with suppress(KeyboardInterrupt):
        asyncio.run(_host(sys.argv[1]))

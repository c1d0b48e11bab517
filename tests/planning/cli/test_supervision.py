"""The supervisor of a host: crashes, hangs, mistakes, orderly ends, and the end of the supervisor itself."""

from __future__ import annotations

import signal
import sys
import textwrap

import pytest

from dsc.wire.service_manager import ADDRESS, ServiceManager
from planning.cli.supervision import Supervisor

SIGN = """
    import os, socket, sys, time, pathlib
    log = pathlib.Path(sys.argv[1])
    lives = len(log.read_text()) if log.exists() else 0
    log.write_text("x" * (lives + 1))
    def sign():
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as one:
            one.sendto(b"WATCHDOG=1", os.environ["NOTIFY_SOCKET"])
"""


@pytest.fixture
def supervise(tmp_path):
    """Run a program under a supervisor; return its exit status, the number of its lives and the lines."""
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def run(code, **how):
        said: list[str] = []
        script, log = tmp_path / "program.py", tmp_path / "lives"
        script.write_text(textwrap.dedent(SIGN) + textwrap.dedent(code))
        supervisor = Supervisor([sys.executable, str(script), str(log)], said.append, shortest=0.05, **how)
        return supervisor.run(), len(log.read_text()), said

    yield run
    for number, handler in handlers.items():
        signal.signal(number, handler)


def test_a_program_that_crashes_starts_again_with_growing_delays(supervise):
    status, lives, said = supervise("sys.exit(0 if lives == 3 else 7)")
    assert (status, lives) == (0, 4)
    assert said == [
        "the program has ended with status 7; it starts again in 0.05 s",
        "the program has ended with status 7; it starts again in 0.1 s",
        "the program has ended with status 7; it starts again in 0.2 s",
    ]


def test_a_program_that_is_killed_starts_again(supervise):
    status, lives, said = supervise("os.kill(os.getpid(), 9 if lives == 0 else 0)")
    assert (status, lives) == (0, 2)
    assert said == ["the program has ended by SIGKILL; it starts again in 0.05 s"]


def test_a_program_that_hangs_after_a_sign_of_life_is_killed(supervise):
    status, lives, said = supervise("sign()\nif lives == 0: time.sleep(600)", silence=0.3)
    assert (status, lives) == (0, 2)
    assert said == ["the program has not responded for 0.3 s, and was killed; it starts again in 0.05 s"]


def test_a_program_that_loads_for_a_long_time_is_left_alone(supervise):
    status, lives, said = supervise("time.sleep(1)", silence=0.1)
    assert (status, lives, said) == (0, 1, [])


def test_a_mistake_in_the_input_is_not_repeated(supervise):
    assert supervise("sys.exit(2)") == (2, 1, [])


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_program_and_supervisor(supervise, number):
    code = """
        import signal
        signal.signal(signal.SIGTERM, lambda *_: sys.exit(5))
        os.kill(os.getppid(), NUMBER)
        time.sleep(60)
    """
    status, lives, said = supervise(code.replace("NUMBER", str(int(number))))
    assert (status, lives, said) == (0, 1, [])


def test_a_program_without_its_manager_knows_it(tmp_path, monkeypatch):
    import asyncio

    monkeypatch.delenv(ADDRESS, raising=False)
    assert ServiceManager().notify(b"READY=1")
    gone = ServiceManager(str(tmp_path / "gone"))
    assert not gone.notify(b"READY=1")
    asyncio.run(asyncio.wait_for(gone.watch(), 5))

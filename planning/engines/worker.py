"""The planner process: `python -m planning.engines.worker ENGINE [MEGABYTES]`.

It imports the engine once and then forks for each problem. So every search starts from the same state of the
process (the same problem gets the same plan), can be ended without ending the worker, gives back its memory,
and may crash as it likes.

One JSON object a line. The worker begins with `{"ready": true}`. For each problem (see `planning.engines.request`) on
standard input it says `{"searching": G}`, G being the process group of the search and of all that it starts;
then answers, `{"actions": [3, 0, ...]}` or, with the seconds at which each begins and that it takes, `{"timed":
[[3, 0.0, 5.0], ...]}` (each plan better than the one before), `{"actions": null}` when there
is proven to be no plan, or `{"failed": "why"}`; and at last, always, `{"ended": STATUS}`. With what an engine answers
goes `"translated"`: the seconds of processor time for reading the problem and putting it into the engine's words. It
ends when its standard input does, and the search with it: a planner never outlives who asked.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import json
import os
import resource
import select
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from typing import Any, NoReturn

_PR_SET_CHILD_SUBREAPER = 36  # linux/prctl.h

Schedule = dict[str, list[tuple[int, float, float]]]
"""A plan with times as it is answered."""

Answers = Iterator[list[int] | Schedule | None]
"""What an engine finds, which it searches for when asked for the next one."""

Request = Mapping[str, Any]
"""A problem as it is read, with numbers for facts, which is all that most engines want to know."""

Search = Callable[[Request], Answers]
"""Puts a problem into the engine's words; the search begins when the first answer is asked for."""

MEGABYTES = 2048
"""Memory that a search may take, each of its processes by itself, if nobody says otherwise."""


def main() -> None:
    """Serve until standard input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the one who asked
    name, megabytes = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else MEGABYTES
    out = _claim_stdout()
    _adopt_orphans()
    search = _loaded(name)
    gc.freeze()  # what is there now is shared by all searches
    _say(out, {"ready": True})
    for line in sys.stdin.buffer:
        _serve(line, search, out, megabytes)


def _claim_stdout() -> int:
    """Our answers' way out; whatever libraries print goes to standard error instead."""
    out = os.dup(1)
    os.dup2(2, 1)
    return out


def _adopt_orphans() -> None:
    """What a search has started and left is ours to bury (Linux); in a container often nobody else does."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


def _say(out: int, said: dict[str, Any]) -> None:
    data = json.dumps(said).encode() + b"\n"
    while data:
        data = data[os.write(out, data) :]


def _loaded(name: str) -> Search:
    """The engine's search; if it cannot be imported, one that says so to each problem."""
    try:
        import planning.strips  # noqa: F401, PLC0415  before the first fork, so that no search pays for it
        from planning.engines.registry import engine  # noqa: PLC0415

        one = engine(name)
        driver = import_module(f"planning.engines.{one.driver}")
        searching: Search = driver.searching(one)
    except Exception as error:  # noqa: BLE001  a broken installation is an answer, too
        failure = error

        def failing(request: Request) -> Answers:  # noqa: ARG001
            raise failure

        return failing
    return searching


def _serve(line: bytes, search: Search, out: int, megabytes: int) -> None:
    heard, said = os.pipe()
    lifeline, held = os.pipe()
    child = os.fork()
    if child == 0:
        for fd in (heard, held, out):
            os.close(fd)
        _search(line, search, said, lifeline, megabytes)
    os.close(said)
    os.close(lifeline)
    _in_group(child)
    _say(out, {"searching": child})
    _relay(heard, out, child)
    os.close(heard)
    os.close(held)
    _say(out, {"ended": _reaped(child)})


def _in_group(child: int) -> None:
    """Both sides do this, since either may be first."""
    with contextlib.suppress(OSError):  # it has done so and gone already
        os.setpgid(child, child)


def _relay(heard: int, out: int, child: int) -> None:
    """Hand on what the search says until it ends; end it when our own input does."""
    poll = select.poll()
    poll.register(heard, select.POLLIN)
    poll.register(0, 0)  # nothing is asked meanwhile: only the hang-up is of interest
    last = b"\n"
    while True:
        events = dict(poll.poll())
        if 0 in events:
            _kill_group(child)
            os._exit(0)
        chunk = os.read(heard, 65536)
        if not chunk:
            break
        last = chunk
        while chunk:
            chunk = chunk[os.write(out, chunk) :]
    if not last.endswith(b"\n"):
        os.write(out, b"\n")


def _reaped(child: int) -> int:
    """Its exit status, negative for a signal; what it has left running is gone."""
    os.waitid(os.P_PID, child, os.WEXITED | os.WNOWAIT)  # while it is a zombie, its group's number is taken
    _kill_group(child)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    with contextlib.suppress(ChildProcessError):  # that was the last of the group
        while True:
            os.waitpid(-child, 0)
    return status


def _kill_group(group: int) -> None:
    with contextlib.suppress(OSError):
        os.killpg(group, signal.SIGKILL)


def _search(line: bytes, search: Search, said: int, lifeline: int, megabytes: int) -> NoReturn:
    """What the forked process does; it never returns to the loop that it was forked from."""
    try:
        _in_group(0)
        threading.Thread(target=_end_with, args=(lifeline,), daemon=True).start()
        _limit_memory(megabytes)
        _answer(line, search, said)
        os._exit(0)
    finally:
        os._exit(1)


def _end_with(lifeline: int) -> None:
    """End this search with the worker, should that be killed before it could do so itself."""
    os.read(lifeline, 1)
    os.killpg(0, signal.SIGKILL)


def _limit_memory(megabytes: int) -> None:
    """Bound what each process of the search may write to.

    RLIMIT_DATA, unlike RLIMIT_AS, counts no address space that is only reserved, of which Java takes many
    gigabytes. It is kept by Linux (4.7 and later), not by macOS.
    """
    allowed = megabytes << 20
    resource.setrlimit(resource.RLIMIT_DATA, (allowed, allowed))
    # Half of it as heap, so that Java says itself that it has no more; should it crash, it writes no files for that.
    unwritten = "-XX:ErrorFile=/dev/null -XX:ReplayDataFile=/dev/null"
    os.environ["JAVA_TOOL_OPTIONS"] = f"-Xmx{max(16, megabytes // 2)}m {unwritten}"


def _answer(line: bytes, search: Search, said: int) -> None:
    try:
        began = time.thread_time()
        answers = search(json.loads(line))
        translated = time.thread_time() - began
        for actions in answers:
            answer = actions if isinstance(actions, dict) else {"actions": actions}
            _say(said, {**answer, "translated": translated})
    except MemoryError:
        _say(said, {"failed": "it ran out of memory"})
    except Exception as error:  # noqa: BLE001  an engine may raise anything
        from knowledge_base.errors import described  # noqa: PLC0415  a search that goes well does without

        _say(said, {"failed": described(error)})


if __name__ == "__main__":
    main()

"""The planner process: `python -m planning.engines.worker ENGINE [MEGABYTES]`.

The worker imports the engine once and forks for each problem. Every search starts from the same state of the process,
so that the same problem gets the same plan. The worker survives when a search is killed or crashes, and the search
returns its memory.

The protocol has one JSON object a line. The worker begins with `{"ready": true}`. It reads problems (see
`planning.engines.request`) from standard input and writes for each:

- `{"searching": G}`, with the process group G of the search and its processes.
- Answers, each better than the one before: `{"actions": [3, 0, ...]}` or, with start and duration in seconds,
  `{"timed": [[3, 0.0, 5.0], ...]}`.
- `{"actions": null}` if the engine proves that there is no plan, or `{"failed": "why"}`.
- At last, always, `{"ended": STATUS}`.

Each answer has `"translated"`: seconds of processor time for reading the problem and translating it for the engine. The
worker and its search end with standard input, so that a planner never outlives its caller.
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
"""An answer with a temporal plan: index, start and duration in seconds."""

Answers = Iterator[list[int] | Schedule | None]
"""An engine's answers; each is searched for on demand."""

Request = Mapping[str, Any]
"""A decoded problem with fact numbers, sufficient for most engines."""

Search = Callable[[Request], Answers]
"""Translates a problem for the engine; the search begins with the first answer."""

MEGABYTES = 2048
"""Default memory limit of each process of a search."""


def main() -> None:
    """Serve until standard input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the caller
    name, megabytes = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else MEGABYTES
    out = _claim_stdout()
    _adopt_orphans()
    search = _loaded(name)
    gc.freeze()  # all searches share the present objects
    _say(out, {"ready": True})
    for line in sys.stdin.buffer:
        _serve(line, search, out, megabytes)


def _claim_stdout() -> int:
    """Return the descriptor for answers; output of libraries goes to standard error instead."""
    out = os.dup(1)
    os.dup2(2, 1)
    return out


def _adopt_orphans() -> None:
    """Adopt processes that a search leaves behind (Linux); a container often has no init process that does."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


def _say(out: int, said: dict[str, Any]) -> None:
    data = json.dumps(said).encode() + b"\n"
    while data:
        data = data[os.write(out, data) :]


def _loaded(name: str) -> Search:
    """Return the engine's search; if its import fails, one that reports the failure for each problem."""
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
    """Create the process group; parent and child both do, since either may be first."""
    with contextlib.suppress(OSError):  # the child has done so and ended already
        os.setpgid(child, child)


def _relay(heard: int, out: int, child: int) -> None:
    """Relay the search's output until its end; kill it at the end of the worker's input."""
    poll = select.poll()
    poll.register(heard, select.POLLIN)
    poll.register(0, 0)  # no request arrives meanwhile: only the hang-up counts
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
    """Return the exit status, negative for a signal, after killing the search's remaining processes."""
    os.waitid(os.P_PID, child, os.WEXITED | os.WNOWAIT)  # while it is a zombie, its group's number is reserved
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
    """Run the search in the forked process and exit; it never returns to the parent's loop."""
    try:
        _in_group(0)
        threading.Thread(target=_end_with, args=(lifeline,), daemon=True).start()
        _limit_memory(megabytes)
        _answer(line, search, said)
        os._exit(0)
    finally:
        os._exit(1)


def _end_with(lifeline: int) -> None:
    """Kill this search if the worker dies before it could."""
    os.read(lifeline, 1)
    os.killpg(0, signal.SIGKILL)


def _limit_memory(megabytes: int) -> None:
    """Limit the writable memory of each process of the search.

    RLIMIT_DATA, unlike RLIMIT_AS, does not count reserved address space, of which Java takes many gigabytes. Linux (4.7
    and later) enforces it, macOS does not.
    """
    allowed = megabytes << 20
    resource.setrlimit(resource.RLIMIT_DATA, (allowed, allowed))
    # Half of the memory is Java's heap, so that Java reports its exhaustion; a crash of Java must leave no files.
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
        from knowledge_base.errors import described  # noqa: PLC0415  a successful search does without

        _say(said, {"failed": described(error)})


if __name__ == "__main__":
    main()

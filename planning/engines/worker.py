"""The planner process: `python -m planning.engines.worker ENGINE [MEGABYTES]`.

The worker imports the engine, and then forks a process for each problem. Every search therefore starts from an equal
process state, so that equal problems have equal plans. The worker continues if a search is killed or crashes, and the
end of a search frees its memory.

The protocol has one JSON object per line. The worker first writes `{"ready": true}`. It reads problems (see
`planning.engines.request`) from standard input, and writes for each problem:

- `{"searching": G}`, with the process group G of the search.
- Answers, each better than the previous one: `{"actions": [3, 0, ...]}` or, with start and duration in seconds,
  `{"timed": [[3, 0.0, 5.0], ...]}`.
- `{"actions": null}` if the engine proves that there is no plan, or `{"failed": "why"}`.
- `{"ended": STATUS}`, always as the last line.

Each answer contains `"translated"`: the processor time, in seconds, for reading the problem and translating it for the
engine. The worker and its search end when standard input ends, so that no planner continues after the end of its
caller.
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
"""An answer with a temporal plan: index, start and duration of each action; times in seconds."""

Answers = Iterator[list[int] | Schedule | None]
"""An iterator over the answers of an engine; the search for an answer begins when the answer is requested."""

Request = Mapping[str, Any]
"""A decoded request; most engines work with the fact numbers."""

Search = Callable[[Request], Answers]
"""A function that translates a problem for the engine; the search begins with the first `next` of the iterator."""

MEGABYTES = 2048
"""The default memory limit of each process of a search, in megabytes."""


def main() -> None:
    """Handle requests until standard input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the caller handles Ctrl-C
    name, megabytes = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else MEGABYTES
    out = _claim_stdout()
    _adopt_orphans()
    search = _load(name)
    gc.freeze()  # forked searches share the existing objects
    _say(out, {"ready": True})
    for line in sys.stdin.buffer:
        _serve(line, search, out, megabytes)


def _claim_stdout() -> int:
    """Return the descriptor for answers, and redirect standard output of libraries to standard error."""
    out = os.dup(1)
    os.dup2(2, 1)
    return out


def _adopt_orphans() -> None:
    """Adopt orphaned processes of a search (Linux), since a container often lacks an init process that adopts them."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


def _say(out: int, said: dict[str, Any]) -> None:
    data = json.dumps(said).encode() + b"\n"
    while data:
        data = data[os.write(out, data) :]


def _load(name: str) -> Search:
    """Return the engine's search function; if its import fails, a function that raises the error for each problem."""
    try:
        import planning.model.problem  # noqa: F401, PLC0415  before the first fork, so that no search imports it
        from planning.engines.registry import engine  # noqa: PLC0415

        one = engine(name)
        driver = import_module(f"planning.engines.{one.driver}")
        searching: Search = driver.searching(one)
    except Exception as error:  # noqa: BLE001  each request then receives the import error
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
    _say(out, {"ended": _reap(child)})


def _in_group(child: int) -> None:
    """Create the process group; parent and child both call this, since either process may run first."""
    with contextlib.suppress(OSError):  # the child has created the group, or has ended
        os.setpgid(child, child)


def _relay(heard: int, out: int, child: int) -> None:
    """Copy the output of the search to `out` until the search ends; kill the search if the worker's input ends."""
    poll = select.poll()
    poll.register(heard, select.POLLIN)
    poll.register(0, 0)  # during a search no request arrives, so only a hang-up matters
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


def _reap(child: int) -> int:
    """Kill the remaining processes of the search, and return the exit status of the search, negative for a signal."""
    os.waitid(os.P_PID, child, os.WEXITED | os.WNOWAIT)  # the zombie reserves the number of its process group
    _kill_group(child)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    with contextlib.suppress(ChildProcessError):  # no process of the group is left
        while True:
            os.waitpid(-child, 0)
    return status


def _kill_group(group: int) -> None:
    with contextlib.suppress(OSError):
        os.killpg(group, signal.SIGKILL)


def _search(line: bytes, search: Search, said: int, lifeline: int, megabytes: int) -> NoReturn:
    """Run the search in the forked process and exit; never return to the loop of the parent."""
    try:
        _in_group(0)
        threading.Thread(target=_end_with, args=(lifeline,), daemon=True).start()
        _limit_memory(megabytes)
        _answer(line, search, said)
        os._exit(0)
    finally:
        os._exit(1)


def _end_with(lifeline: int) -> None:
    """Kill this search if the worker dies before it can kill the search."""
    os.read(lifeline, 1)
    os.killpg(0, signal.SIGKILL)


def _limit_memory(megabytes: int) -> None:
    """Limit the writable memory of each process of the search.

    RLIMIT_DATA, unlike RLIMIT_AS, does not count reserved address space, of which Java reserves many gigabytes. Linux
    from version 4.7 enforces the limit; macOS does not.
    """
    allowed = megabytes << 20
    resource.setrlimit(resource.RLIMIT_DATA, (allowed, allowed))
    # Java uses half of the memory as its heap, so that Java itself reports exhaustion. A crash of Java must leave no
    # files.
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
    except Exception as error:  # noqa: BLE001  an engine may raise any error
        from knowledge_base.user_objects import described  # noqa: PLC0415  a successful search does not need this import

        _say(said, {"failed": described(error)})


if __name__ == "__main__":
    main()

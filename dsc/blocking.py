"""Skills that block: in a thread, or in a new process. Cancellation and deadline always take effect.

While a body blocks, simulated time stands still, so deadlines count real seconds. Threads are daemons: one that does
not stop is abandoned after `STOPPING` seconds and does not keep the program alive. A process is ended, also when the
program dies. So nothing moves while another program resumes the run.
"""

from __future__ import annotations

import asyncio
import ctypes
import math
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass, field
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

from dsc.calls import OBSERVED, Outcome, SkillCall
from knowledge_base.errors import described
from knowledge_base.facts import Delta

STOPPING = 2.0
"""Real seconds for a body to stop after the request."""
_KILLING = 3
"""Multiples of `STOPPING` until a process is abandoned: it is terminated, then killed."""
_POLL = 0.02
"""Real seconds between two checks for a stop request."""
MOST_REPORTED = 1_000
"""Reports that the loop has not taken; the body waits before the next one."""
_PR_SET_PDEATHSIG = 1
"""Of Linux's `prctl`: the signal that a process gets when its parent dies."""


class DeadlineError(TimeoutError):
    """The time of a skill is over."""


class StoppedError(BaseException):
    """A blocking body must stop; not an `Exception`, so that no handler catches it by mistake."""


@dataclass(frozen=True, slots=True)
class BlockingCall:
    """One execution of a skill, as its blocking body sees it.

    Attributes:
        action_id: as in `SkillCall`.
        report: as in `SkillCall`; may be used from the thread or process that the body runs in. It waits while
            `MOST_REPORTED` are on their way, and raises as `sleep`.
        seconds: real seconds that the body has at most.
        stopping: is set when the body must stop; never in a process, which is ended instead.
    """

    action_id: str
    report: Callable[[Outcome], None]
    seconds: float
    stopping: threading.Event = field(default_factory=threading.Event)

    def observe(self, observed: Delta) -> None:
        """As in `SkillCall`."""
        self.report(Outcome(OBSERVED, observed=observed))

    def sleep(self, seconds: float = 0.0) -> None:
        """Wait for real seconds; with none, only look whether to stop.

        Raises:
            StoppedError: the skill was cancelled, or its deadline has passed.
        """
        if self.stopping.wait(seconds):
            raise StoppedError


async def in_thread(body: Callable[..., Outcome], call: SkillCall, arguments: Mapping[str, Any]) -> Outcome:
    """Run `body(BlockingCall, **arguments)` in a thread.

    Raises:
        DeadlineError: the deadline has passed.
    """
    blocking = _blocking(call)
    return await _supervised(lambda: body(blocking, **arguments), blocking, call, "thread", STOPPING)


async def in_process(body: Callable[..., Outcome], name: str, call: SkillCall, arguments: Mapping[str, Any]) -> Outcome:
    """Run `body(BlockingCall, **arguments)` in a fresh process; raises as `in_thread`.

    Raises:
        RuntimeError: the body raised, or its process ended by itself.
    """
    blocking = _blocking(call)
    work = partial(_in_child, body, name, blocking, arguments)
    return await _supervised(work, blocking, call, "process", _KILLING * STOPPING)


def _blocking(call: SkillCall) -> BlockingCall:
    loop = asyncio.get_running_loop()
    room = threading.BoundedSemaphore(MOST_REPORTED)

    def take(outcome: Outcome) -> None:
        room.release()
        call.report(outcome)

    def report(outcome: Outcome) -> None:
        while not room.acquire(timeout=_POLL):
            blocking.sleep()
        loop.call_soon_threadsafe(take, outcome)

    blocking = BlockingCall(call.action_id, report, call.remaining)
    return blocking


async def _supervised(
    work: Callable[[], Outcome], blocking: BlockingCall, call: SkillCall, what: str, stopping: float
) -> Outcome:
    """Run work in a daemon thread; request its stop at the cancellation of the skill or at its deadline.

    If it has not stopped after `stopping` real seconds, `what` the body runs in is abandoned and reported.
    """
    loop = asyncio.get_running_loop()
    ended: asyncio.Future[Outcome] = loop.create_future()

    def post(tell: Callable[[Any], None], value: object) -> None:
        with suppress(RuntimeError):  # the loop is closed: this work was abandoned
            loop.call_soon_threadsafe(lambda: None if ended.done() else tell(value))

    def run() -> None:
        try:
            outcome = work()
        except BaseException as error:  # noqa: BLE001  # e.g. SystemExit: it must not end in silence
            stopped = issubclass(type(error), StoppedError) and blocking.stopping.is_set()
            post(ended.set_exception, DeadlineError() if stopped else _carried_over(error))
        else:
            post(ended.set_result, outcome)

    def stop() -> None:
        blocking.stopping.set()
        watchers.append(_later(stopping, lambda: post(leave_alone, None)))

    def leave_alone(_: None) -> None:
        call.give_up(f"the {what} of action '{call.action_id}' went on for {stopping:g} s after it was told to stop")
        ended.set_exception(DeadlineError())

    watchers: list[threading.Timer] = []
    if math.isfinite(blocking.seconds):
        watchers.append(_later(max(blocking.seconds, 0.0), stop))
    threading.Thread(target=run, name=f"skill {blocking.action_id}", daemon=True).start()
    try:
        with _hold(call):
            return await _until_stopped(ended, stop)
    finally:
        for watcher in tuple(watchers):
            watcher.cancel()


def _carried_over(error: BaseException) -> Exception:
    """A thread's error in a form for a future: not `StopIteration`, and not one that would end the program."""
    with suppress(BaseException):  # an exception may fail when it is asked for its class
        if isinstance(error, Exception) and not isinstance(error, StopIteration | type):
            return error
    return RuntimeError(described(error))


async def _until_stopped(ended: asyncio.Future[Outcome], stop: Callable[[], None]) -> Outcome:
    try:
        return await asyncio.shield(ended)
    except asyncio.CancelledError:
        stop()
        with suppress(Exception):
            await asyncio.shield(ended)
        raise


def _later(seconds: float, do: Callable[[], None]) -> threading.Timer:
    timer = threading.Timer(seconds, do)
    timer.daemon = True
    timer.start()
    return timer


def _hold(call: SkillCall) -> AbstractContextManager[None]:
    hold: Callable[[], AbstractContextManager[None]] = getattr(call.clock, "hold", nullcontext)
    return hold()


# -- the process ---------------------------------------------------------------------------------------------


def _in_child(body: Callable[..., Outcome], name: str, blocking: BlockingCall, arguments: Mapping[str, Any]) -> Outcome:
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    given = (theirs, body, blocking.action_id, blocking.seconds, dict(arguments))
    process = context.Process(target=_child, args=given, name=f"skill of {name}", daemon=True)
    process.start()
    theirs.close()
    try:
        return _heard(ours, process, blocking)
    finally:
        _end(process)
        ours.close()


def _heard(ours: Connection, process: BaseProcess, blocking: BlockingCall) -> Outcome:
    """Pass on the child's reports until its end; return its outcome."""
    while True:
        while not ours.poll(_POLL):
            blocking.sleep()
        try:
            kind, said = ours.recv()
        except EOFError:
            process.join(STOPPING)
            raise RuntimeError(f"its process ended with exit code {process.exitcode}") from None
        if kind == "report":
            blocking.report(said)
        elif kind == "error":
            raise RuntimeError(said)
        else:
            ended: Outcome = said
            return ended


def _end(process: BaseProcess) -> None:
    process.terminate()
    process.join(STOPPING)
    if process.is_alive():
        process.kill()
        process.join()  # a process that hangs in a device takes time even then: it is abandoned
    process.close()


def _child(
    theirs: Connection, body: Callable[..., Outcome], action_id: str, seconds: float, arguments: Mapping[str, Any]
) -> None:
    _end_with_parent()
    call = BlockingCall(action_id, lambda outcome: theirs.send(("report", outcome)), seconds)
    try:
        theirs.send(("ended", body(call, **arguments)))
    except BaseException as error:  # noqa: BLE001  # any error reaches the parent as text
        with suppress(OSError):  # the parent is gone
            theirs.send(("error", described(error)))


def _end_with_parent() -> None:
    """End this process with its parent: it has no deadline itself, and a resumed run acts again.

    Linux's kernel does so also while the body blocks all other threads of this process. It reacts to the death of the
    thread that started this process, which lives as long as its supervision.
    """
    parent = multiprocessing.parent_process()
    assert parent is not None  # noqa: S101
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if not parent.is_alive():  # it died before the kernel was asked
        os._exit(1)

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, name="ends with its parent", daemon=True).start()

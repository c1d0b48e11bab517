"""Execution of skills whose body blocks, in a thread or in a new process.

A cancellation and a deadline always take effect. While a body blocks, simulated time does not advance, so the body's
deadline counts real seconds. Threads are daemons: a thread that ignores the stop request is abandoned after `STOPPING`
seconds and does not keep the program alive. A process is ended, also when the program dies. So no body of the old
program acts while another program resumes the run.
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
from contextlib import suppress
from contextvars import copy_context
from dataclasses import dataclass, field
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any, Generic, cast

from dsc.calls import OBSERVED, Reported_contra, SkillCall
from dsc.errors import ProgrammingError, SkillError
from dsc.outcomes import Outcome
from dsc.run_log import run_logger
from knowledge_base.facts import Delta
from knowledge_base.tracebacks import raised_at, whole_traceback
from knowledge_base.user_objects import as_exception, described, has_type

_LOG = run_logger("dsc.skills")

STOPPING = 2.0
"""Real seconds between the stop request and the end of a body, at most."""
_KILLING = 3
"""Number of `STOPPING` periods after which a process is abandoned; before, it is terminated, then killed."""
_POLL = 0.02
"""Real seconds between two checks for a stop request."""
MOST_REPORTED = 1_000
"""Number of reports that may wait for the event loop; with more, the body waits before its next report."""
_PR_SET_PDEATHSIG = 1
"""Option of Linux's `prctl`: the signal that a process receives when its parent dies."""


class DeadlineError(TimeoutError):
    """The deadline of a skill has passed."""


class StoppedError(BaseException):
    """The request that a blocking body stops. No handler of `Exception` catches it by mistake."""


@dataclass(frozen=True, slots=True)
class BlockingCall(Generic[Reported_contra]):
    """One execution of a skill, as its blocking body receives it.

    Attributes:
        action_id: as in `SkillCall`.
        report: as in `SkillCall`; callable from the thread or process of the body. While `MOST_REPORTED` reports wait
            for the event loop, the call waits too, and raises `StoppedError` as `sleep` does.
        seconds: real seconds until the deadline, from the start of the body.
        stopping: is set when a body in a thread must stop. A body in a process never sees it set: the process is ended.
    """

    action_id: str
    report: Callable[[Reported_contra], None]
    seconds: float
    stopping: threading.Event = field(default_factory=threading.Event)

    def observe(self, observed: Delta) -> None:
        """Report observed facts immediately, as `SkillCall.observe` does."""
        self.report(cast(Any, Outcome(OBSERVED, observed=observed)))

    def sleep(self, seconds: float = 0.0) -> None:
        """Wait for `seconds` of real time; with 0, only check for a stop request.

        Raises:
            StoppedError: the skill was cancelled, or the skill's deadline has passed.
        """
        if self.stopping.wait(seconds):
            raise StoppedError


async def in_thread(body: Callable[..., Outcome], call: SkillCall[Any], arguments: Mapping[str, Any]) -> Outcome:
    """Run `body(BlockingCall, **arguments)` in a thread, and return its outcome.

    Raises:
        DeadlineError: the deadline has passed.
    """
    blocking = _blocking(call)
    return await _run_supervised(lambda: body(blocking, **arguments), blocking, call, "thread", STOPPING)


async def in_process(
    body: Callable[..., Outcome], name: str, call: SkillCall[Any], arguments: Mapping[str, Any]
) -> Outcome:
    """Run `body(BlockingCall, **arguments)` in a fresh process, and return its outcome.

    Raises:
        DeadlineError: the deadline has passed.
        SkillError: the process ended without an outcome, or the body raised a declared exception.
        ProgrammingError: the body raised another exception.
    """
    blocking = _blocking(call)
    work = partial(_in_child, body, name, blocking, arguments)
    return await _run_supervised(work, blocking, call, "process", _KILLING * STOPPING)


def _blocking(call: SkillCall[Any]) -> BlockingCall:
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


async def _run_supervised(
    work: Callable[[], Outcome], blocking: BlockingCall, call: SkillCall[Any], what: str, stopping: float
) -> Outcome:
    """Run `work` in a daemon thread; request its stop when the skill is cancelled or reaches its deadline.

    Work that has not stopped `stopping` real seconds after the request is abandoned. The call then reports `what` was
    abandoned: the thread or the process.
    """
    loop = asyncio.get_running_loop()
    ended: asyncio.Future[Outcome] = loop.create_future()

    def post(tell: Callable[[Any], None], value: object) -> None:
        with suppress(RuntimeError):  # the loop is closed, as this work was abandoned
            loop.call_soon_threadsafe(lambda: None if ended.done() else tell(value))

    def run() -> None:
        try:
            outcome = work()
        except BaseException as error:  # noqa: BLE001  # e.g. SystemExit, which would otherwise end the thread without a report
            stopped = has_type(error, StoppedError) and blocking.stopping.is_set()
            post(ended.set_exception, DeadlineError() if stopped else as_exception(error))
        else:
            post(ended.set_result, outcome)

    def stop() -> None:
        blocking.stopping.set()
        watchers.append(_later(stopping, lambda: post(leave_alone, None)))

    def leave_alone(_: None) -> None:
        call.abandon(f"the {what} of action '{call.action_id}' went on for {stopping:g} s after it was told to stop")
        ended.set_exception(DeadlineError())

    watchers: list[threading.Timer] = []
    if math.isfinite(blocking.seconds):
        watchers.append(_later(max(blocking.seconds, 0.0), stop))
    threading.Thread(target=copy_context().run, args=(run,), name=f"skill {blocking.action_id}", daemon=True).start()
    try:
        with call.clock.hold():
            return await _until_stopped(ended, stop)
    finally:
        for watcher in tuple(watchers):
            watcher.cancel()


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


# -- the process ---------------------------------------------------------------------------------------------


def _in_child(body: Callable[..., Outcome], name: str, blocking: BlockingCall, arguments: Mapping[str, Any]) -> Outcome:
    context = multiprocessing.get_context("spawn")
    connection, theirs = context.Pipe()
    given = (theirs, body, name, blocking.action_id, blocking.seconds, dict(arguments))
    process = context.Process(target=_child, args=given, name=f"skill of {name}", daemon=True)
    process.start()
    theirs.close()
    try:
        return _outcome_from(connection, process, blocking)
    finally:
        _end(process)
        connection.close()


def _outcome_from(connection: Connection, process: BaseProcess, blocking: BlockingCall) -> Outcome:
    """Pass the child's reports to `blocking.report` until the child ends; return the child's outcome."""
    while True:
        while not connection.poll(_POLL):
            blocking.sleep()
        try:
            kind, said = connection.recv()
        except EOFError:
            process.join(STOPPING)
            raise SkillError(f"its process ended with exit code {process.exitcode}") from None
        if kind == "report":
            blocking.report(said)
        elif kind == "error":
            raise SkillError(said)
        elif kind == "bug":
            message, traceback = said
            _LOG.error("%s\n%s", message, traceback)
            raise ProgrammingError(message)
        else:
            ended: Outcome = said
            return ended


def _end(process: BaseProcess) -> None:
    process.terminate()
    process.join(STOPPING)
    if process.is_alive():
        process.kill()
        process.join()  # a process that hangs in a device driver is slow to end even after a kill: it is abandoned
    process.close()


def _child(
    theirs: Connection,
    body: Callable[..., Outcome],
    name: str,
    action_id: str,
    seconds: float,
    arguments: Mapping[str, Any],
) -> None:
    _end_with_parent()
    call = BlockingCall(action_id, lambda outcome: theirs.send(("report", outcome)), seconds)
    try:
        theirs.send(("ended", body(call, **arguments)))
    except BaseException as error:  # noqa: BLE001  # any error reaches the parent as text
        with suppress(OSError):  # the parent process has ended
            theirs.send(_news_of(error, body, name))


def _news_of(error: BaseException, body: Callable[..., Outcome], name: str) -> tuple[str, Any]:
    """Return the message about an error of the body, as text: the parent process may be unable to read the error."""
    declared = (SkillError, *getattr(getattr(body, "__self__", None), "device_errors", ()))
    if has_type(error, declared):
        return "error", described(error)
    return "bug", (f"{name}.{body.__name__}: {described(error)}{raised_at(error)}", whole_traceback(error))


def _end_with_parent() -> None:
    """End this process when its parent ends.

    This process checks no deadline itself, and a resumed run executes the action again. On Linux, the kernel ends this
    process also while the body blocks all its other threads. The kernel reacts to the end of the parent's thread that
    started this process. That thread exists as long as it supervises the skill.
    """
    parent = multiprocessing.parent_process()
    assert parent is not None  # noqa: S101
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if not parent.is_alive():  # the parent died before `prctl` took effect
        os._exit(1)

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, name="ends with its parent", daemon=True).start()

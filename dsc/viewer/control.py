"""Control of a live run from the page: post events, change facts and parameters, and pause at breakpoints."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from dsc.events import Event
from dsc.sequencer.clock import LoopClock
from dsc.viewer.queries import require_short
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.language.checking.check import check
from knowledge_base.language.evaluation.world_protocol import Bounds
from knowledge_base.language.syntax.text import parse_condition

if TYPE_CHECKING:
    from dsc.engine.steps import Step
    from dsc.sequencer.sequencer import Sequencer
    from knowledge_base.language.syntax.expression import Expression

AUTHOR = "viewer"
MOST_SECONDS = 10
"""Seconds that a command waits for the run at most, as the run may be computing."""
MOST_WORK = 20_000
"""Number of facts and objects that a browser's condition or effect may read: about 20 ms of the run's thread."""
MOST_STATEMENTS = 1000
MOST_BREAKS = 50
"""Maximum number of breakpoints, as the run evaluates all their conditions after every macrostep."""
KINDS = ("state", "event", "condition", "plan_step")


class Hands(Protocol):
    """A page's interface to a controllable run, in this process or another."""

    @property
    def paused(self) -> str | None:
        """The reason of a pause, or `None`."""

    def obey(self, command: Mapping[str, Any]) -> dict[str, Any]:
        """Execute a page's command, and return its result; raise `InputError` for an invalid command."""
        ...


@dataclass(frozen=True, slots=True)
class Breakpoint:
    """A condition that pauses the run when it becomes true.

    A run pauses when it enters a state, handles an event, makes a condition true, or begins a plan step.
    """

    kind: str
    text: str
    condition: Expression | None = None

    def __str__(self) -> str:
        """Return a short name, e.g. `state clear/execute`."""
        return f"{self.kind.replace('_', ' ')} {self.text}"


class Control:
    """Commands from the page's thread to a run in another thread; the run executes them before its next event.

    During a pause, simulated time stops. Real time continues: skills run and timers expire, and the run handles their
    events after the pause.
    """

    def __init__(self, changed: Callable[[], None]) -> None:
        """Create a control; `changed` is called when `paused` may have changed."""
        self._changed = changed
        self._sequencer: Sequencer | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._go: asyncio.Event | None = None
        self._breaks: dict[int, Breakpoint] = {}
        self._numbers = 0
        self._steps: int | None = None  # remaining macrosteps before a pause; `None` without a count
        self._was_true: set[int] = set()
        self._plan_steps: dict[str, str] = {}  # plan steps by the path of a generated plot's state
        self._dropped: list[str] = []
        self.paused: str | None = None
        """The reason of a pause, or `None`."""

    def attach(self, sequencer: Sequencer) -> None:
        """Attach to a run before its start; call this method in the run's loop."""
        self._sequencer, self._loop, self._go = sequencer, asyncio.get_running_loop(), asyncio.Event()
        sequencer.listen(self._after_step)
        sequencer.wait_before_events(self._before_event)

    def obey(self, command: Mapping[str, Any]) -> dict[str, Any]:
        """Execute a page's command, and return its result.

        Raises:
            InputError: the command refers to an unknown element, or the run has ended.
        """
        verbs: dict[str, Callable[[Mapping[str, Any]], object]] = {
            "event": self._event, "tell": self._tell, "retract": self._tell, "set": self._set, "pause": self._pause,
            "resume": self._resume, "step": self._step, "break": self._break, "unbreak": self._unbreak,
            "breaks": lambda _: None,
        }  # fmt: skip
        verb = command.get("do")
        if verb not in verbs:
            raise UnknownNameError(f"there is nothing to do called '{verb}'", found=str(verb), valid=verbs)
        verbs[verb](command)
        self._changed()
        result = {"ok": True, "breaks": [{"number": n, "on": str(b)} for n, b in self._breaks.items()]}
        return {**result, "dropped": list(self._dropped)} if self._dropped else result

    # --- methods for the page's thread

    def _event(self, command: Mapping[str, Any]) -> None:
        event = Event(str(command.get("name")), dict(command.get("attributes") or {}))
        self._in_run(lambda run: run.post(event))

    def _tell(self, command: Mapping[str, Any]) -> None:
        from knowledge_base.statements import retracted, told  # noqa: PLC0415  imported only for a controlled run

        statements = command.get("statements")
        if not isinstance(statements, list) or not all(isinstance(one, str) for one in statements):
            raise InputError("'statements' is a list of texts such as (on cup1 table)")
        if len(statements) > MOST_STATEMENTS:
            raise InputError(f"these are {len(statements)} statements; a browser may send {MOST_STATEMENTS}")
        require_short("".join(statements), "statements")
        known = self._run().knowledge
        if command["do"] == "tell":
            delta = told(statements, known, "FACT", Bounds(work=MOST_WORK))
        else:
            delta = retracted(statements, known, "FACT")  # a statement retracts only the facts that it states
        self._in_run(lambda run: run.change(delta, AUTHOR))

    def _set(self, command: Mapping[str, Any]) -> None:
        """Set a parameter of a component or plot that operators may change."""
        owner, name = str(command.get("owner")), str(command.get("name"))
        self._in_run(lambda run: run.set_parameter(owner, name, command.get("value")))

    def _pause(self, _: Mapping[str, Any]) -> None:
        self._steps = 0
        self._in_run(lambda _: None)

    def _resume(self, _: Mapping[str, Any]) -> None:
        self._steps = None
        self._in_run(lambda _: self._release())

    def _step(self, _: Mapping[str, Any]) -> None:
        self._steps = 1
        self._in_run(lambda _: self._release())

    def _break(self, command: Mapping[str, Any]) -> None:
        on = command.get("on")
        if not isinstance(on, dict) or len(on) != 1 or (kind := next(iter(on))) not in KINDS:
            raise InputError(f"a breakpoint is on one of {', '.join(KINDS)}", found=str(on), valid=KINDS)
        if len(self._breaks) >= MOST_BREAKS:
            raise InputError(f"there are {MOST_BREAKS} breakpoints, as many as there may be; remove one")
        condition, said = None, str(on[kind])
        require_short(said, kind)
        if kind == "condition":
            condition = parse_condition(said, "EXPR")
            check(condition, self._run().knowledge.schema)
            # An expensive condition is refused here, rather than dropped during the run.
            self._run().knowledge.ask(condition, bounds=Bounds(work=MOST_WORK))
        self._numbers += 1
        self._breaks[self._numbers] = Breakpoint(kind, said, condition)

    def _unbreak(self, command: Mapping[str, Any]) -> None:
        number = command.get("number")
        if number not in self._breaks:
            raise InputError(f"there is no breakpoint {number}", found=str(number), valid=map(str, self._breaks))
        del self._breaks[number]

    def _run(self) -> Sequencer:
        if self._sequencer is None or self._loop is None or self._loop.is_closed():
            raise InputError("the run is over, or has not begun")
        return self._sequencer

    def _in_run(self, act: Callable[[Sequencer], None]) -> None:
        """Execute `act` in the run's own thread; raise its errors in the page's thread."""
        run, loop = self._run(), self._loop

        async def acting() -> None:
            act(run)

        assert loop is not None  # noqa: S101  checked by _run
        try:
            asyncio.run_coroutine_threadsafe(acting(), loop).result(timeout=MOST_SECONDS)
        except TimeoutError:
            raise InputError(f"the run did not listen for {MOST_SECONDS} seconds") from None

    # --- methods for the run's thread

    def _release(self) -> None:
        if self._go is not None:
            self._go.set()

    def _after_step(self, step: Step) -> None:
        for bound in (bound for micro in step.microsteps for bound in micro.bound if bound.plot.generated):
            prefix = f"{bound.state}/" if bound.state else ""
            for name, state, _ in bound.plot.walk():
                self._plan_steps[prefix + name] = state.about or ""
        if self._steps:
            self._steps -= 1
        for number, one in tuple(self._breaks.items()):
            try:
                met = self._is_met(number, one, step)
            except InputError as error:  # the condition has become too expensive, or reads a removed element
                self._drop(number, f"{one}: {error}")
                continue
            if met:
                self._steps = 0
                self.paused = str(one)

    def _drop(self, number: int, why: str) -> None:
        """Drop a breakpoint without a pause; the result of the page's next command has the reason."""
        self._breaks.pop(number, None)
        self._was_true.discard(number)
        self._dropped = [*self._dropped, why][-MOST_BREAKS:]
        self._changed()

    def _is_met(self, number: int, one: Breakpoint, step: Step) -> bool:
        entered = {name for micro in step.microsteps for name in micro.entered}
        match one.kind:
            case "state":
                return one.text in entered
            case "event":
                return any(micro.event is not None and micro.event.name == one.text for micro in step.microsteps)
            case "plan_step":
                return any(self._plan_steps.get(name) == one.text for name in entered)
            case _:
                return self._has_become_true(number, one)

    def _has_become_true(self, number: int, one: Breakpoint) -> bool:
        now = one.condition is not None and self._run().knowledge.ask(one.condition, bounds=Bounds(work=MOST_WORK))
        rose = now and number not in self._was_true
        (self._was_true.add if now else self._was_true.discard)(number)
        return rose

    async def _before_event(self) -> None:
        """Wait until a pause ends; return immediately without a pause."""
        if self._steps != 0 or self._go is None:
            return
        self.paused = self.paused or "on request"
        self._go.clear()
        self._changed()
        with LoopClock().hold():
            await self._go.wait()
        self.paused = None
        self._changed()

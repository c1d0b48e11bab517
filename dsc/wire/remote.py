"""Remote components: clients of hosted components, used like local components.

An action has an id, by which the host executes it only one time, also if frames are repeated. The host stores the
action's end until the client has received it, so that a resumed run also receives it. During a run, the client queries
the host every second, and watches its address. When the address is gone, or after `SILENCE` seconds without an answer,
the client's component enters FatalError, also if no skill uses it. A skill then ends with `skill_error`, and the next
one connects again.
"""

from __future__ import annotations

import asyncio
import math
import secrets
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from typing import Any, ClassVar

from dsc.calls import Ended, SkillCall, Status
from dsc.components.component import Component
from dsc.components.declarations import Parameter
from dsc.components.interface import Interface
from dsc.components.life_cycle import Life
from dsc.components.parameters import Parameters, ParameterValues, parameters_of
from dsc.errors import NoAnswerError, PreemptedError, ProgrammingError, RefusedError
from dsc.model.plot import ActionPlot
from dsc.outcomes import Outcome
from dsc.skills import SkillSignature
from dsc.wire.action_news import ActionNews
from dsc.wire.endpoint import AGAIN, RESOLUTION, WITHIN, Endpoint, Transport
from dsc.wire.heartbeat import Heartbeat
from dsc.wire.host import CONDITION, outcome_of
from dsc.wire.publication import RemotePush, Subscription
from dsc.wire.remote_ports import RemoteWires, requirement_of
from knowledge_base.errors import InputError
from knowledge_base.language.checking.inputs import require_text
from knowledge_base.user_objects import described, text_of

WATCH = 1.0
"""Seconds between queries of an action's state."""
MOST_UNACKNOWLEDGED = 1_000
"""Number of messages about an action that a client receives before it acknowledges them."""
SILENCE = 3.0
"""Seconds after which a host without an answer, or without any message, counts as failed."""


class RemoteComponent(Component):
    """The client of a hosted component; `connect` creates it.

    The host outlasts programs, and programs may use equal action ids. So each id is sent with the name of the program's
    run.
    """

    def __init__(self, name: str, transport: Transport, endpoint: Endpoint, skills: dict[str, SkillSignature]) -> None:
        super().__init__(name)
        self._transport = transport
        self._endpoint = endpoint
        self._skills = skills
        self._run = endpoint.life
        self._condition = Subscription(endpoint, name, CONDITION, self._receive_change)
        self._heart = Heartbeat(endpoint, lambda: [name], _ignore, root=True)
        self._domain: str | None = None
        self._plots: tuple[ActionPlot, ...] = ()
        self._wires = RemoteWires(endpoint, name)
        self._messages: Mapping[str, SkillSignature] | None = None
        self._values_there: dict[str, Any] = {}
        self._profile: dict[str, Any] | None = None  # values of this program's profile; `None` before the first start
        self._is_silent = False
        self._is_gone = False
        self._presence_changed = asyncio.Event()
        self._unreleased: dict[str, None] = {}  # ids of actions, in their order
        self._releasing: asyncio.Task[None] | None = None
        self._beating: asyncio.Task[None] | None = None
        self._is_watched = False
        self._watching: tuple[asyncio.Task[None], ...] = ()
        self._end_watch: Callable[[], None] = _do_nothing
        self._program = ""  # the host's life

    is_remote: ClassVar[bool] = True

    def remember(self) -> str:
        """Return the name of this program's run, by which the host identifies its actions."""
        return self._run

    def recall(self, memory: Any) -> None:
        """Continue the actions of the run before a restart."""
        self._run = memory

    @classmethod
    async def connect(cls, name: str, transport: Transport, within: float = WITHIN) -> RemoteComponent:
        """Return the component of that name, with its present skills.

        Raises:
            NoAnswerError: no host has answered.
            RefusedError: the description in the host's answer cannot be read.
        """
        life = secrets.token_hex(6)
        endpoint = Endpoint(f"for {name} {life}", transport, life)
        try:
            said = await endpoint.call(name, "hull", within=within)
        except (NoAnswerError, RefusedError):
            await endpoint.close()
            raise
        try:
            skills = {form["name"]: SkillSignature(**form) for form in said["skills"]}
            remote = cls(name, transport, endpoint, skills)
            remote.concurrent = bool(said["concurrent"])
            for port, form in said["pushes"].items():
                remote.pushes[port] = RemotePush(endpoint, name, port, form["values"])
            for port, form in said["requires"].items():
                remote.requirements[port] = requirement_of(f"{name}.{port}", form, remote._wires)
            remote._take_parameters(said["parameters"])
            remote.modes = tuple(said["modes"])  # type: ignore[misc]  # a class declares them; a client receives them
            if said["messages"] is not None:
                remote._messages = {name: SkillSignature(**form) for name, form in said["messages"].items()}
            if said["domain"] is not None:
                require_text(said["domain"], "the part of the planning domain")
                remote._domain = said["domain"]
            remote._plots = tuple([ActionPlot.model_validate(form) for form in said["plots"]])
            remote._condition.take(said["condition"])
        except Exception as error:
            await endpoint.close()
            raise RefusedError(f"the description of '{name}' cannot be read: {described(error)}") from error
        return remote

    def _take_parameters(self, form: Mapping[str, Any]) -> None:
        """Declare the parameters that the component has at its host, with their present values."""
        declared = {name: _parameter_of(one) for name, one in form["declared"].items()}
        kind = parameters_of(declared, tuple(form["relations"])) if declared else Parameters
        self.parameter_values = ParameterValues(self.name, kind)
        self.parameter_values.replace(form["values"])
        self.parameters = self.parameter_values.parameters
        self._values_there = dict(form["values"])

    def domain_fragment(self) -> str | None:
        """Return the text of the component's part of the planning domain at its host."""
        return self._domain

    def plots(self) -> tuple[ActionPlot, ...]:
        """Return the plots that the component brings at its host."""
        return self._plots

    def interface(self) -> Interface:
        """Return the parameters, modes, messages and ports at the time of the connection."""
        requires = {port: one.service for port, one in self.requirements.items()}
        return replace(super().interface(), messages=self._messages, requires=requires)

    def skills(self) -> dict[str, SkillSignature]:
        """Return the signatures at the time of the connection."""
        return dict(self._skills)

    def needed(self) -> tuple[str, ...]:
        """Return the names of the components that this one needs in its present mode, from the host's last message."""
        return tuple(self._condition.value["needs"])

    @property
    def condition(self) -> Mapping[str, Any]:
        """The component's `life`, `reason`, `mode` and `needs`, from the host's last message."""
        return dict(self._condition.value)

    async def reach(self, name: str) -> Component:
        """Wait for a required component on the transport of this one."""
        while True:
            with suppress(NoAnswerError):
                return await RemoteComponent.connect(name, self._transport, WATCH)

    async def start(self) -> None:
        """Start the component at its host, with the values that this program's profile gives to its parameters.

        Raises:
            NoAnswerError: the host does not answer.
            RefusedError: the component cannot start.
        """
        if self._profile is None:
            there = self._values_there
            self._profile = {name: value for name, value in self.parameters.items() if there.get(name) != value}
        if self._profile:
            await self._endpoint.call(self.name, "bind", self._profile, SILENCE)
        condition = await self._endpoint.call(self.name, "come alive", within=SILENCE)
        self._is_silent = False
        await self._release()
        self._require_alive(condition)
        if self.life.state is Life.FATAL_ERROR:  # the host was gone during this start, and has returned
            self.life.become(Life.INIT)

    def watch(self, watching: bool) -> None:  # noqa: FBT001
        """Begin or end to query the host about the component's life, mode and needs; an active component is queried."""
        self._is_watched = watching
        self._begin_or_end_queries()

    def _begin_or_end_queries(self) -> None:
        loop, wanted = asyncio.get_running_loop(), self._is_watched or self._beating is not None
        if wanted and not self._watching:
            self._end_watch = self._endpoint.watch(self.name, self._note_presence)
            self._watching = loop.create_task(self._watch()), loop.create_task(self._condition.run())
        elif not wanted:
            watched, self._watching = self._watching, ()
            self._end_watch()
            self._is_gone = False
            for task in watched:
                task.cancel()

    async def activate(self, active: bool) -> None:  # noqa: FBT001
        """Activate the component at its host, by heartbeats.

        Raises:
            NoAnswerError: the host does not answer.
            RefusedError: the component cannot become active.
        """
        if active:
            self._beating = self._beating or asyncio.get_running_loop().create_task(self._heart.run())
            self._begin_or_end_queries()
            self._require_alive(await self._endpoint.call(self.name, "be active", within=SILENCE))
        elif self._beating is not None:
            beating, self._beating = self._beating, None
            self._begin_or_end_queries()
            beating.cancel()
            await asyncio.wait([beating])

    def _require_alive(self, condition: dict[str, Any]) -> None:
        self._condition.take(condition)
        life, reason = condition["value"]["life"], condition["value"]["reason"]
        if condition["value"]["bug"]:
            raise ProgrammingError(reason)
        if life != Life.ALIVE:
            raise RefusedError(f"it is in '{life}' there" + (f": {reason}" if reason else ""))

    def _note_presence(self, present: bool) -> None:  # noqa: FBT001
        self._is_gone = not present
        if self._is_gone:
            self._condition.forget_age()  # only a message of the returned host is a sign of life
        self._presence_changed.set()

    async def _watch(self) -> None:
        """Enter FatalError when the host is gone or silent, and leave it when the host answers again."""
        loop = asyncio.get_running_loop()
        began = loop.time()
        while True:
            if self._is_gone:
                began = -math.inf  # the former program has sent the known condition
            left = 0.0 if self._is_gone else SILENCE - min(self._condition.age, loop.time() - began)
            self._presence_changed.clear()
            if left > RESOLUTION:
                if self._is_silent:
                    self._is_silent = False
                    self._follow(self._condition.value)
                    self._wires.repeat()
                    self._releasing = loop.create_task(self._release())
                await self._wait_for_presence(left)
                continue
            self._is_silent = True
            if self.life.state in {Life.INIT, Life.ALIVE}:
                lost = "is gone: its program has ended, or cannot be reached"
                self.life.become(
                    Life.FATAL_ERROR,
                    f"'{self.name}' {lost if self._is_gone else _silent_for(SILENCE)}",
                )
            await self._wait_for_presence(AGAIN)

    async def _wait_for_presence(self, seconds: float) -> None:
        """Wait for a report about the host's address, at most that many seconds."""
        with suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                await self._presence_changed.wait()

    def _receive_change(self, condition: Any, _: float) -> None:
        match condition:
            case {
                "life": str(life), "reason": str(), "bug": bool(), "mode": str(mode), "needs": [*needs],
                "program": str(program),
            } if life in list(Life):  # fmt: skip
                for need in needs:
                    require_text(need, "the name of a component that is needed")
            case _:
                raise InputError(f"the condition of '{self.name}' cannot be read: {text_of(condition, repr)}")
        restarted, self._program = self._program not in {"", program}, program
        if restarted:
            self._wires.send_all()
        if restarted and self._watching and self.life.state in {Life.INIT, Life.ALIVE} and not self.life.starting:
            self.life.become(Life.FATAL_ERROR, f"the program of '{self.name}' was restarted")
        self._follow(condition)
        self.life.mode = mode

    def _follow(self, condition: Mapping[str, Any]) -> None:
        """Enter the state that the component has at its host."""
        life, reason, mine = Life(condition["life"]), condition["reason"], self.life
        if not self._watching or mine.starting or self._is_gone:
            return
        if not mine.active and life is not Life.FATAL_ERROR:  # this program does not use the component
            if mine.state is Life.FATAL_ERROR:
                mine.become(Life.INIT)
            return
        if mine.state is Life.SHUTDOWN and life is not Life.SHUTDOWN:
            mine.become(Life.INIT)
        mine.become(life, reason, ProgrammingError(reason) if condition["bug"] else None)

    async def execute(self, skill_name: str, call: SkillCall[Any], arguments: Mapping[str, Any]) -> Outcome:
        """Execute the skill at the host, and return its outcome.

        Raises:
            PreemptedError: a skill with a higher priority has taken the component.
            RefusedError: the skill failed there, or the host no longer knows the action.
            ProgrammingError: the skill's code failed there.
            NoAnswerError: the host does not answer.
        """
        news = ActionNews(self.name)
        self._endpoint.receive(f"news {call.action_id}", news.receive)
        seconds = call.remaining if call.remaining < float("inf") else None
        try:
            said: dict[str, Any] = {
                "skill": skill_name,
                "arguments": dict(arguments),
                "seconds": seconds,
                "rank": list(call.rank),
                "of_run": call.run,
            }
            await self._ask_about(call.action_id, "start", **said)
            return await self._end_of(call, news)
        except asyncio.CancelledError:
            await self.forget(call.action_id)
            raise
        finally:
            self._endpoint.deafen(f"news {call.action_id}")

    async def _end_of(self, call: SkillCall[Any], news: ActionNews) -> Outcome:
        """Pass the action's reports to `call.report`, and return its outcome.

        The host pushes each message. The question `how` acknowledges the messages, and gets those that were lost.
        """
        loop = asyncio.get_running_loop()
        received, acknowledged, asked_at = 0, 0, -math.inf
        while True:
            messages: list[Any] | None = news.take_after(received)
            is_due = loop.time() - asked_at >= WATCH or received - acknowledged >= MOST_UNACKNOWLEDGED
            if not messages or is_due:
                messages = await self._ask_about(call.action_id, "how", heard=received)
                acknowledged, asked_at = received, loop.time()
            if messages is None:
                raise RefusedError(f"'{self.name}' does not know '{call.action_id}' any longer")
            for form in messages:
                received += 1
                if "report" in form:
                    call.report(outcome_of(form["report"]))
                elif "waits" in form:
                    call.waits(text_of(form["waits"], str))
                elif "bug" in form:
                    raise ProgrammingError(text_of(form["bug"], str))
                elif "preempted" in form:
                    raise PreemptedError(text_of(form["preempted"], str))
                elif "failed" in form:
                    raise RefusedError(text_of(form["failed"], str))
                else:
                    return outcome_of(form["ended"])
            await news.wait(WATCH)

    async def status(self, action_id: str, skill_name: str, arguments: Mapping[str, Any]) -> Status | Ended:  # noqa: ARG002
        """Return `RUNNING` if the host knows the action, also after its end; else `UNKNOWN`.

        A restarted host knows no action.
        """
        return Status.UNKNOWN if await self._ask_about(action_id, "how", heard=0) is None else Status.RUNNING

    async def abandon(self, action_id: str, skill_name: str, arguments: Mapping[str, Any]) -> Ended | None:  # noqa: ARG002
        """Stop the action at the host; return its end if it has ended.

        Raise `NoAnswerError` if the host does not answer.
        """
        messages = await self._ask_about(action_id, "how", heard=0)
        await self._ask_about(action_id, "stop")
        return next((Ended(outcome_of(form["ended"])) for form in messages or () if "ended" in form), None)

    async def forget(self, action_id: str) -> None:
        """Stop and release the action at the host; if the host is silent, when it answers again."""
        self._unreleased[action_id] = None
        if not self._is_silent:
            await self._release()

    async def _release(self) -> None:
        """Release the actions whose release the host has not answered; a restarted host knows none of them."""
        for action_id in tuple(self._unreleased):
            try:
                await self._ask_about(action_id, "stop")
            except NoAnswerError:
                return
            except RefusedError:
                pass
            self._unreleased.pop(action_id, None)

    async def configure(self, parameter: str, value: object) -> None:
        """Set a parameter at the host.

        Raises:
            UnknownNameError: the component declares parameters, and `parameter` is not among them.
            InputError: the value violates its declaration or a relation.
            NoAnswerError: the host does not answer.
            RefusedError: the component refuses the value.
        """
        with self._revert_on_error():
            self.parameter_values.set(parameter, value)
            await self._ask("set", {"parameter": parameter, "value": value})

    async def configure_all(self, values: Mapping[str, Any]) -> None:
        """Set parameters at the host as one set; raise as `configure`."""
        with self._revert_on_error():
            with self.parameter_values.as_one_set(values):
                for parameter, value in values.items():
                    self.parameter_values.set(parameter, value)
            await self._ask("set all", dict(values))

    @contextmanager
    def _revert_on_error(self) -> Iterator[None]:
        """Return a context manager that restores the values of the parameters after an error."""
        before = dict(self.parameters)
        try:
            yield
        except BaseException:
            self.parameter_values.replace(before)
            raise

    async def change_mode(self, mode: str) -> None:
        """Change the mode at the host; raise `NoAnswerError` or `RefusedError`."""
        self._condition.take(await self._ask("switch", {"mode": mode}))

    async def receive(self, port: str, message: Mapping[str, Any]) -> None:
        """Send a message to the host; raise `NoAnswerError` or `RefusedError`."""
        await self._ask("take", {"port": port, "message": dict(message)})

    async def diagnose(self) -> dict[str, Any]:
        """Return the component's status at the host; raise `NoAnswerError` or `RefusedError`."""
        status: dict[str, Any] = await self._endpoint.call(self.name, "diagnose")
        return status

    async def _ask_about(self, action_id: str, kind: str, within: float = SILENCE, **more: Any) -> Any:
        return await self._ask(kind, {"run": self._run, "id": action_id, **more}, within)

    async def _ask(self, kind: str, said: Any, within: float = SILENCE) -> Any:
        try:
            return await self._endpoint.call(self.name, kind, said, within)
        except NoAnswerError as error:
            reason = f"'{self.name}' {_silent_for(within)}"
            if self.life.state is Life.ALIVE:
                self.life.become(Life.FATAL_ERROR, reason)
            raise NoAnswerError(reason) from error


def _silent_for(seconds: float) -> str:
    return f"has not answered for {seconds:g} s"


def _do_nothing() -> None:
    """Do nothing: no watch has begun."""


async def _ignore(_: bool) -> None:  # noqa: FBT001
    """Do nothing: a client acquires no resources for its heartbeat."""


def _parameter_of(form: Mapping[str, Any]) -> Parameter:
    return Parameter(**{**form, "among": tuple(form["among"]), "depends_on": tuple(form["depends_on"])})

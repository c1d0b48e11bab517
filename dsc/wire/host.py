"""Hosts: components on a transport, whose actions are executed for clients, each only one time for its id.

A host stores an action's reports and end until the client releases them, within the bounds `MOST_ACTIONS` and
`MOST_KEPT`. After each change, the host publishes the component's life, mode and needs, as on a push port.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import AbstractAsyncContextManager, asynccontextmanager, nullcontext
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from dsc.calls import OBSERVED, Clock, Reports, SkillCall
from dsc.components.component import Component
from dsc.components.frames import encoded
from dsc.components.hooks import GRACE, abandon, cancel_once, contained, reason_of
from dsc.components.life_cycle import Life
from dsc.components.parameters import ParameterValues
from dsc.components.requirement import USUAL
from dsc.components.turns import turn_of
from dsc.errors import NotAliveError, PreemptedError, ProgrammingError
from dsc.outcomes import Outcome
from dsc.rank import ORDINARY, Rank
from dsc.run_log import run_logger
from dsc.wire.endpoint import Endpoint, Transport
from dsc.wire.heartbeat import BEAT, Heartbeat
from dsc.wire.publication import HostedStreams, Publisher
from dsc.wire.remote_ports import requirement_form
from knowledge_base.errors import InputError
from knowledge_base.exchange import delta_form, delta_of
from knowledge_base.language.checking.inputs import require_delta, require_text, require_time
from knowledge_base.user_objects import shown

_LOG = run_logger(__package__)

MOST_ACTIONS = 1_000
"""Number of running actions of a host, and of ended actions that were not forgotten; the latest ends are kept."""
MOST_KEPT = 10_000
"""Number of an action's reports that are kept for a resumed client; older reports become empty observations."""
CONDITION = "its condition"
"""The port of a component's life, mode and needs; no declared port has a blank in its name."""


class Host:
    """The services of one component on a transport, and its part in the activation tree, until `close`.

    At most one program should host a component. If a second one begins, e.g. as the first one hangs, the first
    host ends at the first message of the second. Until then, a device can tell them apart by `SkillCall.fence`.

    Attributes:
        endpoint: the component's address, which all these services share.
        fence: the fencing number: the time of the start in milliseconds, so that a later host has a greater number.
        replaced: is set when a later host has taken over.
    """

    def __init__(self, component: Component, transport: Transport, clock: Clock) -> None:
        self._component = component
        self.endpoint = Endpoint(component.name, transport)
        self._condition = Publisher(self.endpoint, CONDITION)
        self.fence = time.time_ns() // 1_000_000
        self.replaced = asyncio.Event()
        self._actions = HostedActions(component, self.endpoint, clock, self.fence)
        self._streams = HostedStreams(component, self.endpoint)
        self.endpoint.answer("hull", self._hull)
        self.endpoint.answer("come alive", self._come_alive)
        self.endpoint.answer("be active", self._be_active)
        self.endpoint.answer("switch", self._switch)
        self.endpoint.answer("bind", self._bind)
        self._wires = HostedWires(component, self.endpoint)
        self._answer("set", "configure", lambda said: component.configure(said["parameter"], said["value"]))
        self._answer("set all", "configure_all", component.configure_all)
        self._answer("take", "take", lambda said: component.receive(said["port"], said["message"]))
        self._answer("diagnose", "diagnose", lambda _: component.diagnose())
        self._is_active = asyncio.Event()
        self._heart = Heartbeat(self.endpoint, self._find_needs, self._activate, busy=self._actions.is_any_active)
        loop = asyncio.get_running_loop()
        self._claims = Endpoint(f"host of {component.name} {self.endpoint.life}", transport)
        self._claims.receive("host", self._note_host)
        self._tasks = [loop.create_task(self._heart.run()), loop.create_task(self._claim())]
        self._publish_change()
        component.life.listen(self._publish_change)
        for port in component.requirements.values():
            port.redirections.listen(self._publish_change)

    def _answer(self, kind: str, hook: str, call: Callable[[Any], Awaitable[Any]]) -> None:
        """Answer calls of that kind with the result of a hook."""

        async def answers(_: str, said: Any) -> Any:
            if hook != "diagnose":
                await self._component.life.ensure_alive()
            with contained(f"{self._component.name}.{hook}", self._component.device_errors):
                return await call(said)

        self.endpoint.answer(kind, answers)

    async def close(self) -> None:
        """Stop all services without a message, then the component; clients treat the component as failed."""
        self._component.life.leave(self._publish_change)
        for port in self._component.requirements.values():
            port.redirections.leave(self._publish_change)
        await self._claims.close()
        await self.endpoint.close()
        await self._actions.close()
        tasks = [*self._tasks, *self._streams.close()]
        for task in tasks:
            task.cancel()
        await asyncio.wait(tasks)
        try:
            async with asyncio.timeout(GRACE):
                await self._component.life.retire()
        except Exception as error:  # noqa: BLE001  # the host ends after any error
            _LOG.warning("component '%s' could not stop: %s", self._component.name, reason_of(error))

    async def _claim(self) -> None:
        """Announce this host to other hosts of the component, until cancelled."""
        while True:
            self._claims.broadcast("host", {"of": self._component.name, "fence": self.fence})
            await asyncio.sleep(BEAT)

    def _note_host(self, _: str, said: Any) -> None:
        """Stop answering if a later host of the same component exists."""
        if said["of"] == self._component.name and said["fence"] > self.fence and not self.replaced.is_set():
            _LOG.warning("component '%s' has a later host, so this host ends", self._component.name)
            self.replaced.set()
            self._actions.cancel()
            self._tasks.append(asyncio.get_running_loop().create_task(self.endpoint.close()))

    def _publish_change(self) -> None:
        life = self._component.life
        needs = list(self._find_needs())  # may change the life
        said = {"life": life.state, "reason": life.reason, "bug": life.bug is not None, "mode": life.mode}
        said["program"] = self.endpoint.life
        self._condition.put({**said, "needs": needs})
        self._heart.stir()
        if life.state is not Life.ALIVE:
            self._actions.cancel()

    def _find_needs(self) -> tuple[str, ...]:
        """Return the needs of the component; its error leads to FatalError, and counts as no needs."""
        component = self._component
        if component.life.bug is not None:
            return ()
        try:
            with contained(f"{component.name}.needed", component.device_errors):
                return component.needed()
        except Exception as error:  # noqa: BLE001  # the heartbeat must continue
            if component.life.state is Life.ALIVE:
                component.life.fail(error)
            return ()

    async def _hull(self, _: str, __: Any) -> dict[str, Any]:
        skills = [asdict(signature) for signature in self._component.skills().values()]
        pushes = {name: {"values": dict(port.values)} for name, port in self._component.pushes.items()}
        interface = self._component.interface()
        messages = None
        if interface.messages is not None:
            messages = {name: asdict(message) for name, message in interface.messages.items()}
        return {
            "modes": [*interface.modes],
            "messages": messages,
            "skills": skills,
            "pushes": pushes,
            "requires": {name: requirement_form(port) for name, port in self._component.requirements.items()},
            "concurrent": self._component.concurrent,
            "parameters": parameters_form(self._component.parameter_values),
            "domain": _domain_of(self._component),
            "plots": [plot.to_form() for plot in self._component.plots()],
            "condition": self._condition.newest,
        }

    async def _bind(self, _: str, said: dict[str, Any]) -> None:
        """Set parameters by the profile of a client, before the start of the component."""
        values = self._component.parameter_values
        values.replace(values.after(said))

    async def _come_alive(self, _: str, __: Any) -> dict[str, Any]:
        await self._component.life.come_alive()
        return self._condition.newest

    async def _be_active(self, sender: str, _: Any) -> dict[str, Any]:
        """Handle the call like a heartbeat that needs this component, and answer when the component is active."""
        self._heart.need(sender)
        await self._is_active.wait()
        return self._condition.newest

    async def _activate(self, active: bool) -> None:  # noqa: FBT001
        life = self._component.life
        if active:
            await life.come_alive()
        await life.become_active(id(self), active=active)
        (self._is_active.set if active else self._is_active.clear)()

    async def _switch(self, _: str, said: dict[str, Any]) -> dict[str, Any]:
        if said["mode"] not in {Life.INIT, Life.SHUTDOWN}:
            await self._component.life.ensure_alive()
        with contained(f"{self._component.name}.switch", self._component.device_errors):
            await self._component.change_mode(said["mode"])
        return self._condition.newest


class HostedWires:
    """Handler of the calls `wire` at an endpoint: clients change the wires of a component while they run.

    Args:
        component: the hosted component.
        endpoint: its address.
    """

    def __init__(self, component: Component, endpoint: Endpoint) -> None:
        self._component = component
        self._endpoint = endpoint
        self._clients: dict[str, str] = {}  # the client of each changed port
        self._watches: dict[str, Callable[[], None]] = {}
        endpoint.answer("wire", self._wire)

    async def _wire(self, sender: str, said: dict[str, Any]) -> None:
        port, to = said["port"], said["to"]
        self._component.interface().require_port(self._component.name, port)
        if to is not None:
            require_text(to, "the provider of a wire")
        self._clients[port] = sender
        if sender not in self._watches:
            self._watches[sender] = self._endpoint.watch(sender, partial(self._note_presence, sender))
        self._component.requirements[port].redirect(to)

    def _note_presence(self, client: str, present: bool) -> None:  # noqa: FBT001
        """Restore the wires that a client has changed, when it is gone."""
        if present:
            return
        self._watches.pop(client)()
        for port in [port for port, changed_by in self._clients.items() if changed_by == client]:
            del self._clients[port]
            self._component.requirements[port].redirect(USUAL)


def parameters_form(values: ParameterValues) -> dict[str, Any]:
    """Return declarations, relations and values of parameters as plain data."""
    declared = {name: asdict(parameter) for name, parameter in values.declared.items()}
    return {"declared": declared, "relations": values.relations, "values": dict(values.parameters)}


def _domain_of(component: Component) -> str | None:
    """Return the text of the component's part of the planning domain."""
    domain = component.domain_fragment()
    return domain.read_text(encoding="utf-8") if isinstance(domain, Path) else domain


def outcome_form(outcome: Outcome) -> dict[str, Any]:
    """Return an outcome as plain data."""
    return {"event": outcome.event, "attributes": dict(outcome.attributes), "observed": delta_form(outcome.observed)}


def outcome_of(form: Mapping[str, Any]) -> Outcome:
    """Return the outcome of a form that `outcome_form` returned."""
    return Outcome(form["event"], form["attributes"], delta_of(form["observed"]))


_NO_REPORT = {"report": outcome_form(Outcome(OBSERVED))}
"""Replacement of an old report that the client has received."""


_ENDS = {"ended", "failed", "bug", "preempted"}
"""Keys of the messages with which an action ends."""


@dataclass(slots=True)
class _Action:
    """An action of a client, with the action's reports and end as messages; `lost` is its end if the device is lost."""

    client: str
    task: asyncio.Task[None] | None = None
    reports: Reports | None = None
    messages: list[dict[str, Any]] = field(default_factory=list)
    received: int = 0
    lost: dict[str, Any] | None = None

    @property
    def over(self) -> bool:
        """Whether the action's task has ended."""
        return self.task is None or self.task.done()

    def take(self, received: int) -> None:
        """Store that the client has received the first `received` messages.

        The component may then post further reports; empty reports replace old ones.
        """
        assert self.reports is not None  # noqa: S101
        for number in range(self.received, min(received, len(self.messages))):
            if number >= MOST_KEPT and "report" in self.messages[number - MOST_KEPT]:
                self.messages[number - MOST_KEPT] = _NO_REPORT
            self.received = number + 1
            if "report" in self.messages[number]:
                self.reports.taken()


class HostedActions:
    """Handler of the calls `start`, `how` and `stop` at an endpoint, for a component's skills."""

    def __init__(self, component: Component, endpoint: Endpoint, clock: Clock, fence: int) -> None:
        self._component = component
        self._endpoint = endpoint
        self._fence = fence
        self._clock = clock
        self._actions: dict[tuple[str, str], _Action] = {}
        self._active: set[asyncio.Task[Any]] = set()
        endpoint.answer("start", self._start)
        endpoint.answer("how", self._how)
        endpoint.answer("stop", self._stop)

    def tasks(self) -> list[asyncio.Task[None]]:
        """Return the tasks of all actions that were not forgotten."""
        return [action.task for action in self._actions.values() if action.task is not None]

    def is_any_active(self) -> bool:
        """Return whether the component executes an action; it then stays active, also without its client."""
        return bool(self._active)

    async def close(self) -> None:
        """Cancel all actions, and wait for their clean-up, for `GRACE` seconds at most."""
        running = [task for task in self.tasks() if not task.done()]
        for task in running:
            cancel_once(task)
        if running:
            _, others = await asyncio.wait(running, timeout=GRACE)
            for task in others:
                abandon(task)

    def cancel(self) -> None:
        """Cancel the skills that the component executes, since the component is no longer alive."""
        life = self._component.life
        lost = {"bug": str(life.bug)} if life.bug is not None else {"failed": reason_of(NotAliveError(life.describe()))}
        for action in self._actions.values():
            if action.task in self._active:
                action.lost = lost
                cancel_once(action.task)

    async def _start(self, sender: str, said: dict[str, Any]) -> None:
        action = self._actions.get(_key(said))
        if action is not None:  # the client has restarted
            action.client = sender
            return
        self._make_room()
        action = self._actions[_key(said)] = _Action(sender)
        action.reports = Reports(lambda report, _: self._tell(said["id"], action, {"report": outcome_form(report)}))
        action.task = asyncio.get_running_loop().create_task(self._execute(said, action, action.reports))

    def _make_room(self) -> None:
        """Delete the oldest ended actions beyond the bound; raise `InputError` if too many actions are running."""
        over = [key for key, action in self._actions.items() if action.over]
        if len(self._actions) - len(over) >= MOST_ACTIONS:
            raise InputError(f"{MOST_ACTIONS} actions are running here, and no more are accepted")
        for key in over[: max(0, len(over) + 1 - MOST_ACTIONS)]:
            del self._actions[key]

    def _tell(self, action_id: str, action: _Action, form: dict[str, Any]) -> None:
        action.messages.append(form)
        self._endpoint.push(action.client, f"news {action_id}", {"n": len(action.messages), "message": form})

    async def _execute(self, said: dict[str, Any], action: _Action, reports: Reports) -> None:
        end: dict[str, Any]
        try:
            seconds: dict[str, Any] = {}
            if said["seconds"] is not None:
                require_time(said["seconds"])
                seconds["deadline"] = self._clock.now() + said["seconds"]
            rank = _rank_of(said.get("rank"))
            run = str(said.get("of_run", ""))
            call = SkillCall(
                said["id"], self._clock, lambda one: reports.put(_plain(one)), rank=rank, run=run, fence=self._fence,
                **seconds,
            )  # fmt: skip
            async with asyncio.timeout(said["seconds"]), self._turn(said, action, rank), self._alive():
                with contained(f"{self._component.name}.{said['skill']}", self._component.device_errors):
                    outcome = await self._component.execute(said["skill"], call, said["arguments"])
                    form = outcome_form(_plain(outcome))
            end = {"ended": form}
        except PreemptedError as error:
            end = {"preempted": error.by}
        except ProgrammingError as error:
            end = {"bug": str(error)}
        except Exception as error:  # noqa: BLE001  # any error reaches the client as text
            end = {"failed": reason_of(error)}
        reports.flush()
        self._tell(said["id"], action, end)

    @asynccontextmanager
    async def _alive(self) -> AsyncIterator[None]:
        """Start the component if necessary, and cancel the block when the component is no longer alive."""
        task = asyncio.current_task()
        assert task is not None  # noqa: S101  # an action is a task
        await self._component.life.ensure_alive()
        with self._component.life.executing(task):
            self._active.add(task)
            try:
                yield
            finally:
                self._active.discard(task)

    def _turn(self, said: Mapping[str, Any], action: _Action, rank: Rank) -> AbstractAsyncContextManager[None]:
        """Return the turn of the component for a skill; a concurrent component needs none."""
        component, skill = self._component, said["skill"]
        signature = component.skills().get(skill)
        if signature is None or not component.takes_turns(signature):
            return nullcontext()

        def waits(holder: str) -> None:
            self._tell(said["id"], action, {"waits": holder})

        return turn_of(component.turns, f"{component.name}.{skill} of another client", rank, waits)

    async def _how(self, _: str, said: dict[str, Any]) -> list[dict[str, Any]] | None:
        """Return the messages that the client has not received; `None` for an unknown action."""
        action = self._actions.get(_key(said))
        if action is None:
            return None
        action.take(said["heard"])
        if action.over and not (action.messages and _ENDS & action.messages[-1].keys()):
            self._tell(said["id"], action, action.lost or {"failed": "its task was cancelled"})
        return action.messages[said["heard"] :]

    async def _stop(self, _: str, said: dict[str, Any]) -> None:
        """Cancel an action that is running, and forget it."""
        action = self._actions.get(_key(said))
        if action is not None and action.task is not None and not action.over:
            cancel_once(action.task)
            await asyncio.wait([action.task])
        self._actions.pop(_key(said), None)


def _plain(outcome: Outcome) -> Outcome:
    """Return the outcome if it can be sent; raise `InputError` if not."""
    if not isinstance(outcome, Outcome) or not isinstance(outcome.event, str):
        raise InputError(f"it ended with {shown(outcome)}, which is not an outcome")
    require_delta(outcome.observed)
    encoded(outcome_form(outcome))
    return outcome


def _rank_of(said: object) -> Rank:
    """Return the rank that a client has sent; raise `InputError` for anything else."""
    match said:
        case None:
            return ORDINARY
        case [int() | float() as priority, bool(handles), int(depth), bool(preempts)]:
            return Rank(priority, handles, depth, preempts)
        case _:
            raise InputError(f"a rank is a list of priority, handles, depth and preempts, not {shown(said)}")


def _key(said: Mapping[str, Any]) -> tuple[str, str]:
    run, action_id = said["run"], said["id"]
    if not (isinstance(run, str) and isinstance(action_id, str)):
        raise InputError("an action is named by the texts 'run' and 'id'")
    return run, action_id

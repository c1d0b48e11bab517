"""A component on the other side of a transport: `Host` offers one there, `RemoteComponent` is used here like any other.

An action is started by its id: however often a frame arrives, whatever is asked again, it is carried out once, and its
end is there until it has been taken, so that a run which is resumed hears of it. While it
runs the host is asked how it goes; one that is silent for `SILENCE` seconds is in FatalError as seen from here, which
ends the action with `skill_error`, and the next action looks for it anew.
"""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from typing import Any

from dsc.calls import Clock, Ended, Outcome, SkillCall, Status
from dsc.components.component import Component
from dsc.components.endpoint import WITHIN, Endpoint, NoAnswerError, RefusedError
from dsc.components.heartbeats import Heart
from dsc.components.life import Life
from dsc.components.transport import Transport
from dsc.skills import SkillSignature
from knowledge_base.exchange.forms import delta_form, delta_of

WATCH = 1.0
"""Seconds after which a host is asked how an action goes."""
SILENCE = 3.0
"""Seconds for its answer."""


def outcome_form(outcome: Outcome) -> dict[str, Any]:
    """An outcome as plain data."""
    return {
        "event": outcome.event,
        "attributes": dict(outcome.attributes),
        "observed": delta_form(outcome.observed),
    }


def outcome_of(form: Mapping[str, Any]) -> Outcome:
    """The outcome that `outcome_form` made it from."""
    return Outcome(form["event"], form["attributes"], delta_of(form["observed"]))


@dataclass(slots=True)
class _Action:
    """An action on the host's side: who wants to know, and what it has said so far, its end last."""

    user: str
    task: asyncio.Task[None]
    said: list[dict[str, Any]] = field(default_factory=list)


class Host:
    """Offers a component on a transport until it is closed; there it is part of the activation tree, too."""

    def __init__(self, component: Component, transport: Transport, clock: Clock) -> None:
        self._component = component
        self._clock = clock
        self._endpoint = Endpoint(component.name, transport)
        self._actions: dict[tuple[str, str], _Action] = {}
        self._endpoint.answer("skills", self._skills)
        self._endpoint.answer("come alive", self._come_alive)
        self._endpoint.answer("start", self._start)
        self._endpoint.answer("how", self._how)
        self._endpoint.answer("stop", self._stop)
        self._endpoint.answer("set", lambda _, said: component.configure(said["parameter"], said["value"]))
        self._endpoint.answer("set all", lambda _, said: component.configure_all(said))
        self._endpoint.answer("switch", lambda _, said: component.change_mode(said["mode"]))
        self._endpoint.answer("take", lambda _, said: component.take(said["port"], said["message"]))
        self._endpoint.answer("diagnose", lambda _, __: component.diagnose())
        self._heart = Heart(self._endpoint, component.needed, component.activate)
        self._beating = asyncio.get_running_loop().create_task(self._heart.run())

    async def close(self) -> None:
        """Stop everything, and answer no more: to the others it has died."""
        await self._endpoint.close()
        tasks = [self._beating, *(action.task for action in self._actions.values())]
        for task in tasks:
            task.cancel()
        await asyncio.wait(tasks)

    async def _skills(self, _: str, __: Any) -> list[dict[str, Any]]:
        return [asdict(signature) for signature in self._component.skills().values()]

    async def _come_alive(self, _: str, __: Any) -> dict[str, str]:
        if self._component.life.state is Life.FATAL_ERROR:
            self._component.life.become(Life.INIT)
        await self._component.come_alive()
        return {"life": self._component.life.state, "reason": self._component.life.reason}

    async def _start(self, sender: str, said: dict[str, Any]) -> None:
        action = self._actions.get(_key(said))
        if action is not None:  # whose user has been started anew
            action.user = sender
        else:
            task = asyncio.get_running_loop().create_task(self._carry_out(said))
            self._actions[_key(said)] = _Action(sender, task)

    async def _carry_out(self, said: dict[str, Any]) -> None:
        def tell(form: dict[str, Any]) -> None:
            action.said.append(form)
            self._endpoint.push(action.user, f"news {said['id']}", len(action.said))

        await asyncio.sleep(0)  # until it is known under its id
        action = self._actions[_key(said)]
        seconds = {} if said["seconds"] is None else {"deadline": self._clock.now() + said["seconds"]}
        call = SkillCall(said["id"], self._clock, lambda outcome: tell({"report": outcome_form(outcome)}), **seconds)
        end: dict[str, Any]
        try:
            async with asyncio.timeout(said["seconds"]):
                end = {"ended": outcome_form(await self._component.execute(said["skill"], call, said["arguments"]))}
        except Exception as error:  # noqa: BLE001  # whatever it is, it is told
            end = {"failed": f"{type(error).__name__}: {error}"}
        tell(end)

    async def _how(self, _: str, said: dict[str, Any]) -> list[dict[str, Any]] | None:
        """What the action has said after so many answers; `None` if it is unknown."""
        action = self._actions.get(_key(said))
        return None if action is None else action.said[said["heard"] :]

    async def _stop(self, _: str, said: dict[str, Any]) -> None:
        """Cancel the action if it is still going on, and forget it."""
        action = self._actions.get(_key(said))
        if action is not None and not action.task.done():
            action.task.cancel()
            await asyncio.wait([action.task])
        self._actions.pop(_key(said), None)


def _key(said: Mapping[str, Any]) -> tuple[str, str]:
    return said["run"], said["id"]


class RemoteComponent(Component):
    """A hosted component as seen from here; made by `connect`.

    The host outlives programs, whose action ids are alike: there, they stand behind a name for the program's run.
    """

    def __init__(self, name: str, endpoint: Endpoint, skills: dict[str, SkillSignature]) -> None:
        super().__init__(name)
        self._endpoint = endpoint
        self._skills = skills
        self._run = endpoint.life

    def remember(self) -> str:
        """What its actions are known by there."""
        return self._run

    def recall(self, memory: Any) -> None:
        """Go on with actions that were started before a restart."""
        self._run = memory

    def _key(self, action_id: str) -> dict[str, str]:
        return {"run": self._run, "id": action_id}

    @classmethod
    async def connect(cls, name: str, transport: Transport, within: float = WITHIN) -> RemoteComponent:
        """The component of that name, with the skills it says it has.

        Raises:
            NoAnswerError: it is not there.
        """
        life = secrets.token_hex(6)
        endpoint = Endpoint(f"for {name} {life}", transport, life)
        forms = await endpoint.call(name, "skills", within=within)
        return cls(name, endpoint, {form["name"]: SkillSignature(**form) for form in forms})

    def skills(self) -> dict[str, SkillSignature]:
        """As they were when it was connected."""
        return dict(self._skills)

    async def start(self) -> None:
        """Bring it to life there.

        Raises:
            NoAnswerError: it is not there.
            RefusedError: it is there and cannot start.
        """
        said = await self._endpoint.call(self.name, "come alive")
        if said["life"] != Life.ALIVE:
            raise RefusedError(f"it is in '{said['life']}' there" + (f": {said['reason']}" if said["reason"] else ""))

    async def come_alive(self) -> None:
        """Start it; also if it was lost, since it may be back."""
        if self.life.state is Life.FATAL_ERROR:
            self.life.become(Life.INIT)
        await super().come_alive()

    async def execute(self, skill_name: str, call: SkillCall, arguments: Mapping[str, Any]) -> Outcome:
        """Have the skill carried out there.

        Raises:
            RefusedError: it failed there, or nothing is known of it there any more.
            NoAnswerError: it fell silent.
        """
        news = asyncio.Event()
        self._endpoint.hear(f"news {call.action_id}", lambda _, __: news.set())
        seconds = call.remaining if call.remaining < float("inf") else None
        said = {"skill": skill_name, "arguments": dict(arguments), "seconds": seconds}
        try:
            await self._ask("start", {**self._key(call.action_id), **said})
            return await self._followed(call, news)
        except asyncio.CancelledError:
            with suppress(NoAnswerError):  # it is gone, and so is what it did
                await self._ask("stop", self._key(call.action_id), within=WITHIN)
            raise
        finally:
            self._endpoint.deafen(f"news {call.action_id}")

    async def _followed(self, call: SkillCall, news: asyncio.Event) -> Outcome:
        heard = 0
        while True:
            news.clear()
            said = await self._ask("how", {**self._key(call.action_id), "heard": heard})
            if said is None:
                raise RefusedError(f"'{self.name}' knows nothing of '{call.action_id}' any more")
            for form in said:
                heard += 1
                if "report" in form:
                    call.report(outcome_of(form["report"]))
                    continue
                if "failed" in form:
                    raise RefusedError(form["failed"])
                return outcome_of(form["ended"])
            if not said:
                with suppress(TimeoutError):
                    await asyncio.wait_for(news.wait(), WATCH)

    async def status(self, action_id: str, skill_name: str, arguments: Mapping[str, Any]) -> Status | Ended:  # noqa: ARG002
        """Whether it is known there, going on or ended; a host that is new itself knows nothing."""
        said = await self._ask("how", {**self._key(action_id), "heard": 0})
        return Status.UNKNOWN if said is None else Status.RUNNING

    async def abandon(self, action_id: str, skill_name: str, arguments: Mapping[str, Any]) -> Ended | None:  # noqa: ARG002
        """Stop it there; raises `NoAnswerError`."""
        said = await self._ask("how", {**self._key(action_id), "heard": 0})
        await self._ask("stop", self._key(action_id))
        return next((Ended(outcome_of(form["ended"])) for form in said or () if "ended" in form), None)

    async def forget(self, action_id: str) -> None:
        """Let it be forgotten there."""
        with suppress(NoAnswerError):  # then there is nothing to forget
            await self._ask("stop", self._key(action_id))

    async def _ask(self, kind: str, said: Any, within: float = SILENCE) -> Any:
        try:
            return await self._endpoint.call(self.name, kind, said, within)
        except NoAnswerError as error:
            if self.life.state is Life.ALIVE:
                self.life.become(Life.FATAL_ERROR, str(error))
            raise

    async def configure(self, parameter: str, value: object) -> None:
        """Set a parameter there; raises `NoAnswerError` or `RefusedError`."""
        await self._ask("set", {"parameter": parameter, "value": value})

    async def configure_all(self, values: Mapping[str, Any]) -> None:
        """Set parameters there as one set; raises `NoAnswerError` or `RefusedError`."""
        await self._ask("set all", dict(values))

    async def change_mode(self, mode: str) -> None:
        """Enter a mode there; raises `NoAnswerError` or `RefusedError`."""
        await self._ask("switch", {"mode": mode})

    async def take(self, port: str, message: Mapping[str, Any]) -> None:
        """Send a message there; raises `NoAnswerError` or `RefusedError`."""
        await self._ask("take", {"port": port, "message": dict(message)})

    async def diagnose(self) -> dict[str, Any]:
        """How it is there; raises `NoAnswerError` or `RefusedError`."""
        said: dict[str, Any] = await self._endpoint.call(self.name, "diagnose")
        return said

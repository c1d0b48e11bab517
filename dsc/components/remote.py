"""A component on the other side of a transport: `Host` offers one there, `RemoteComponent` is used here like any other.

An action is started by its id: however often a frame arrives, whatever is asked again, it is carried out once, and its
end is there until it has been taken, so that a run which is resumed hears of it. While it
runs the host is asked how it goes; one that is silent for `SILENCE` seconds is in FatalError as seen from here, which
ends the action with `skill_error`, and the next action looks for it anew.

The host says how its component is, and whom it needs, each time that changes: a push port like any other.
"""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict
from typing import Any

from dsc.calls import Clock, Ended, Outcome, SkillCall, Status
from dsc.components.component import Component
from dsc.components.endpoint import WITHIN, Endpoint, NoAnswerError, RefusedError, Transport
from dsc.components.heartbeat import Heartbeat
from dsc.components.hosted import HostedActions, outcome_of
from dsc.components.life_cycle import Life
from dsc.components.publication import RENEWED, HostedStreams, Publisher, Subscription, ports_form, ports_of
from dsc.skills import SkillSignature
from knowledge_base.errors import InputError, described, text_of
from knowledge_base.language.checking.inputs import require_text

WATCH = 1.0
"""Seconds after which a host is asked how an action goes."""
SILENCE = 3.0
"""Seconds for its answer, and for any sign of life."""
CONDITION = "its condition"
"""Where a host pushes life, mode and needs of its component; no port that is declared has a blank in its name."""


class Host:
    """Offers a component on a transport until it is closed; there it is part of the activation tree, too.

    Attributes:
        endpoint: the component's address; whatever else it does on the transport shares it.
    """

    def __init__(self, component: Component, transport: Transport, clock: Clock) -> None:
        self._component = component
        self.endpoint = Endpoint(component.name, transport)
        self._condition = Publisher(self.endpoint, CONDITION)
        self._actions = HostedActions(component, self.endpoint, clock)
        self._streams = HostedStreams(component, self.endpoint)
        self.endpoint.answer("hull", self._hull)
        self.endpoint.answer("come alive", self._come_alive)
        self.endpoint.answer("be active", self._be_active)
        self.endpoint.answer("switch", self._switch)
        self.endpoint.answer("set", lambda _, said: component.configure(said["parameter"], said["value"]))
        self.endpoint.answer("set all", lambda _, said: component.configure_all(said))
        self.endpoint.answer("take", lambda _, said: component.take(said["port"], said["message"]))
        self.endpoint.answer("diagnose", lambda _, __: component.diagnose())
        self._is_active = asyncio.Event()
        self._heart = Heartbeat(self.endpoint, component.needed, self._activated)
        self._beating = asyncio.get_running_loop().create_task(self._heart.run())
        self._changed()
        component.life.listen(self._changed)

    async def close(self) -> None:
        """Stop everything, and answer no more: to the others it has died."""
        self._component.life.leave(self._changed)
        await self.endpoint.close()
        tasks = [self._beating, *self._actions.tasks(), *self._streams.close()]
        for task in tasks:
            task.cancel()
        await asyncio.wait(tasks)

    def _changed(self) -> None:
        life = self._component.life
        needs = list(self._component.needed())
        self._condition.put({"life": life.state, "reason": life.reason, "mode": life.mode, "needs": needs})
        self._heart.stir()

    async def _hull(self, _: str, __: Any) -> dict[str, Any]:
        skills = [asdict(signature) for signature in self._component.skills().values()]
        return {"skills": skills, "pushes": ports_form(self._component), "condition": self._condition.newest}

    async def _come_alive(self, _: str, __: Any) -> dict[str, Any]:
        life = self._component.life
        before = life.state
        await life.come_alive(self._component.start)
        if before is not Life.ALIVE and self._is_active.is_set():  # it was restarted
            await life.become_active(id(self), self._component.activate, active=True)
        return self._condition.newest

    async def _be_active(self, sender: str, _: Any) -> dict[str, Any]:
        """As a heartbeat of somebody who needs it, and answered when it is active."""
        self._heart.need(sender)
        await self._is_active.wait()
        return self._condition.newest

    async def _activated(self, active: bool) -> None:  # noqa: FBT001
        component = self._component
        if active:
            await component.life.come_alive(component.start)
        await component.life.become_active(id(self), component.activate, active=active)
        (self._is_active.set if active else self._is_active.clear)()

    async def _switch(self, _: str, said: dict[str, Any]) -> dict[str, Any]:
        await self._component.change_mode(said["mode"])
        return self._condition.newest


class RemoteComponent(Component):
    """A hosted component as seen from here; made by `connect`.

    The host outlives programs, whose action ids are alike: there, they stand behind a name for the program's run.
    """

    def __init__(self, name: str, transport: Transport, endpoint: Endpoint, skills: dict[str, SkillSignature]) -> None:
        super().__init__(name)
        self._transport = transport
        self._endpoint = endpoint
        self._skills = skills
        self._run = endpoint.life
        self._there = Subscription(endpoint, name, CONDITION, self._heard)
        self._heart = Heartbeat(endpoint, lambda: [name], _unmoved, root=True)
        self._working: tuple[asyncio.Task[None], ...] = ()

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
            RefusedError: it is there, and says of itself what cannot be read.
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
            remote.pushes = ports_of(said["pushes"], remote, endpoint)
            remote._there.take(said["condition"])
        except Exception as error:
            await endpoint.close()
            raise RefusedError(f"'{name}' says of itself what cannot be read: {described(error)}") from error
        return remote

    def skills(self) -> dict[str, SkillSignature]:
        """As they were when it was connected."""
        return dict(self._skills)

    def needed(self) -> tuple[str, ...]:
        """Whom it needs there, in its present mode, as far as it is known here."""
        return tuple(self._there.value["needs"])

    async def reach(self, name: str) -> Component:
        """Wait for a component that it needs, on its own transport."""
        while True:
            with suppress(NoAnswerError):
                return await RemoteComponent.connect(name, self._transport, WATCH)

    async def start(self) -> None:
        """Bring it to life there.

        Raises:
            NoAnswerError: it is not there.
            RefusedError: it is there and cannot start.
        """
        self._require_alive(await self._endpoint.call(self.name, "come alive"))

    async def activate(self, active: bool) -> None:  # noqa: FBT001
        """Have it active there, and watch how it is as long as it is.

        Raises:
            NoAnswerError: it is not there.
            RefusedError: it is there and cannot be active.
        """
        loop = asyncio.get_running_loop()
        if active:
            self._working = self._working or (loop.create_task(self._watch()), loop.create_task(self._heart.run()))
            self._require_alive(await self._endpoint.call(self.name, "be active"))
        elif self._working:
            working, self._working = self._working, ()
            for task in working:
                task.cancel()
            await asyncio.wait(working)

    def _require_alive(self, said: dict[str, Any]) -> None:
        self._there.take(said)
        life, reason = said["value"]["life"], said["value"]["reason"]
        if life != Life.ALIVE:
            raise RefusedError(f"it is in '{life}' there" + (f": {reason}" if reason else ""))

    async def _watch(self) -> None:
        renewing = asyncio.get_running_loop().create_task(self._there.run())
        try:
            while True:
                await asyncio.sleep(WATCH)
                if self._there.age > RENEWED + SILENCE and self.life.state is Life.ALIVE:
                    self.life.become(Life.FATAL_ERROR, f"'{self.name}' has not answered for {SILENCE:g} s")
        finally:
            renewing.cancel()

    def _heard(self, said: Any) -> None:
        match said:
            case {"life": str(life), "reason": str(), "mode": str(), "needs": [*needs]} if life in list(Life):
                for need in needs:
                    require_text(need, "the name of a component that is needed")
            case _:
                raise InputError(f"'{self.name}' says of its condition what cannot be read: {text_of(said, repr)}")
        if self._working and not self.life.starting:
            self._follow(Life(said["life"]), said["reason"])
        self.life.mode = said["mode"]

    def _follow(self, there: Life, reason: str) -> None:
        if self.life.state is Life.SHUTDOWN and there is not Life.SHUTDOWN:
            self.life.become(Life.INIT)
        self.life.become(there, reason)

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
            patience = WITHIN if self.life.state is Life.ALIVE else WATCH
            with suppress(NoAnswerError):  # it is gone, and so is what it did
                await self._ask("stop", self._key(call.action_id), patience)
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
                    raise RefusedError(text_of(form["failed"], str))
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
        said = await self._ask("switch", {"mode": mode})
        self._there.take(said)

    async def take(self, port: str, message: Mapping[str, Any]) -> None:
        """Send a message there; raises `NoAnswerError` or `RefusedError`."""
        await self._ask("take", {"port": port, "message": dict(message)})

    async def diagnose(self) -> dict[str, Any]:
        """How it is there; raises `NoAnswerError` or `RefusedError`."""
        said: dict[str, Any] = await self._endpoint.call(self.name, "diagnose")
        return said


async def _unmoved(_: bool) -> None:  # noqa: FBT001
    """Who needs somebody elsewhere has nothing else to do for it."""

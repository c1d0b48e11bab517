"""The actions that a host carries out for others: each once for its id, however often it is asked for.

What an action has said, its end last, is there until its user lets it be forgotten.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from dsc.calls import Clock, Outcome, SkillCall
from dsc.components.component import Component
from dsc.components.endpoint import Endpoint
from knowledge_base.exchange.forms import delta_form, delta_of


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
    """Who wants to know, and what the action has said so far."""

    user: str
    task: asyncio.Task[None]
    said: list[dict[str, Any]] = field(default_factory=list)


class HostedActions:
    """Answers `start`, `how` and `stop` at an endpoint for a component's skills."""

    def __init__(self, component: Component, endpoint: Endpoint, clock: Clock) -> None:
        self._component = component
        self._endpoint = endpoint
        self._clock = clock
        self._actions: dict[tuple[str, str], _Action] = {}
        endpoint.answer("start", self._start)
        endpoint.answer("how", self._how)
        endpoint.answer("stop", self._stop)

    def tasks(self) -> list[asyncio.Task[None]]:
        """What is going on, or is over and not forgotten."""
        return [action.task for action in self._actions.values()]

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

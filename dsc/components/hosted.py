"""The actions that a host carries out for others: each once for its id, however often it is asked for.

What an action has said, its end last, is there until its user lets it be forgotten, within the bounds `MOST_ACTIONS`
and `MOST_KEPT`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from dsc.calls import OBSERVED, Clock, Outcome, Reports, SkillCall
from dsc.components.component import Component
from dsc.components.endpoint import Endpoint, encoded
from dsc.components.hooks import contained
from knowledge_base.errors import InputError, described
from knowledge_base.exchange import delta_form, delta_of
from knowledge_base.language.checking.inputs import require_delta, require_time, shown

MOST_ACTIONS = 1_000
"""Actions that are going on at a host, and as many that are over and were not forgotten; of those, the latest."""
MOST_KEPT = 10_000
"""Reports of an action whose text is kept for a user that is resumed; older ones count, and say nothing."""


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


_NO_REPORT = {"report": outcome_form(Outcome(OBSERVED))}
"""Stands for a report that its user has had long ago."""


@dataclass(slots=True)
class _Action:
    """Who wants to know, and what the action has said so far."""

    user: str
    task: asyncio.Task[None] | None = None
    reports: Reports | None = None
    said: list[dict[str, Any]] = field(default_factory=list)
    heard: int = 0

    def hear(self, heard: int) -> None:
        """The user has so much of what was said: there is room for more, and the oldest need not be kept."""
        assert self.reports is not None  # noqa: S101
        for number in range(self.heard, min(heard, len(self.said))):
            if number >= MOST_KEPT:
                self.said[number - MOST_KEPT] = _NO_REPORT
            self.heard = number + 1
            self.reports.taken()


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
        return [action.task for action in self._actions.values() if action.task is not None]

    async def _start(self, sender: str, said: dict[str, Any]) -> None:
        action = self._actions.get(_key(said))
        if action is not None:  # whose user has been started anew
            action.user = sender
            return
        self._make_room()
        action = self._actions[_key(said)] = _Action(sender)
        action.reports = Reports(lambda report, _: self._tell(said["id"], action, {"report": outcome_form(report)}))
        action.task = asyncio.get_running_loop().create_task(self._carry_out(said, action, action.reports))

    def _make_room(self) -> None:
        """Forget the first action that is over and was not claimed; refuse a new one while too many are going on."""
        over = [key for key, action in self._actions.items() if action.task is None or action.task.done()]
        if len(self._actions) - len(over) >= MOST_ACTIONS:
            raise InputError(f"{MOST_ACTIONS} actions are going on here, and no more are carried out")
        for key in over[: max(0, len(over) + 1 - MOST_ACTIONS)]:
            del self._actions[key]

    def _tell(self, action_id: str, action: _Action, form: dict[str, Any]) -> None:
        action.said.append(form)
        self._endpoint.push(action.user, f"news {action_id}", len(action.said))

    async def _carry_out(self, said: dict[str, Any], action: _Action, reports: Reports) -> None:
        end: dict[str, Any]
        try:
            seconds = {}
            if said["seconds"] is not None:
                require_time(said["seconds"])
                seconds["deadline"] = self._clock.now() + said["seconds"]
            call = SkillCall(said["id"], self._clock, lambda outcome: reports.put(_plain(outcome)), **seconds)
            async with asyncio.timeout(said["seconds"]):
                with contained():
                    outcome = await self._component.execute(said["skill"], call, said["arguments"])
            end = {"ended": outcome_form(_plain(outcome))}
        except Exception as error:  # noqa: BLE001  # whatever it is, it is told
            end = {"failed": described(error)}
        reports.flush()
        self._tell(said["id"], action, end)

    async def _how(self, _: str, said: dict[str, Any]) -> list[dict[str, Any]] | None:
        """What the action has said after so many answers; `None` if it is unknown."""
        action = self._actions.get(_key(said))
        if action is None:
            return None
        action.hear(said["heard"])
        if action.task is not None and action.task.done() and not (action.said and "report" not in action.said[-1]):
            self._tell(said["id"], action, {"failed": "its task was cancelled"})
        return action.said[said["heard"] :]

    async def _stop(self, _: str, said: dict[str, Any]) -> None:
        """Cancel the action if it is still going on, and forget it."""
        action = self._actions.get(_key(said))
        if action is not None and action.task is not None and not action.task.done():
            action.task.cancel()
            await asyncio.wait([action.task])
        self._actions.pop(_key(said), None)


def _plain(outcome: Outcome) -> Outcome:
    """The outcome, if it can be sent.

    Raises:
        InputError: it is none, or something in it is no plain data.
    """
    if not isinstance(outcome, Outcome) or not isinstance(outcome.event, str):
        raise InputError(f"it ended with {shown(outcome)}, which is no outcome")
    require_delta(outcome.observed)
    encoded(outcome_form(outcome))
    return outcome


def _key(said: Mapping[str, Any]) -> tuple[str, str]:
    run, action_id = said["run"], said["id"]
    if not (isinstance(run, str) and isinstance(action_id, str)):
        raise InputError("an action is named by the texts 'run' and 'id'")
    return run, action_id

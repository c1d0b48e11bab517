"""Watched condition over several sources: its parts report their truth, which decides the truth of the whole."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator, Awaitable, Callable, Mapping
from contextlib import aclosing, suppress
from dataclasses import replace
from typing import Any, Never, Protocol, TypeVar

from dsc.calls import SkillCall
from dsc.components.component import Component
from dsc.components.value_conditions import WATCH, BecameFalse, BecameTrue, ValueCondition, checks_of
from dsc.components.value_vocabulary import kinds_of
from dsc.errors import NoAnswerError, RefusedError
from dsc.loop_calls import LoopCalls
from dsc.outcomes import Outcome
from dsc.sensing.condition_parts import Part, parts_in, split, truth_of
from dsc.sensing.live_values import live_values, require_evaluable
from dsc.sensing.vocabulary import vocabulary_of
from knowledge_base.conditions.damping import relaxed
from knowledge_base.errors import InputError
from knowledge_base.language.syntax.text import parse_condition, to_text
from knowledge_base.store import KnowledgeBase

_Result = TypeVar("_Result")
_AGAIN = 0.05
"""Seconds until values are sent again to a source that does not evaluate the part yet."""


class Work(Protocol):
    """Function that awaits work on a component, which stays active until the end of the work."""

    def __call__(self, name: str, on: Callable[[Component], Awaitable[_Result]], /) -> Awaitable[_Result]:
        """Await the work; raise `NotAliveError` if the component is lost."""
        ...


class WatchedCondition:
    """A condition that a chart watches, until the task of `watch` is cancelled.

    Args:
        call: receives the changes of the truth.
        condition: the condition as text.
        values: the values of its variables.
        hysteresis: the margin by which the comparisons of a true part must fail before the part is false.
        hold: seconds for which the whole condition must stay true before it counts as true.
        components: the components by name.
        work: keeps a component active.
        knowledge: the knowledge base.

    Raises:
        InputError: the text is not such a condition, or a number is invalid.
        UnknownNameError: a component or one of its values does not exist.
    """

    def __init__(
        self,
        call: SkillCall[Outcome],
        condition: str,
        values: Mapping[str, Any],
        hysteresis: float,
        hold: float,
        components: Mapping[str, Component],
        work: Work,
        knowledge: KnowledgeBase,
    ) -> None:
        self._call, self._given, self._hold = call, values, hold
        self._components, self._work, self._knowledge = components, work, knowledge
        whole = parse_condition(condition, "condition")
        if hysteresis:
            relaxed(whole, hysteresis)  # refuses a condition without bounds
        self._hysteresis = hysteresis
        interfaces = {name: component.interface() for name, component in components.items()}
        self._structure = split(whole, values, vocabulary_of(interfaces, kinds_of(values), knowledge.schema.functions))
        for part in parts_in(self._structure):
            require_evaluable(part.live.values(), knowledge)
        self._truths: dict[Part, bool] = {}
        self._unknown: set[Part] = set()  # parts with a live value that is unknown at present
        self._read: dict[str, Any] = {}  # the values that the parts have reported
        self._truth: bool | None = None
        self._held: asyncio.TimerHandle | None = None

    async def watch(self) -> Never:
        """Report the first truth and each change of it; end only with the error of a part."""
        try:
            await _await_all(*(self._watch_part(part, number) for number, part in enumerate(parts_in(self._structure))))
            raise AssertionError("no part ends")
        finally:
            self._stop_hold()

    # -- parts -------------------------------------------------------------------------------------------

    async def _watch_part(self, part: Part, number: int) -> None:
        if not part.components:
            await self._watch_knowledge(part)
            return
        async with aclosing(live_values(self._knowledge, part.live)) as live:
            first = await self._await_known(live) if part.live else {}
            if len(part.components) == 1:
                await self._watch_at_source(part, number, first, live)
            else:
                await self._watch_here(part, first, live)

    async def _watch_knowledge(self, part: Part) -> None:
        calls = LoopCalls()
        calls.bind()
        with self._knowledge.install(part.condition, hysteresis=self._margin(part) or None) as condition:
            condition.subscribe(lambda _: calls.call(lambda: self._note(part, truth=condition.truth)), falls=True)
            self._note(part, truth=condition.truth)
            await _wait()

    async def _watch_at_source(
        self, part: Part, number: int, first: Mapping[str, Any], live: AsyncGenerator[dict[str, Any] | None, None]
    ) -> None:
        (name,) = part.components

        def receive(outcome: Outcome) -> None:
            values = {f"{name}.{value}": one for value, one in outcome.attributes["values"].items()}
            self._note(part, truth=outcome.event == BecameTrue.event, values=values)

        call = replace(self._call, action_id=f"{self._call.action_id}.{number}", report=receive)
        arguments = {
            "condition": to_text(part.condition),
            "values": {**self._given, **first},
            "hysteresis": self._margin(part),
        }

        async def at_source(source: Component) -> None:
            async def send(values: dict[str, Any]) -> None:
                await _send(source, {"key": call.key, "values": values})

            follow = [self._follow(part, live, send)] if part.live else []
            await _await_all(source.execute(WATCH, call, arguments), *follow)

        await self._work(name, at_source)

    async def _watch_here(
        self, part: Part, first: Mapping[str, Any], live: AsyncGenerator[dict[str, Any] | None, None]
    ) -> None:
        """Evaluate a part with the values of several components in this program, to which the values travel."""
        ports = {f"{name}.{port}": one for name in part.components
                 for port, one in self._components[name].pushes.items()}  # fmt: skip
        given = {**self._given, **first}
        condition = ValueCondition(
            part.condition, ports, checks_of(ports.values()), given, hysteresis=self._margin(part)
        )
        failed: asyncio.Future[None] = asyncio.get_running_loop().create_future()

        async def replace_values(values: dict[str, Any]) -> None:
            condition.replace_values(values)

        condition.listen(
            lambda truth, values: self._note(part, truth=truth, values=values),
            lambda error: None if failed.done() else failed.set_exception(error),
        )
        try:
            active = [self._work(name, lambda _: _wait()) for name in part.components]
            follow = [self._follow(part, live, replace_values)] if part.live else []
            await _await_all(failed, *active, *follow)
        finally:
            condition.end()

    @staticmethod
    async def _await_known(live: AsyncGenerator[dict[str, Any] | None, None]) -> dict[str, Any]:
        """Return the live values of a part as soon as all are known."""
        async for values in live:
            if values is not None:
                return values
        raise AssertionError("live values never end")

    async def _follow(
        self,
        part: Part,
        live: AsyncGenerator[dict[str, Any] | None, None],
        use: Callable[[dict[str, Any]], Awaitable[None]],
    ) -> None:
        """Use each change of the live values; while a value is unknown, the part is unknown."""
        async for values in live:
            if values is None:
                self._unknown.add(part)
            else:
                await use(values)
                self._unknown.discard(part)
            self._report()

    def _margin(self, part: Part) -> float:
        """Return the hysteresis of a part; 0 for a part without bounds."""
        with suppress(InputError):
            return self._hysteresis if self._hysteresis and relaxed(part.condition, self._hysteresis) else 0.0
        return 0.0

    # -- the whole ---------------------------------------------------------------------------------------

    def _note(self, part: Part, *, truth: bool, values: Mapping[str, Any] | None = None) -> None:
        self._truths[part] = truth
        self._read.update(values or {})
        self._report()

    def _report(self) -> None:
        """Report a change of the truth, or begin the time for which the condition must stay true."""
        holds = truth_of(self._structure, self._truth_of)
        if not holds:
            self._stop_hold()
        if holds is None:
            return
        if holds and self._hold and not self._truth:
            self._held = self._held or asyncio.get_running_loop().call_later(self._hold, self._become_true)
            holds = False
        self._become(truth=holds)

    def _become_true(self) -> None:
        self._become(truth=True)

    def _become(self, *, truth: bool) -> None:
        if truth is self._truth:
            return
        self._truth = truth
        parts = {part.text: self._truth_of(part) for part in parts_in(self._structure)}
        event = BecameTrue.event if truth else BecameFalse.event
        self._call.report(Outcome(event, {"values": dict(self._read), "parts": parts}))

    def _truth_of(self, part: Part) -> bool | None:
        return None if part in self._unknown else self._truths.get(part)

    def _stop_hold(self) -> None:
        if self._held is not None:
            self._held.cancel()
            self._held = None


async def _send(source: Component, message: Mapping[str, Any]) -> None:
    """Send values to a source, which may begin with the part a little later."""
    while True:
        try:
            await source.receive(WATCH, message)
        except (InputError, NoAnswerError, RefusedError):  # a lost source ends the work on it
            await asyncio.sleep(_AGAIN)
        else:
            return


async def _await_all(*works: Awaitable[Any]) -> None:
    """Await all works; the first error cancels the others, and waits for their end."""
    tasks = [asyncio.ensure_future(work) for work in works]
    try:
        await asyncio.gather(*tasks)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.wait(tasks)


async def _wait() -> None:
    """Wait until cancelled."""
    await asyncio.get_running_loop().create_future()

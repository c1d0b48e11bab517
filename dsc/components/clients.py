"""Required ports besides streams: queries, messages, events, parameters and modes of other components (S1.1, S0.17).

```python
class Charger(Component):
    lasts = QueryClient({"watts": "number"}, answer={"hours": "number"})
    low = EventClient({"below": "number"}, event={"level": "number"})
    say = SendClient({"text": "text"})
    camera = ParameterClient({"exposure": "number"})
    laser = StateClient("scanning")

    @skill
    async def wait(self, call: SkillCall) -> Charged:
        hours = (await self.lasts.ask(watts=60.0, within=1))["hours"]
```
"""

from __future__ import annotations

import asyncio
import json
import secrets
from collections.abc import AsyncIterator, Callable, Coroutine, Mapping
from contextlib import AbstractContextManager, asynccontextmanager, nullcontext
from typing import Any

from dsc.calls import SkillCall
from dsc.components.frames import encoded
from dsc.components.requirement import Provider, Requirement
from dsc.components.services import Service, Values, declared_values
from dsc.errors import NoAnswerError, NotWiredError
from dsc.outcomes import Outcome
from knowledge_base.errors import InputError

WITHIN = 10.0
"""Seconds after which a call without `within` ends with `NoAnswerError`."""
_RESERVED = "within"


class LoopTime:
    """The clock of the running event loop; in simulated time, it is the simulated one."""

    def now(self) -> float:
        """Return the seconds of loop time."""
        return asyncio.get_running_loop().time()

    async def sleep(self, seconds: float) -> None:
        """Wait."""
        await asyncio.sleep(seconds)

    def hold(self) -> AbstractContextManager[None]:
        """Return a context manager without effect."""
        return nullcontext()


class _Client(Requirement):
    """A required port whose calls have ids, so that a remote provider executes each call one time."""

    _calls = 0

    def _call(self, report: Callable[[Outcome], None] = lambda _: None) -> SkillCall[Any]:
        if not self._calls:
            self._prefix = secrets.token_hex(6)
        self._calls += 1
        return SkillCall(f"{self.name} {self._prefix} {self._calls}", LoopTime(), report)

    async def _reach(self, work: Callable[[Provider], Coroutine[Any, Any, Any]], within: float | None) -> Any:
        """Start the provider unless it is alive, and return the result of the work on it."""
        provider = self.require_wired()

        async def alive() -> Any:
            await provider.component.life.come_alive()
            provider.component.life.require_alive()
            return await work(provider)

        return await self.await_call(alive(), within)


class QueryClient(_Client):
    """A required query.

    Args:
        arguments: names and types of the arguments.
        answer: names and types of the wanted attributes of the answer.
        source: the provider, unless the profile names another one.
        optional: whether the component also works without a provider.
    """

    what = "a query client"

    def __init__(self, arguments: Values, *, answer: Values, source: str | None = None, optional: bool = False) -> None:
        takes, gives = _arguments(arguments, self.what), declared_values(answer, "an answer")
        super().__init__(Service("query", takes, gives), source, optional=optional)

    async def ask(self, *, within: float = WITHIN, **arguments: Any) -> dict[str, Any]:
        """Return the answer of the provider.

        Raises:
            InputError: an argument is missing, is not declared, or has another type.
            NotWiredError: the port is not wired, or the wire was cut during the call.
            NoAnswerError: the provider has not answered after `within` seconds.
            SkillError: the provider has failed.
        """
        given = _plain(self.check_all(arguments))

        async def ask(provider: Provider) -> Outcome:
            return await provider.component.execute(provider.port, self._call(), given)

        outcome = await self._reach(ask, within)
        return _plain({name: outcome.attributes[name] for name in self.service.gives})


class SendClient(_Client):
    """A required message, which has no answer.

    Args:
        parts: names and types of the parts of the message.
        source: the provider, unless the profile names another one.
        optional: whether the component also works without a provider.
    """

    what = "a send client"

    def __init__(self, parts: Values, *, source: str | None = None, optional: bool = False) -> None:
        super().__init__(Service("send", _arguments(parts, self.what), {}), source, optional=optional)

    async def send(self, *, within: float = WITHIN, **parts: Any) -> None:
        """Send a message; errors as for `QueryClient.ask`."""
        given = _plain(self.check_all(parts))
        await self._reach(lambda provider: provider.component.receive(provider.port, given), within)


class EventClient(_Client):
    """A required event.

    Args:
        arguments: names and types of the parameters of an activation.
        event: names and types of the wanted attributes of the event.
        source: the provider, unless the profile names another one.
        optional: whether the component also works without a provider.
    """

    what = "an event client"

    def __init__(self, arguments: Values, *, event: Values, source: str | None = None, optional: bool = False) -> None:
        takes, gives = _arguments(arguments, self.what), declared_values(event, "an event")
        super().__init__(Service("event", takes, gives), source, optional=optional)

    @asynccontextmanager
    async def activation(self, **arguments: Any) -> AsyncIterator[Occurrences]:
        """Activate the event inside the block; the value of the block returns the occurrences.

        Raises:
            InputError: an argument is missing, is not declared, or has another type.
            NotWiredError: the port is not wired.
            SkillError: the provider cannot start.
        """
        given = _plain(self.check_all(arguments))
        occurrences = Occurrences(self)

        async def activate(provider: Provider) -> None:
            await provider.component.execute(provider.port, self._call(occurrences.add), given)

        self.require_wired()
        task = asyncio.ensure_future(self._reach(activate, None))
        task.add_done_callback(occurrences.end)
        try:
            yield occurrences
        finally:
            task.cancel()
            await asyncio.wait([task])


class Occurrences:
    """The occurrences of an activated event, the earliest first."""

    def __init__(self, client: EventClient) -> None:
        self._client = client
        self._found: asyncio.Queue[dict[str, Any] | BaseException] = asyncio.Queue()

    def add(self, outcome: Outcome) -> None:
        """Add an occurrence."""
        self._found.put_nowait({name: outcome.attributes[name] for name in self._client.service.gives})

    def end(self, task: asyncio.Future[Any]) -> None:
        """Add the error that has ended the activation."""
        error = None if task.cancelled() else task.exception()
        self._found.put_nowait(error or NotWiredError(f"the activation of '{self._client.name}' has ended"))

    async def next(self, within: float) -> dict[str, Any]:
        """Wait for the next occurrence, and return its attributes.

        Raises:
            NoAnswerError: the event has not occurred within that number of seconds.
            NotWiredError: the wire was cut.
            SkillError: the provider has failed.
        """
        try:
            found = await asyncio.wait_for(self._found.get(), within)
        except TimeoutError:
            raise NoAnswerError(f"'{self._client.name}' has not occurred within {within:g} s") from None
        if isinstance(found, BaseException):
            self._found.put_nowait(found)  # for the next call, too
            raise found
        return found


class ParameterClient(_Client):
    """Required parameters of a component.

    Args:
        parameters: names and types of the parameters.
        source: the component, unless the profile names another one.
        optional: whether the component also works without a provider.
    """

    what = "a parameter client"

    def __init__(self, parameters: Values, *, source: str | None = None, optional: bool = False) -> None:
        super().__init__(Service("parameters", _arguments(parameters, self.what), {}), source, optional=optional)

    async def set(self, *, within: float = WITHIN, **values: Any) -> None:
        """Set parameters of the provider as one set; errors as for `QueryClient.ask`, and those of the provider."""
        given = _plain(self.check(values))
        await self._reach(lambda provider: provider.component.configure_all(given), within)


class StateClient(_Client):
    """Required modes of a component.

    Args:
        modes: names of the modes.
        source: the component, unless the profile names another one.
        optional: whether the component also works without a provider.
    """

    what = "a state client"

    def __init__(self, *modes: str, source: str | None = None, optional: bool = False) -> None:
        if not all(isinstance(mode, str) for mode in modes) or not modes:
            raise InputError("a state client has the names of modes, as in StateClient('scanning')")
        super().__init__(Service("modes", dict.fromkeys(modes), {}), source, optional=optional)

    async def switch(self, mode: str, within: float = WITHIN) -> None:
        """Switch the provider to a mode, or to `neutral`; errors as for `QueryClient.ask`."""
        await self._reach(lambda provider: provider.component.change_mode(mode), within)

    @property
    def mode(self) -> str:
        """The present mode of the provider; raise `NotWiredError` if the port is not wired."""
        return self.require_wired().component.mode


def _arguments(values: object, what: str) -> Mapping[str, str | None]:
    declared = declared_values(values, what)
    if _RESERVED in declared:
        raise InputError(f"'{_RESERVED}' is the time limit of a call; choose another name", found=_RESERVED)
    return declared


def _plain(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return a separate copy, as a remote provider would receive it."""
    copied: dict[str, Any] = json.loads(encoded(dict(values)))
    return copied

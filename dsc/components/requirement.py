"""Required ports: services of other components, which a component uses under its own names (S0.17, S1.1)."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Coroutine, Mapping
from copy import copy
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Protocol, Self, TypeVar

from dsc.calls import SkillCall
from dsc.components.life_cycle import Announcer, LifeCycle
from dsc.components.services import Service
from dsc.data_types import data_type
from dsc.errors import NoAnswerError, NotWiredError
from dsc.outcomes import Outcome
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.tracebacks import calling_place
from knowledge_base.user_objects import shown

_Result = TypeVar("_Result")
USUAL = ""
"""Target of a required port whose wire no client changes."""
_HERE = str(Path(__file__).parent)


class Server(Protocol):
    """The part of a component, local or remote, that wires use."""

    name: str
    life: LifeCycle
    pushes: dict[str, Any]
    is_remote: ClassVar[bool]

    @property
    def mode(self) -> str:
        """The present mode."""
        ...

    def execute(self, skill_name: str, call: SkillCall[Any], arguments: Mapping[str, Any]) -> Awaitable[Outcome]:
        """Start a query or an event."""
        ...

    async def receive(self, port: str, message: Mapping[str, Any]) -> None:
        """Pass a message."""
        ...

    async def configure_all(self, values: Mapping[str, Any]) -> None:
        """Set parameters as one set."""
        ...

    async def change_mode(self, mode: str) -> None:
        """Switch to a mode."""
        ...


@dataclass(frozen=True, slots=True)
class Provider:
    """A provided port of a component, with its service.

    Attributes:
        component: the component, local or remote.
        port: the name of the port; empty for the parameters and for the modes of the component.
        service: the service.
    """

    component: Server
    port: str
    service: Service

    @property
    def name(self) -> str:
        """The port as `component.port`, or the component for its parameters and modes."""
        return f"{self.component.name}.{self.port}" if self.port else self.component.name


class Requirement:
    """Base class of required ports. A component declares them as class attributes; the run wires them.

    Args:
        service: the wanted service.
        source: the provider, as `component.port` or `component`, unless the profile names another one; without a
            source, the only provider whose service fits.
        optional: whether the component also works without a provider.

    Attributes:
        name: the port as `component.port`, for messages and profiles.
        place: the line of the declaration, for messages.
        provider: the present provider; `None` if the port is not wired.
        is_hosted: whether another program hosts the component, and wires the port unless a run changes the wire.
        target: the provider that the host of the component connects: the source, unless a client changes the wire.
        redirections: announces a change of `target`.
    """

    what: ClassVar[str] = "a required port"
    is_hosted: ClassVar[bool] = False

    def __init__(self, service: Service, source: str | None = None, *, optional: bool = False) -> None:
        if source is not None and not (isinstance(source, str) and all(source.split("."))):
            raise InputError(f"{self.what} has a source such as 'laser.scan', not {shown(source)}")
        self.service = service
        self.source = source
        self.optional = optional
        self.name = ""
        self.place = calling_place(_HERE)
        self.provider: Provider | None = None
        self.redirections = Announcer()
        self._redirect: str | None = USUAL
        self._runs = 0
        self._pending: set[asyncio.Future[None]] = set()

    def __getstate__(self) -> dict[str, object]:
        """Return the state for pickling, without provider and pending calls, which stay in this process."""
        fresh: dict[str, object] = {
            "provider": None,
            "redirections": Announcer(),
            "_redirect": USUAL,
            "_runs": 0,
            "_pending": set(),
        }
        return {**self.__dict__, **fresh}

    def of(self, component: str, port: str) -> Self:
        """Return the port of one component."""
        own = copy(self)
        own.name = f"{component}.{port}"
        return own

    @property
    def target(self) -> str | None:
        """The provider that the host connects, as `component.port` or `component`; `None` without a wire."""
        return self.source if self._redirect == USUAL else self._redirect

    def redirect(self, to: str | None) -> None:
        """Change the target, for a client of the host: a provider, `None` for no wire, or `USUAL` for the source."""
        self._redirect = to
        self.redirections.announce()

    async def follow_target(self, serve: Callable[[str | None], Coroutine[Any, Any, None]]) -> None:
        """Run `serve` with the target, and again with each later target, until cancelled."""
        while True:
            changed = asyncio.Event()
            self.redirections.listen(changed.set)
            serving = asyncio.get_running_loop().create_task(serve(self.target))
            try:
                await changed.wait()
            finally:
                self.redirections.leave(changed.set)
                serving.cancel()
                await asyncio.wait([serving])

    def require_reachable(self, provider: Provider) -> None:
        """Raise `InputError` if the program of the component cannot reach the provider."""

    def provider_name(self) -> str | None:
        """Return the name of the present provider; `None` if the port is not wired."""
        return None if self.provider is None else self.provider.name

    def join(self) -> None:
        """Count a run that uses the port."""
        self._runs += 1

    def leave(self) -> None:
        """Count the end of a run; the last run releases the port."""
        self._runs -= 1
        if self._runs == 0:
            self.release()

    def release(self) -> None:
        """End the wires of all runs."""
        self.disconnect()

    def connect(self, provider: Provider) -> None:
        """Use the service of a provider from now on."""
        if self.provider == provider:
            return
        self.disconnect()
        self.provider = provider

    def disconnect(self) -> None:
        """Use no service any longer; pending calls end with `NotWiredError`."""
        self.provider = None
        for cut in tuple(self._pending):
            if not cut.done():
                cut.set_result(None)

    def require_wired(self) -> Provider:
        """Return the provider; raise `NotWiredError` if the port is not wired."""
        if self.provider is None:
            raise NotWiredError(f"port '{self.name}' is not wired")
        return self.provider

    async def await_call(self, work: Coroutine[Any, Any, _Result], within: float | None) -> _Result:
        """Await a call of the provider.

        Raises:
            NoAnswerError: the call has not ended after `within` seconds.
            NotWiredError: the wire was cut.
        """
        cut: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._pending.add(cut)
        provider = self.provider
        task = asyncio.ensure_future(work)
        try:
            await asyncio.wait((task, cut), timeout=within, return_when=asyncio.FIRST_COMPLETED)
            if task.done():
                return task.result()
            whose = "" if provider is None else f" to '{provider.name}'"
            if cut.done():
                raise NotWiredError(f"the wire of '{self.name}'{whose} was cut during a call")
            raise NoAnswerError(f"the call of '{self.name}'{whose} has no answer within {within:g} s")
        finally:
            self._pending.discard(cut)
            if not task.done():
                task.cancel()

    def check(self, arguments: Mapping[str, Any]) -> dict[str, Any]:
        """Return the arguments of a call.

        Raises:
            InputError: an argument has another type.
            UnknownNameError: an argument is not declared.
        """
        wanted = self.service.takes
        for name, value in arguments.items():
            if name not in wanted:
                raise UnknownNameError(f"'{self.name}' has no argument '{name}'", found=name, valid=wanted)
            kind = wanted[name]
            if kind is not None:
                data_type(kind).check(f"the argument '{name}' of '{self.name}'", value)
        return dict(arguments)

    def check_all(self, arguments: Mapping[str, Any]) -> dict[str, Any]:
        """Return all arguments of a call; raise as `checked`, and for an argument that is missing."""
        given = self.check(arguments)
        for name in self.service.takes:
            if name not in given:
                raise InputError(f"'{self.name}' needs its argument '{name}'")
        return given

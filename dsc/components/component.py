"""Component: a deployed part of the robot with skills, parameters, modes and a life cycle."""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import Awaitable, Mapping
from pathlib import Path
from typing import Any, ClassVar

from dsc.calls import Ended, Outcome, SkillCall, Status
from dsc.components.life_cycle import NEUTRAL, Life, LifeCycle
from dsc.components.parameters import Parameter, Parameters, check_declarations
from dsc.components.ports import TAKES, EventActivations
from dsc.components.streams import Push, Stream
from dsc.skills import DECLARED, Declared, SkillBody, SkillSignature, check_arguments, signature_of, signatures
from knowledge_base.errors import UnknownNameError

ALWAYS = ""
"""Stands for every mode in `ComponentHooks.needs`."""


class ComponentHooks:
    """Attributes to set and hooks to override in a subclass of `Component`; all are optional.

    Attributes:
        name: the name in charts; the deployment may choose another.
        domain: its part of the planning domain: a PDDL file, or PDDL text; `None` for nothing.
        concurrent: whether it executes several skills together. If not, steps of a plan that use it never overlap;
            plots may still start them in parallel.
        modes: the sub-states of Alive besides `neutral`; if empty, any mode is valid.
        declares: its parameters with type, range and the roles that may change them; if empty, any name is valid.
        relations: conditions between its parameters that always hold.
        needs: mode -> a tuple of names of required components; `ALWAYS`: in every mode.
        parameters: the present values, by name.
        life: its life cycle; call `self.life.become(Life.FATAL_ERROR, "no power")` when the device is lost.
    """

    name: str = ""
    domain: ClassVar[Path | str | None] = None
    concurrent: bool = False
    modes: ClassVar[tuple[str, ...]] = ()
    declares: ClassVar[Mapping[str, Parameter]] = {}
    relations: ClassVar[tuple[str, ...]] = ()
    needs: ClassVar[Mapping[str, tuple[str, ...]]] = {}

    parameters: Parameters
    life: LifeCycle

    async def start(self) -> None:
        """From Init to Alive: override to open devices; an error leads to FatalError."""

    async def stop(self) -> None:
        """To Shutdown: override to close devices."""

    async def activate(self, active: bool) -> None:  # noqa: FBT001
        """Become active for a state or an active component, or inactive (S1.9, S4.1).

        Override to acquire and release resources. The first call comes between `start` and the first skill, and a
        restart repeats it. `False` only follows `True`. An error leads to FatalError.
        """

    async def configure(self, parameter: str, value: object) -> None:
        """The *param* port: set a named parameter; override to react.

        `None` resets a declared one. Parameters that depend on it are unbound, see `Parameter.depends_on`.

        Raises:
            UnknownNameError: the component declares its parameters, and this is not among them.
            InputError: the value violates its declaration or a relation.
        """
        self.parameters.configure(parameter, value)

    async def switch(self, mode: str) -> None:
        """The *state* port: enter a mode (`neutral` when idle); override to react."""
        self.life.mode = mode


class RestartHooks:
    """Hooks for runs with a store, which a component overrides if its actions or data outlive the program."""

    async def status(self, action_id: str, skill_name: str, arguments: Mapping[str, Any]) -> Status | Ended:  # noqa: ARG002
        """The status of an action that another process started; override to query the robot.

        After `RUNNING` and `NOT_BEGUN` the skill is executed with that id: it awaits the end of the action, or begins
        it. After `UNKNOWN` the skill's `after_crash` decides.
        """
        return Status.UNKNOWN

    async def abandon(self, action_id: str, skill_name: str, arguments: Mapping[str, Any]) -> Ended | None:  # noqa: ARG002
        """Stop an action that was cancelled just before a crash, if it still runs.

        The cancellation may not have reached the robot. Override it if actions survive this process.

        Returns:
            Its end, if it ended before it was stopped: these observations are true.
        """
        return None

    async def forget(self, action_id: str) -> None:
        """Forget the end of an action: it was taken and, with a store, is kept.

        Override it if ends are remembered for `status`.
        """

    def remember(self) -> Any:
        """Plain data for `recall` after a restart; called with each macrostep that is committed."""
        return None

    def recall(self, memory: Any) -> None:
        """Restore the state at the time of `memory`; called first after a restart."""


class Component(ComponentHooks, RestartHooks):
    """Base class of components: the ports through which sequencer, supervisors and hosts use one.

    A subclass declares skills and ports by decorators, and overrides `ComponentHooks` and `RestartHooks`.

    Attributes:
        activations: the activations of its events.
        pushes, streams: its push ports and its subscriptions to others, by name; see `dsc.components.streams`.
    """

    _ports: ClassVar[Mapping[str, Push | Stream]] = {}
    _functions: Mapping[str, SkillBody] = {}  # skills that are functions

    def __init_subclass__(cls, **named: Any) -> None:
        """Validate the declared parameters, and collect the ports; raises `InputError`."""
        super().__init_subclass__(**named)
        check_declarations(cls.name or cls.__name__.lower(), cls.declares, cls.relations, cls.__module__)
        cls._ports = {name: one for name, one in inspect.getmembers(cls) if isinstance(one, Push | Stream)}

    def __init__(self, name: str | None = None) -> None:
        self.name = name or self.name or type(self).__name__.lower()
        self.parameters = Parameters(self.name, self.declares, self.relations)
        self.life = LifeCycle()
        self.activations = EventActivations()
        self.pushes: dict[str, Push] = {}
        self.streams: dict[str, Stream] = {}
        for port, declared in self._ports.items():
            if isinstance(declared, Push):
                self.pushes[port] = Push(declared.values, declared.period, f"{self.name}.{port}", self.life)
                setattr(self, port, self.pushes[port])
            else:
                self.streams[port] = Stream(declared.source, declared.values)
                setattr(self, port, self.streams[port])

    @property
    def mode(self) -> str:
        """The sub-state of Alive, `neutral` when idle."""
        return self.life.mode

    @mode.setter
    def mode(self, mode: str) -> None:
        self.life.mode = mode

    def needed(self) -> tuple[str, ...]:
        """Names of required components in the present mode; override it if they depend on more than the mode."""
        return tuple(dict.fromkeys((*self.needs.get(ALWAYS, ()), *self.needs.get(self.mode, ()))))

    async def reach(self, name: str) -> Component:  # noqa: ARG002
        """Wait for a required component that is not deployed here; override it where others can be found."""
        never: asyncio.Future[Component] = asyncio.get_running_loop().create_future()
        return await never

    def skills(self) -> dict[str, SkillSignature]:
        """The signatures of all decorated methods, by skill name."""
        return dict(signatures(type(self), self.name))  # type: ignore[arg-type]  # mypy: classes are hashable

    def execute(self, skill_name: str, call: SkillCall, arguments: Mapping[str, Any]) -> Awaitable[Outcome]:
        """Start the named skill; the sequencer's dispatcher awaits and may cancel it.

        Raises:
            UnknownNameError: the component has no such skill.
            InputError: an argument is missing or unknown.
        """
        signatures = self.skills()
        signature = signatures.get(skill_name)
        if signature is None:
            raise UnknownNameError(
                f"component '{self.name}' has no skill '{skill_name}'", found=skill_name, valid=signatures
            )
        check_arguments(signature, arguments)
        if self.declares:
            self.parameters.require_bound()
        body = self._functions.get(skill_name) or getattr(self, skill_name)
        declared: Declared = getattr(body, DECLARED)
        return declared.carry_out(self, body, call, arguments)

    async def configure_all(self, values: Mapping[str, Any]) -> None:
        """Restore the parameters of before a restart: validate them as one set, then `configure` each.

        They come in the order of their last changes, as each change unbinds the parameters that depend on it.

        Raises:
            UnknownNameError, InputError: as `configure`; if one value is invalid, none is set.
        """
        with self.parameters.as_one_set(values):
            for parameter, value in values.items():
                await self.configure(parameter, value)

    async def change_mode(self, mode: str) -> None:
        """Execute a chart's `switch`: enter a mode, restart (`init`) or shut down (`shutdown`).

        Raises:
            UnknownNameError: the component declares its modes, and this is not among them.
        """
        if mode == Life.INIT:
            self.life.become(Life.INIT)
            await self.life.come_alive(self.start)
        elif mode == Life.SHUTDOWN:
            await self.stop()
            self.life.become(Life.SHUTDOWN)
        elif self.modes and mode not in (NEUTRAL, *self.modes):
            valid = (NEUTRAL, *self.modes)
            raise UnknownNameError(f"component '{self.name}' has no mode '{mode}'", found=mode, valid=valid)
        else:
            await self.switch(mode)

    async def take(self, port: str, message: Mapping[str, Any]) -> None:
        """The *send* port: a one-way message for the method of that name with the decorator `takes`.

        Raises:
            UnknownNameError: there is no such method.
            InputError: a part of the message is missing or unknown.
        """
        taking = {n: m for n, m in inspect.getmembers(type(self), inspect.isfunction) if hasattr(m, TAKES)}
        if port not in taking:
            raise UnknownNameError(f"component '{self.name}' takes no '{port}'", found=port, valid=taking)
        check_arguments(signature_of(self.name, port, taking[port], getattr(taking[port], TAKES)), message)
        await getattr(self, port)(**message)

    def update(self, event: str, *values: Any) -> None:
        """Test a new value for each activation of the event, and for later ones at their beginning.

        Raises:
            UnknownNameError: the component has no such event.
        """
        events = [name for name, signature in self.skills().items() if signature.pattern == "event"]
        if event not in events:
            raise UnknownNameError(f"component '{self.name}' has no event '{event}'", found=event, valid=events)
        self.activations.update(event, values)

    async def diagnose(self) -> dict[str, Any]:
        """The *diagnose* port: its status as plain data; override it to add more."""
        return {
            "component": self.name,
            "life": str(self.life.state),
            "reason": self.life.reason,
            "mode": self.mode,
            "active": self.life.active,
            "parameters": dict(self.parameters),
            "needs": list(self.needed()),
            "skills": sorted(self.skills()),
            "pushes": sorted(self.pushes),
            "streams": {name: stream.source for name, stream in self.streams.items()},
        }

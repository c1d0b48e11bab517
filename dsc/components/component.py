"""What is deployed: something with skills, parameters, modes and a life."""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import Awaitable, Mapping
from pathlib import Path
from typing import Any, ClassVar, cast

from dsc.calls import Ended, Outcome, SkillCall, Status
from dsc.components.event_activations import EventActivations
from dsc.components.life_cycle import NEUTRAL, Life, LifeCycle
from dsc.components.parameters import (
    Parameter,
    changed,
    check_declarations,
    check_relations,
    known,
    require_bound,
    unsaid,
)
from dsc.components.streams import Push, Stream
from dsc.model.ranges import Who, refuse_change
from dsc.skills import DECLARED, Declared, SkillBody, SkillSignature, check_arguments, signature_of, signatures
from knowledge_base.errors import UnknownNameError

ALWAYS = ""
"""Stands for every mode in `Component.needs`."""
TAKES = "__dsc_takes__"
"""Where `takes` notes what it declares."""


class Component:
    """Base of all components.

    Attributes:
        name: how charts address it; it may be chosen at deployment.
        domain: what it brings to the planning domain: a PDDL file, or PDDL text; `None` for nothing.
        concurrent: whether it can carry out several skills at once. Steps of a plan that use one which cannot never
            overlap; what plots start side by side is their own affair.
        modes: the sub-states it has while Alive, besides `neutral`; if it names none, any may be asked for.
        declares: its parameters with type, range and who may change them; if it names none, any may be set.
        relations: conditions between its parameters that always hold.
        needs: mode -> a tuple of names of the components it needs then; `ALWAYS`: in every mode.
        activations: who has activated its events.
        pushes, streams: its push ports, and what it takes from those of others, by name; see `dsc.components.streams`.
        life: where it is in its life; `self.life.become(Life.FATAL_ERROR, "no power")` when the device is gone.
    """

    name: str = ""
    domain: ClassVar[Path | str | None] = None
    concurrent: bool = False
    modes: ClassVar[tuple[str, ...]] = ()
    declares: ClassVar[Mapping[str, Parameter]] = {}
    relations: ClassVar[tuple[str, ...]] = ()
    needs: ClassVar[Mapping[str, tuple[str, ...]]] = {}

    _ports: ClassVar[Mapping[str, Push | Stream]] = {}

    def __init_subclass__(cls, **named: Any) -> None:
        """Check what its builder declares of parameters, and find the ports; raises `InputError`."""
        super().__init_subclass__(**named)
        check_declarations(cls.name or cls.__name__.lower(), cls.declares, cls.relations, cls.__module__)
        cls._ports = {name: one for name, one in inspect.getmembers(cls) if isinstance(one, Push | Stream)}

    def __init__(self, name: str | None = None) -> None:
        self.name = name or self.name or type(self).__name__.lower()
        self.parameters: dict[str, Any] = dict(unsaid(self.declares))
        self._judged = False  # the parameters that are being set are known to fit together
        self.life = LifeCycle()
        self.activations = EventActivations()
        self.pushes: dict[str, Push] = {}
        self.streams: dict[str, Stream] = {}
        for port, declared in self._ports.items():
            if isinstance(declared, Push):
                self.pushes[port] = declared.of(self, port)
                setattr(self, port, self.pushes[port])
            else:
                self.streams[port] = declared.of()
                setattr(self, port, self.streams[port])

    @property
    def mode(self) -> str:
        """The sub-state of Alive that it is in, `neutral` at rest; whom it needs may depend on it."""
        return self.life.mode

    @mode.setter
    def mode(self, mode: str) -> None:
        self.life.mode = mode

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
            require_bound(self.name, self.declares, self.parameters)
        body = self.body(skill_name)
        declared: Declared = getattr(body, DECLARED)
        return declared.carry_out(self, body, call, arguments)

    def body(self, skill_name: str) -> SkillBody:
        """What carries out a skill of that name, which exists."""
        return cast(SkillBody, getattr(self, skill_name))

    async def configure(self, parameter: str, value: object) -> None:
        """The *param* port: set a named parameter; override to react.

        Of a declared one, `None` takes back what was said. What relies on it is unbound, see `Parameter.depends_on`.

        Raises:
            UnknownNameError: the component declares its parameters, and this is none.
            InputError: the value does not fit what is declared, or a relation.
        """
        after = self._after(parameter, value)
        self.parameters.clear()
        self.parameters.update(after)

    async def configure_all(self, values: Mapping[str, Any]) -> None:
        """Have the parameters that were in force before a restart: judged as one set, then each set by `configure`.

        They come in the order in which they were said last, as what is said anew unbinds what relies on it.

        Raises:
            UnknownNameError, InputError: as `configure`; if one value does not fit, none is set.
        """
        after = dict(self.parameters)
        for parameter, value in values.items():
            after = self._changed(after, parameter, value)
        check_relations(self.name, self.relations, after)
        self._judged = True
        try:
            for parameter, value in values.items():
                await self.configure(parameter, value)
        finally:
            self._judged = False

    def check_parameter(self, parameter: str, value: object, who: Who | None = None) -> None:
        """Whether a parameter may have that value now; nothing is changed.

        Args:
            parameter: its name.
            value: what it shall be.
            who: somebody who wants to change it; nobody in particular if left out.

        Raises:
            UnknownNameError: the component declares its parameters, and this is none.
            InputError: the value does not fit what is declared, or a relation, or it is not for `who` to say.
        """
        if not self.declares and who is None:  # it takes anything from plots, and nothing from others
            return
        if who is not None:
            declared = known(self.name, parameter, self.declares)
            refuse_change(f"{self.name}.{parameter}", who, declared.changed_by)
        self._after(parameter, value)

    def _after(self, parameter: str, value: Any) -> dict[str, Any]:
        """The values after one has been set."""
        after = self._changed(self.parameters, parameter, value)
        if not self._judged:
            check_relations(self.name, self.relations, after)
        return after

    def _changed(self, values: Mapping[str, Any], parameter: str, value: Any) -> dict[str, Any]:
        if not self.declares:
            return {**values, parameter: value}
        known(self.name, parameter, self.declares)
        return changed(self.name, self.declares, values, {parameter: value})

    async def switch(self, mode: str) -> None:
        """The *state* port: enter a mode (`neutral` is at rest); override to react."""
        self.mode = mode

    async def take(self, port: str, message: Mapping[str, Any]) -> None:
        """The *send* port: a one-way message, for the method of that name that is decorated with `takes`.

        Raises:
            UnknownNameError: there is no such method.
            InputError: something is missing in the message or unknown.
        """
        taking = {n: m for n, m in inspect.getmembers(type(self), inspect.isfunction) if hasattr(m, TAKES)}
        if port not in taking:
            raise UnknownNameError(f"component '{self.name}' takes no '{port}'", found=port, valid=taking)
        check_arguments(signature_of(self.name, port, taking[port], getattr(taking[port], TAKES)), message)
        await getattr(self, port)(**message)

    def update(self, event: str, *values: Any) -> None:
        """Put a new value before all who have activated the event; those who come later are told it, too.

        Raises:
            UnknownNameError: the component has no such event.
        """
        events = [name for name, signature in self.skills().items() if signature.pattern == "event"]
        if event not in events:
            raise UnknownNameError(f"component '{self.name}' has no event '{event}'", found=event, valid=events)
        self.activations.update(event, values)

    async def start(self) -> None:
        """From Init to Alive: override to open devices; what is raised means FatalError."""

    async def stop(self) -> None:
        """To Shutdown: override to close devices."""

    async def activate(self, active: bool) -> None:  # noqa: FBT001
        """A state or somebody active needs it from now on, or nobody any more (S1.9, S4.1).

        Override it to take resources and to free them. It is called between `start` and the first skill, again with
        `True` if it was started anew meanwhile, and with `False` only if it was with `True`; what it raises means
        FatalError.
        """

    async def change_mode(self, mode: str) -> None:
        """What `switch` in a chart does: a mode, or `init` (start anew) and `shutdown`.

        Raises:
            UnknownNameError: the component says which modes it has, and this is none.
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

    def needed(self) -> tuple[str, ...]:
        """Names of the components it needs in its present mode."""
        return tuple(dict.fromkeys((*self.needs.get(ALWAYS, ()), *self.needs.get(self.mode, ()))))

    async def reach(self, name: str) -> Component:  # noqa: ARG002
        """Wait for a component that it needs and that is not deployed here; override where others can be found."""
        never: asyncio.Future[Component] = asyncio.get_running_loop().create_future()
        return await never

    async def status(self, action_id: str, skill_name: str, arguments: Mapping[str, Any]) -> Status | Ended:  # noqa: ARG002
        """What became of an action that this process did not start; override to ask the robot.

        `RUNNING` and `NOT_BEGUN` let the skill be executed with that id; it then awaits the action's end, or
        does it. What may be done about an `UNKNOWN` one, the skill's `after_crash` says.
        """
        return Status.UNKNOWN

    async def abandon(self, action_id: str, skill_name: str, arguments: Mapping[str, Any]) -> Ended | None:  # noqa: ARG002
        """Stop an action, if it still goes on, that was cancelled just before the run was broken off.

        Whether the cancellation has reached the robot is not known. Override it where actions go on when this
        process dies; those that are part of it have ended with it.

        Returns:
            How it ended, if it had before it could be stopped: what it observed then is so.
        """
        return None

    async def forget(self, action_id: str) -> None:
        """Nobody will ask for the action's end any more: it has been taken and, with a store, is kept.

        Override it where ends are remembered for that.
        """

    def remember(self) -> Any:
        """Plain data to be kept, for `recall` after a restart; asked with each macrostep that is committed."""
        return None

    def recall(self, memory: Any) -> None:
        """Be as when `memory` was kept; called before anything else after a restart."""

    async def diagnose(self) -> dict[str, Any]:
        """The *diagnose* port: how it is, as plain data; override to add what only it knows."""
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

"""Components: deployed parts of the robot with skills, parameters, modes and a life cycle."""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import Awaitable, Iterable, Mapping
from dataclasses import asdict
from inspect import get_annotations
from pathlib import Path
from typing import Any, ClassVar

from dsc.annotations import Namespace, class_statement, evaluated
from dsc.calls import Ended, SkillCall, Status
from dsc.components.demands import Demand, read_demands
from dsc.components.interface import Interface
from dsc.components.life_cycle import NEUTRAL, Life, LifeCycle
from dsc.components.parameters import Parameters, ParameterValues
from dsc.components.ports import TAKES, EventActivations, messages, plain_methods
from dsc.components.program_use import program_use
from dsc.components.requirement import Requirement
from dsc.components.services import Service
from dsc.components.streams import Push
from dsc.components.turns import Turns
from dsc.components.value_conditions import WATCH, declare_watch, own_checks
from dsc.data_types import check_all, data_type
from dsc.model.plot import ActionPlot
from dsc.outcomes import Outcome
from dsc.skills import DECLARED, Declared, SkillBody, SkillSignature, check_arguments, signatures
from knowledge_base.errors import InputError, Place, SchemaError, UnknownNameError, tolerated
from knowledge_base.user_objects import shown

ALWAYS = ""
"""Key of `ComponentHooks.needs` that applies in every mode."""


class ComponentHooks:
    """Attributes and hooks that a subclass of `Component` may override; all are optional.

    Attributes:
        name: the name in charts; the deployment may choose another name.
        domain: the component's part of the planning domain: a PDDL file or PDDL text; `None` without such a part.
        concurrent: whether the component executes several skills concurrently. If not, it executes one skill at a
            time, and the other skills wait, see `dsc.components.turns`.
        modes: the sub-states of Alive besides `neutral`; if empty, any mode is valid. A mapping limits the transitions:
            it maps each mode to the modes that may follow. From and to `neutral`, each transition is permitted.
        device_errors: exceptions that report a failed device, e.g. `(OSError,)`: a skill that raises one ends with
            `skill_error`, and a hook leads to FatalError. Every other exception is a programming error.
        period: seconds between two calls of `step`; `None` without such steps.
        needs: for each mode, a tuple of names of required components, or of the component's required ports, whose
            providers it then needs; the key `ALWAYS` applies in every mode.
        demands: for each mode, the hardware, resources and real-time tasks that the component needs of its host, see
            `dsc.components.demands`; the key `ALWAYS` applies in every mode.
        parameters: the present values. A component declares its parameters by a subclass: `parameters: BaseParameters`;
            without one, any name is valid.
        life: the life cycle. When the device is lost, call `self.life.become(Life.FATAL_ERROR, "no power")`.
    """

    name: str = ""
    domain: ClassVar[Path | str | None] = None
    concurrent: bool = False
    modes: ClassVar[tuple[str, ...] | Mapping[str, tuple[str, ...]]] = ()
    device_errors: ClassVar[tuple[type[BaseException], ...]] = ()
    needs: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    demands: ClassVar[Mapping[str, Demand]] = {}
    period: float | None = None

    parameters: Parameters
    parameter_values: ParameterValues
    life: LifeCycle

    async def start(self) -> None:
        """Enter Alive. Override to open devices; an error leads to FatalError."""

    async def stop(self) -> None:
        """Leave Alive. Override to close devices.

        Each successful `start` has one `stop`: at the end of the run, at a shutdown, or before the next `start`. The
        skills of the component have ended, and `activate(False)` and `leave_mode` were called before.
        """

    async def activate(self, active: bool) -> None:  # noqa: FBT001
        """Become active for a state or an active component, or become inactive (S1.9, S4.1).

        Override to acquire resources if `active`, and to release them if not. The first call comes between `start` and
        the first skill. Each successful call with `True` has one call with `False`, which comes before `stop`. An error
        leads to FatalError.
        """

    async def configure(self, parameter: str, value: object) -> None:
        """Set a named parameter, for the *param* port; override to react to the new value.

        The value `None` resets a declared parameter. The parameters that depend on the named parameter are reset too,
        see `parameter`.

        Raises:
            UnknownNameError: the component declares parameters, and `parameter` is not among them.
            InputError: the value violates its declaration or a relation.
        """
        self.parameter_values.set(parameter, value)

    async def switch(self, mode: str) -> None:
        """Enter a mode (`neutral` when idle), for the *state* port; override to react."""
        self.life.mode = mode

    async def leave_mode(self, mode: str) -> None:
        """Leave a mode other than `neutral`, before another `switch` and before `stop`; override to react."""

    async def step(self) -> None:
        """Execute one periodic step: the component calls it every `period` seconds while it is active (S4.13).

        Steps never overlap. An error leads to FatalError. `self.life.steps` counts late and missed steps.
        """


class RestartHooks:
    """Hooks for runs with a store; a component overrides them if its actions or data outlast the program."""

    async def status(self, action_id: str, skill_name: str, arguments: Mapping[str, Any]) -> Status | Ended:  # noqa: ARG002
        """Return the status of an action that another process started; override to query the robot.

        After `RUNNING` and `NOT_BEGUN`, the skill is executed with that id: the skill then awaits the end of the
        running action, or begins the action. After `UNKNOWN`, the skill's `after_crash` determines the reaction.
        """
        return Status.UNKNOWN

    async def abandon(self, action_id: str, skill_name: str, arguments: Mapping[str, Any]) -> Ended | None:  # noqa: ARG002
        """Stop an action that was cancelled just before a crash, if the action still runs.

        The cancellation may not have reached the robot. Override this hook if actions outlast this process.

        Returns:
            The action's end, if the action ended before it was stopped, as its observations are true; else `None`.
        """
        return None

    async def forget(self, action_id: str) -> None:
        """Delete the stored end of an action: the sequencer has handled it and, with a store, has written it.

        Override this hook if the component stores ends for `status`.
        """

    def remember(self) -> Any:
        """Return plain data for `recall` after a restart; called with each committed macrostep."""
        return None

    def recall(self, memory: Any) -> None:
        """Restore the state at the time of `memory`; after a restart, this hook is called before all others."""


class Component(ComponentHooks, RestartHooks):
    """Base class of components, with the ports that the sequencer, supervisors and hosts use.

    A subclass declares skills and ports by decorators, and overrides `ComponentHooks` and `RestartHooks`.

    Attributes:
        is_remote: whether another program hosts the component.
        activations: the activations of the component's events.
        parameter_class: the class in the annotation of `parameters`.
        pushes: the push ports, by name; see `dsc.components.streams`.
        requirements: the required ports, by name; see `dsc.components.clients` and `Stream`.
    """

    is_remote: ClassVar[bool] = False
    parameter_class: ClassVar[type[Parameters]] = Parameters
    _ports: ClassVar[Mapping[str, Push | Requirement]] = {}
    _required: ClassVar[Mapping[str, Service]] = {}
    _offered: ClassVar[Mapping[str, Service]] = {}
    _functions: Mapping[str, SkillBody] = {}  # skills that are functions, by name

    def __init_subclass__(cls, **named: Any) -> None:
        """Collect the class of the parameters and the ports; raise `InputError` for an invalid declaration."""
        super().__init_subclass__(**named)
        for check in (_require_exceptions, _refuse_hidden):
            with tolerated():
                check(cls)
        with class_statement(cls) as names:
            if "demands" in vars(cls):
                cls.demands = read_demands(vars(cls)["demands"])
            if "parameters" in get_annotations(cls):
                cls.parameter_class = _parameter_class(cls, names)
            elif "parameters" in vars(cls):
                cls.parameter_class = vars(cls)["parameters"]
                raise SchemaError(f"`parameters` of {cls.__qualname__} is an annotation: `parameters: BaseParameters`")
        cls._ports = {name: one for name, one in inspect.getmembers(cls) if isinstance(one, Push | Requirement)}
        cls._required = {name: one.service for name, one in cls._ports.items() if isinstance(one, Requirement)}
        cls._offered = {name: one.service for name, one in cls._ports.items() if isinstance(one, Push)}

    def __init__(self, name: str | None = None) -> None:
        self.name = name or self.name or type(self).__name__.lower()
        self.parameter_values = ParameterValues(self.name, self.parameter_class)
        self.parameters = self.parameter_values.parameters
        self.life = LifeCycle(self)
        self.activations = EventActivations()
        self.turns = Turns()
        self.pushes: dict[str, Push] = {}
        self.requirements: dict[str, Requirement] = {}
        for port, declared in self._ports.items():
            if isinstance(declared, Push):
                self.pushes[port] = Push(
                    declared.values, declared.period, f"{self.name}.{port}", self.life, declared.checks
                )
                setattr(self, port, self.pushes[port])
            else:
                self.requirements[port] = declared.of(self.name, port)
                setattr(self, port, self.requirements[port])

    @property
    def mode(self) -> str:
        """The sub-state of Alive; `neutral` when idle."""
        return self.life.mode

    @mode.setter
    def mode(self, mode: str) -> None:
        self.life.mode = mode

    def watch(self, watching: bool) -> None:  # noqa: FBT001
        """Begin to watch a device in another program before the first run, or end after the last run."""

    def needed(self) -> tuple[str, ...]:
        """Return the names of required components in the present mode; override if needs depend on other values.

        The name of a required port stands for its provider.

        Raises:
            NotWiredError: a port without a source is not wired.
        """
        named = (*self.needs.get(ALWAYS, ()), *self.needs.get(self.mode, ()))
        return tuple(dict.fromkeys(self._component_for(name) for name in named))

    def _component_for(self, name: str) -> str:
        port = self.requirements.get(name)
        if port is None:
            return name
        named = port.target or port.source
        if port.provider is None and named is not None:
            return named.partition(".")[0]  # it may be deployed later
        return port.require_wired().component.name

    async def reach(self, name: str) -> Component:  # noqa: ARG002
        """Wait for a required component that is not deployed in this process.

        The default waits without end. Override this method if such components can be found elsewhere.
        """
        never: asyncio.Future[Component] = asyncio.get_running_loop().create_future()
        return await never

    def domain_fragment(self) -> Path | str | None:
        """Return the component's part of the planning domain, see `ComponentHooks.domain`."""
        return type(self).domain

    def plots(self) -> Iterable[ActionPlot]:
        """Return the plots that the component brings for other plots; their names begin with the component's name."""
        return ()

    def skills(self) -> dict[str, SkillSignature]:
        """Return the signatures of all decorated methods, by skill name; without push ports, not `watch_values`."""
        found = dict(signatures(type(self), self.name))  # type: ignore[arg-type]  # mypy: classes are hashable
        if not self.pushes:
            del found[WATCH]
        return found

    @declare_watch
    def watch_values(
        self,
        condition: str,
        values: Mapping[str, Any] | None = None,
        hysteresis: float = 0.0,
        hold: float = 0.0,
        times: int = 1,
        out_of: int = 1,
    ) -> None:
        """Report each change of a condition on the values of the push ports, see `ValueCondition` (S2.4).

        Charts start it as `trigger: arm.watch_values`. The events `became_true` and `became_false` have the values that
        the condition reads. The first of them reports the truth at the beginning.
        """

    def takes_turns(self, skill: SkillSignature) -> bool:
        """Return whether a skill waits until no other skill has the component; events and queries never wait."""
        return not self.concurrent and skill.pattern == "skill"

    def execute(self, skill_name: str, call: SkillCall[Any], arguments: Mapping[str, Any]) -> Awaitable[Outcome]:
        """Start the named skill and return its awaitable outcome; the dispatcher awaits and may cancel it.

        Raises:
            UnknownNameError: the component has no such skill.
            InputError: an argument is missing or unknown.
            NoValueError: a declared parameter of the component has no value.
        """
        signatures = self.skills()
        signature = signatures.get(skill_name)
        if signature is None:
            raise UnknownNameError(
                f"component '{self.name}' has no skill '{skill_name}'", found=skill_name, valid=signatures
            )
        check_arguments(signature, arguments)
        self.parameter_values.require_bound()
        body = self._functions.get(skill_name) or getattr(self, skill_name)
        declared: Declared = getattr(body, DECLARED)
        return declared.execute(self, body, call, declared.build(arguments))

    async def configure_all(self, values: Mapping[str, Any]) -> None:
        """Restore the parameters after a restart: validate them as one set, then `configure` each.

        The parameters must be in the order of their last changes, as each change resets the parameters that depend on
        it.

        Raises:
            UnknownNameError: the component declares parameters, and a name is not among them.
            InputError: a value violates its declaration or a relation; then no value is set.
        """
        with self.parameter_values.as_one_set(values):
            for parameter, value in values.items():
                await self.configure(parameter, value)

    async def change_mode(self, mode: str) -> None:
        """Execute a chart's `switch`: enter a mode, restart (mode `init`) or shut down (mode `shutdown`).

        Raises:
            UnknownNameError: the component declares its modes, and `mode` is not among them, or may not follow the
                present mode.
        """
        if mode == Life.INIT:
            await self.life.restart()
        elif mode == Life.SHUTDOWN:
            await self.life.shut_down()
        else:
            self._require_mode(mode)
            await self.life.enter(mode)

    def _require_mode(self, mode: str) -> None:
        """Raise `UnknownNameError` unless the component may enter the mode from its present one."""
        Interface(modes=self.modes).require_mode(self.name, mode)
        next_modes = self.modes.get(self.mode) if isinstance(self.modes, Mapping) else None
        if next_modes is not None and mode not in (NEUTRAL, self.mode, *next_modes):
            message = f"component '{self.name}' cannot change from mode '{self.mode}' to '{mode}'"
            raise UnknownNameError(message, found=mode, valid=(NEUTRAL, *next_modes))

    async def receive(self, port: str, message: Mapping[str, Any]) -> None:
        """Pass a one-way message to the method `port`, which has the decorator `takes`; for the *send* port.

        Raises:
            UnknownNameError: the component has no such method.
            InputError: a part of the message is missing or unknown.
        """
        if port == WATCH:
            self.activations.replace_values(**message)
            return
        taken = Interface(messages=self._taken()).message(self.name, port)
        assert taken is not None  # noqa: S101
        check_arguments(taken, message)
        name, parts = f"{self.name}.{port}", dict(message)
        check_all("the part '{name}' of the message {owner}", name, parts, taken.parameters, taken.records)
        body = getattr(self, port)
        declared: Declared = getattr(body, TAKES)
        await body(**declared.build(parts))

    def _taken(self) -> Mapping[str, SkillSignature]:
        return messages(type(self), self.name)  # type: ignore[arg-type]  # mypy: classes are hashable

    def interface(self) -> Interface:
        """Return the parameters, modes and messages for the checks of charts before a run."""
        own = type(self).receive is Component.receive
        methods = plain_methods(type(self)) - plain_methods(Component)
        messages = self._taken() if own else None
        checks = None if self.is_remote else own_checks(self.pushes.values())
        return Interface(
            self.parameters.declared, self.modes, messages, methods, self._required, self._push_services(), checks
        )

    def _push_services(self) -> Mapping[str, Service]:
        if self.pushes.keys() == self._offered.keys():
            return self._offered
        return {name: port.service for name, port in self.pushes.items()}

    def update(self, event: str, *values: Any) -> None:
        """Pass new values to the test of each activation of the event; later activations begin with these values.

        Drivers may call it from any thread. The values of one thread arrive in their order.

        Raises:
            UnknownNameError: the component has no such event.
            InputError: the number of values, or a value's type, is not that of the parameters of the event's test.
        """
        events = [name for name, signature in self.skills().items() if signature.pattern == "event" and name != WATCH]
        if event not in events:
            raise UnknownNameError(f"component '{self.name}' has no event '{event}'", found=event, valid=events)
        declared: Declared = getattr(getattr(self, event), DECLARED)
        if len(values) != len(declared.values):
            wanted = f"({', '.join(declared.values)})"
            raise InputError(f"event '{self.name}.{event}' has the values {wanted}; found {len(values)}", found=event)
        for (value, kind), one in zip(declared.values.items(), values, strict=True):
            if kind is not None:
                data_type(kind).check(f"the value '{value}' of event '{self.name}.{event}'", one, declared.records)
        self.activations.update(event, values)

    async def diagnose(self) -> dict[str, Any]:
        """Return the status as plain data, for the *diagnose* port; override to add more."""
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
            "wires": {name: port.provider_name() for name, port in self.requirements.items()},
            "steps": asdict(self.life.steps),
            "program": program_use(),
        }


def _parameter_class(kind: type[Component], names: Namespace) -> type[Parameters]:
    """Return the class that the annotation of `parameters` names; raise `SchemaError` if it is none."""
    said = f"`parameters` of {kind.__qualname__}"
    found = evaluated(get_annotations(kind)["parameters"], names, said)
    if isinstance(found, type) and issubclass(found, Parameters):
        return found
    shown = getattr(found, "__name__", None) or str(found)
    raise SchemaError(f"the annotation of {said} is {shown}, which is not a subclass of Parameters", found=shown)


def _refuse_hidden(kind: type[Component]) -> None:
    """Raise `SchemaError` for a skill that hides a method or attribute of `Component`."""
    for name, body in vars(kind).items():
        if hasattr(Component, name) and (hasattr(body, DECLARED) or hasattr(body, TAKES)):
            code = getattr(inspect.unwrap(body), "__code__", None)
            place = None if code is None else Place(code.co_filename, code.co_firstlineno)
            message = f"'{name}' of {kind.__qualname__} hides an attribute of every component; choose another name"
            raise SchemaError(message, place=place, found=name)


def _require_exceptions(kind: type[Component]) -> None:
    """Raise `InputError` unless `device_errors` of a component class is a tuple of exception classes."""
    found = kind.device_errors
    if isinstance(found, tuple) and all(isinstance(one, type) and issubclass(one, BaseException) for one in found):
        return
    said = f"`device_errors` of {kind.__qualname__} is a tuple of exception classes, as in device_errors = (OSError,)"
    raise InputError(f"{said}, not {shown(found)}")

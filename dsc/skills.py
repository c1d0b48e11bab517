"""What a robot can do, seen from the sequencer: components with typed skills, states and parameters.

A component is configured (`configure`), switched between modes (`switch`) and triggered (a skill); it
answers with outcome events and with what it observed, and it judges nothing (S0.7, S0.8, S1.1). A skill is
one decorated coroutine:

    class Gripper(Component):
        @skill(outcomes={"grasped": {}, "slipped": {"item": "item"}})
        async def grasp(self, call: SkillCall, item: str) -> Outcome:
            await call.clock.sleep(2.0)
            return Outcome("grasped", observed=Delta(added=(fact("holding", item),)))
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Awaitable, Callable, Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, Literal, Protocol, TypeVar, cast

from dsc.components.activations import Activations
from dsc.components.blocking import in_process, in_thread
from dsc.components.life import Life, LifeCycle
from dsc.components.parameters import Parameter, check_relations, known
from dsc.events import EXECUTIVES
from knowledge_base.errors import InputError, SchemaError, UnknownNameError
from knowledge_base.facts import Delta


class Clock(Protocol):
    """Time as skills and the sequencer see it: simulated or real, always injected."""

    def now(self) -> float:
        """Seconds of run time."""
        ...

    async def sleep(self, seconds: float) -> None:
        """Let `seconds` of run time pass."""
        ...


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a skill ended: its outcome event, the event's attributes, and what was observed meanwhile.

    `observed` is applied to the knowledge base, with the component as author, before the event is handled.
    """

    event: str
    attributes: Mapping[str, Any] = field(default_factory=dict)
    observed: Delta = field(default_factory=Delta)


@dataclass(frozen=True, slots=True)
class SkillCall:
    """One execution of a skill.

    Attributes:
        action_id: names this execution; stable across restarts, never used for another one.
        clock: the only time a skill may use.
        report: hands over an intermediate event while the skill goes on (e.g. progress, a perception).
        deadline: second of run time at which the skill is cancelled.
        give_up: says that something of the skill goes on that cannot be stopped.

    When a run is resumed after a crash, a call may come again with the same id. Its clock then begins when the
    action was started, and what was reported before is not heard twice: a skill that acts once for an id simply
    goes the same way.
    """

    action_id: str
    clock: Clock
    report: Callable[[Outcome], None]
    deadline: float = math.inf
    give_up: Callable[[str], None] = lambda _: None

    @property
    def remaining(self) -> float:
        """Seconds of run time until the deadline."""
        return self.deadline - self.clock.now()


class Status(Enum):
    """What a component says about an action that may have been under way when the run was broken off."""

    RUNNING = "running"
    UNKNOWN = "unknown"
    NOT_BEGUN = "not begun"


@dataclass(frozen=True, slots=True)
class Ended:
    """The action came to its end, and how."""

    outcome: Outcome


AfterCrash = Literal["repeat", "same_id", "sense"]
"""What may be done about an action of which nothing is known: do it again, since twice is as once; do it with the
same id, since the component does each id once; neither, since somebody has to look what happened first."""

SkillBody = Callable[..., Any]
"""What is decorated: a coroutine function or, if it blocks, a plain one, that gives an `Outcome`."""
_Body = TypeVar("_Body", bound=SkillBody)
Pattern = Literal["skill", "query", "event"]
"""Which pattern of communication `trigger` uses: a skill ends by itself, a query with its answer, an event not at
all: it is activated until the state is left (S1.1)."""


@dataclass(frozen=True, slots=True)
class SkillSignature:
    """A skill's interface.

    Attributes:
        component, name: how charts address it, `component.name`.
        parameters: names with types (`None`: anything).
        defaults: values of the parameters that may be left out.
        outcomes: events it may end with or report, with their attributes and types.
        pattern: how it communicates.
        after_crash: see `AfterCrash`.
    """

    component: str
    name: str
    parameters: Mapping[str, str | None]
    defaults: Mapping[str, Any]
    outcomes: Mapping[str, Mapping[str, str | None]]
    pattern: Pattern = "skill"
    after_crash: AfterCrash = "sense"


CarryOut = Callable[["Component", SkillBody, SkillCall, Mapping[str, Any]], Awaitable[Outcome]]
"""How a decorated body is made to act: the component, the bound body, the call, the arguments."""


@dataclass(frozen=True, slots=True)
class Declared:
    """What a decorator notes about the body below it.

    Attributes:
        types: types of parameters by name; others follow from the annotations `int`, `float` and `bool`.
        outcomes: as in `SkillSignature`.
        carry_out: how a call reaches the body.
        own: how many of the body's first parameters no chart gives.
        pattern: how it communicates.
        after_crash: see `AfterCrash`.
    """

    types: Mapping[str, str]
    outcomes: Mapping[str, Mapping[str, str | None]]
    carry_out: CarryOut
    own: int = 2
    pattern: Pattern = "skill"
    after_crash: AfterCrash = "sense"

    def __call__(self, body: _Body) -> _Body:
        """Note it; raises `SchemaError` for an outcome that is an event of the executive's own."""
        refuse_reserved(body.__qualname__.rpartition("<locals>.")[2], self.outcomes)
        setattr(body, DECLARED, self)
        return body


DECLARED = "__dsc_skill__"
"""Where `Declared` is noted."""
_ANNOTATED: Mapping[Any, str] = {"int": "number", "float": "number", "bool": "boolean"} | {
    int: "number", float: "number", bool: "boolean",
}  # fmt: skip


def skill(
    outcomes: Mapping[str, Mapping[str, str | None]],
    types: Mapping[str, str] | None = None,
    *,
    blocking: Literal["thread", "process"] | None = None,
    after_crash: AfterCrash = "sense",
) -> Callable[[_Body], _Body]:
    """Declare a component's method, or a function of its own (see `dsc.components.functions`), as a skill.

    Args:
        outcomes: every event it may end with or report, with the event's attributes and their types.
        types: types of its parameters by name; others follow from the annotations `int`, `float` and `bool`, and
            what is left takes any value.
        blocking: the body is no coroutine and blocks: it runs in a thread, with a `BlockingCall` to be asked now and
            then whether it shall stop; or in a process, which is ended when it shall stop. What goes to a process
            and comes back is pickled, the component itself included.
        after_crash: what may be done when a run is resumed and the component does not know what became of it.
    """
    declared = {event: dict(attributes) for event, attributes in outcomes.items()}
    return Declared(dict(types or {}), declared, _CARRIED_OUT[blocking], after_crash=after_crash)


async def _awaited(_: Component, body: SkillBody, call: SkillCall, arguments: Mapping[str, Any]) -> Outcome:
    return cast(Outcome, await body(call, **arguments))


async def _in_thread(_: Component, body: SkillBody, call: SkillCall, arguments: Mapping[str, Any]) -> Outcome:
    return await in_thread(body, call, arguments)


async def _in_process(component: Component, body: SkillBody, call: SkillCall, arguments: Mapping[str, Any]) -> Outcome:
    return await in_process(body, component.name, call, arguments)


_CARRIED_OUT: Mapping[str | None, CarryOut] = {None: _awaited, "thread": _in_thread, "process": _in_process}


NEUTRAL = "neutral"
"""The mode at rest."""
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
        needs: mode -> names of the components it needs then; `ALWAYS`: in every mode.
        activations: who has activated its events.
        life: where it is in its life; `self.life.become(Life.FATAL_ERROR, "no power")` when the device is gone.
    """

    name: str = ""
    domain: ClassVar[Path | str | None] = None
    concurrent: bool = False
    modes: ClassVar[tuple[str, ...]] = ()
    declares: ClassVar[Mapping[str, Parameter]] = {}
    relations: ClassVar[tuple[str, ...]] = ()
    needs: ClassVar[Mapping[str, tuple[str, ...]]] = {}

    def __init__(self, name: str | None = None) -> None:
        self.name = name or self.name or type(self).__name__.lower()
        self.mode = NEUTRAL
        self.parameters: dict[str, Any] = {
            name: one.default for name, one in self.declares.items() if one.default is not None
        }
        self.life = LifeCycle()
        self._starting = False
        self.activations = Activations()

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
        body = self.body(skill_name)
        declared: Declared = getattr(body, DECLARED)
        return declared.carry_out(self, body, call, arguments)

    def body(self, skill_name: str) -> SkillBody:
        """What carries out a skill of that name, which exists."""
        return cast(SkillBody, getattr(self, skill_name))

    async def configure(self, parameter: str, value: object) -> None:
        """The *param* port: set a named parameter; override to react.

        Raises:
            UnknownNameError: the component declares its parameters, and this is none.
            InputError: the value does not fit what is declared, or a relation.
        """
        if self.declares:
            declared = known(self.name, parameter, self.declares)
            value = declared.check(f"{self.name}.{parameter}", value)
            check_relations(self.name, self.relations, {**self.parameters, parameter: value})
        self.parameters[parameter] = value

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
        """Somebody needs it from now on, or nobody any more: override to take resources and to free them (S4.1)."""

    async def come_alive(self) -> None:
        """Start if it is in Init; who comes meanwhile waits for the same start."""
        if self.life.state is not Life.INIT:
            return
        if self._starting:
            await self.life.until(lambda life: life is not Life.INIT)
            return
        self._starting = True
        try:
            await self.start()
        except Exception as error:  # noqa: BLE001  # whatever it is, the component cannot work
            self.life.become(Life.FATAL_ERROR, f"{type(error).__name__}: {error}")
        else:
            self.life.become(Life.ALIVE)
        finally:
            self._starting = False

    async def change_mode(self, mode: str) -> None:
        """What `switch` in a chart does: a mode, or `init` (start anew) and `shutdown`.

        Raises:
            UnknownNameError: the component says which modes it has, and this is none.
        """
        if mode == Life.INIT:
            self.life.become(Life.INIT)
            await self.come_alive()
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

    async def status(self, action_id: str, skill_name: str, arguments: Mapping[str, Any]) -> Status | Ended:  # noqa: ARG002
        """What became of an action that this process did not start; override to ask the robot.

        `RUNNING` and `NOT_BEGUN` let the skill be executed with that id; it then awaits the action's end, or
        does it. What may be done about an `UNKNOWN` one, the skill's `after_crash` says.
        """
        return Status.UNKNOWN

    async def abandon(self, action_id: str, skill_name: str, arguments: Mapping[str, Any]) -> None:
        """Stop an action, if it still goes on, that was cancelled just before the run was broken off.

        Whether the cancellation has reached the robot is not known. Override it where actions go on when this
        process dies; those that are part of it have ended with it.
        """

    async def forget(self, action_id: str) -> None:
        """Nobody will ask for the action's end any more: it has been taken and, with a store, is kept.

        Override it where ends are remembered for that.
        """

    def remember(self) -> Any:
        """Plain data to be kept, for `recall` after a restart; asked with each macrostep that is committed."""
        return None

    def recall(self, memory: Any) -> None:
        """Be as when `memory` was kept; called before anything else after a restart."""

    @property
    def remembers(self) -> bool:
        """Whether there is anything to remember: most components are not asked again and again."""
        return type(self).remember is not Component.remember

    async def diagnose(self) -> dict[str, Any]:
        """The *diagnose* port: how it is, as plain data; override to add what only it knows."""
        return {
            "component": self.name,
            "life": str(self.life.state),
            "reason": self.life.reason,
            "mode": self.mode,
            "parameters": dict(self.parameters),
            "needs": list(self.needed()),
            "skills": sorted(self.skills()),
        }


@cache
def signatures(kind: type[Component], name: str) -> Mapping[str, SkillSignature]:
    """The signatures of a component class's decorated methods, for a component of that name.

    Found once for a class and name: every skill call asks for them.
    """
    found = {}
    for attribute, body in inspect.getmembers(kind, inspect.isfunction):
        declared: Declared | None = getattr(body, DECLARED, None)
        if declared is not None:
            found[attribute] = signature_of(name, attribute, body, declared)
    return found


def refuse_reserved(skill_name: str, outcomes: Iterable[str]) -> None:
    """Raise `SchemaError` for an outcome that only the executive fires, e.g. `done`."""
    for event in outcomes:
        if event in EXECUTIVES:
            raise SchemaError(
                f"skill '{skill_name}' cannot have the outcome '{event}', which the executive itself fires", found=event
            )


def check_arguments(signature: SkillSignature, arguments: Mapping[str, Any]) -> None:
    """Raise `InputError` for an argument that is missing or that the skill does not take."""
    name = f"{signature.component}.{signature.name}"
    for given in arguments:
        if given not in signature.parameters:
            raise UnknownNameError(
                f"skill '{name}' has no parameter '{given}'", found=given, valid=signature.parameters
            )
    for wanted in signature.parameters:
        if wanted not in arguments and wanted not in signature.defaults:
            raise InputError(f"skill '{name}' needs its parameter '{wanted}'")


def signature_of(component: str, name: str, body: SkillBody, declared: Declared) -> SkillSignature:
    """The interface of a decorated body under that name."""
    given = list(inspect.signature(body).parameters.values())[declared.own :]
    return SkillSignature(
        component=component,
        name=name,
        parameters={p.name: declared.types.get(p.name, _ANNOTATED.get(p.annotation)) for p in given},
        defaults={p.name: p.default for p in given if p.default is not inspect.Parameter.empty},
        outcomes=declared.outcomes,
        pattern=declared.pattern,
        after_crash=declared.after_crash,
    )

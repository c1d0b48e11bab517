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
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, Literal, Protocol, TypeVar

from knowledge_base.errors import InputError, UnknownNameError
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

    When a run is resumed after a crash, a call may come again with the same id. Its clock then begins when the
    action was started, and what was reported before is not heard twice: a skill that acts once for an id simply
    goes the same way.
    """

    action_id: str
    clock: Clock
    report: Callable[[Outcome], None]


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


SkillBody = Callable[..., Awaitable[Outcome]]
_Body = TypeVar("_Body", bound=SkillBody)


@dataclass(frozen=True, slots=True)
class SkillSignature:
    """A skill's interface.

    Attributes:
        component, name: how charts address it, `component.name`.
        parameters: names with types (`None`: anything).
        defaults: values of the parameters that may be left out.
        outcomes: events it may end with or report, with their attributes and types.
        after_crash: see `AfterCrash`.
    """

    component: str
    name: str
    parameters: Mapping[str, str | None]
    defaults: Mapping[str, Any]
    outcomes: Mapping[str, Mapping[str, str | None]]
    after_crash: AfterCrash = "sense"


@dataclass(frozen=True, slots=True)
class _Declared:
    types: Mapping[str, str]
    outcomes: Mapping[str, Mapping[str, str | None]]
    after_crash: AfterCrash


_DECLARED = "__dsc_skill__"


def skill(
    outcomes: Mapping[str, Mapping[str, str | None]],
    types: Mapping[str, str] | None = None,
    after_crash: AfterCrash = "sense",
) -> Callable[[_Body], _Body]:
    """Declare a component's coroutine method as a skill.

    Args:
        outcomes: every event it may end with or report, with the event's attributes and their types.
        types: types of its parameters by name; a parameter left out takes any value.
        after_crash: what may be done when a run is resumed and the component does not know what became of it.
    """

    def declare(body: _Body) -> _Body:
        setattr(body, _DECLARED, _Declared(dict(types or {}), {k: dict(v) for k, v in outcomes.items()}, after_crash))
        return body

    return declare


class Component:
    """Base of all components.

    Attributes:
        name: how charts address it; it may be chosen at deployment.
        domain: what it brings to the planning domain: a PDDL file, or PDDL text; `None` for nothing.
        concurrent: whether it can carry out several skills at once. Steps of a plan that use one which cannot never
            overlap; what plots start side by side is their own affair.
    """

    name: str = ""
    domain: ClassVar[Path | str | None] = None
    concurrent: bool = False

    def __init__(self, name: str | None = None) -> None:
        self.name = name or self.name or type(self).__name__.lower()
        self.mode = "neutral"
        self.parameters: dict[str, Any] = {}

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
        body: SkillBody = getattr(self, skill_name)
        return body(call, **arguments)

    async def configure(self, parameter: str, value: object) -> None:
        """The *param* port: set a named parameter; override to react."""
        self.parameters[parameter] = value

    async def switch(self, mode: str) -> None:
        """The *state* port: enter a mode (`neutral` is at rest); override to react."""
        self.mode = mode

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

    def remember(self) -> Any:
        """Plain data to be kept, for `recall` after a restart; asked with each macrostep that is committed."""
        return None

    def recall(self, memory: Any) -> None:
        """Be as when `memory` was kept; called before anything else after a restart."""

    @property
    def remembers(self) -> bool:
        """Whether there is anything to remember: most components are not asked again and again."""
        return type(self).remember is not Component.remember


@cache
def signatures(kind: type[Component], name: str) -> Mapping[str, SkillSignature]:
    """The signatures of a component class's decorated methods, for a component of that name.

    Found once for a class and name: every skill call asks for them.
    """
    found = {}
    for attribute, body in inspect.getmembers(kind, inspect.isfunction):
        declared: _Declared | None = getattr(body, _DECLARED, None)
        if declared is not None:
            found[attribute] = _signature(name, attribute, body, declared)
    return found


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


def _signature(component: str, name: str, body: SkillBody, declared: _Declared) -> SkillSignature:
    own = list(inspect.signature(body).parameters.values())[2:]  # after self and call
    return SkillSignature(
        component=component,
        name=name,
        parameters={p.name: declared.types.get(p.name) for p in own},
        defaults={p.name: p.default for p in own if p.default is not inspect.Parameter.empty},
        outcomes=declared.outcomes,
        after_crash=declared.after_crash,
    )

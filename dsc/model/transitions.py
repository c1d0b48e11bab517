"""Transitions of states and connectors, under the keys that name their triggers."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field, field_validator

from dsc.model.actions import Assign, Emit, Internal, InternalAction, Tell, flat
from dsc.model.language import ConditionField, EffectField, Frozen, TermField
from dsc.model.reading import FormPath
from knowledge_base.language.syntax.expression import Constant, Term


def as_tuple(value: Any) -> Any:
    """Return a list unchanged, anything else as the only element: the short form of lists of one."""
    return tuple(value) if isinstance(value, list | tuple) else (value,)


def _a_duration(value: Term) -> Term:
    if isinstance(value, Constant) and (isinstance(value.value, str | bool) or value.value < 0):
        raise ValueError(f"a number of seconds was expected; found {value.value!r}")
    return value


Duration = Annotated[TermField, AfterValidator(_a_duration)]
"""Seconds; a constant is a number of at least 0."""


class Transition(Frozen):
    """An edge of the chart; the key around it names its trigger.

    Attributes:
        target: name of the state to enter (`to`); without one, only the actions run.
        guard: condition that must hold (`when`).
        assign, tell, emit, arguments: internal actions in this order, written directly; `arguments` (`with`) are the
            attributes of the emitted event.
        do: more internal actions, before those.
        passed: arguments (`pass`) for the plot of the target state, over its own `with` (S2.1). Event attributes and
            this plot's parameters and variables are the sources.
        clear: states whose histories are cleared; `*` after a name includes all levels below. These are Harel's
            clear-history(state) and clear-history(state*); only in dialect `scxml`.
        rule: label of the contingency rule that created the transition.
        also: more targets, in other regions (only in dialect `scxml`).
        internal: a composite source stays active if the target is inside it (SCXML 3.5; only in dialect `scxml`).
    """

    target: str | None = Field(default=None, alias="to")
    guard: ConditionField | None = Field(default=None, alias="when")
    passed: dict[str, TermField] = Field(default_factory=dict, alias="pass")
    clear: Annotated[tuple[str, ...], BeforeValidator(as_tuple)] = ()
    do: tuple[InternalAction, ...] = ()
    rule: str | None = None
    also: tuple[str, ...] = ()
    internal: bool = False
    assign: dict[str, TermField] = Field(default_factory=dict)
    tell: EffectField | None = None
    emit: str | None = None
    arguments: dict[str, TermField] = Field(default_factory=dict, alias="with")

    @property
    def targets(self) -> tuple[str, ...]:
        """All states to enter."""
        if self.target is None:
            return ()
        return (self.target, *self.also) if self.also else (self.target,)

    @property
    def effect(self) -> tuple[Internal, ...]:
        """All internal actions in order of execution."""
        if not self.assign and self.tell is None and self.emit is None:
            return self.do
        actions: list[Internal] = list(self.do)
        if self.assign:
            actions.append(Assign(assign=self.assign))
        if self.tell is not None:
            actions.append(Tell(tell=self.tell))
        if self.emit is not None:
            actions.append(Emit(emit=self.emit, arguments=self.arguments))
        return tuple(actions)

    @property
    def emitted(self) -> tuple[str, ...]:
        """The events that its actions fire."""
        effect = self.effect  # most transitions have none, and large plots have many transitions
        return tuple(action.emit for action in flat(effect) if isinstance(action, Emit)) if effect else ()


class TimedTransition(Transition):
    """A transition taken `seconds` after the entry of its state, unless the state was exited before."""

    seconds: Duration


class CyclicTransition(TimedTransition):
    """A transition taken every `seconds` while its state is active (S3.2); 0 seconds would never end a macrostep."""

    @field_validator("seconds")
    @classmethod
    def _is_a_period(cls, value: Term) -> Term:
        if value == Constant(0):
            raise ValueError("a period is longer than 0 seconds; found 0")
        return value


def as_transition(value: Any) -> Any:
    """Return a transition, or the name of its target: the short form."""
    return {"to": value} if isinstance(value, str) else value


def _as_transitions(value: Any) -> Any:
    return tuple(map(as_transition, as_tuple(value)))


Transitions = Annotated[tuple[Transition, ...], BeforeValidator(_as_transitions)]
TimedTransitions = Annotated[tuple[TimedTransition, ...], BeforeValidator(as_tuple)]
CyclicTransitions = Annotated[tuple[CyclicTransition, ...], BeforeValidator(as_tuple)]


class TransitionSource(Frozen):
    """The source of transitions: a state or a connector."""

    about: str | None = None

    @abstractmethod
    def placed_transitions(self) -> Iterator[tuple[FormPath, str, Transition]]:
        """Yield every outgoing transition in order, with its path inside the source and the label of its trigger."""

    def transitions(self) -> Iterator[tuple[str, Transition]]:
        """Yield every outgoing transition with the label of its trigger."""
        for _, trigger, transition in self.placed_transitions():
            yield trigger, transition

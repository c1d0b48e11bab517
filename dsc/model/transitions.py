"""Transitions and connectors.

A connector is a pseudostate that selects a transition by conditions or by a value (S3.1). It is never active.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Annotated, Any, Self

from pydantic import AfterValidator, BeforeValidator, Field, ValidationInfo, field_validator, model_validator
from pydantic_core import PydanticCustomError

from dsc.model.actions import Assign, Bind, Emit, Internal, InternalAction, Tell, flat
from dsc.model.language import ConditionField, EffectField, Frozen, TermField, is_quoted
from dsc.model.reading import LOCATED, FormPath
from knowledge_base.facts import Value
from knowledge_base.language.syntax.expression import And, Comparison, Constant, Term
from knowledge_base.spelling import TRUTH_VALUES, is_number


def as_tuple(value: Any) -> Any:
    """Return a list as a tuple, and any other value as a tuple of one, because a list of one has a short form."""
    return tuple(value) if isinstance(value, list | tuple) else (value,)


def _a_duration(value: Term) -> Term:
    if isinstance(value, Constant) and (isinstance(value.value, str | bool) or value.value < 0):
        raise ValueError(f"a number of seconds was expected; found {value.value!r}")
    return value


Duration = Annotated[TermField, AfterValidator(_a_duration)]
"""Field type of a time in seconds; a constant must be a number of at least 0."""


class Transition(Frozen):
    """A transition; the key under which it is written determines its trigger.

    Attributes:
        target: name of the state to enter (`to`); `None` means that only the actions are executed.
        guard: condition that must be true (`when`).
        bind: conditions that find the values of variables, by variable (S4.3). Without values that fulfil all of them,
            and `when`, the transition is not taken. They may read each other's variables.
        bind_all: conditions by variable, which receives the list of all values that fulfil its condition.
        order_by: terms that order the values for `bind` and `bind_all`, the smallest first.
        assign, tell, emit, arguments: internal actions without a list, executed in this order; `arguments` (`with`) are
            the attributes of the emitted event.
        do: further internal actions, executed before `assign`, `tell` and `emit`.
        passed: arguments for the plot inside the target state (`pass`); they override that state's `with` (S2.1). They
            may read event attributes and this plot's parameters and variables.
        clear: names of states whose histories are cleared; `*` after a name includes the histories of all inner states.
            These are Harel's clear-history(state) and clear-history(state*); only in dialect `scxml`.
        rule: label of the contingency rule whose expansion made the transition; `None` for any other transition.
        also: names of further targets, in other regions (only in dialect `scxml`).
        keep: whether the plot inside the target continues, if the target is the source. Active states that the next
            plot has too then stay active, with their skills and timers. So a plot can be replaced while it runs.
        internal: whether a composite source stays active if the target is inside the source (SCXML 3.5; only in
            dialect `scxml`).
    """

    target: str | None = Field(default=None, alias="to")
    guard: ConditionField | None = Field(default=None, alias="when")
    passed: dict[str, TermField] = Field(default_factory=dict, alias="pass")
    clear: Annotated[tuple[str, ...], BeforeValidator(as_tuple)] = ()
    keep: bool = Field(default=False, strict=True)
    do: tuple[InternalAction, ...] = ()
    rule: str | None = None
    also: tuple[str, ...] = ()
    internal: bool = False
    bind: dict[str, ConditionField] = Field(default_factory=dict)
    bind_all: dict[str, ConditionField] = Field(default_factory=dict)
    order_by: Annotated[tuple[TermField, ...], BeforeValidator(as_tuple)] = ()
    assign: dict[str, TermField] = Field(default_factory=dict)
    tell: EffectField | None = None
    emit: str | None = None
    arguments: dict[str, TermField] = Field(default_factory=dict, alias="with")

    @field_validator("order_by")
    @classmethod
    def _orders_values(cls, terms: tuple[Term, ...], info: ValidationInfo) -> tuple[Term, ...]:
        if terms and not any(info.data.get(key) for key in ("bind", "bind_all")):
            raise ValueError("`order_by` orders what `bind` or `bind_all` finds, and neither is given")
        return terms

    @property
    def targets(self) -> tuple[str, ...]:
        """Names of all target states; empty without `target`."""
        if self.target is None:
            return ()
        return (self.target, *self.also) if self.also else (self.target,)

    @property
    def has_guard(self) -> bool:
        """Whether a condition may prevent the transition: `when`, or that nothing fulfils `bind`."""
        return self.guard is not None or bool(self.bind)

    @property
    def binding(self) -> Bind | None:
        """The action for `bind`, whose condition includes `when`; `None` without `bind`."""
        if not self.bind:
            return None
        both = (*self.bind.values(), *(() if self.guard is None else (self.guard,)))
        condition = both[0] if len(both) == 1 else And(both)
        return Bind(names=tuple(self.bind), condition=condition, order_by=self.order_by)

    @property
    def effect(self) -> tuple[Internal, ...]:
        """All internal actions in order of execution."""
        if not self.assign and self.tell is None and self.emit is None and not self.bind and not self.bind_all:
            return self.do
        binding = self.binding
        actions: list[Internal] = [] if binding is None else [binding]
        for name, condition in self.bind_all.items():
            actions.append(Bind(names=(name,), condition=condition, order_by=self.order_by, every=True))
        actions += self.do
        if self.assign:
            actions.append(Assign(assign=self.assign))
        if self.tell is not None:
            actions.append(Tell(tell=self.tell))
        if self.emit is not None:
            actions.append(Emit(emit=self.emit, arguments=self.arguments))
        return tuple(actions)

    @property
    def emitted(self) -> tuple[str, ...]:
        """Names of the events that the actions of the transition fire."""
        effect = self.effect  # most transitions have none, and large plots have many transitions
        return tuple(action.emit for action in flat(effect) if isinstance(action, Emit)) if effect else ()


class TimedTransition(Transition):
    """A transition that is taken `seconds` after the entry of its source, unless the source is exited earlier."""

    seconds: Duration


class CyclicTransition(TimedTransition):
    """A transition that is taken every `seconds` while its source is active (S3.2).

    A period of 0 seconds is refused, because its macrostep would never end.
    """

    @field_validator("seconds")
    @classmethod
    def _is_a_period(cls, value: Term) -> Term:
        if value == Constant(0):
            raise ValueError("a period is longer than 0 seconds; found 0")
        return value


def as_transition(value: Any) -> Any:
    """Return the written form of a transition; a string is the short form, the name of the target."""
    return {"to": value} if isinstance(value, str) else value


def _as_transitions(value: Any) -> Any:
    return tuple(map(as_transition, as_tuple(value)))


Transitions = Annotated[tuple[Transition, ...], BeforeValidator(_as_transitions)]
TimedTransitions = Annotated[tuple[TimedTransition, ...], BeforeValidator(as_tuple)]
CyclicTransitions = Annotated[tuple[CyclicTransition, ...], BeforeValidator(as_tuple)]


Redirect = Callable[[Transition], Mapping[str, object]]
"""Function that returns the new values of a transition's fields; an empty mapping leaves the transition unchanged."""


def redirected(ways: Iterable[Transition], change: Redirect) -> tuple[Transition, ...]:
    """Return the transitions with the fields that `change` returns; each transition keeps its class."""
    return tuple(way.model_copy(update=fields) if (fields := change(way)) else way for way in ways)


class TransitionSource(Frozen):
    """A source of transitions: a state or a connector."""

    about: str | None = None

    @abstractmethod
    def placed_transitions(self) -> Iterator[tuple[FormPath, str, Transition]]:
        """Yield path inside the source, label of the trigger and transition of each outgoing transition, in order."""

    @abstractmethod
    def redirected(self, change: Redirect) -> Self:
        """Return the source with the transition fields that `change` returns."""

    def transitions(self) -> Iterator[tuple[str, Transition]]:
        """Yield label of the trigger and transition of each outgoing transition, in order."""
        for _, trigger, transition in self.placed_transitions():
            yield trigger, transition


CHOICE = "choice"
"""Label in place of a trigger for the transitions of connectors."""


class Connector(TransitionSource):
    """A pseudostate that selects the first transition whose guard is true; the last transition has no guard."""

    @model_validator(mode="after")
    def _leads_on(self) -> Connector:
        for path, _, transition in self.placed_transitions():
            if transition.target is None:
                problem = "nothing rests in a connector; name the next state with `to`"
                raise PydanticCustomError(LOCATED, problem, {"path": path})
        return self


class ChoiceState(Connector):
    """A connector that selects by conditions: `choice: [{when: G, to: a}, z]`; the last branch has no `when`."""

    choice: Transitions = Field(min_length=1)

    def placed_transitions(self) -> Iterator[tuple[FormPath, str, Transition]]:
        """Yield the branches in order, with the paths `("choice", number)`."""
        for number, branch in enumerate(self.choice):
            yield ("choice", number), CHOICE, branch

    def redirected(self, change: Redirect) -> Self:
        """Return the connector with changed transitions; see `TransitionSource`."""
        return self.model_copy(update={"choice": redirected(self.choice, change)})


def _as_cases(value: Any) -> Any:
    if not isinstance(value, Mapping):
        return value
    cases = {_case_text(key): as_transition(case) for key, case in value.items()}
    if len(set(map(case_value, cases))) < len(value):  # in Python and YAML, 1 and true are equal keys
        raise ValueError(f"two cases have the same value; found {', '.join(map(str, value))}")
    return cases


def _case_text(key: Any) -> str:
    """Return a key of `cases` as text; each number has one spelling, so that a written and read plot stays equal."""
    if isinstance(key, bool):
        return "true" if key else "false"
    if isinstance(key, str) and not is_number(key):
        return key
    number = case_value(key if isinstance(key, str) else repr(key))
    if isinstance(number, int) or (isinstance(number, float) and math.isfinite(number)):
        return repr(number)
    raise ValueError(f"a case is text, a number or a truth value; found {key!r}")


def case_value(key: str) -> Value:
    """Return the constant for a key of `cases`: number for `1`, truth value for `true`, text for `"1"` or `cup`."""
    if is_number(key):
        return _number(key)
    return TRUTH_VALUES.get(key, key[1:-1] if is_quoted(key) else key)


def _number(text: str) -> int | float:
    try:
        return int(text)  # a float would lose digits of a large whole number
    except ValueError:
        number = float(text)
    return int(number) if number.is_integer() else number


class SelectState(Connector):
    """A connector that selects by value: `select: ?event.kind`, `cases: {cup: wash, can: throw}`, `else: ask`.

    Attributes:
        select: the term whose value is compared with the cases.
        cases: transitions by constant. The model stores the constants as text, because JSON allows no other keys;
            `case_value` returns the constant. A `when` in a case must be true as well.
        otherwise: the transition for all other values (`else`).
    """

    select: TermField
    cases: Annotated[dict[str, Transition], BeforeValidator(_as_cases)] = Field(min_length=1)
    otherwise: Annotated[Transition, BeforeValidator(as_transition)] = Field(alias="else")

    def placed_transitions(self) -> Iterator[tuple[FormPath, str, Transition]]:
        """Yield the cases as guarded transitions, then `otherwise`; the paths are `("cases", key)` and `("else",)`."""
        for path, value, case in self.written_cases():
            yield path, CHOICE, self._add_guard(value, case)
        yield ("else",), CHOICE, self.otherwise

    def written_cases(self) -> Iterator[tuple[FormPath, Value, Transition]]:
        """Yield the path, the value and the transition of each case, without the comparison with the value."""
        for key, case in self.cases.items():
            value = case_value(key)
            # In YAML, a key that is a whole number or a truth value has this type.
            yield ("cases", value if isinstance(value, int) else key), value, case

    def redirected(self, change: Redirect) -> Self:
        """Return the connector with changed transitions; see `TransitionSource`."""
        *cases, otherwise = redirected((*self.cases.values(), self.otherwise), change)
        return self.model_copy(update={"cases": dict(zip(self.cases, cases, strict=True)), "otherwise": otherwise})

    def _add_guard(self, value: Value, case: Transition) -> Transition:
        is_case = Comparison("=", self.select, Constant(value))
        guard = is_case if case.guard is None else And((is_case, case.guard))
        return case.model_copy(update={"guard": guard})

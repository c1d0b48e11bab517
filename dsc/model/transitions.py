"""Transitions, under the keys that name their triggers, and connectors.

Connectors are pseudostates that select a transition by conditions or by a value (S3.1). No connector is ever active.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Annotated, Any, Self

from pydantic import AfterValidator, BeforeValidator, Field, field_validator, model_validator
from pydantic_core import PydanticCustomError

from dsc.model.actions import Assign, Emit, Internal, InternalAction, Tell, flat
from dsc.model.language import ConditionField, EffectField, Frozen, TermField
from dsc.model.reading import LOCATED, FormPath
from knowledge_base.facts import Value
from knowledge_base.language.syntax.expression import And, Comparison, Constant, Term
from knowledge_base.spelling import TRUTH_VALUES, is_number


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


Redirect = Callable[[Transition], Mapping[str, object]]
"""Returns the new values of a transition's fields; nothing for a transition that stays."""


def redirected(ways: Iterable[Transition], change: Redirect) -> tuple[Transition, ...]:
    """Return changed transitions of the same kinds, e.g. timed ones."""
    return tuple(way.model_copy(update=fields) if (fields := change(way)) else way for way in ways)


class TransitionSource(Frozen):
    """The source of transitions: a state or a connector."""

    about: str | None = None

    @abstractmethod
    def placed_transitions(self) -> Iterator[tuple[FormPath, str, Transition]]:
        """Yield every outgoing transition in order, with its path inside the source and the label of its trigger."""

    @abstractmethod
    def redirected(self, change: Redirect) -> Self:
        """Return the source with changed transitions."""

    def transitions(self) -> Iterator[tuple[str, Transition]]:
        """Yield every outgoing transition with the label of its trigger."""
        for _, trigger, transition in self.placed_transitions():
            yield trigger, transition


CHOICE = "choice"
"""Label of the transitions of connectors, which have no trigger."""


class Connector(TransitionSource):
    """A pseudostate on the way to a state; its transitions are tried in order, and the last one always holds."""

    @model_validator(mode="after")
    def _leads_on(self) -> Connector:
        for path, _, transition in self.placed_transitions():
            if transition.target is None:
                problem = "nothing rests in a connector; name the next state with `to`"
                raise PydanticCustomError(LOCATED, problem, {"path": path})
        return self


class ChoiceState(Connector):
    """Selects by conditions: `choice: [{when: G, to: a}, z]`; the last branch has no `when`."""

    choice: Transitions = Field(min_length=1)

    def placed_transitions(self) -> Iterator[tuple[FormPath, str, Transition]]:
        """Yield the branches in order; paths are `("choice", number)`."""
        for number, branch in enumerate(self.choice):
            yield ("choice", number), CHOICE, branch

    def redirected(self, change: Redirect) -> Self:
        """See `TransitionSource`."""
        return self.model_copy(update={"choice": redirected(self.choice, change)})


def _as_cases(value: Any) -> Any:
    if not isinstance(value, Mapping):
        return value
    cases = {_case_text(key): as_transition(case) for key, case in value.items()}
    if len(set(map(case_value, cases))) < len(value):  # to Python and YAML, 1 and true are the same key
        raise ValueError(f"two cases have the same value; found {', '.join(map(str, value))}")
    return cases


def _case_text(key: Any) -> str:
    """Return the key as text, with one spelling for each number, so that writing and reading keep the plot equal."""
    if isinstance(key, bool):
        return "true" if key else "false"
    if isinstance(key, str) and not is_number(key):
        return key
    number = case_value(key if isinstance(key, str) else repr(key))
    if isinstance(number, int) or (isinstance(number, float) and math.isfinite(number)):
        return repr(number)
    raise ValueError(f"a case is text, a number or a truth value; found {key!r}")


def case_value(key: str) -> Value:
    """Return the constant of a case's key: `1` a number, `true` a truth value, `"1"` and `cup` texts."""
    if is_number(key):
        return _number(key)
    quoted = len(key) > 1 and key[0] == key[-1] == '"'
    return TRUTH_VALUES.get(key, key[1:-1] if quoted else key)


def _number(text: str) -> int | float:
    try:
        return int(text)  # a large one has more digits than a float can hold
    except ValueError:
        number = float(text)
    return int(number) if number.is_integer() else number


class SelectState(Connector):
    """Selects by value: `select: ?event.kind`, `cases: {cup: wash, can: throw}`, `else: ask`.

    Attributes:
        select: the value to compare.
        cases: constant -> transition. Keys are kept as text, the only kind in JSON; `case_value` reads them. A `when`
            in a case must hold as well.
        otherwise: the transition for all other values (`else`).
    """

    select: TermField
    cases: Annotated[dict[str, Transition], BeforeValidator(_as_cases)] = Field(min_length=1)
    otherwise: Annotated[Transition, BeforeValidator(as_transition)] = Field(alias="else")

    def placed_transitions(self) -> Iterator[tuple[FormPath, str, Transition]]:
        """Yield the cases as guarded transitions, then the rest; paths are `("cases", key)` and `("else",)`."""
        for key, case in self.cases.items():
            value = case_value(key)
            # YAML reads a whole number or a truth value as a key of that type.
            place = value if isinstance(value, int) else key
            yield ("cases", place), CHOICE, self._guarded(value, case)
        yield ("else",), CHOICE, self.otherwise

    def redirected(self, change: Redirect) -> Self:
        """See `TransitionSource`."""
        *cases, otherwise = redirected((*self.cases.values(), self.otherwise), change)
        return self.model_copy(update={"cases": dict(zip(self.cases, cases, strict=True)), "otherwise": otherwise})

    def _guarded(self, value: Value, case: Transition) -> Transition:
        is_case = Comparison("=", self.select, Constant(value))
        guard = is_case if case.guard is None else And((is_case, case.guard))
        return case.model_copy(update={"guard": guard})

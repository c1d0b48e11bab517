"""The kinds of states. The kind follows from the key that is there: `use`, `dynamic`, `states`, `regions`, `final`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Discriminator, Field, Tag, field_validator

from dsc.model.actions import Action, Assign, Emit, Internal, InternalAction, Tell, flat
from dsc.model.language import ConditionField, EffectField, Frozen, TermField
from knowledge_base.language.expression import Constant, Term


class Transition(Frozen):
    """An edge of the chart; its trigger is the key it stands under.

    Attributes:
        target: name of the state to enter (`to`); none means: stay, only the actions happen.
        guard: condition that must hold (`when`).
        assign, tell, emit, arguments: internal actions in this order, written directly; `arguments` (`with`)
            are the attributes of the emitted event.
        do: more internal actions, before those.
        rule: label of the contingency rule that put the transition there.
        also: more targets, in other regions (only in profile `scxml`).
        internal: a composite source is not left if the target is inside it (SCXML 3.5; only in profile `scxml`).
    """

    target: str | None = Field(default=None, alias="to")
    guard: ConditionField | None = Field(default=None, alias="when")
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
        return () if self.target is None else (self.target, *self.also)

    @property
    def effect(self) -> tuple[Internal, ...]:
        """All internal actions in order of execution."""
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
        """The events its actions fire."""
        return tuple(action.emit for action in flat(self.effect) if isinstance(action, Emit))


class TimedTransition(Transition):
    """A transition taken `seconds` after its state was entered, unless the state was left before."""

    seconds: TermField

    @field_validator("seconds")
    @classmethod
    def _is_a_duration(cls, value: Term) -> Term:
        if isinstance(value, Constant) and (isinstance(value.value, str | bool) or value.value < 0):
            raise ValueError(f"a number of seconds was expected; found {value.value!r}")
        return value


def _as_transitions(value: Any) -> Any:
    many = value if isinstance(value, list | tuple) else [value]
    return tuple({"to": one} if isinstance(one, str) else one for one in many)


def _as_tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list | tuple) else (value,)


Transitions = Annotated[tuple[Transition, ...], BeforeValidator(_as_transitions)]
TimedTransitions = Annotated[tuple[TimedTransition, ...], BeforeValidator(_as_tuple)]
Actions = Annotated[tuple[Action, ...], BeforeValidator(_as_tuple)]


class State(Frozen):
    """A simple state: a configuration of the skill layer, set in entry and reverted by exit (S0.15).

    Attributes:
        entry, exit: external actions; in profile `scxml` internal ones too.
        on: event -> transitions, tried in order; `done` is the completion of the state's content.
        after: timeouts.
        always: transitions without trigger, taken as soon as their guard holds.
    """

    about: str | None = None
    entry: Actions = ()
    exit: Actions = ()
    on: dict[str, Transitions] = Field(default_factory=dict)
    after: TimedTransitions = ()
    always: Transitions = ()

    def transitions(self) -> Iterator[tuple[str, Transition]]:
        """Every outgoing transition with the label of its trigger."""
        for _, trigger, transition in self.placed_transitions():
            yield trigger, transition

    def placed_transitions(self) -> Iterator[tuple[tuple[str | int, ...], str, Transition]]:
        """As `transitions`, each with its path inside the state, e.g. `("on", "grasped", 0)`."""
        for event, transitions in self.on.items():
            for number, transition in enumerate(transitions):
                yield ("on", event, number), event, transition
        for number, timed in enumerate(self.after):
            yield ("after", number), "after", timed
        for number, transition in enumerate(self.always):
            yield ("always", number), "always", transition


class CompositeState(State):
    """States grouped for common transitions; brings no scope of its own (S0.2)."""

    states: dict[str, AnyState] = Field(min_length=1)
    initial: str | None = None


class Region(Frozen):
    """One of several parallel control flows (S0.3)."""

    states: dict[str, AnyState] = Field(min_length=1)
    initial: str | None = None


class OrthogonalState(State):
    """Regions that are active together; done when each has reached its final state.

    Attributes:
        regions: the regions by name.
        connectors: histories of the whole (only in profile `scxml`).
    """

    regions: dict[str, Region] = Field(min_length=1)
    connectors: dict[str, HistoryState] = Field(default_factory=dict)


class SubmachineState(State):
    """A state whose content is another plot, used as a black box (S0.1, S0.2).

    `use` names a plot of the library, or a variable (`?plan`) that holds a plot as a value.
    """

    use: str
    arguments: dict[str, TermField] = Field(default_factory=dict, alias="with")


class Budget(Frozen):
    """Bounds of planning for one dynamic state: replans after the first plan, seconds for each search."""

    replans: int = Field(default=8, ge=0, strict=True)
    seconds: float = Field(default=10.0, gt=0, strict=True)


class DynamicState(State):
    """An empty hull that chooses its content on entry (S0.4), and may ask a planner for it (S0.12).

    Attributes:
        dynamic: names of candidate plots in order of preference; each carries its own `when`.
        arguments: values for the candidates' parameters (`with`).
        goal: what shall hold in the end; planned for when no candidate fits. Adds the outcomes `no_plan`
            and `gave_up`, which must be wired.
        budget: bounds for planning.
    """

    dynamic: tuple[str, ...] = ()
    arguments: dict[str, TermField] = Field(default_factory=dict, alias="with")
    goal: ConditionField | None = None
    budget: Budget = Budget()


class FinalState(Frozen):
    """The end of its region or plot; entering it completes the state around (S0.11, S2.2).

    `entry` holds internal actions, and only in profile `scxml`.
    """

    about: str | None = None
    final: Literal[True]
    entry: Annotated[tuple[InternalAction, ...], BeforeValidator(_as_tuple)] = ()
    emit: str | None = None
    arguments: dict[str, TermField] = Field(default_factory=dict, alias="with")


class HistoryState(Frozen):
    """Stands for what was active when the state around was last left (SCXML 3.10; only in profile `scxml`).

    Attributes:
        history: `shallow` remembers the states directly inside, `deep` the innermost ones. What ran inside a
            submachine or dynamic state is not remembered: such a state begins anew.
        target: the state to enter (`to`) if the state around was never left.
        do: internal actions of that default.
    """

    about: str | None = None
    history: Literal["shallow", "deep"]
    target: str = Field(alias="to")
    do: tuple[InternalAction, ...] = ()


_KIND_OF_KEY = {"use": "submachine", "dynamic": "dynamic", "goal": "dynamic", "states": "composite",
                "regions": "orthogonal", "final": "final", "history": "history"}  # fmt: skip


def _kind(value: Any) -> str:
    keys = value if isinstance(value, Mapping) else getattr(type(value), "model_fields", ())
    return next((kind for key, kind in _KIND_OF_KEY.items() if key in keys), "simple")


def _as_state(value: Any) -> Any:
    return {} if value is None else value


AnyState = Annotated[
    Annotated[State, Tag("simple")]
    | Annotated[CompositeState, Tag("composite")]
    | Annotated[OrthogonalState, Tag("orthogonal")]
    | Annotated[SubmachineState, Tag("submachine")]
    | Annotated[DynamicState, Tag("dynamic")]
    | Annotated[FinalState, Tag("final")]
    | Annotated[HistoryState, Tag("history")],
    Discriminator(_kind),
    BeforeValidator(_as_state),
]
CompositeState.model_rebuild()
Region.model_rebuild()
OrthogonalState.model_rebuild()

"""The kinds of states and connectors; a distinctive key such as `use` or `states` determines the kind."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Discriminator, Field, Tag

from dsc.model.actions import Action, InternalAction
from dsc.model.language import ConditionField, Frozen, TermField
from dsc.model.reading import FormPath
from dsc.model.transitions import (
    ChoiceState,
    CyclicTransitions,
    Duration,
    Redirect,
    SelectState,
    TimedTransitions,
    Transition,
    Transitions,
    TransitionSource,
    as_tuple,
    redirected,
)

Actions = Annotated[tuple[Action, ...], BeforeValidator(as_tuple)]


class State(TransitionSource):
    """A simple state: a configuration of the skill layer, set in entry and reverted by exit (S0.15).

    Attributes:
        entry, exit, on_break: external actions; in dialect `scxml` internal ones too. `on_break` replaces `exit` when
            the state is interrupted, which is an exit by another state's transition (S2.3). Without `on_break`,
            `exit` runs then too.
        at_least: seconds before the state's own transitions are enabled (S3.1). Until then an event for one of them is
            kept, and then offered again. The upper bound is `after`.
        on: event -> transitions, tried in order; `done` is the completion of the state's content.
        after: timeouts.
        every: periodic reactions while the state is active (S3.2).
        always: transitions without trigger, taken as soon as their guard holds.
    """

    entry: Actions = ()
    exit: Actions = ()
    on_break: Actions = ()
    at_least: Duration | None = None
    on: dict[str, Transitions] = Field(default_factory=dict)
    after: TimedTransitions = ()
    every: CyclicTransitions = ()
    always: Transitions = ()

    def blocks(self) -> Iterator[tuple[str, Actions]]:
        """Yield its actions with their keys."""
        yield "entry", self.entry
        yield "exit", self.exit
        yield "on_break", self.on_break

    def placed_transitions(self) -> Iterator[tuple[FormPath, str, Transition]]:
        """Yield every outgoing transition, with its path, e.g. `("on", "grasped", 0)`, and the label of its trigger."""
        for event, transitions in self.on.items():
            for number, transition in enumerate(transitions):
                yield ("on", event, number), event, transition
        for number, timed in enumerate(self.after):
            yield ("after", number), "after", timed
        for number, cyclic in enumerate(self.every):
            yield ("every", number), "every", cyclic
        for number, transition in enumerate(self.always):
            yield ("always", number), "always", transition

    def redirected(self, change: Redirect) -> Self:
        """See `TransitionSource`."""
        return self.model_copy(update={
            "on": {event: redirected(ways, change) for event, ways in self.on.items()},
            "after": redirected(self.after, change),
            "every": redirected(self.every, change),
            "always": redirected(self.always, change),
        })  # fmt: skip


class CompositeState(State):
    """States grouped for common transitions, without a separate scope of names (S0.2)."""

    states: dict[str, AnyState] = Field(min_length=1)
    initial: str | None = None


class Region(Frozen):
    """One of several parallel control flows (S0.3)."""

    states: dict[str, AnyState] = Field(min_length=1)
    initial: str | None = None


class OrthogonalState(State):
    """Regions that are active together; the state is done when each has reached its final state.

    Attributes:
        regions: the regions by name.
        connectors: histories of the whole (only in dialect `scxml`).
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
    """An empty hull that chooses its content on entry (S0.4), and may request it from a planner (S0.12).

    Attributes:
        dynamic: names of candidate plots in order of preference; each carries its own `when`.
        arguments: values for the candidates' parameters (`with`).
        goal: the planning goal; planned for when no candidate fits. It adds the outcomes `no_plan` and `gave_up`, which
            must be wired.
        budget: bounds for planning.
    """

    dynamic: tuple[str, ...] = ()
    arguments: dict[str, TermField] = Field(default_factory=dict, alias="with")
    goal: ConditionField | None = None
    budget: Budget = Budget()


class FinalState(Frozen):
    """The end of its region or plot; its entry completes the state around it (S0.11, S2.2).

    `entry` holds internal actions, and only in dialect `scxml`.
    """

    about: str | None = None
    final: Literal[True]
    entry: Annotated[tuple[InternalAction, ...], BeforeValidator(as_tuple)] = ()
    emit: str | None = None
    arguments: dict[str, TermField] = Field(default_factory=dict, alias="with")


class HistoryState(Frozen):
    """Stands for the states that were active at the last exit of the state around (SCXML 3.10; dialect `scxml` only).

    Attributes:
        history: `shallow` remembers the states directly inside, `deep` the innermost ones. The content of a submachine
            or dynamic state is not remembered: such a state starts again.
        target: the state to enter (`to`) if the state around was never exited.
        do: internal actions of that default.
    """

    about: str | None = None
    history: Literal["shallow", "deep"]
    target: str = Field(alias="to")
    do: tuple[InternalAction, ...] = ()


_KIND_OF_KEY = {"use": "submachine", "dynamic": "dynamic", "goal": "dynamic", "states": "composite",
                "regions": "orthogonal", "final": "final", "history": "history", "choice": "choice",
                "select": "select"}  # fmt: skip


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
    | Annotated[HistoryState, Tag("history")]
    | Annotated[ChoiceState, Tag("choice")]
    | Annotated[SelectState, Tag("select")],
    Discriminator(_kind),
    BeforeValidator(_as_state),
]
CompositeState.model_rebuild()
Region.model_rebuild()
OrthogonalState.model_rebuild()

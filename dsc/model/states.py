"""States and connectors; a distinctive key, e.g. `use` or `states`, determines the kind of a state."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping
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
    """A simple state: entry configures the skill layer, and exit reverts this configuration (S0.15).

    Attributes:
        entry: external actions on entry; in dialect `scxml` also internal ones.
        exit: external actions on exit; in dialect `scxml` also internal ones.
        on_break: actions on interruption, an exit by the transition of another state (S2.3). They replace `exit`; if
            `on_break` is empty, `exit` is executed.
        at_least: seconds after entry before the state's own transitions are enabled (S3.1). An event for these
            transitions is kept, and is handled after this time. The upper bound is `after`.
        on: transitions by event, tried in order; the event `done` reports the completion of the state's content.
        after: transitions that a timer triggers after the entry.
        every: transitions that a periodic timer triggers while the state is active (S3.2).
        always: transitions without trigger, taken as soon as their guard is true.
        priority: rank of the state's skills, and of all skills inside, where they wait for a component (S1.21). The
            larger number comes first; `None` means the rank of the state around, and 0 for the plot of a run.
        preempt: whether these skills take a component from skills with a lower priority. The other state is then
            interrupted: it executes `on_break`, is entered again, and waits.
        handles: whether the state is the response of a handler, whose skills come before those of its plot.
    """

    entry: Actions = ()
    exit: Actions = ()
    on_break: Actions = ()
    at_least: Duration | None = None
    on: dict[str, Transitions] = Field(default_factory=dict)
    after: TimedTransitions = ()
    every: CyclicTransitions = ()
    always: Transitions = ()
    priority: float | None = Field(default=None, strict=True)
    preempt: bool = Field(default=False, strict=True)
    handles: bool = False

    def blocks(self) -> Iterator[tuple[str, Actions]]:
        """Yield each sequence of actions with its key, e.g. `entry`."""
        yield "entry", self.entry
        yield "exit", self.exit
        yield "on_break", self.on_break

    def placed_transitions(self) -> Iterator[tuple[FormPath, str, Transition]]:
        """Yield path, trigger and transition of each outgoing transition; a path is e.g. `("on", "grasped", 0)`."""
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
        """Return the state with changed transitions; see `TransitionSource`."""
        return self.model_copy(update={
            "on": {event: redirected(ways, change) for event, ways in self.on.items()},
            "after": redirected(self.after, change),
            "every": redirected(self.every, change),
            "always": redirected(self.always, change),
        })  # fmt: skip


class CompositeState(State):
    """A group of states with common transitions; state names stay unique in the whole plot (S0.2)."""

    states: dict[str, AnyState] = Field(min_length=1)
    initial: str | None = None


class Region(Frozen):
    """One of several parallel control flows of an orthogonal state (S0.3)."""

    states: dict[str, AnyState] = Field(min_length=1)
    initial: str | None = None


class OrthogonalState(State):
    """A state with regions that are active together; it is done when each region has reached a final state.

    Attributes:
        regions: regions by name.
        connectors: history states of the whole orthogonal state, by name (only in dialect `scxml`).
    """

    regions: dict[str, Region] = Field(min_length=1)
    connectors: dict[str, HistoryState] = Field(default_factory=dict)


class SubmachineState(State):
    """A state whose content is another plot, used as a black box (S0.1, S0.2).

    `use` is the name of a plot in the library, or a variable (`?plan`) whose value is a plot as data.
    """

    use: str
    arguments: dict[str, TermField] = Field(default_factory=dict, alias="with")


class Budget(Frozen):
    """Bounds of planning for one dynamic state.

    Attributes:
        replans: largest number of new plans after the first plan.
        seconds: longest time of each search.
    """

    replans: int = Field(default=8, ge=0, strict=True)
    seconds: float = Field(default=10.0, gt=0, strict=True)


Choice = Literal["order", "priority", "utility", "cost", "learned"]
"""Choice of a dynamic state among the candidates that fit: the first one, or by this number of the candidates."""


class Exclusion(Frozen):
    """Condition under which a dynamic state does not choose a candidate that has failed.

    Attributes:
        failures: number of successive failures with equal arguments: the candidate has ended with an outcome, one of
            its skills has failed, or the state was left by `after`.
        seconds: time of the exclusion after the last failure.
    """

    failures: int = Field(default=1, ge=1, strict=True)
    seconds: float = Field(gt=0, strict=True)


class Offers(Frozen):
    """The candidates of a dynamic state that declare themselves: all plots of the library that offer this name.

    Attributes:
        offers: the name that the candidates have in their own `offers`.
    """

    offers: str


class DynamicState(State):
    """A state that chooses its content on its entry (S0.4), and may request the content from a planner (S0.12).

    Attributes:
        dynamic: names of candidate plots, in order of preference; each candidate declares its condition in `when`. With
            `Offers`, the candidates are the plots that offer a name, in the order of the library.
        choose: the choice among several candidates that fit (S0.14): the first one in `order`, the one of the largest
            `priority` or `utility`, or of the smallest `cost`; of equal ones the first. `learned` chooses by the
            expected time until success, see `dsc.dynamic.experience`.
        situation: conditions on which the success of candidates may depend; decisions record their truth.
        explore: probability of a random choice among the candidates that fit, with `learned`.
        exclude: exclusion of candidates that have failed; by default none.
        arguments: values for the candidates' parameters (`with`).
        goal: planning goal; if no candidate fits, a plan for the goal is made. The goal adds the outcomes `no_plan` and
            `gave_up`, which the chart must handle.
        budget: bounds of planning.
    """

    dynamic: tuple[str, ...] | Offers = ()
    choose: Choice = "order"
    exclude: Exclusion | None = None
    situation: tuple[ConditionField, ...] = ()
    explore: float = Field(default=0.0, ge=0, le=1, strict=True)
    arguments: dict[str, TermField] = Field(default_factory=dict, alias="with")
    goal: ConditionField | None = None
    budget: Budget = Budget()

    @property
    def candidates(self) -> tuple[str, ...]:
        """The names of the candidates that the state lists; empty with `Offers`."""
        return () if isinstance(self.dynamic, Offers) else self.dynamic

    @property
    def offer(self) -> str | None:
        """The name that the candidates offer; `None` for a list of candidates."""
        return self.dynamic.offers if isinstance(self.dynamic, Offers) else None

    def admits(self, plot: str, offers: Container[str]) -> bool:
        """Return whether a plot of that name, which offers these names, is a candidate of the state."""
        return self.offer in offers if isinstance(self.dynamic, Offers) else plot in self.dynamic


class FinalState(Frozen):
    """The end of a region, composite state or plot; its entry completes the surrounding state (S0.11, S2.2).

    `entry` is allowed only in dialect `scxml`, and contains internal actions.
    """

    about: str | None = None
    final: Literal[True]
    entry: Annotated[tuple[InternalAction, ...], BeforeValidator(as_tuple)] = ()
    emit: str | None = None
    arguments: dict[str, TermField] = Field(default_factory=dict, alias="with")


class HistoryState(Frozen):
    """A history: represents the states that were active at the last exit from its parent (SCXML 3.10).

    Histories exist only in dialect `scxml`.

    Attributes:
        history: `shallow` remembers the states directly inside, `deep` the innermost states. The content of a
            submachine or dynamic state is not remembered: this content starts from the beginning.
        target: name of the state to enter if the parent was never exited (`to`).
        do: internal actions that precede the entry of `target`.
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
    for key, kind in _KIND_OF_KEY.items():
        if key in keys:
            return kind
    return "simple"


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

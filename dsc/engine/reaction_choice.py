"""Choice of the reaction to a trigger: computed on first use for each combination of guard results, then cached."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from dsc.engine.frames import Frame
from dsc.engine.machine_state import MOST_TRIGGERS, Configuration, FrameState
from dsc.engine.membership import FALSE, settle
from dsc.engine.reaction import CompiledReaction, reaction_of
from dsc.engine.tables import TransitionEdge
from dsc.engine.transition_selection import Trigger, edges_of, select
from knowledge_base.language.syntax.expression import TRUE, Expression

MOST_QUESTIONS = 1024
"""Upper bound of `Question` objects for one configuration: n independent guards have 2**n outcomes."""


@dataclass(slots=True, eq=False)
class Question:
    """A guard to evaluate next; each result leads to another `Question` or to a reaction.

    Attributes:
        edge: the guarded transition.
        configuration: the configuration in which the guard is evaluated.
        trigger: the trigger of the transitions to choose from.
    """

    configuration: Configuration
    trigger: Trigger
    edge: TransitionEdge
    condition: Expression
    answers: Mapping[TransitionEdge, bool]
    _branches: dict[bool, Choice] = field(default_factory=dict)

    def follow(self, answer: bool) -> Choice:  # noqa: FBT001  # the guard's truth value
        """Return the reaction, or the next guard to evaluate, after this result of the guard."""
        found = self._branches.get(answer)
        if found is None:
            answers = {**self.answers, self.edge: answer}
            found = self._branches[answer] = _compute(self.configuration, self.trigger, answers)
        return found


Choice = CompiledReaction | Question
"""The reaction to a trigger, or the guard to evaluate next."""

_UNKNOWN = object()


def choice_of(plot: Frame | FrameState, trigger: Trigger) -> Choice | None:
    """Return the reaction or first guard for a trigger; `None` if no active state has a transition for the trigger."""
    configuration = plot.configuration
    found = configuration.choices.get(trigger, _UNKNOWN)
    if found is _UNKNOWN:
        if len(configuration.choices) >= MOST_TRIGGERS:
            configuration.forget()
        listens = any(edges_of(configuration.compiled, index, trigger) for index in configuration.active)
        found = configuration.choices[trigger] = _compute(configuration, trigger, {}) if listens else None
    return found  # type: ignore[no-any-return]


def settle_guard(edge: TransitionEdge, guard: Expression, configuration: Configuration) -> Expression:
    """Return the guard of a transition with each `in-state` replaced by its truth value."""
    return settle(guard, configuration.is_active) if edge.asks else guard


class _Open(Exception):  # noqa: N818  # control flow: the search stops at a guard without a result
    def __init__(self, question: Question) -> None:
        super().__init__()
        self.question = question


def _compute(configuration: Configuration, trigger: Trigger, answers: Mapping[TransitionEdge, bool]) -> Choice:
    def guard(_frame: Frame, edge: TransitionEdge) -> bool:
        if edge.guard is None:
            return True
        condition = settle_guard(edge, edge.guard, configuration)
        if condition in (TRUE, FALSE):
            return condition == TRUE
        if edge not in answers:
            raise _Open(Question(configuration, trigger, edge, condition, answers))
        return answers[edge]

    try:
        taken, late = select(Frame(FrameState(0, configuration.compiled, configuration)), trigger, guard)
    except _Open as stop:
        configuration.questions += 1
        if configuration.questions > MOST_QUESTIONS:
            configuration.forget()
        return stop.question
    keeping = dict.fromkeys(one.frame.compiled.nodes[one.edge.source].name for one in late)
    return reaction_of(configuration, tuple([one.edge for one in taken]), tuple(keeping))

"""Choice of the reaction to a trigger: computed on first use for each combination of guard results, then cached."""

from __future__ import annotations

from collections.abc import Mapping

from dsc.engine.automaton import Choice, Configuration, Question
from dsc.engine.frames import Frame
from dsc.engine.machine_state import FrameState
from dsc.engine.membership import FALSE, settle
from dsc.engine.reaction import reaction_of
from dsc.engine.tables import TransitionEdge, Trigger
from dsc.engine.transition_selection import edges_of, select
from knowledge_base.language.syntax.expression import TRUE, Expression


def choice_of(plot: Frame | FrameState, trigger: Trigger) -> Choice | None:
    """Return the reaction or first guard for a trigger; `None` if no active state has a transition for the trigger."""
    configuration = plot.configuration
    known = configuration.reactions.choices
    try:
        return known[trigger]  # one lookup: another thread may add the choice at any time
    except KeyError:
        configuration.reactions.make_room()
        listens = any(edges_of(configuration.compiled, index, trigger) for index in configuration.active)
        choice = known[trigger] = _compute(configuration, trigger, {}) if listens else None
        return choice


def follow(question: Question, answer: bool) -> Choice:  # noqa: FBT001  # the guard's truth value
    """Return the reaction, or the next guard to evaluate, after this result of the guard."""
    found = question.branches.get(answer)
    if found is None:
        answers = {**question.answers, question.edge: answer}
        found = question.branches[answer] = _compute(question.configuration, question.trigger, answers)
    return found


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
        configuration.reactions.count_question()
        return stop.question
    keeping = dict.fromkeys(one.frame.compiled.nodes[one.edge.source].name for one in late)
    return reaction_of(configuration, tuple([one.edge for one in taken]), tuple(keeping))

"""Situation of the engine with a knowledge base, and the choice of a dynamic state's content.

The choice is top-down, because the state lists the candidates, and bottom-up, because each candidate declares its
condition (S0.4).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from dsc.chance import uniform
from dsc.dynamic.experience import NO_EXPERIENCE, Experience, Tries, situation_of
from dsc.dynamic.library import Library
from dsc.dynamic.steps import Plots, candidates_of
from dsc.engine.exclusion import Excluded, FailedCandidate
from dsc.engine.situation import Bindings, Decision, Verdict
from dsc.model.data_forms import (
    PLAIN,
    Values,
    plain_condition,
    plain_effect,
    plain_term,
    reads_data,
)
from dsc.model.plot import ActionPlot
from dsc.model.states import Choice, DynamicState
from knowledge_base.facts import Content, Delta
from knowledge_base.language.evaluation.evaluator import apply_effect, evaluate_term, holds, rows
from knowledge_base.language.evaluation.explanation import explain
from knowledge_base.language.evaluation.world_protocol import World
from knowledge_base.language.syntax.effect import Effect
from knowledge_base.language.syntax.expression import Constant, Expression, Term, Variable, substitute
from knowledge_base.language.syntax.text import to_text
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.overlay import Overlay


class KnowledgeSituation:
    """A `Situation` for one macrostep; it never changes the knowledge base.

    Args:
        knowledge: the knowledge base.
        library: the plots.
        now: returns the second of run time, equal in the whole macrostep.

    Attributes:
        now: see `Situation`.
    """

    def __init__(self, knowledge: KnowledgeBase, library: Library, now: Callable[[], float] = lambda: 0.0) -> None:
        self.now = now
        self._version = knowledge.version
        self._knowledge = knowledge
        self._library = library
        self._pending: Overlay | None = None

    @property
    def _world(self) -> Overlay:
        """The knowledge with the macrostep's changes.

        It is created on first use, because most steps neither read nor change the knowledge.
        """
        if self._pending is None:
            self._pending = self._knowledge.overlay()
        return self._pending

    def holds(self, expression: Expression, bindings: Bindings) -> bool:
        """See `Situation`."""
        if PLAIN.get(id(expression)) is not expression and reads_data(expression):
            expression = plain_condition(expression, Values(bindings))
        return holds(expression, self._world, bindings)

    def answers(self, expression: Expression, bindings: Bindings) -> Iterator[dict[str, Any]]:
        """See `Situation`."""
        if reads_data(expression):
            expression = plain_condition(expression, Values(bindings))
        return rows(expression, self._world, scalars(bindings))

    def value(self, term: Term, bindings: Bindings) -> Any:
        """See `Situation`."""
        if PLAIN.get(id(term)) is not term and reads_data(term):
            term = plain_term(term, Values(bindings))
        return plain(evaluate_term(term, self._world, bindings))

    def tell(self, effect: Effect, bindings: Bindings) -> Delta:
        """See `Situation`."""
        if PLAIN.get(id(effect)) is not effect and reads_data(effect):
            effect = plain_effect(effect, Values(bindings))
        delta = apply_effect(effect, self._world, scalars(bindings))
        self._world.apply(delta)
        return delta

    def choose(
        self,
        state: DynamicState,
        holder: str,
        bindings: Bindings,
        failed: Sequence[FailedCandidate] = (),
        activation: int = 0,
    ) -> Decision:
        """See `Situation`."""
        excluded = Excluded(failed, self.now()) if failed else None
        library = self._library
        draw = uniform(library.experience.seed, str(activation), "explore") if state.explore else 1.0
        return choose(state, holder, bindings, self._world, library, self._version, excluded, library.experience, draw)


NOT_INSTALLED = "not installed"
"""Reason of the verdict on a listed candidate that the library lacks (S0.4)."""
ACHIEVE = "achieve"
"""Name of the library's plot for a goal without a fitting candidate; this plot plans, executes and replans."""


def choose(
    state: DynamicState,
    holder: str,
    bindings: Mapping[str, Any],
    world: World,
    plots: Plots,
    version: int,
    excluded: Excluded | None = None,
    experience: Experience = NO_EXPERIENCE,
    draw: float = 1.0,
) -> Decision:
    """Return the decision on the content of `state`, a dynamic state of the plot named `holder`.

    If the state's goal is already true, no plot is chosen. Otherwise `choose` of the state determines the choice among
    the candidates with true conditions; one whose number is unknown comes last. If no candidate fits and the state has
    a goal, the plot `achieve` is chosen.

    Args:
        state: the dynamic state.
        holder: the name of its plot.
        bindings: values of variables.
        world: the knowledge.
        plots: provider of the candidates.
        version: version of the knowledge.
        excluded: the candidates that have failed.
        experience: the tries for a learned choice; those of plan steps count for a candidate without others.
        draw: a random number in [0, 1); below `explore` of the state, it chooses among the candidates that fit.

    Raises:
        UnknownNameError: a variable has no value.
    """
    goal = state.goal
    if goal is not None:
        goal = substitute(_plain(goal, bindings), scalars(bindings))
    if goal is not None and holds(goal, world, {}):
        return Decision(None, satisfied=True, version=version)
    arguments = {name: _argument(term, world, bindings) for name, term in state.arguments.items()}
    read = scalars(bindings) if state.situation else {}
    truths = {to_text(one): holds(_plain(one, bindings), world, read) for one in state.situation}
    situation = situation_of(truths)
    verdicts, own = [], {}
    fitting: list[Verdict] = []
    for plot in candidates_of(state, plots):
        name = plot.name
        own[name] = {key: value for key, value in arguments.items() if key in plot.parameters}
        verdict = judge(plot, own[name], world)
        if verdict.fits and excluded is not None and (reason := excluded.reason(name, own[name])):
            verdict = Verdict(name, fits=False, reason=reason)
        if verdict.fits and state.choose == "learned":
            tries = experience.of(holder, name, situation) or experience.of(plot.implements or "", name, ())
            verdict = _with_tries(verdict, tries)
        elif verdict.fits and state.choose != "order":
            verdict = replace(verdict, score=_score(plot, state.choose, own[name], world))
        verdicts.append(verdict)
        if verdict.fits:
            fitting.append(verdict)
    verdicts += [Verdict(name, fits=False, reason=NOT_INSTALLED) for name in state.candidates if name not in plots]
    explored = state.choose == "learned" and draw < state.explore and len(fitting) > 1
    if explored:
        best: Verdict | None = fitting[int(draw / state.explore * len(fitting))]
    else:
        best = min(fitting, key=partial(_rank, by=state.choose), default=None)
    chosen = None if best is None else best.plot
    chosen_arguments = own[chosen] if chosen is not None else {}
    if chosen is None and goal is not None:
        chosen = ACHIEVE
        budget = state.budget
        chosen_arguments = {
            "goal": to_text(goal), "holder": holder, "replans": budget.replans, "seconds": budget.seconds,
        }  # fmt: skip
    return Decision(
        chosen, chosen_arguments, verdicts=tuple(verdicts), version=version, by=state.choose, holder=holder,
        situation=truths, explored=explored,
    )  # fmt: skip


def judge(plot: ActionPlot, arguments: Mapping[str, Any], world: World) -> Verdict:
    """Return whether a candidate's condition is true for these arguments, with the part that determines the result."""
    if plot.when is None:
        return Verdict(plot.name, fits=True, reason="no condition")
    bindings = {**_defaults(plot), **arguments}
    why = explain(_plain(plot.when, bindings), world, scalars(bindings))
    return Verdict(plot.name, fits=why.truth, reason=str(why.deciding), explanation=why.to_json())


def _score(plot: ActionPlot, by: Choice, arguments: Mapping[str, Any], world: World) -> float | None:
    """Return the number by which a candidate is chosen; `None` if it declares none, or if a part of it is unknown."""
    term = plot.scores().get(by)
    if term is None:
        return None
    bindings = {**_defaults(plot), **arguments}
    found = evaluate_term(plain_term(term, Values(bindings)), world, scalars(bindings))
    return None if isinstance(found, bool) or not isinstance(found, int | float) else float(found)


def _rank(verdict: Verdict, by: Choice) -> float:
    """Return a number that is smallest for the candidate to choose; `min` takes the first of equal ones."""
    if verdict.score is None:
        return math.inf
    return verdict.score if by in {"cost", "learned"} else -verdict.score


def _with_tries(verdict: Verdict, tries: Tries | None) -> Verdict:
    """Return the verdict with the expected time until success; without a try, it is unknown."""
    return verdict if tries is None else replace(verdict, score=tries.time_to_success, learned=str(tries))


def _plain(condition: Expression, bindings: Mapping[str, Any]) -> Expression:
    """Return the condition with the values of the data that it reads."""
    return plain_condition(condition, Values(bindings)) if reads_data(condition) else condition


def _argument(term: Term, world: World, bindings: Mapping[str, Any]) -> Any:
    if isinstance(term, Variable):
        return Values(bindings).value(term.name)
    return plain(evaluate_term(plain_term(term, Values(bindings)), world, bindings))


def _defaults(plot: ActionPlot) -> dict[str, Any]:
    return {
        name: parameter.default.value
        for name, parameter in plot.parameters.items()
        if isinstance(parameter.default, Constant)
    }


def plain(content: Content) -> Any:
    """Return a value of the knowledge base as plain JSON: a geometry as a list of numbers, an unknown one as `None`."""
    return (list(content) or None) if isinstance(content, tuple) else content


def scalars(bindings: Mapping[str, Any]) -> dict[str, Any]:
    """Return the bindings that a condition can read: strings, numbers and truth values, without plots or lists."""
    return {name: value for name, value in bindings.items() if isinstance(value, str | int | float | bool)}

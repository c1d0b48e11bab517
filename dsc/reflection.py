"""The design in the knowledge base: plots, their rules, components and skills as objects of queries (S1.6, S1.13).

At run time, queries reach the design in the same graph and language as the world. The design includes the plots that
implement a planning action, the components that offer a skill, and the rules that react to a failure.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from dsc.dynamic.library import Library
from dsc.dynamic.steps import candidates_of
from dsc.model.actions import Trigger
from dsc.model.plot import ActionPlot
from dsc.model.rules import Handler, Rule
from dsc.model.states import DynamicState, State, SubmachineState
from dsc.skills import SkillSignature
from knowledge_base.facts import Delta, Fact, fact
from knowledge_base.world.schema import Schema

MODELS = Schema.parse(
    """(define (domain models)
  (:types model - object  action-plot component skill planning-action reaction - model  rule handler - reaction)
  (:predicates
    (implements ?p - action-plot ?a - planning-action)
    (uses ?p ?part - action-plot)
    (candidate ?p ?part - action-plot ?state - text)
    (triggers ?p - action-plot ?s - skill)
    (offers ?c - component ?s - skill)
    (emits ?m - model ?event - text)
    (answers ?p - action-plot ?event - text ?response - text)
    (stands-in ?r - reaction ?p - action-plot)
    (reacts-to ?r - reaction ?event - text)
    (concerns ?r - rule ?step - text)
    (runs ?r - reaction ?part - action-plot)
    (leads-to ?r - rule ?next - text)))""",
    "models",
)
"""Predicates about the design; `Schema.merged` adds them to a world's schema."""


def design_facts(library: Library, skills: Iterable[SkillSignature] = ()) -> Delta:
    """Return the design as one change for a knowledge base whose schema includes `MODELS`.

    The name of each object has its kind as prefix, which distinguishes it from objects of the world: `plot:search`,
    `skill:arm.grasp`, `component:arm`, `action:pick-up`, `rule:search.1`, `handler:patrol.1`. Rules and handlers are
    numbered from 1 within their plot. An `answers` fact states a plot's rule for an outcome, with the rule's label. A
    `concerns` fact states a plan step of a rule. A `leads-to` fact states the continuation after a rule's response.

    Args:
        library: the plots.
        skills: the skills of the deployed components.
    """
    nodes: dict[str, str] = {}
    facts: dict[Fact, None] = {}
    for said in (*_skills(skills), *(one for plot in library for one in _plot(plot, library))):
        if isinstance(said, Fact):
            facts[said] = None
        else:
            nodes.update([said])
    return Delta(nodes=nodes, added=tuple(facts))


_Said = Fact | tuple[str, str]
"""A fact, or an object with its type."""


def _skills(skills: Iterable[SkillSignature]) -> Iterator[_Said]:
    for one in skills:
        component, skill = f"component:{one.component}", f"skill:{one.component}.{one.name}"
        yield component, "component"
        yield skill, "skill"
        yield fact("offers", component, skill)
        yield from (fact("emits", skill, event) for event in one.outcomes)


def _plot(plot: ActionPlot, library: Library) -> Iterator[_Said]:
    name = f"plot:{plot.name}"
    yield name, "action-plot"
    yield from (fact("emits", name, event) for event in plot.emits)
    if plot.implements is not None:
        action = f"action:{plot.implements}"
        yield action, "planning-action"
        yield fact("implements", name, action)
    for number, rule in enumerate(plot.rules, start=1):
        yield from _rule(name, f"rule:{plot.name}.{number}", rule)
    for number, handler in enumerate(plot.handlers, start=1):
        yield from _handler(name, f"handler:{plot.name}.{number}", handler)
    for state_name, state, _ in plot.walk():
        if isinstance(state, DynamicState):
            for candidate in candidates_of(state, library):
                yield from _part(name, candidate.name)
                yield fact("candidate", name, f"plot:{candidate.name}", state_name)
        if isinstance(state, SubmachineState) and not state.use.startswith("?"):
            yield from _part(name, state.use)
        if isinstance(state, State):
            yield from _triggers(name, state)


def _rule(plot: str, name: str, rule: Rule) -> Iterator[_Said]:
    yield name, "rule"
    yield fact("stands-in", name, plot)
    if rule.on is not None:
        yield fact("answers", plot, rule.on, rule.label)
        yield fact("reacts-to", name, rule.on)
    yield from (fact("concerns", name, step) for step in rule.steps)
    yield from (fact("leads-to", name, then) for then in sorted({one.then for one in rule.continuations}))
    yield from _run(plot, name, rule.do.use)


def _handler(plot: str, name: str, handler: Handler) -> Iterator[_Said]:
    yield name, "handler"
    yield fact("stands-in", name, plot)
    yield fact("reacts-to", name, handler.on)
    yield from _run(plot, name, handler.do.use)
    if handler.listen is not None:
        yield f"skill:{handler.listen.trigger}", "skill"
        yield fact("triggers", plot, f"skill:{handler.listen.trigger}")


def _run(plot: str, reaction: str, part: str | None) -> Iterator[_Said]:
    if part is not None:
        yield from _part(plot, part)
        yield fact("runs", reaction, f"plot:{part}")


def _part(name: str, part: str) -> Iterator[_Said]:
    yield f"plot:{part}", "action-plot"
    yield fact("uses", name, f"plot:{part}")


def _triggers(name: str, state: State) -> Iterator[_Said]:
    for _, actions in state.blocks():
        for action in actions:
            if isinstance(action, Trigger):
                yield f"skill:{action.trigger}", "skill"
                yield fact("triggers", name, f"skill:{action.trigger}")

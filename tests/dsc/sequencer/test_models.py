"""The design is asked about in the same graph and words as the world."""

from __future__ import annotations

import pytest

from domains.clean_up_table.bringup import bundle, deploy
from dsc.dynamic.library import Library
from dsc.reflection import MODELS, design_facts
from dsc.text.plot_files import parse_plot
from knowledge_base import KnowledgeBase


@pytest.fixture(scope="module")
def kb() -> KnowledgeBase:
    with deploy() as robot:
        skills = [signature for component in robot.components for signature in component.skills().values()]
        kb = KnowledgeBase(robot.domain.schema.merged(MODELS))
        kb.apply(design_facts(robot.library, skills), author="design")
    return kb


def named(kb: KnowledgeBase, query: str, variable: str) -> set[str]:
    return {str(answer[variable]) for answer in kb.query(query)}


def test_which_plots_carry_out_an_action(kb) -> None:
    plots = named(kb, "(implements ?p action:pick-up)", "p")
    assert plots == {"plot:pick_up_from_above", "plot:pick_up_from_side"}


def test_who_offers_what_may_fail_like_that_and_which_plot_answers(kb) -> None:
    failing = '(and (emits ?s "grasp_failed") (skill ?s) (offers ?c ?s))'
    assert named(kb, failing, "c") == {"component:arm"}
    assert "plot:clean_up_table" in named(kb, '(answers ?p "grasp_failed" ?how)', "p")
    assert kb.ask(
        '(forall (?s - skill) (imply (emits ?s "grasp_failed") (exists (?p - action-plot) (triggers ?p ?s))))'
    )


def test_which_rule_answers_what_and_what_it_leads_to(kb) -> None:
    answering = '(and (reacts-to ?r "slipped") (stands-in ?r plot:clean_up_table) (leads-to ?r ?next))'
    (answer,) = kb.query(answering)
    assert answer["next"] == "replan"
    assert kb.ask("(runs ?r plot:pick_up_from_above)", {"r": answer["r"]})


def test_insertions_and_handlers_are_known_too() -> None:
    plots = [parse_plot(text) for text in (PATROL, "{plot: wipe, states: {e: {final: true}}}")]
    kb = KnowledgeBase(MODELS)
    kb.apply(design_facts(Library(plots)), author="design")
    assert named(kb, '(and (rule ?r) (concerns ?r "look") (runs ?r plot:wipe))', "r") == {"rule:patrol.1"}
    assert named(kb, '(and (handler ?h) (reacts-to ?h "low"))', "h") == {"handler:patrol.1"}
    assert kb.ask("(and (triggers plot:patrol skill:battery.low) (uses plot:patrol plot:wipe))")


PATROL = """
plot: patrol
states: {look: {use: wipe, on: {done: e}}, e: {final: true}}
rules: [{before: look, do: {use: wipe}}]
handlers: [{on: low, listen: {trigger: battery.low}, do: {use: wipe}}]
"""


def test_everything_that_a_plot_uses_is_there(kb) -> None:
    library = Library(bundle().plots)
    for plot in library:
        assert named(kb, f"(uses plot:{plot.name} ?part)", "part") == {f"plot:{part}" for part in plot.uses()}


def test_the_design_and_the_world_are_one_graph(kb) -> None:
    offered = [skill for _, skill, key in kb.graph.out_edges("component:arm", keys=True) if key == "offers"]
    assert offered
    assert {kb.graph.nodes[skill]["type"] for skill in offered} == {"skill"}
    assert set(offered) == named(kb, "(offers component:arm ?s)", "s")

"""Choosing content on a knowledge base: by condition and order, with a record that says why (not)."""

from __future__ import annotations

from typing import Annotated

import pytest
from dsc_charts import FakeSituation, plot

from dsc.components.component import Component
from dsc.dynamic.knowledge_situation import ACHIEVE, KnowledgeSituation
from dsc.dynamic.library import MOST_BOUND, Library
from dsc.dynamic.steps import outcomes_of
from dsc.engine.machine import Machine
from dsc.engine.situation import Decision
from dsc.events import Event
from dsc.outcomes import Outcome
from dsc.skills import primitive_plot, skill
from knowledge_base.errors import InputError, SchemaError, UnknownNameError
from knowledge_base.facts import Delta, Fact, fact
from knowledge_base.language.syntax.text import parse_condition, parse_effect, parse_term
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema import Schema

SCHEMA = Schema.parse("""
    (define (domain kitchen)
      (:types item place - object cup can - item)
      (:predicates (on ?i - item ?p - place) (held ?i - item) (tidy ?i - item) (busy))
      (:functions (failures ?i - item)))
""")


@pytest.fixture
def kb():
    made = KnowledgeBase(SCHEMA)
    made.apply(
        Delta(
            nodes={"cup1": "cup", "can1": "can", "table": "place"},
            added=(fact("on", "cup1", "table"), fact("on", "can1", "table")),
            values={fact("failures", "can1"): 2},
        ),
        "test",
    )
    return made


ABOVE = "{plot: above, parameters: {item: item}, when: (= (failures ?item) 0), states: {s: }}"
SIDE = "{plot: side, parameters: {item: item}, when: (and (on ?item table) (> (failures ?item) 0)), states: {s: }}"
ANYHOW = "{plot: anyhow, parameters: {item: item}, states: {s: }}"
ACHIEVER = """
    plot: achieve
    parameters: {goal: condition, holder: text, replans: number, seconds: number}
    emits: {no_plan: {reason: text}, gave_up: {reason: text}}
    states: {s: }
"""


def holder(dynamic, name="p"):
    return plot(f"""
        plot: {name}
        parameters: {{item: item}}
        states:
          h: {{{dynamic}, on: {{done: fine, no_candidate: sad}}}}
          fine:
          sad:
    """)


class Chosen:
    def __init__(self, kb, dynamic, *plots, item="cup1"):
        library = Library([holder(dynamic), *map(plot, plots)])
        self.machine = Machine(library)
        self.step = self.machine.start("p", {"item": item}, KnowledgeSituation(kb, library))
        decisions = [made.decision for made in self.step.decisions]
        self.decision = decisions[0] if decisions else None
        self.active = self.machine.state.configuration()


# -- candidates --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("item", "expected"), [("cup1", "above"), ("can1", "side")])
def test_the_candidate_whose_condition_holds_is_chosen(kb, item, expected):
    chosen = Chosen(kb, "dynamic: [above, side], with: {item: ?item}", ABOVE, SIDE, item=item)
    assert chosen.decision.chosen == expected
    assert chosen.decision.arguments == {"item": item}
    assert chosen.active == ("h", "h/s")


def test_of_several_the_first_in_the_list_is_chosen_and_the_others_are_judged_too(kb):
    chosen = Chosen(kb, "dynamic: [anyhow, above], with: {item: ?item}", ABOVE, ANYHOW)
    assert chosen.decision.chosen == "anyhow"
    assert [(v.plot, v.fits) for v in chosen.decision.verdicts] == [("anyhow", True), ("above", True)]
    chosen = Chosen(kb, "dynamic: [above, anyhow], with: {item: ?item}", ABOVE, ANYHOW)
    assert chosen.decision.chosen == "above"


def test_the_record_says_why_not_with_the_leaf_that_decides(kb):
    kb.apply(Delta(removed=(fact("on", "can1", "table"),)), "test")
    chosen = Chosen(kb, "dynamic: [above, side], with: {item: ?item}", ABOVE, SIDE, item="can1")
    above, side = chosen.decision.verdicts
    assert not above.fits
    assert above.reason == "(= (failures can1) 0) is false: 2 = 0"
    assert not side.fits
    assert side.reason.startswith("(on can1 table)")
    assert side.explanation["truth"] is False
    assert [child["truth"] for child in side.explanation["children"]] == [False, True]


def test_the_record_names_the_version_of_the_knowledge(kb):
    kb.apply(Delta(added=(Fact("busy"),)), "test")
    assert Chosen(kb, "dynamic: [above], with: {item: ?item}", ABOVE).decision.version == kb.version == 2


def test_nothing_that_fits_is_no_candidate(kb):
    chosen = Chosen(kb, "dynamic: [side], with: {item: ?item}", SIDE)
    assert chosen.decision.chosen is None
    assert chosen.active == ("sad",)


def test_candidates_take_the_arguments_they_have_and_defaults_for_the_rest(kb):
    fast = "{plot: fast, parameters: {speed: {type: number, default: 3}}, when: (> ?speed 2), states: {s: }}"
    chosen = Chosen(kb, "dynamic: [fast, anyhow], with: {item: ?item}", fast, ANYHOW)
    assert chosen.decision.chosen == "fast"
    assert chosen.decision.arguments == {}
    frame = chosen.machine.state.root.children["h"]
    assert frame.variables == {"speed": 3}


def test_a_choice_counts_the_values_changed_in_its_macrostep(kb):
    text = """
        plot: p
        states:
          a: {on: {go: {to: h, tell: (increase (failures cup1) 1)}}}
          h: {dynamic: [above, side], with: {item: cup1}}
    """
    library = Library([plot(text), plot(ABOVE), plot(SIDE)])
    machine = Machine(library)
    machine.start("p", {}, KnowledgeSituation(kb, library))
    step = machine.send(Event("go"), KnowledgeSituation(kb, library))
    assert step.decisions[0].decision.chosen == "side"
    assert step.knowledge.values == {fact("failures", "cup1"): 1}
    assert kb.value("failures", ("cup1",)) == 0  # the knowledge base itself is not touched


@pytest.mark.parametrize(
    ("dynamic", "candidate"),
    [
        ("dynamic: [anyhow], with: {item: ?nope}", ANYHOW),
        ("dynamic: [anyhow]", ANYHOW),
        ("dynamic: [above]", ABOVE),
        ("dynamic: [odd]", "{plot: odd, when: (nonsense), states: {s: }}"),
    ],
)
def test_an_impossible_candidate_is_an_error_of_the_chart(kb, dynamic, candidate):
    chosen = Chosen(kb, dynamic, candidate)
    assert len(chosen.step.errors) == 1
    assert chosen.active == ("h",)


def test_a_variable_that_holds_a_plot_does_no_harm(kb):
    text = """
        plot: p
        parameters: {made: plot, item: item}
        states:
          a: {on: {go: {to: h, when: (on ?item table), tell: (held ?item)}}}
          h: {dynamic: [anyhow], with: {item: ?item}, goal: (tidy ?item)}
    """
    library = Library([plot(text), plot(ANYHOW)])
    machine = Machine(library)
    machine.start("p", {"made": {"plot": "x", "states": {"s": {}}}, "item": "cup1"}, KnowledgeSituation(kb, library))
    step = machine.send(Event("go", {"more": {"a": 1}}), KnowledgeSituation(kb, library))
    assert step.errors == ()
    assert step.decisions[0].decision.chosen == "anyhow"


# -- goals -------------------------------------------------------------------------------------------------

GOAL = "goal: (forall (?i - item) (imply (on ?i table) (tidy ?i)))"


def test_a_goal_that_holds_needs_no_content(kb):
    kb.apply(Delta(added=(fact("tidy", "cup1"), fact("tidy", "can1"))), "test")
    chosen = Chosen(kb, f"dynamic: [anyhow], {GOAL}, with: {{item: ?item}}", ANYHOW, ACHIEVER)
    assert chosen.decision == Decision(None, satisfied=True, version=2)
    assert chosen.active == ("fine",)


def test_a_designed_candidate_comes_before_the_planner(kb):
    chosen = Chosen(kb, f"dynamic: [anyhow], {GOAL}, with: {{item: ?item}}", ANYHOW, ACHIEVER)
    assert chosen.decision.chosen == "anyhow"


def test_with_no_candidate_that_fits_the_goal_is_to_be_achieved(kb):
    dynamic = f"dynamic: [side], {GOAL}, with: {{item: ?item}}, budget: {{replans: 2, seconds: 3}}"
    chosen = Chosen(kb, dynamic, SIDE, ACHIEVER)
    assert chosen.decision.chosen == ACHIEVE
    assert chosen.decision.arguments == {
        "goal": "(forall (?i - item) (imply (on ?i table) (tidy ?i)))",
        "holder": "p", "replans": 2, "seconds": 3.0,
    }  # fmt: skip
    assert [v.plot for v in chosen.decision.verdicts] == ["side"]
    assert chosen.active == ("h", "h/s")


def test_the_goal_is_told_with_its_variables_filled_in(kb):
    chosen = Chosen(kb, "goal: (and (tidy ?item) (exists (?item - can) (held ?item)))", ACHIEVER)
    assert chosen.decision.arguments["goal"] == "(and (tidy cup1) (exists (?item - can) (held ?item)))"


def test_a_goal_with_a_variable_without_value_is_an_error(kb):
    assert len(Chosen(kb, "goal: (tidy ?nope)", ACHIEVER).step.errors) == 1


# -- the window on the knowledge ---------------------------------------------------------------------------


def test_the_situation_shows_one_version_with_what_was_told_on_top(kb):
    situation = KnowledgeSituation(kb, Library())
    told = situation.tell(parse_effect("(and (held ?i) (not (on ?i table)))"), {"i": "cup1"})
    assert told == Delta(removed=(fact("on", "cup1", "table"),), added=(fact("held", "cup1"),))
    assert situation.holds(parse_condition("(and (held cup1) (not (on cup1 table)))"), {})
    assert not kb.ask("(held cup1)")
    assert situation.value(parse_term("(+ (failures can1) ?n)"), {"n": 1}) == 3


def test_a_free_variable_is_an_error_that_says_what_to_do(kb):
    situation = KnowledgeSituation(kb, Library())
    with pytest.raises(InputError, match="exists"):
        situation.holds(parse_condition("(on ?x table)"), {})


# -- the library -------------------------------------------------------------------------------------------


def test_the_library_finds_plots_and_names_the_nearest():
    library = Library([plot(ABOVE), plot(SIDE)])
    assert "above" in library
    assert "below" not in library
    assert [p.name for p in library] == ["above", "side"]
    with pytest.raises(UnknownNameError, match="did you mean 'above'"):
        library.plot("abov")


def test_a_plot_may_be_added_twice_but_not_two_of_one_name():
    library = Library([plot(ABOVE), plot(ABOVE)])
    assert len(list(library)) == 1
    with pytest.raises(SchemaError, match="two different plots are named 'above'"):
        library.add(plot(SIDE.replace("side", "above")))


def test_plots_that_implement_an_action_come_in_the_order_of_the_library():
    one, two = (
        plot("{plot: one, implements: pick, states: {s: }}"),
        plot("{plot: two, implements: pick, states: {s: }}"),
    )
    assert Library([two, one, plot(ABOVE)]).implementing("pick") == (two, one)


def test_equal_plots_bound_as_values_share_their_tables():
    library = Library()
    form = {"plot": "made", "states": {"s": {}}}
    assert library.bind(form) is library.bind(dict(form))


def test_plots_bound_as_values_are_not_kept_for_ever():
    library = Library()
    forms = [{"plot": f"made{n}", "states": {"s": {}}} for n in range(MOST_BOUND + 1)]
    first, second = library.bind(forms[0]), library.bind(forms[1])
    for form in forms[2:]:
        library.bind(forms[0])
        library.bind(form)
    assert library.bind(forms[0]) is first
    assert library.bind(forms[1]) is not second


def test_the_outcomes_of_a_state_are_those_of_what_it_uses():
    grasp = plot("{plot: grasp, emits: {failed: {item: item}}, states: {s: }}")
    library = Library([grasp, plot(ANYHOW)])
    states = plot("""
        plot: p
        states:
          a: {use: grasp}
          b: {dynamic: [anyhow, grasp]}
          c: {dynamic: [grasp], goal: (busy)}
          d: {use: ?what}
          e:
    """).states
    assert set(outcomes_of(states["a"], library)) == {"failed"}
    assert set(outcomes_of(states["b"], library)) == {"failed", "no_candidate"}
    assert set(outcomes_of(states["c"], library)) == {"failed", "no_plan", "gave_up"}
    assert outcomes_of(states["d"], library) == outcomes_of(states["e"], library) == {}


# -- skills as plots ---------------------------------------------------------------------------------------


Item = Annotated[str, "item"]


class Grasped(Outcome): ...


class Slipped(Outcome):
    item: Item


class Arm(Component):
    name = "arm"

    @skill
    async def grasp(self, call, item: Item) -> Grasped | Slipped:
        return Grasped()


def test_a_skill_alone_makes_a_plot():
    made = primitive_plot(Arm().skills()["grasp"], done="grasped", when="(not (held ?item))")
    library = Library([made])
    machine = Machine(library)
    step = machine.start("grasp", {"item": "cup1"}, FakeSituation())
    assert step.output[0].arguments == {"item": "cup1"}
    serial = machine.state.root.active["execute"]
    step = machine.send(Event("slipped", {"item": "cup1"}, to=serial), FakeSituation())
    assert step.emitted == (Event("slipped", {"item": "cup1"}),)
    assert step.state.finished
    with pytest.raises(UnknownNameError, match="did you mean 'grasped'"):
        primitive_plot(Arm().skills()["grasp"], done="grsped")

"""The testing kit where a planner is in the loop: stand-ins, scripted skills and coverage under a robot."""

from __future__ import annotations

from typing import Annotated, Any

import pytest

from dsc import Component, Library, Outcome, SkillCall, parse_plot, primitive_plot, skill
from dsc.errors import PlotError
from dsc.testing import Answer, Coverage, ScriptedSkills, ends_with, entered, started, world
from knowledge_base import InputError
from planning import Plan, PlanningDomain, PlanStep, Robot
from planning.model.plan import PlanFound

DOMAIN = PlanningDomain.parse("""
(define (domain lights)
  (:types lamp)
  (:predicates (on ?l - lamp) (broken ?l - lamp))
  (:action switch-on :parameters (?lamp - lamp) :precondition (not (broken ?lamp)) :effect (on ?lamp)))
""")
LIGHT_UP = parse_plot("""
plot: light_up
states:
  lighting:
    goal: (forall (?l - lamp) (on ?l))
    on: {done: lit, no_plan: dark, gave_up: dark}
  lit: {final: true}
  dark: {final: true}
rules:
  - on: blown
    do: {then: retry, limit: 1}
  - on: blown
    do: {tell: (broken ?event.lamp), then: give_up}
""")


Lamp = Annotated[str, "lamp"]


class Lit(Outcome): ...


class Blown(Outcome):
    lamp: Lamp


class Lamps(Component):
    name = "lamps"

    @skill
    async def light(self, call: SkillCall, lamp: Lamp) -> Lit | Blown:
        raise AssertionError("nobody calls the real one")


class OnePlan:
    async def solve(self, problem, seconds):
        return PlanFound(Plan(tuple(PlanStep("switch-on", (lamp,)) for lamp in "ab")), "fake", 0.0, 0.1)


LIGHT = primitive_plot(Lamps().skills()["light"], done="lit", name="light", implements="switch-on")
PLOTS = Library([LIGHT_UP, LIGHT])


def light_up(replies, plots=PLOTS):
    knowledge = world(DOMAIN.schema, "a b - lamp")
    skills = ScriptedSkills(knowledge, {"lamps.light": replies}, like=[Lamps()])
    robot = Robot(DOMAIN, plots, skills.components, knowledge, planner=OnePlan(), clock="simulated")
    steps: list[Any] = []
    coverage = Coverage(plots)

    def prepare(sequencer):
        sequencer.listen(steps.append)
        sequencer.listen(coverage.add)

    robot.run("light_up", prepare=prepare)
    return skills, steps, coverage


LIT = Answer("lit", observed="(on ?lamp)")


def test_scripted_skills_carry_out_a_plan():
    skills, steps, coverage = light_up(LIT)
    skills.check()
    assert [call.arguments for call in skills.calls] == [{"lamp": "a"}, {"lamp": "b"}]
    assert started(steps, "lamps.light", lamp="b")
    assert entered(steps, "lit")
    assert {item.text for item in coverage.missing("light_up") if item.kind == "rule"} == {
        "rule 'blown: retry' never answered", "rule 'blown: give_up' never answered",
    }  # fmt: skip


def test_rules_that_answer_inside_a_plan_count_for_the_plot_that_has_them():
    skills, steps, coverage = light_up([LIT, *[Answer("blown", {"lamp": "b"})] * 2])
    assert len(skills.calls) == 3
    assert entered(steps, "dark")
    assert coverage.count("light_up", "rule") == (2, 2)
    assert coverage.count("light", "transition") == (2, 2)


def test_an_executive_runs_with_a_stand_in_for_one_of_its_plots():
    substituted = ends_with(LIGHT, tell="(on ?lamp)", after=1)
    skills, steps, coverage = light_up("lit", PLOTS.substitute("light", substituted))
    assert skills.calls == []
    assert entered(steps, "lit")
    assert entered(steps, "standing_in")
    assert coverage.count("light", "state") == (2, 2)  # of the stand-in, which this coverage is about


def test_a_script_without_an_answer_is_reported_by_its_check():
    skills, steps, _ = light_up([LIT])
    assert not entered(steps, "lit")
    with pytest.raises(InputError, match=r"the script of 'lamps.light' has no answer to call 2"):
        skills.check()


def test_free_components_declare_nothing_so_an_executive_refuses_their_arguments():
    knowledge = world(DOMAIN.schema, "a b - lamp")
    skills = ScriptedSkills(knowledge, {"lamps.light": ["lit", Answer("blown", {"lamp": "a"})]})
    with pytest.raises(PlotError, match="has no parameter 'lamp'"):
        Robot(DOMAIN, PLOTS, skills.components, knowledge, planner=OnePlan(), clock="simulated")

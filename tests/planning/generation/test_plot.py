"""From plan to plot: the generated plot is a plot like any other, and says what each step needs."""

from typing import Any

import pytest

from dsc import ActionPlot, Library, parse_plot, validate_plot
from dsc.text.plot_files import plot_to_yaml
from knowledge_base import UnknownNameError
from knowledge_base.language.syntax.text import to_text
from planning import Plan, PlanningDomain, PlanStep, plot_from_plan
from planning.generation.carried_steps import Carrier

DOMAIN = PlanningDomain.parse("""
(define (domain delivery)
  (:requirements :strips :typing)
  (:types room parcel)
  (:predicates (robot-in ?r - room) (in ?p - parcel ?r - room) (holding ?p - parcel) (free))
  (:action go :parameters (?from ?to - room) :precondition (robot-in ?from)
    :effect (and (not (robot-in ?from)) (robot-in ?to)))
  (:action take :parameters (?parcel - parcel ?room - room) :precondition (and (robot-in ?room) (in ?parcel ?room) (free))
    :effect (and (not (in ?parcel ?room)) (not (free)) (holding ?parcel))))
""")


def primitive(name, implements, parameters, *, effects="observed", emits=()):
    on = {"finished": "completed"} | {event: {"to": "ended", "emit": event, "with": {}} for event in emits}
    return ActionPlot.model_validate({
        "plot": name, "implements": implements, "parameters": parameters, "effects": effects,
        "emits": {event: {} for event in emits},
        "states": {"do": {"entry": {"trigger": "robot.act"}, "on": on}, "completed": {"final": True},
                   **({"ended": {"final": True}} if emits else {})},
    })  # fmt: skip


GO = primitive("drive", "go", {"to": "room"})
CREEP = primitive("creep", "go", {"from": "room", "to": "room"})
TAKE = primitive("grasp", "take", {"parcel": "parcel"}, effects="assumed", emits=("slipped", "stuck"))
PLAN = Plan((PlanStep("go", ("hall", "store")), PlanStep("take", ("box", "store"))))


def made(rules=(), library=None):
    return plot_from_plan(PLAN, DOMAIN, library or Library([GO, CREEP, TAKE]), rules, "plan_1")


def test_every_step_is_a_dynamic_state_over_the_plots_that_implement_its_action():
    first, second = (made().state(f"step_{n}") for n in (1, 2))
    assert (first.dynamic, second.dynamic) == (("drive", "creep"), ("grasp",))
    assert {name: term.value for name, term in first.arguments.items()} == {"from": "hall", "to": "store"}
    assert first.about == "(go hall store)"


def test_a_step_gets_only_the_arguments_that_some_candidate_takes():
    assert set(made().state("step_2").arguments) == {"parcel"}


def test_effects_are_waited_for_when_observed_and_told_when_assumed():
    observed, assumed = made().state("after_1"), made().state("step_2")
    assert observed.after[0].target == "replan"
    assert made().state("after_2").after == ()
    (done,) = assumed.on["done"]
    assert done.tell is not None


def test_assumed_effects_are_told_whole_also_what_depends_on_the_world():
    domain = PlanningDomain.parse("""
(define (domain boxes)
  (:types box thing)
  (:predicates (in ?t - thing ?b - box) (gone ?t) (emptied ?b - box))
  (:functions (weight ?b - box))
  (:action empty :parameters (?box - box)
    :effect (and (emptied ?box) (assign (weight ?box) 0)
                 (forall (?t - thing) (when (in ?t ?box) (and (gone ?t) (not (in ?t ?box))))))))
""")
    empty = primitive("tip_over", "empty", {"box": "box"}, effects="assumed")
    plot = plot_from_plan(Plan((PlanStep("empty", ("b1",)),)), domain, Library([empty]))
    tell = plot.state("step_1").on["done"][0].tell
    assert tell is not None
    assert to_text(tell) == (
        "(and (emptied b1) (assign (weight b1) 0)"
        " (forall (?t - thing) (when (in ?t b1) (and (gone ?t) (not (in ?t b1))))))"
    )


def test_a_generated_plot_is_yaml_like_any_other():
    text = plot_to_yaml(made())
    assert parse_plot(text).to_form() == made().to_form()
    assert "(not (robot-in hall))" in text


def test_a_generated_plot_passes_the_validator():
    library = Library([GO, CREEP, TAKE])
    assert validate_plot(made(library=library), library, DOMAIN.schema) == []


def test_it_inherits_the_rules_that_concern_its_steps_and_replans_for_the_rest():
    holder = parse_plot("""
plot: holder
states: {s: {dynamic: [grasp], on: {done: e, no_candidate: e}}, e: {final: true}}
rules:
  - {on: slipped, do: {then: retry}}
  - {on: unknown_here, do: {then: retry}}
""")
    library = Library([GO, CREEP, TAKE, holder])
    plot = made(holder.rules, library)
    assert [rule.on for rule in plot.rules] == ["slipped"]
    step = library.expanded(plot).state("step_2")
    assert [t.target for t in step.on["slipped"]] == ["step_2_again", "replan"]
    assert [t.target for t in step.on["stuck"]] == ["replan"]


CLEAN = parse_plot("""
plot: clean
parameters: {parcel: parcel}
states: {c: {entry: {trigger: brush.sweep, within: 7}, on: {done: e}}, e: {final: true}}
""")
INSERTING = parse_plot("""
plot: holder
states: {s: {goal: (free), on: {done: e, no_plan: e, gave_up: e}}, e: {final: true}}
rules:
  - {before: [take, s], when: (in ?step.parcel store), do: {use: clean, with: {parcel: ?step.parcel}}}
  - {before: go, when: (robot-in ?step.to), do: {then: continue}}
  - {after: fly, do: {use: clean}}
  - {before: s, do: {then: give_up}}
""")


def test_it_inherits_what_is_inserted_before_its_steps_and_which_are_left_out():
    library = Library([GO, TAKE, CLEAN, INSERTING])
    plot = made(INSERTING.rules, library)
    assert [rule.label for rule in plot.rules] == ["before take: clean", "before go: continue"]
    expanded = library.expanded(plot)
    go: Any = expanded.state("step_1_before_1")
    take: Any = expanded.state("step_2_before_0")
    assert [(to_text(way.guard), way.target) for way in go.choice[:-1]] == [("(robot-in store)", "step_1_skipped")]
    assert to_text(take.choice[0].guard) == "(in box store)"
    assert expanded.state(take.choice[0].target).arguments["parcel"].value == "box"
    assert not expanded.state("step_1_skipped").after
    assert "step_2_skipped" not in {name for name, _, _ in expanded.walk()}


def test_a_step_takes_hold_of_what_is_inserted_before_it():
    library = Library([GO, TAKE, CLEAN, INSERTING])
    assert made(INSERTING.rules, library).state("step_2").after[0].seconds.value == 2 * (300 + 7)
    assert made((), library).state("step_2").after[0].seconds.value == 2 * 300


def test_an_action_without_a_plot_is_an_error_that_names_the_nearest():
    with pytest.raises(UnknownNameError, match="no plot implements the planning action 'take'"):
        made(library=Library([GO]))


def test_robots_that_share_a_domain_keep_the_steps_of_their_own_libraries():
    libraries = (Library([GO, TAKE]), Library([CREEP, TAKE]))
    first = [Carrier.of(DOMAIN, library, ()) for library in libraries]
    again = [Carrier.of(DOMAIN, library, ()) for library in libraries]
    assert first[0] is again[0]
    assert first[1] is again[1]
    assert [made(library=library).state("step_1").dynamic for library in libraries] == [("drive",), ("creep",)]

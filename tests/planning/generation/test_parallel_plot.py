"""Plans as regions side by side: who waits for whom, what never overlaps, and what ends a step early."""

import pytest

from dsc import ActionPlot, Component, Library, Outcome, parse_plot, skill, validate_plot
from dsc.drawing import draw
from dsc.skills import signatures
from dsc.text.plot_files import plot_to_yaml
from dsc.trace import Record
from knowledge_base import Delta, fact
from knowledge_base.errors import InputError
from knowledge_base.language.syntax.text import parse_condition, to_text
from planning import Plan, PlanningDomain, PlanStep, Robot, plot_from_plan
from planning.generation.carried_steps import fitting, usage
from planning.model.plan import PlanFound, Timing
from planning.ordering.causal_tracing import deordered
from planning.ordering.partial_order import PartialOrder

DOMAIN = PlanningDomain.parse("""
(define (domain lamps)
  (:requirements :typing :durative-actions)
  (:types lamp)
  (:predicates (on ?l - lamp) (power) (near ?l - lamp) (free ?l - lamp) (held ?l - lamp))
  (:functions (slowness ?l - lamp))
  (:action plug-in :parameters () :precondition () :effect (power))
  (:action approach :parameters (?lamp - lamp) :precondition () :effect (near ?lamp))
  (:action switch-on :parameters (?lamp - lamp) :precondition (and (power) (near ?lamp)) :effect (on ?lamp))
  (:durative-action screw-in :parameters (?lamp - lamp)
    :duration (and (>= ?duration 1) (<= ?duration (* 3 (slowness ?lamp))))
    :condition (and (at start (free ?lamp)) (over all (power)) (over all (held ?lamp)))
    :effect (and (at start (not (free ?lamp))) (at start (held ?lamp))
                 (at end (on ?lamp)) (at end (free ?lamp)) (at end (not (held ?lamp))))))
""")
GOAL = "(and (on a) (on b))"
PLAN = Plan((
    PlanStep("plug-in"), PlanStep("approach", ("a",)), PlanStep("approach", ("b",)),
    PlanStep("switch-on", ("a",)), PlanStep("switch-on", ("b",)),
))  # fmt: skip
ORDER = PartialOrder(PLAN.steps).restricted({(1, 4), (1, 5), (2, 4), (3, 5)})


def primitive(name, implements, component, *, parameters=("lamp",), when=None, emits=(), within=None):
    trigger = {"trigger": f"{component}.act", **({"within": within} if within else {})}
    on = {"acted": "over", **{event: {"to": "over", "emit": event} for event in emits}}
    return ActionPlot.model_validate({
        "plot": name, "implements": implements, "parameters": dict.fromkeys(parameters, "lamp"), "when": when,
        "emits": {event: {} for event in emits},
        "states": {"do": {"entry": trigger, "on": on}, "over": {"final": True}},
    })  # fmt: skip


def crew(*, switching=("x", "y"), **more):
    """Somebody plugs in; lamp `a` is the affair of one component, `b` of another."""
    plots = [primitive("plug", "plug-in", "socket", parameters=())]
    for action in ("approach", "switch-on", "screw-in"):
        for lamp, component in zip("ab", switching, strict=True):
            plots.append(primitive(f"{action}_{lamp}", action, component, when=f"(= ?lamp {lamp})", **more))
    return Library(plots)


def made(library=None, order=ORDER, plan=PLAN, **more):
    return plot_from_plan(plan, DOMAIN, library or crew(), name="plan_1", order=order, **more)


def lanes(plot):
    if "work" not in plot.states:
        return [[int(name[5:]) for name in plot.states if name.startswith("step_")]]
    regions = plot.states["work"].regions.values()
    return [[int(name[5:]) for name in region.states if name.removeprefix("step_").isdigit()] for region in regions]


def guard(plot, state):
    """When the step after a state begins."""
    return to_text(plot.state(state).always[0].guard)


def test_chains_become_regions_named_after_who_works_there():
    plot = made()
    assert lanes(plot) == [[1], [2, 4], [3, 5]]
    assert list(plot.states["work"].regions) == ["socket", "x", "y"]


def test_a_step_waits_for_those_of_other_regions_and_says_so():
    plot = made()
    assert guard(plot, "before_4") == "(and (= ?done_1 true) (power) (near a))"
    assert plot.state("before_4").about == "waits for (plug-in)"
    (ended,) = plot.state("after_1").always
    assert {name: term.value for name, term in ended.assign.items()} == {"done_1": True}
    assert set(plot.variables) == {"reason", "done_1"}


def test_it_is_a_plot_like_any_other():
    plot, library = made(), crew()
    assert validate_plot(plot, library, DOMAIN.schema) == []
    assert parse_plot(plot_to_yaml(plot)) == plot
    assert "waits for (plug-in)" in draw(plot, library)


def test_steps_of_one_component_never_overlap():
    assert lanes(made(crew(switching=("x", "x")))) == [[1], [2, 3, 4, 5]]


def test_a_component_may_do_several_things_at_once():
    assert sorted(map(len, lanes(made(crew(switching=("x", "x")), shared=["x"])))) == [1, 2, 2]


def test_a_step_that_plans_for_itself_may_need_anything_and_is_alone():
    plots = [plot for plot in crew() if plot.implements != "plug-in"]
    planning = ActionPlot.model_validate({
        "plot": "plug", "implements": "plug-in",
        "states": {
            "how": {"goal": "(power)", "on": {"done": "over", "no_plan": "over", "gave_up": "over"}},
            "over": {"final": True},
        },
    })  # fmt: skip
    plot = made(Library([planning, *plots]))
    assert sorted(lanes(plot)) == [[1, 2, 4], [3, 5]]
    assert "(= ?done_1 true)" in guard(plot, "before_3")
    assert plot.state("step_1").after == ()  # nobody knows how long that takes


def test_components_used_by_rules_determine_the_lanes_too():
    library = crew(emits=("stuck",))
    library.add(primitive("help", None, "helper", parameters=()))
    rules = parse_plot("""
plot: holder
states: {s: {use: help, on: {done: e}}, e: {final: true}}
rules: [{on: stuck, do: {use: help, then: retry}}]
""").rules
    plot = plot_from_plan(PLAN, DOMAIN, library, rules, "plan_1", ORDER)
    assert lanes(plot) == [[1], [2, 3, 4, 5]]


def test_an_event_without_a_rule_leads_to_the_end_of_its_own_region():
    library = crew(emits=("stuck",))
    expanded = library.expanded(made(library))
    assert [t.target for t in expanded.state("step_2").on["stuck"]] == ["replan_2"]
    assert [t.target for t in expanded.state("step_3").on["stuck"]] == ["replan_3"]


def test_arguments_rule_out_candidates_that_can_never_fit():
    assert made().state("step_4").dynamic == ("switch-on_a",)
    plots = crew().implementing("approach")
    assert fitting(plots, {"lamp": "c"}) == plots  # then it is for the run to find that none fits


def test_usage_is_about_everything_that_plots_reach():
    library = crew()
    inner = primitive("inner", None, "drill", parameters=(), within=20.0)
    outer = parse_plot("""
plot: outer
states:
  a: {entry: {set: light.brightness, to: 1}, use: inner, exit: {switch: door, to: shut}, on: {done: b}}
  b: {final: true}
""")
    for plot in (inner, outer):
        library.add(plot)
    found = usage([outer], library)
    assert (found.components, found.seconds, found.anything) == (frozenset({"light", "drill", "door"}), 20.0, False)


def test_a_sketch_uses_plots_called_like_the_actions():
    plot = plot_from_plan(PLAN, DOMAIN, None, order=ORDER)
    assert plot.state("step_4").use == "switch-on"
    assert plot.uses() == {"plug-in", "approach", "switch-on"}
    assert sorted(map(len, lanes(plot))) == [1, 2, 2]
    assert not plot.state("step_4").entry
    missing = validate_plot(plot, Library(), DOMAIN.schema)
    assert "there is no plot 'plug-in'" in str(missing[0].error)


def test_a_schedule_is_kept_as_it_is():
    steps = tuple(PlanStep("approach", (lamp,)) for lamp in "aba")
    plan = Plan(steps, (Timing(0.0, 5.0), Timing(1.0, 2.0), Timing(5.0, 1.0)))
    plot = plot_from_plan(plan, DOMAIN, crew(), name="plan_1")
    assert lanes(plot) == [[1, 3], [2]]
    assert guard(plot, "before_2") == "(= ?begun_1 true)"
    assert guard(plot, "before_3") == "(= ?done_2 true)"


def test_a_schedule_fits_its_plan():
    with pytest.raises(InputError, match="a time for each of the 2 steps"):
        Plan(PLAN.steps[:2], (Timing(0.0),))
    with pytest.raises(InputError, match="by start"):
        Plan(PLAN.steps[:2], (Timing(1.0), Timing(0.0)))


SCREWING = Plan((PlanStep("screw-in", ("a",)),))


def test_a_step_has_as_long_as_its_action_says_and_again_as_long():
    (late,) = made(plan=SCREWING, order=None).state("step_1").after
    assert (to_text(late.seconds), late.target) == ("(* 2 (* 3 (slowness a)))", "replan")


def test_a_step_of_an_action_without_duration_has_what_its_skills_may_take():
    (late,) = made(crew(within=45.0)).state("step_2").after
    assert late.seconds.value == 90.0


def test_over_all_conditions_are_watched_unless_the_step_changes_them_itself():
    (watched,) = made(plan=SCREWING, order=None).state("step_1").always
    assert (to_text(watched.guard), watched.target) == ("(not (power))", "replan")


def test_a_durative_step_needs_its_place_for_itself_though_it_gives_it_back(world_of):
    nodes, facts = {"a": "lamp"}, [fact("free", "a"), fact("power")]
    world = world_of(DOMAIN.schema, nodes, facts)
    twice = Plan((*SCREWING.steps, *SCREWING.steps))
    assert deordered(twice, DOMAIN, world, parse_condition("(on a)")).before == {(1, 2)}


class Acted(Outcome): ...


class Worker(Component):
    """Does what its plots ask for, in the time that it is given."""

    concurrent = True

    def __init__(self, name, seconds, *observed):
        super().__init__(name)
        self.seconds, self.observed = seconds, Delta(added=observed)

    @skill
    async def act(self, call) -> Acted:
        await call.clock.sleep(self.seconds)
        return Acted(observed=self.observed)


class Answers:
    def __init__(self, plan):
        self.plan = plan

    async def solve(self, problem, seconds):
        return PlanFound(self.plan, "fake", 0.0, 0.0)


def executed(plan, goal, facts, *workers, change=None):
    """The states entered in the plan's plot, with times, and how the run ended."""
    plots = [*crew(switching=("worker", "worker"))]
    plots = [plot for plot in plots if plot.implements != "plug-in"]
    plots.append(primitive("plug", "plug-in", "worker", parameters=()))
    robot = Robot(DOMAIN, plots, workers, planner=Answers(plan), clock="simulated")
    robot.knowledge.apply(
        Delta(nodes=dict.fromkeys("ab", "lamp"), added=facts, values={fact("slowness", "a"): 1.0}), "me"
    )
    records: list[Record] = []
    robot.listen(records.append)
    arguments = {"goal": goal, "holder": "", "replans": 0, "seconds": 5}
    prepare = None if change is None else lambda sequencer: sequencer.change(change, "somebody", after=2.0)
    end = robot.run("achieve", arguments, prepare=prepare)
    entered = [
        (record.t, path.rpartition("/")[2])
        for record in records if record.type == "step"
        for micro in record.data["microsteps"] for path in micro["entered"]
    ]  # fmt: skip
    return [(t, name) for t, name in entered if name.startswith(("step", "replan"))], end


def test_a_step_begins_when_the_last_of_those_it_waits_for_is_done():
    worker = Worker("worker", 3.0, fact("power"), fact("near", "a"), fact("near", "b"))
    entered, end = executed(PLAN, GOAL, (), worker)
    assert entered[:3] == [(0.0, "step_1"), (0.0, "step_2"), (0.0, "step_3")]
    assert entered[3:5] == [(3.0, "step_4"), (3.0, "step_5")]
    assert end.finished


def test_an_over_all_condition_that_is_lost_ends_the_step_at_once():
    entered, end = executed(
        SCREWING, "(on a)", (fact("free", "a"), fact("power")), Worker("worker", 5.0, fact("on", "a")),
        change=Delta(removed=(fact("power"),)),
    )  # fmt: skip
    assert entered[0] == (0.0, "step_1")
    assert entered[1] == (2.0, "replan")
    assert end.emitted[-1].name == "gave_up"
    assert end.emitted[-1].attributes["reason"].endswith("lost during (screw-in a): (power)")


def test_a_step_that_takes_too_long_is_ended_and_tried_again_a_bounded_number_of_times():
    entered, end = executed(SCREWING, "(on a)", (fact("free", "a"), fact("power")), Worker("worker", 50.0))
    assert entered[:3] == [(0.0, "step_1"), (6.0, "replan"), (6.0, "step_1")]
    assert end.emitted[-1].name == "gave_up"
    assert end.emitted[-1].attributes["reason"].endswith("too slow: (screw-in a)")


def test_a_component_says_whether_it_can_do_several_things_at_once():
    assert signatures(Worker, "worker")["act"].outcomes == {"acted": {}}
    assert (Worker.concurrent, Component.concurrent) == (True, False)

"""What is kept from one plan to the next: the result is that of work done afresh, and there is an end to what is kept."""

import gc

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsc import ActionPlot, Component, Library, Outcome, SkillCall, skill
from knowledge_base import Delta, KnowledgeBase, fact
from knowledge_base.language.evaluation.lookups import conjuncts
from knowledge_base.language.syntax.text import parse_condition, parse_term
from knowledge_base.pddl.problem_text import Metric
from planning import Plan, PlanningDomain, PlanStep, Robot, build_problem, plot_from_plan
from planning.execution.regression import CausalNeeds, leaves, regressed
from planning.robot.garbage import settled

TEXT = """
(define (domain shelves) (:types shelf box)
  (:predicates (at ?s - shelf) (in ?b - box ?s - shelf) (holding ?b - box) (lit))
  (:action go :parameters (?from ?to - shelf) :precondition (at ?from) :effect (and (not (at ?from)) (at ?to)))
  (:action take :parameters (?b - box ?s - shelf) :precondition (and (at ?s) (in ?b ?s))
    :effect (and (not (in ?b ?s)) (holding ?b)))
  (:action put :parameters (?b - box ?s - shelf) :precondition (and (at ?s) (holding ?b) (or (lit) (in ?b ?s)))
    :effect (and (not (holding ?b)) (in ?b ?s) (when (lit) (not (lit))))))
"""
DOMAIN = PlanningDomain.parse(TEXT)
SHELVES, BOXES = ("s1", "s2"), ("b1", "b2")
STEPS = [
    *(PlanStep("go", (a, b)) for a in SHELVES for b in SHELVES),
    *(PlanStep(action, (box, shelf)) for action in ("take", "put") for box in BOXES for shelf in SHELVES),
]
GOALS = ("(forall (?b - box) (in ?b s1))", "(and (in b1 s2) (not (lit)))", "(or (holding b1) (at s2))")
PLANS = st.lists(st.lists(st.sampled_from(STEPS), max_size=6), min_size=2, max_size=4)


def plots():
    for action in DOMAIN.actions.values():
        yield ActionPlot.model_validate({
            "plot": f"do-{action.name}", "implements": action.name,
            "parameters": {one.name: one.types[0] for one in action.parameters},
            "states": {"do": {"entry": {"trigger": "robot.act"}, "on": {"finished": "end"}}, "end": {"final": True}},
        })  # fmt: skip


LIBRARY = Library(plots())


@settings(max_examples=60, deadline=None, derandomize=True)
@given(PLANS)
def test_a_plot_made_after_others_is_the_same_as_one_made_afresh(plans):
    for steps in map(tuple, plans):
        again = plot_from_plan(Plan(steps), DOMAIN, LIBRARY)
        assert again == plot_from_plan(Plan(steps), PlanningDomain.parse(TEXT), Library(plots()))
        assert ActionPlot.model_validate(again.to_form()) == again


def test_a_way_to_do_a_step_that_is_added_later_is_used_in_the_next_plan():
    library, plan = Library(plots()), Plan((STEPS[1],))
    before = plot_from_plan(plan, DOMAIN, library).state("step_1").dynamic
    library.add(next(plots()).model_copy(update={"name": "drive"}))
    assert plot_from_plan(plan, DOMAIN, library).state("step_1").dynamic == (*before, "drive")


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.lists(st.sampled_from(STEPS), max_size=6), st.sampled_from(GOALS))
def test_causal_needs_equal_a_full_regression_over_all_steps(steps, goal_text):
    goal = parse_condition(goal_text)
    needed = dict.fromkeys(conjuncts(goal))
    for step in reversed(steps):
        ground = DOMAIN.ground(step)
        after = [part for one in needed for part in conjuncts(regressed(one, leaves(ground.effect)))]
        needed = dict.fromkeys((*conjuncts(ground.typed), *after))
    before = CausalNeeds(steps, DOMAIN, goal).before(tuple(range(1, len(steps) + 1)))
    assert before is not None
    assert set(before) == set(needed)


def test_ground_steps_are_kept_within_bounds():
    domain = PlanningDomain.parse(TEXT)
    first = domain.ground(PlanStep("go", ("s1", "s2")))
    assert domain.ground(PlanStep("go", ("s1", "s2"))) is first
    for number in range(3000):
        domain.ground(PlanStep("go", ("s1", f"s{number}")))
    assert len(domain._ground) <= 1024
    assert domain.ground(PlanStep("go", ("s1", "s2"))) == first


def test_an_expected_plot_is_bound_as_if_it_had_been_read():
    library, plot = Library(plots()), plot_from_plan(Plan(tuple(STEPS[1:4])), DOMAIN, LIBRARY)
    library.expect(plot)
    bound, read = library.bind(plot.to_form()), LIBRARY.bind(plot.to_form())
    assert (bound.plot, bound.form) == (read.plot, read.form)
    assert [node.name for node in bound.nodes] == [node.name for node in read.nodes]


def test_the_form_of_an_expected_plot_that_was_changed_is_read():
    library, plot = Library(plots()), plot_from_plan(Plan((STEPS[1],)), DOMAIN, LIBRARY)
    library.expect(plot)
    form = plot.to_form()
    form["states"]["step_1"]["about"] = "another"
    assert library.bind(form).plot.state("step_1").about == "another"


def test_few_plots_are_expected_at_a_time():
    library = Library(plots())
    for number in range(50):
        library.expect(plot_from_plan(Plan((STEPS[1],)), DOMAIN, LIBRARY, name=f"plan_{number}"))
    assert len(library._made) <= 4


def test_a_slice_of_a_problem_whose_metric_is_ignored_costs_the_same_everywhere(clean_up, table):
    metric = Metric("minimize", parse_term("(total-time)"))
    problem = build_problem(clean_up, table(cups=2), parse_condition("(forall (?i - item) (tidy ?i))"), metric)
    assert problem.whole is not None
    assert {action.cost for form in (problem, problem.whole) for action in form.actions} == {1.0}


class Finished(Outcome): ...


class Arm(Component):
    """Says how much the collector leaves alone while it works, and how often it looks."""

    name = "robot"

    @skill
    async def act(self, call: SkillCall) -> Finished:
        self.left_alone, self.patience = gc.get_freeze_count(), gc.get_threshold()
        return Finished()


@pytest.mark.parametrize("clock", ["real", "simulated"])
def test_a_run_in_somebodys_program_leaves_its_garbage_collection_alone(clock):
    world, robot, before = KnowledgeBase(DOMAIN.schema), Arm(), gc.get_freeze_count()
    threshold = gc.get_threshold()
    world.apply(Delta(nodes=dict.fromkeys(SHELVES, "shelf"), added=(fact("at", "s1"),)), "test")
    Robot(DOMAIN, plots(), [robot], world, clock=clock).run("do-go", {"from": "s1", "to": "s2"})
    assert (robot.left_alone, robot.patience) == (before, threshold)
    assert (gc.get_freeze_count(), gc.get_threshold()) == (before, threshold)


def test_the_command_excludes_what_was_there_before_from_garbage_collection():
    before, threshold = gc.get_freeze_count(), gc.get_threshold()
    with settled(), settled():
        assert gc.get_freeze_count() > before
        assert gc.get_threshold() > threshold
    assert (gc.get_freeze_count(), gc.get_threshold()) == (before, threshold)

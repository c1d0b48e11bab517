"""A plan in execution: its state, its successor, and which plans are kept."""

import asyncio
import json
from collections import Counter

import pytest
from errands import DOMAIN
from test_carrying_out import Run

from knowledge_base import Delta, KnowledgeBase, UnknownNameError, fact
from knowledge_base.language.syntax.text import parse_condition
from planning import PlanStep
from planning.execution.attempt import Attempt, Failure
from planning.execution.link_monitor import Broken, GoalReached, Shorter
from planning.execution.outcomes import Withdrawn
from planning.execution.plan_progress import PlanProgress
from planning.execution.plan_run import PlanRun, PlanState, Successor
from planning.execution.plan_runs import MOST_UNMONITORED, PlanRuns
from planning.problem.derived import derivation

GOAL = parse_condition("(at c)")
STEPS = (PlanStep("go", ("a", "b")), PlanStep("go", ("b", "c")))
ROUND_ABOUT = (PlanStep("go", ("a", "d")), PlanStep("go", ("d", "c")))


def plan_run(name="plan_1", **more):
    return PlanRun(name, GOAL, PlanProgress(STEPS, DOMAIN, GOAL), Attempt(), "errand", 5, 4, **more)


def kept(*runs):
    all_of_them = PlanRuns()
    for run in runs:
        all_of_them.add(run)
    return all_of_them


def names(runs):
    return [form["name"] for form in runs.remember()["runs"]]


def skills_started(run):
    return [r.data["skill"] for r in run.records if r.type == "action" and r.data.get("action") == "start"]


def test_monitoring_ends_with_the_new_plan_and_nobody_asks_for_it_again():
    blocked = (0.5, Delta(removed=(fact("way", "b", "c"),)))
    run = Run("(at c)", then=[blocked], links=("a b", "b c", "a d", "d c"))
    assert run.how == "reached"
    answers = [r.data["name"] for r in run.records if r.type == "event" and r.data.get("source") == "planner.monitor"]
    assert (answers, len(run.said("replaced"))) == (["plan_found"], 1)
    assert skills_started(run).count("planner.repair") == 0


def test_running_steps_continue_with_which_a_successor_begins():
    run = plan_run(state=PlanState.BROKEN)
    run.progress.begin(1)
    assert run.continuing(STEPS[:1]) == (1,)
    assert run.continuing(ROUND_ABOUT) == ()


def test_a_successor_that_is_shortened_keeps_its_name():
    run = plan_run(successor=Successor(ROUND_ABOUT, name="plan_2", kept=1))
    assert run.shortened(ROUND_ABOUT[1:]) == Successor(ROUND_ABOUT[1:], name="plan_2", kept=1)
    assert plan_run().shortened(STEPS[1:]) == Successor(STEPS[1:])


SIDE_BY_SIDE = PlanStep("take", ("cup", "a"))


def parallel_run():
    """A plan with two running parallel steps, and the messages about its steps 1 and 2."""
    progress = PlanProgress((SIDE_BY_SIDE, *STEPS), DOMAIN, GOAL, {(2, 3)})
    run = PlanRun("plan_1", GOAL, progress, Attempt(), "errand", 5, 4, state=PlanState.BROKEN)
    for number in (1, 2):
        run.begun.add(number)
        progress.begin(number)
    return run


async def ended(run, act):
    """Hold both steps, act, and return the steps that were withdrawn."""
    holds = {number: asyncio.ensure_future(run.hold(number)) for number in (1, 2)}
    await asyncio.sleep(0)
    act()
    await asyncio.sleep(0)
    found = {number: hold.result() for number, hold in holds.items() if hold.done()}
    for hold in holds.values():
        hold.cancel()
    return found


def successor(run, steps):
    """The plan that replaces a plan, with the running steps that continue in it."""
    running = len(run.continuing(steps))
    progress = PlanProgress(steps, DOMAIN, GOAL)
    progress.take_order(
        frozenset((first, second) for second in range(running + 1, len(steps) + 1) for first in range(1, second))
    )
    again = PlanRun(
        "plan_2", GOAL, progress, run.attempt, "errand", 5, 4, replaces="plan_1", labels=run.labels_for(steps)
    )
    again.take_over(run, running)
    return again


def test_parallel_running_steps_continue_in_any_order_with_their_numbers_in_the_plot():
    run = parallel_run()
    again = successor(run, (STEPS[0], SIDE_BY_SIDE, *ROUND_ABOUT))
    assert (again.progress.running, again.labels, again.begun) == ((1, 2), (2, 1, 4, 5), {1, 2})


def test_of_parallel_running_steps_only_those_continue_with_which_the_successor_begins():
    again = successor(parallel_run(), STEPS)
    assert again.progress.steps_of(again.progress.running) == STEPS[:1]
    assert again.labels == (2, 3)


def test_a_step_that_continues_can_still_be_withdrawn():
    run = parallel_run()

    def act():
        successor(run, (STEPS[0], SIDE_BY_SIDE)).withdraw(1)

    assert asyncio.run(ended(run, act)) == {2: Withdrawn()}


def test_a_step_that_begins_just_before_the_replacement_belongs_to_both_plans():
    run = parallel_run()
    again = successor(run, (STEPS[0], *STEPS[1:]))
    runs = kept(run, again)
    for one in runs.carrying("plan_1"):
        one.begin(3)
    assert again.progress.steps_of(again.progress.running) == STEPS[1:]
    again.begin(7)  # a step that the new plan lacks has ended
    assert again.begun == {2, 3}


def test_a_withdrawn_step_ends_alone_also_after_a_restart():
    run = parallel_run()
    assert asyncio.run(ended(run, lambda: run.withdraw(2))) == {2: Withdrawn()}
    world = KnowledgeBase(DOMAIN.schema)
    world.apply(Delta(nodes={**dict.fromkeys("abcd", "room"), "cup": "thing"}), "test")
    again = PlanRun.from_json(json.loads(json.dumps(run.to_json())), derivation(DOMAIN).at(world), Attempt())
    assert asyncio.run(ended(again, lambda: None)) == {2: Withdrawn()}


def test_two_attempts_at_equal_goals_are_different_after_a_restart():
    runs = PlanRuns()
    attempts = [runs.attempt("task", None), runs.attempt("task", None)]
    for number, attempt in enumerate(attempts):
        attempt.disturbances = number
        progress = PlanProgress(STEPS, DOMAIN, GOAL)
        runs.add(PlanRun(f"plan_{number}", GOAL, progress, attempt, "errand", 5, 4))
    world = KnowledgeBase(DOMAIN.schema)
    world.apply(Delta(nodes={**dict.fromkeys("abcd", "room"), "cup": "thing"}), "test")
    again = PlanRuns()
    again.recall(json.loads(json.dumps(runs.remember())), derivation(DOMAIN).at(world))
    assert [again.required(f"plan_{number}").attempt for number in range(2)] == attempts
    assert again.interrupted("task") is again.required("plan_1").attempt


@pytest.mark.parametrize("state", PlanState)
def test_a_plan_run_converts_to_plain_data_and_back(state):
    run = plan_run(replaces="plan_0", state=state, successor=Successor(ROUND_ABOUT, "plan_2", 1), searching_since=2.5)
    run.begun.add(1)
    run.news.extend([Broken("no", "(at b)", 2, "somebody", 7), Shorter(STEPS[1:]), GoalReached("me")])
    world = KnowledgeBase(DOMAIN.schema)
    world.apply(Delta(nodes=dict.fromkeys("abcd", "room")), "test")
    form = json.loads(json.dumps(run.to_json()))
    again = PlanRun.from_json(form, derivation(DOMAIN).at(world), Attempt())
    assert again.to_json() == form
    assert (again.state, again.successor, again.news) == (run.state, run.successor, run.news)


def test_an_attempt_as_plain_data():
    attempt = Attempt(3, 1, 2, 4, Counter({Failure(STEPS[0], "failed", "here"): 2}), Counter({STEPS[1]: 3}))
    assert Attempt.from_json(json.loads(json.dumps(attempt.to_json()))) == attempt


def test_no_attempt_after_the_goal():
    runs = PlanRuns()
    runs.attempt("task", None)
    runs.conclude("task")
    assert runs.interrupted("task") is None


def test_the_oldest_plans_without_a_monitor_give_way():
    monitored = plan_run("plan_0")
    runs = kept(monitored)
    runs.begin(monitored)
    monitored.on_begin = print
    for number in range(1, MOST_UNMONITORED + 3):
        runs.add(plan_run(f"plan_{number}"))
    assert names(runs) == ["plan_0", *(f"plan_{number}" for number in range(2, MOST_UNMONITORED + 3))]


def test_a_step_that_begins_before_its_monitor_is_back_is_not_forgotten():
    run = plan_run(state=PlanState.MONITORED)
    run.begun.add(1)
    run.begin(1)  # a restart repeats the last parameter
    run.begin(2)
    assert run.missed == [2]


def test_a_plan_is_kept_until_the_monitoring_of_the_one_that_replaces_it_begins():
    old, new = plan_run(), plan_run("plan_2", replaces="plan_1")
    runs = kept(old, new)
    assert names(runs) == ["plan_1", "plan_2"]
    runs.begin(new)
    assert names(runs) == ["plan_2"]
    runs.begin(new)
    assert names(runs) == ["plan_2"]


def test_a_plan_that_the_chart_does_not_take_is_withdrawn():
    runs = kept(plan_run(), plan_run("plan_2", replaces="plan_1"))
    runs.withdraw("plan_1")
    assert names(runs) == ["plan_1"]


@pytest.mark.parametrize("over", ["plan_1", "plan_2"])
def test_a_plan_that_is_over_takes_the_one_that_it_replaces_and_its_successor_along(over):
    runs = kept(plan_run(), plan_run("plan_2", replaces="plan_1"), plan_run("plan_3"))
    runs.over(over)
    assert names(runs) == ["plan_3"]
    with pytest.raises(UnknownNameError, match="there is no plan 'plan_1'"):
        runs.required("plan_1")

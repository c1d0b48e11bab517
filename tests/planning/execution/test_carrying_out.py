"""A plan carried out when things go wrong: which rung of the ladder answers, and that what it does is said."""

import asyncio
import os
import sys
import threading
import time

import pytest
from breadth_first import BreadthFirst
from errands import DOMAIN, HOLDER, ROOMS, ROUND, when_asked
from obedient_robot import FAILED, ObedientRobot, plots

from dsc import Component, Event, Outcome, parse_plot, skill
from dsc.trace import Record
from knowledge_base import Delta, fact
from planning import Plan, PlannerProcess, PlanStep, Robot
from planning.analysis.validation import Validation
from planning.execution.plan_records import why_broken
from planning.model.plan import EngineFailed, PlanFound
from planning.ordering.causal_tracing import deordered


class Run:
    """One run: how it ended, what the robot did, what the trace says."""

    def __init__(
        self, goal, script=None, *, planner=None, replans=4, ways=None, things=("cup",), plots_of=None, then=(), known=(),
        foresight=None, prepare=None, links=ROUND, clock="simulated",
    ):  # fmt: skip
        self.planner = planner or BreadthFirst()
        self.robot = ObedientRobot(DOMAIN, script, seconds=1.0 if clock == "simulated" else 0.02)
        holder = parse_plot(HOLDER.replace("GOAL", goal).replace("REPLANS", str(replans)))
        program = Robot(
            DOMAIN,
            [holder, *plots(DOMAIN, ways)],
            [self.robot],
            planner=self.planner,
            foresight=foresight,
            clock=clock,
        )
        self.knowledge = self.robot.knowledge = program.knowledge
        told = [fact("at", "a"), *(fact("in", t, "a") for t in things), *(fact("way", *one.split()) for one in links)]
        nodes = {**dict.fromkeys(ROOMS, "room"), **dict.fromkeys(things, "thing")}
        self.knowledge.apply(Delta(nodes=nodes, added=(*told, *known)), "test")
        self.records: list[Record] = []
        program.listen(self.records.append)

        def ready(sequencer):
            for seconds, delta in then:
                sequencer.change(delta, "somebody", after=seconds)
            if prepare is not None:
                prepare(sequencer)

        self.end = program.run("errand", prepare=ready)
        self.how = self.end.emitted[-1].attributes["how"] if self.end.emitted else None

    def said(self, kind):
        return [record.data for record in self.records if record.type == f"plan.{kind}"]

    @property
    def done(self):
        return self.robot.done


def test_a_failure_that_leaves_the_plan_valid_needs_no_planner():
    run = Run("(in cup c)", {"(go b c)": [FAILED]})
    assert run.how == "reached"
    assert run.done == ["(take cup a)", "(go a b)", "(go b c)", "(go b c)", "(put cup c)"]
    assert len(run.planner.asked) == 1
    (resumed,) = run.said("resumed")
    assert (resumed["step"], resumed["why"], resumed["after"]) == ("(go b c)", "failed", "plan_1")


def test_the_order_of_a_plan_that_continues_is_computed_outside_of_the_event_loop(monkeypatch):
    threads = []

    def noted(*given):
        threads.append(threading.current_thread())
        return deordered(*given)

    for module in ("escalation", "plotting"):
        monkeypatch.setattr(f"planning.execution.{module}.deordered", noted)
    run = Run("(in cup c)", {"(go b c)": [FAILED]})
    assert run.how == "reached"
    assert len(threads) == 1
    assert threads[0] is not threading.main_thread()


def test_a_step_without_its_observed_effect_is_repeated_without_the_planner():
    run = Run("(in cup b)", {"(take cup a)": [Delta()]})
    assert run.how == "reached"
    assert run.done == ["(take cup a)", "(take cup a)", "(go a b)", "(put cup b)"]
    assert len(run.planner.asked) == 1


def test_the_same_failure_in_the_same_situation_leads_to_the_other_candidate():
    script = {"by_hand: (take cup a)": [FAILED] * 9}
    run = Run("(holding cup)", script, ways={"take": ["by_hand", "with_tongs"]})
    assert run.how == "reached"
    assert run.done == ["by_hand: (take cup a)", "by_hand: (take cup a)", "with_tongs: (take cup a)"]
    assert [resumed.get("instead_of") for resumed in run.said("resumed")] == [None, "by_hand"]
    assert len(run.planner.asked) == 1


def test_a_step_that_fails_again_and_again_is_done_without_for_a_while():
    run = Run("(at c)", {"(go a b)": [FAILED] * 9, "(go b c)": [FAILED] * 9})
    assert run.how == "reached"
    assert run.done == ["(go a b)", "(go a b)", "(go a d)", "(go d c)"]
    assert [(data["step"], data["why"]) for data in run.said("excluded")] == [("(go a b)", "failed")]
    assert run.said("replaced")[0]["after"] == "plan_2"
    assert not any(action.step == PlanStep("go", ("a", "b")) for action in run.planner.asked[-1].actions)


def test_a_failed_step_is_readmitted_if_every_plan_needs_it():
    run = Run("(at b)", {"(go a b)": [FAILED] * 2}, links=("a b", "b a"))
    assert run.how == "reached"
    assert run.done == ["(go a b)"] * 3
    assert run.said("readmitted") == [{"steps": ["(go a b)"]}]


def test_a_step_that_always_fails_ends_the_plan_with_a_reason():
    run = Run("(at b)", {"(go a b)": [FAILED] * 99}, links=("a b", "b a"))
    assert run.how == "(go a b) has failed before, in the same way and the same situation: failed"
    assert run.said("gave_up") == [{"plot": "plan_3", "reason": run.how}]
    assert run.done == ["(go a b)"] * 3


def test_without_a_budget_for_new_plans_it_is_given_up_with_a_reason():
    run = Run("(at c)", {"(go a b)": [FAILED] * 99}, replans=0)
    assert run.how == "the budget of 0 new plans is used up: failed"


def test_a_local_repair_keeps_the_rest_of_the_plan():
    dropped = Delta(removed=(fact("at", "b"), fact("holding", "cup")), added=(fact("at", "c"), fact("in", "cup", "c")))
    run = Run("(and (in cup d) (clean d) (clean c))", {"(go b c)": [dropped]}, links=("a b", "b c", "c d"))
    assert run.how == "reached"
    assert run.done == ["(take cup a)", "(go a b)", "(go b c)", "(sweep c)", "(take cup c)", "(go c d)", *run.done[-2:]]
    (replaced,) = run.said("replaced")
    assert replaced["kept"] > 0
    assert len(run.planner.asked[-1].goal) > 0


def test_a_running_step_that_the_new_plan_begins_with_is_not_interrupted():
    late = (0.5, Delta(added=(fact("in", "plate", "a"),), nodes={"plate": "thing"}))
    run = Run("(forall (?t - thing) (in ?t b))", then=[late])
    assert run.how == "reached"
    assert (
        len(run.done) == len(set(run.done)) == 5
    )  # the first step was done once, although the plan was broken meanwhile
    (broken,) = run.said("broken")
    (replaced,) = run.said("replaced")
    assert (replaced["after"], replaced["plot"]) == ("plan_1", "plan_2")
    cancelled = [
        r for r in run.records if r.type == "action" and r.data.get("action") == "start" and "act" in r.data["skill"]
    ]
    began = [r.data["arguments"]["action"] for r in cancelled if r.t < 1.0]
    assert began == ["take"]
    assert why_broken(broken).endswith("which the goal needs, does not hold since version 2 (somebody)")


def test_a_running_step_continues_through_any_number_of_changes_by_others_which_use_up_no_budget():
    then = [(0.4 * n, Delta(added=(fact("in", f"t{n}", "a"),), nodes={f"t{n}": "thing"})) for n in range(1, 7)]
    run = Run("(forall (?t - thing) (in ?t b))", then=then, replans=2)
    assert run.how == "reached"
    assert len(run.said("broken")) > 2
    starts = [one for one in run.records if one.type == "action" and one.data["action"] == "start"]
    assert len([one for one in starts if one.data["skill"] == "robot.act"]) == len(run.done) == 15


def test_a_running_step_that_is_hit_itself_is_interrupted_and_the_reason_can_be_told():
    gone = (0.5, Delta(removed=(fact("in", "cup", "a"),), added=(fact("in", "cup", "b"),)))
    run = Run("(in cup c)", then=[gone])
    assert run.how == "reached"
    assert run.done == ["(go a b)", "(take cup b)", "(go b c)", "(put cup c)"]
    (broken,) = run.said("broken")
    assert broken["link"] == {"fact": "(in cup a)", "step": 1, "user": "(take cup a)"}
    assert (
        why_broken(broken) == "(in cup a), which step 1, (take cup a), needs, does not hold since version 2 (somebody)"
    )


def test_a_step_achieved_by_another_author_is_skipped_and_recorded():
    run = Run("(and (clean a) (clean b) (clean c))", then=[(0.5, Delta(added=(fact("clean", "b"),)))])
    assert run.how == "reached"
    assert "(sweep b)" not in run.done
    assert run.said("skipped") == [{"plot": "plan_1", "steps": ["(sweep b)"], "why": "fewer steps lead to the goal"}]
    assert len(run.planner.asked) == 1


def test_a_goal_that_somebody_else_reaches_ends_the_plan_at_once():
    run = Run("(clean c)", then=[(0.5, Delta(added=(fact("clean", "c"),)))])
    assert (run.how, run.done) == ("reached", [])
    (skipped,) = run.said("skipped")
    assert (skipped["steps"], skipped["why"]) == (["(go a b)", "(go b c)", "(sweep c)"], "the goal holds")


DETOUR = ("go a b", "sweep b", "go b a", "go a d", "go d c", "sweep c")


class Improves(BreadthFirst):
    """Finds a detour first, and a better plan when the first step has begun."""

    def __init__(self, better):
        super().__init__()
        self.better = better
        self.begun = asyncio.Event()
        self.closed = False

    async def plans(self, problem, seconds):
        try:
            yield found(*DETOUR)
            await self.begun.wait()
            yield self.better
            await asyncio.get_running_loop().create_future()  # it would go on for ever
        finally:
            self.closed = True

    def prepare(self, sequencer):
        def look(record):
            if record.data.get("skill") == "robot.act":
                self.begun.set()

        sequencer.trace.listen(look)


def found(*steps):
    made = [PlanStep(one.split()[0], tuple(one.split()[1:])) for one in steps]
    return PlanFound(Plan(tuple(made)), "fake", 0.0, 0.1)


def test_a_better_plan_found_later_replaces_the_steps_that_have_not_begun():
    planner = Improves(found("go a b", "sweep b", "go b c", "sweep c"))
    run = Run("(and (clean b) (clean c))", planner=planner, prepare=planner.prepare, clock="real")
    assert planner.closed
    assert (run.how, run.done) == ("reached", ["(go a b)", "(sweep b)", "(go b c)", "(sweep c)"])
    assert [data["steps"] for data in run.said("found")][1] == run.done
    assert len(run.said("replaced")) == 1


@pytest.mark.parametrize("worse", [("go a d", "go d a"), ("go a b",)], ids=["leads_elsewhere", "wrong"])
def test_a_plan_found_later_that_does_not_fit_is_not_taken(worse):
    planner = Improves(found(*worse))
    run = Run("(and (clean b) (clean c))", planner=planner, prepare=planner.prepare, clock="real")
    assert planner.closed
    assert run.done == [f"({step})" for step in DETOUR]
    assert run.said("replaced") == []


class Slippery:
    """A simulation that knows of a floor which the domain does not speak of."""

    def __init__(self, *bad):
        self.bad = bad

    def foresee(self, plan, world):
        for number, step in enumerate(plan.steps):
            if str(step) in self.bad:
                return Validation(valid=False, failing_step=number, why="the floor is wet")
        return Validation(valid=True)


def test_a_plan_that_fails_in_the_simulation_is_rejected_and_another_one_found():
    run = Run("(at c)", foresight=Slippery("(go b c)"))
    assert (run.how, run.done) == ("reached", ["(go a d)", "(go d c)"])
    assert run.said("rejected") == [{"step": "(go b c)", "reason": "the floor is wet", "engine": "breadth"}]


def test_a_robot_executes_no_step_if_every_plan_fails_in_the_simulation():
    run = Run("(at b)", foresight=Slippery("(go a b)", "(go c b)"))
    assert run.done == []
    assert run.how.startswith("the simulation foresees that every plan fails: (go a b): the floor is wet")


class Bad:
    """A planner that misbehaves, and remembers that it was cancelled."""

    def __init__(self, how):
        self.how = how
        self.cancelled = False

    async def solve(self, problem, seconds):
        if self.how == "raises":
            raise RuntimeError("out of paper")
        if self.how == "fails":
            return EngineFailed("fake", "killed by signal 11")
        if self.how == "babbles":
            return "a plan"
        if self.how == "wrong":
            return found("go a c")
        try:
            await asyncio.get_running_loop().create_future()
        except asyncio.CancelledError:
            self.cancelled = True
            raise


@pytest.mark.parametrize(
    ("how", "said"),
    [
        ("raises", "Bad: RuntimeError: out of paper"), ("fails", "fake: killed by signal 11"), ("babbles", "Bad: no answer: 'a plan'"),
        ("wrong", "does not lead to the goal: (go a c): (way a c) is false (fake, the last of 6 wrong plans)"), ("hangs", "no plan within 5 s (Bad)"),
    ],
)  # fmt: skip
def test_a_planner_that_misbehaves_ends_in_no_plan_and_is_named(how, said, monkeypatch):
    if how == "hangs":
        monkeypatch.setattr(
            "planning.execution.planner_call.PATIENCE", -4.9
        )  # its five seconds of real time are over soon
    planner = Bad(how)
    run = Run("(at c)", planner=planner)
    assert run.end.finished
    assert run.done == []
    assert run.how is not None
    assert said in run.how
    assert said in run.said("none")[0]["reason"]
    assert planner.cancelled == (how == "hangs")


HANGING = """
import json, pathlib, sys, time
print(json.dumps({"ready": True}), flush=True)
sys.stdin.readline()
pathlib.Path(sys.argv[1]).touch()
time.sleep(1000)
"""


def test_a_stop_while_a_real_planner_process_hangs_leaves_no_process_behind(tmp_path):
    asked = tmp_path / "asked"
    planner = PlannerProcess(command=(sys.executable, "-c", HANGING, str(asked)))
    alive = []

    async def stop_when_it_works(sequencer):
        while not asked.exists():  # noqa: ASYNC110  a process that hangs tells nobody
            await asyncio.sleep(0)
        alive.append(planner._process._pid)
        sequencer.post(Event("stop"))

    run = Run("(at c)", planner=planner, prepare=when_asked(stop_when_it_works))
    assert run.how == "stopped"
    assert run.records[-1].t == 0.0
    given_up = time.monotonic() + 60
    while _is_there(alive[0]):  # another thread sees to its end, and nobody waits for that
        assert time.monotonic() < given_up


def _is_there(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


class Counted(Outcome): ...


class Counter(Component):
    """Skills that end at once: without a wait, after a look at the loop, or after some time."""

    def __init__(self, seconds):
        super().__init__()
        self.seconds = seconds
        self.done = []

    @skill(after_crash="repeat")
    async def act(self, call, what: str) -> Counted:
        if self.seconds is not None:
            await call.clock.sleep(self.seconds)
        self.done.append(what)
        return Counted()


COUNTING = """(define (domain count) (:functions (n)) (:predicates (done))
  (:action more :parameters () :precondition (< (n) 5) :effect (increase (n) 1))
  (:action stop :parameters () :precondition (>= (n) 3) :effect (done)))"""


class CountsToThree:
    async def solve(self, problem, seconds):
        return PlanFound(Plan((*[PlanStep("more")] * 3, PlanStep("stop"))), "fake", 0.0, 0.1)


@pytest.mark.parametrize("seconds", [None, 0, 1])
def test_steps_that_end_at_once_are_each_done_one_time(seconds):
    counter = Counter(seconds)
    records: list[Record] = []
    ways = [
        parse_plot(
            f"{{plot: {name}, implements: {name}, effects: assumed, states: {{"
            f"do: {{entry: {{trigger: counter.act, with: {{what: {name}}}}}, on: {{counted: e}}}}, e: {{final: true}}}}}}"
        )
        for name in ("more", "stop")
    ]
    with Robot(COUNTING, ways, [counter], planner=CountsToThree(), clock="simulated") as robot:
        with robot.knowledge.transaction(author="test") as world:
            world.set("n", 0)
        robot.listen(records.append)
        assert robot.achieve("(done)").reached
    assert counter.done == ["more", "more", "more", "stop"]
    assert [record.data for record in records if record.type == "plan.skipped"] == []

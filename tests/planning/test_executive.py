"""The executive with planners that misbehave: nothing is executed that is no plan, and nothing ever waits for ever."""

import asyncio

import pytest

from dsc import Component, Event, Outcome, SkillCall, parse_plot, primitive_plot, skill
from dsc.errors import PlotError
from knowledge_base import Delta, fact
from planning import Executive, Plan, PlanningDomain, PlanStep
from planning.plan import EngineFailed, PlanFound, ProvenUnsolvable, TimedOut

DOMAIN = PlanningDomain.parse("""
(define (domain lights)
  (:types lamp)
  (:predicates (on ?l - lamp) (broken ?l - lamp) (works ?l - lamp))
  (:action switch-on :parameters (?lamp - lamp) :precondition (works ?lamp) :effect (on ?lamp)))
""")
GOAL = "(forall (?l - lamp) (on ?l))"
HOLDER = parse_plot(f"""
plot: light_up
receives: {{stop: }}
emits: {{ended: {{how: symbol}}}}
states:
  work:
    on: {{stop: {{to: over, emit: ended, with: {{how: stopped}}}}, done: over}}
    states:
      lighting:
        goal: {GOAL}
        budget: {{replans: 2, seconds: 5}}
        on:
          done: {{to: lit, emit: ended, with: {{how: reached}}}}
          no_plan: {{to: lit, emit: ended, with: {{how: ?event.reason}}}}
          gave_up: {{to: lit, emit: ended, with: {{how: gave_up}}}}
      lit: {{final: true}}
  over: {{final: true}}
rules:
  - on: bulb_blown
    do: {{tell: (not (works ?event.lamp)), then: give_up}}
""")


class Lamps(Component):
    name = "lamps"

    def __init__(self):
        super().__init__()
        self.switched = []
        self.dead = False

    @skill(outcomes={"lit": {}, "bulb_blown": {"lamp": "lamp"}, "nothing": {}}, types={"lamp": "lamp"})
    async def light(self, call: SkillCall, lamp: str) -> Outcome:
        await call.clock.sleep(1.0)
        self.switched.append(lamp)
        if self.dead:
            return Outcome("nothing")
        return Outcome("lit", observed=Delta(added=(fact("on", lamp),)))


class Answers:
    """A planner that gives prepared answers, then the last one for ever."""

    def __init__(self, *answers):
        self.answers = list(answers)
        self.asked = 0

    async def solve(self, problem, seconds):
        self.asked += 1
        return self.answers.pop(0) if len(self.answers) > 1 else self.answers[0]


def found(*lamps):
    return PlanFound(Plan(tuple(PlanStep("switch-on", (lamp,)) for lamp in lamps)), "fake", 0.0, 0.1)


def executive(planner, lamps=("a", "b")):
    component = Lamps()
    light = component.skills()["light"]
    plots = [HOLDER, primitive_plot(light, done="lit", implements="switch-on")]
    robot = Executive(DOMAIN, plots, [component], planner=planner)
    robot.knowledge.apply(
        Delta(nodes=dict.fromkeys(lamps, "lamp"), added=tuple(fact("works", lamp) for lamp in lamps)), "test"
    )
    return robot, component


def how(end):
    return end.emitted[-1].attributes["how"]


def test_a_plan_is_carried_out_and_the_goal_is_judged():
    robot, lamps = executive(Answers(found("a", "b")))
    end = robot.run("light_up")
    assert (end.finished, how(end), lamps.switched) == (True, "reached", ["a", "b"])


def test_a_goal_that_holds_already_asks_nobody():
    planner = Answers(found())
    robot, _ = executive(planner)
    robot.knowledge.apply(Delta(added=(fact("on", "a"), fact("on", "b"))), "test")
    assert how(robot.run("light_up")) == "reached"
    assert planner.asked == 0


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (ProvenUnsolvable("fake", "proven"), "not all of them together"),
        (TimedOut("fake", 5.0), "within 5 s"),
        (EngineFailed("fake", "it crashed"), "it crashed"),
    ],
    ids=["unsolvable", "timed_out", "failed"],
)
def test_the_ways_not_to_find_a_plan_are_told_apart(answer, said):
    robot, lamps = executive(Answers(answer))
    records = []
    robot.listen(records.append)
    end = robot.run("light_up")
    assert lamps.switched == []
    assert said in how(end)
    (none,) = [record for record in records if record.type == "plan.none"]
    assert none.data["kind"] == {"ProvenUnsolvable": "unsolvable", "TimedOut": "timed_out"}.get(
        type(answer).__name__, "failed"
    )


@pytest.mark.parametrize("wrong", [found("a"), found("a", "a"), found("a", "ghost")])
def test_a_plan_that_does_not_lead_to_the_goal_is_never_executed(wrong):
    robot, lamps = executive(Answers(wrong))
    end = robot.run("light_up")
    assert lamps.switched == []
    assert end.finished
    assert how(end) != "reached"


def test_replanning_is_bounded_by_the_budget():
    planner = Answers(found("a", "b"))
    robot, lamps = executive(planner)
    lamps.dead = True
    end = robot.run("light_up")
    assert how(end) == "gave_up"
    assert planner.asked == 3  # the first plan and two replans
    assert lamps.switched == ["a"] * 3


class Hanging:
    """A planner that never answers, and remembers that it was cancelled."""

    def __init__(self):
        self.cancelled = False

    async def solve(self, problem, seconds):
        try:
            await asyncio.get_running_loop().create_future()
        except asyncio.CancelledError:
            self.cancelled = True
            raise


def test_a_stop_is_obeyed_while_the_planner_hangs():
    planner = Hanging()
    robot, _ = executive(planner)

    def prepare(sequencer):
        def stop_once_asked(record):
            if record.type == "plan.asked":
                sequencer.post(Event("stop"))

        sequencer.trace.listen(stop_once_asked)

    end = robot.run("light_up", prepare=prepare)
    assert how(end) == "stopped"
    assert planner.cancelled


def test_what_somebody_else_breaks_is_noticed_while_a_step_runs():
    robot, lamps = executive(Answers(found("a", "b"), found("a", "b", "c")))

    def prepare(sequencer):
        told = Delta(nodes={"c": "lamp"}, added=(fact("works", "c"),))
        asyncio.get_running_loop().call_later(0.5, sequencer.change, told, "somebody")

    records = []
    robot.listen(records.append)
    end = robot.run("light_up", prepare=prepare)
    assert how(end) == "reached"
    (broken,) = [record for record in records if record.type == "plan.broken"]
    assert (broken.data["author"], broken.data["reason"]) == ("somebody", "(on c) is false")
    assert set(lamps.switched) == {"a", "b", "c"}


def test_plots_and_domain_must_fit_before_anything_runs():
    lamps = Lamps()
    wrong = primitive_plot(lamps.skills()["light"], done="lit", implements="switch-onn")
    with pytest.raises(PlotError, match="did you mean 'switch-on'"):
        Executive(DOMAIN, [wrong], [lamps])

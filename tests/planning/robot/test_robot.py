"""The executive with planners that misbehave: nothing is executed that is no plan, and nothing ever waits for ever."""

import asyncio
from collections.abc import Callable
from typing import Annotated, Any, ClassVar

import pytest

from dsc import Component, Event, Outcome, SkillCall, Stream, parse_plot, primitive_plot, skill
from dsc.components.parameters import Parameters, parameter
from dsc.errors import PlotError, SkillError
from dsc.trace import Record
from knowledge_base import Delta, InputError, fact
from planning import Plan, PlanningDomain, PlanStep, Robot
from planning.model.plan import EngineFailed, PlanFound, ProvenUnsolvable, TimedOut

DOMAIN = PlanningDomain.parse("""
(define (domain lights)
  (:types lamp)
  (:predicates (on ?l - lamp) (broken ?l - lamp) (works ?l - lamp))
  (:functions (level ?l - lamp))
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


Lamp = Annotated[str, "lamp"]


class Lit(Outcome): ...


class BulbBlown(Outcome):
    lamp: Lamp


class Nothing(Outcome): ...


class Seen(Outcome): ...


class There(Outcome): ...


class Lamps(Component):
    name = "lamps"

    def __init__(self):
        super().__init__()
        self.switched = []
        self.answer: Callable[[str], Outcome] | None = None

    @skill
    async def light(self, call: SkillCall, lamp: Lamp) -> Lit | BulbBlown | Nothing:
        await call.clock.sleep(1.0)
        self.switched.append(lamp)
        if self.answer is not None:
            return self.answer(lamp)  # type: ignore[return-value]
        return Lit(observed=Delta(added=(fact("on", lamp),)))


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
    robot = Robot(DOMAIN, plots, [component], planner=planner, clock="simulated")
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
    records: list[Record] = []
    robot.listen(records.append)
    end = robot.run("light_up")
    assert lamps.switched == []
    assert said in how(end)
    (none,) = [record for record in records if record.type == "plan.none"]
    # A limit of real time makes no claim to be reproducible.
    assert none.data.get("reproducible", True) == (not isinstance(answer, TimedOut))
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

    def blind(lamp):  # each time the world is another one, so that nothing happens twice in the same situation
        name = f"x{len(lamps.switched)}"
        return Outcome("nothing", observed=Delta(nodes={name: "lamp"}, added=(fact("on", name), fact("works", name))))

    lamps.answer = blind
    reasons = []

    def listening(record):
        if record.type == "plan.gave_up":
            reasons.append(record.data["reason"])

    robot.listen(listening)
    assert how(robot.run("light_up")) == "gave_up"
    assert planner.asked == 3  # the first plan and two replans
    assert reasons == ["the budget of 2 new plans is used up: nothing"]


class Hanging:
    """A planner that never answers, and remembers that it was cancelled; `asked` is called when it begins."""

    def __init__(self):
        self.cancelled = False
        self.asked: Any = None

    async def solve(self, problem, seconds):
        self.asked()
        try:
            await asyncio.get_running_loop().create_future()
        except asyncio.CancelledError:
            self.cancelled = True
            raise


def test_a_stop_is_obeyed_while_the_planner_hangs():
    planner = Hanging()
    robot, _ = executive(planner)

    def prepare(sequencer):
        planner.asked = lambda: sequencer.post(Event("stop"))

    end = robot.run("light_up", prepare=prepare)
    assert how(end) == "stopped"
    assert planner.cancelled


def test_a_stop_is_obeyed_while_the_problem_is_still_being_posed():
    planner = Answers(found("a", "b"))
    robot, _ = executive(planner)

    def prepare(sequencer):
        def stop_once_asked(record):
            if record.type == "plan.asked":
                sequencer.post(Event("stop"))

        sequencer.trace.listen(stop_once_asked)

    assert how(robot.run("light_up", prepare=prepare)) == "stopped"
    assert planner.asked == 0


def test_a_break_by_another_author_is_noticed_while_a_step_runs():
    robot, lamps = executive(Answers(found("a", "b"), found("a", "b", "c")))

    def prepare(sequencer):
        told = Delta(nodes={"c": "lamp"}, added=(fact("works", "c"),))
        asyncio.get_running_loop().call_later(0.5, sequencer.change, told, "somebody")

    records: list[Record] = []
    robot.listen(records.append)
    end = robot.run("light_up", prepare=prepare)
    assert how(end) == "reached"
    (broken,) = [record for record in records if record.type == "plan.broken"]
    assert (broken.data["author"], broken.data["reason"]) == (
        "somebody",
        "after the last step: (on c) is false",
    )
    assert set(lamps.switched) == {"a", "b", "c"}
    (change,) = [record for record in records if record.data.get("author") == "somebody" and record.type == "knowledge"]
    assert broken.cause == change.seq


WATCHING = parse_plot(f"""
plot: watching
emits: {{ended: {{how: symbol}}}}
states:
  both:
    on: {{done: over}}
    regions:
      light:
        states:
          lighting:
            goal: {GOAL}
            on: {{done: lit, no_plan: lit, gave_up: lit}}
          lit: {{final: true}}
      watch:
        states:
          watching: {{entry: {{trigger: watcher.look}}, on: {{seen: quiet}}}}
          quiet: {{final: true}}
  over: {{final: true}}
""")


class Watcher(Component):
    name = "watcher"

    @skill
    async def look(self, call: SkillCall) -> Seen:
        await call.clock.sleep(0.5)
        return Seen(observed=Delta(removed=(fact("works", "b"),)))


def test_a_skill_that_works_for_another_state_is_somebody_else_to_the_monitor():
    lamps = Lamps()
    plots = [WATCHING, primitive_plot(lamps.skills()["light"], done="lit", implements="switch-on")]
    robot = Robot(
        DOMAIN, plots, [lamps, Watcher()], planner=Answers(found("a", "b"), TimedOut("fake", 1.0)), clock="simulated"
    )
    robot.knowledge.apply(
        Delta(nodes={"a": "lamp", "b": "lamp"}, added=(fact("works", "a"), fact("works", "b"))), "test"
    )
    records: list[Record] = []
    robot.listen(records.append)
    assert robot.run("watching").finished
    (broken,) = [record for record in records if record.type == "plan.broken"]
    assert (broken.t, broken.data["author"], broken.data["reason"]) == (
        0.5,
        "watcher",
        "before step 2, (switch-on b): (works b) is false",
    )


@pytest.mark.parametrize(
    ("hand_in", "said"),
    [
        (lambda sequencer: sequencer.change(Delta(added=(fact("onn", "a"),)), "me"), "did you mean 'on'"),
        (lambda sequencer: sequencer.post(Event("stop", {"at": float("nan")})), "not plain data"),
        (lambda sequencer: sequencer.post(Event("stop", {"who": object()})), "not plain data"),
    ],
    ids=["change", "not_a_number", "no_data"],
)
def test_an_invalid_change_or_event_raises_in_its_caller_and_has_no_effect(hand_in, said):
    robot, _ = executive(Answers(found("a", "b")))

    def prepare(sequencer):
        with pytest.raises(InputError, match=said):
            hand_in(sequencer)

    assert how(robot.run("light_up", prepare=prepare)) == "reached"


def test_two_components_of_one_name_are_refused():
    with pytest.raises(InputError, match="two components are named 'lamps'"):
        Robot(DOMAIN, [], [Lamps(), Lamps()], clock="simulated")


def test_plots_and_domain_must_fit_before_anything_runs():
    lamps = Lamps()
    wrong = primitive_plot(lamps.skills()["light"], done="lit", implements="switch-onn")
    with pytest.raises(PlotError, match="did you mean 'switch-on'"):
        Robot(DOMAIN, [wrong], [lamps], clock="simulated")


NESTED = PlanningDomain.parse("""
(define (domain lights)
  (:types lamp)
  (:predicates (on ?l - lamp) (near ?l - lamp) (works ?l - lamp))
  (:action approach :parameters (?lamp - lamp) :precondition () :effect (near ?lamp))
  (:action switch-on :parameters (?lamp - lamp) :precondition (works ?lamp) :effect (on ?lamp)))
""")
GO_AND_LIGHT = parse_plot("""
plot: go_and_light
parameters: {lamp: lamp}
implements: switch-on
states:
  go:
    goal: (near ?lamp)
    on: {done: light, no_plan: light, gave_up: light}
  light:
    entry: {trigger: lamps.light, with: {lamp: ?lamp}}
    on: {lit: ended, nothing: ended, bulb_blown: ended}
  ended: {final: true}
""")
LIGHT_ALL = parse_plot(f"""
plot: light_all
states:
  lighting: {{goal: {GOAL}, on: {{done: ended, no_plan: ended, gave_up: ended}}}}
  ended: {{final: true}}
""")


class Walker(Component):
    name = "legs"

    @skill
    async def walk(self, call: SkillCall, lamp: Lamp) -> There:
        await call.clock.sleep(1.0)
        return There(observed=Delta(added=(fact("near", lamp),)))


def test_a_plan_is_watched_also_after_one_of_its_steps_has_planned_for_itself():
    approach = PlanFound(Plan((PlanStep("approach", ("a",)),)), "fake", 0.0, 0.1)
    planner = Answers(found("a", "b"), approach, found("a"))
    legs = Walker()
    walk = primitive_plot(legs.skills()["walk"], done="there", implements="approach")
    robot = Robot(NESTED, [LIGHT_ALL, GO_AND_LIGHT, walk], [Lamps(), legs], planner=planner, clock="simulated")
    works = tuple(fact("works", lamp) for lamp in "ab")
    robot.knowledge.apply(Delta(nodes={"a": "lamp", "b": "lamp"}, added=works), "test")
    records: list[Record] = []
    robot.listen(records.append)

    def prepare(sequencer):
        broken = Delta(removed=(fact("works", "b"),))
        asyncio.get_running_loop().call_later(2.0, sequencer.change, broken, "somebody")

    robot.run("light_all", prepare=prepare)
    (broken,) = [record for record in records if record.type == "plan.broken"]
    assert (broken.t, broken.data["author"], broken.data["reason"]) == (
        2.0,
        "somebody",
        "before step 2, (switch-on b): (works b) is false",
    )


LEVEL_GOAL = "(and (on a) (< (/ 10 (level a)) 5))"


@pytest.mark.parametrize("when", [0.5, 1.0], ids=["while_a_step_runs", "with_its_answer"])
def test_a_goal_that_cannot_be_evaluated_any_more_is_not_reached_and_ends_no_run_in_an_error(when):
    robot, _ = executive(Answers(found("a")), lamps=("a",))
    robot.knowledge.apply(Delta(values={fact("level", "a"): 10.0}), "test")
    empty = Delta(values={fact("level", "a"): 0.0})

    def prepare(sequencer):
        asyncio.get_running_loop().call_later(when + 0.1, sequencer.change, empty, "somebody")

    arguments = {"goal": LEVEL_GOAL, "holder": "", "replans": 0, "seconds": 5}
    end = robot.run("achieve", arguments, prepare=prepare)
    assert end.finished
    assert end.emitted[-1].name in {"gave_up", "no_plan"}


def test_a_plan_that_is_wrong_is_not_put_down_to_the_world():
    robot, _ = executive(Answers(found("a")))
    assert "the plan found does not lead to the goal: (on b) is false" in how(robot.run("light_up"))


def test_an_executive_can_be_closed_inside_a_loop():
    async def main():
        lamps = Lamps()
        light = primitive_plot(lamps.skills()["light"], done="lit", implements="switch-on")
        with Robot(DOMAIN, [HOLDER, light], [lamps], clock="simulated") as robot:
            pass
        return robot

    assert asyncio.run(main()).library


class Blown(Lamps):
    @skill
    async def light(self, call, lamp: Lamp) -> Lit | BulbBlown | Nothing:
        return BulbBlown(lamp=lamp)


def lit_by_blown_bulbs(rule):
    """The end of a run whose every bulb is blown, with that rule about it."""
    holder = parse_plot(f"""
plot: light_up
emits: {{ended: {{how: symbol}}}}
states:
  lighting:
    goal: {GOAL}
    budget: {{replans: 2, seconds: 5}}
    on:
      done: {{to: lit, emit: ended, with: {{how: reached}}}}
      no_plan: {{to: lit, emit: ended, with: {{how: ?event.reason}}}}
      gave_up: {{to: lit, emit: ended, with: {{how: ?event.reason}}}}
    after: {{seconds: 900, to: help}}
  help: {{always: step_1}}
  step_1: {{use: light, with: {{lamp: a}}, on: {{done: lit, nothing: lit, gave_up: lit}}}}
  lit: {{final: true}}
rules:
  - {{on: bulb_blown, {rule}}}
""")
    lamps = Blown()
    light = primitive_plot(lamps.skills()["light"], done="lit", implements="switch-on")
    robot = Robot(DOMAIN, [holder, light], [lamps], planner=Answers(found("a")), clock="simulated")
    robot.knowledge.apply(Delta(nodes={"a": "lamp"}, added=(fact("works", "a"),)), "test")
    return robot.run("light_up")


def test_a_rule_about_the_states_of_its_plot_is_not_handed_to_a_plan():
    end = lit_by_blown_bulbs("of: [step_1], do: {then: give_up}")
    assert end.problem is None
    assert "(switch-on a) has failed before, in the same way and the same situation: bulb_blown" in how(end)


def test_a_plot_that_goes_round_in_no_time_is_ended_with_the_reason():
    end = lit_by_blown_bulbs("do: {then: help}")  # which tries again at once, with the same rule for what comes of it
    assert not end.finished
    assert end.problem == (
        "no time has passed for 10000 macrosteps; the plot goes round: " + " -> ".join(["bulb_blown"] * 8)
    )


def test_the_plots_of_an_action_agree_on_who_reports_its_effects():
    lamps = Lamps()
    seen = primitive_plot(lamps.skills()["light"], done="lit", implements="switch-on")
    assumed = seen.model_copy(update={"name": "blindly", "effects": "assumed"})
    with pytest.raises(PlotError, match="implement 'switch-on', but only one says `effects: assumed`"):
        Robot(DOMAIN, [seen, assumed], [lamps], clock="simulated")


@pytest.mark.parametrize(
    ("goal", "said"),
    [
        ("(onn a)", "did you mean 'on'"),
        ("(on b)", "no object 'b'"),
        ("(on ?x)", "not bound"),
        (3, "written as text, not as 3"),
    ],
)
def test_a_goal_with_a_mistake_is_refused_before_anything_runs(goal, said):
    robot, _ = executive(Answers(), lamps=("a",))
    with pytest.raises(InputError, match=said):
        robot.achieve(goal)


# -- skills that misbehave ---------------------------------------------------------------------------------


def light(answer):
    lamps = Lamps()
    lamps.answer = answer
    plot = primitive_plot(lamps.skills()["light"], done="lit", implements="switch-on")
    robot = Robot(DOMAIN, [plot], [lamps], clock="simulated")
    robot.knowledge.apply(Delta(nodes={"l1": "lamp"}, added=(fact("works", "l1"),)), "test")
    return robot, lamps


class Once:
    """Answers wrongly the first time, and well after that."""

    def __init__(self, wrong):
        self.wrong = wrong

    def __call__(self, lamp):
        if self.wrong is None:
            return Outcome("lit", observed=Delta(added=(fact("on", lamp),)))
        wrong, self.wrong = self.wrong, None
        return wrong(lamp)


def stuck(_):
    raise RuntimeError("the switch\nis stuck")


def broken(_):
    raise SkillError("no power")


MISBEHAVIOUR = [
    (stuck, "lamps.light: RuntimeError: the switch is stuck"),
    (lambda _: Outcome("dark"), "lamps.light: it ended with 'dark', which it does not declare"),
    (lambda _: "lit", "lamps.light: it ended with 'lit', which is not an Outcome"),
    (
        lambda lamp: Outcome("lit", observed=Delta(added=(fact("onn", lamp),))),
        "lamps.light: there is no predicate 'onn'",
    ),
    (lambda _: Outcome("lit", observed=Delta(added=(fact("on", "l9"),))), "lamps.light: there is no object 'l9'"),
]


@pytest.mark.parametrize(("wrong", "reason"), MISBEHAVIOUR)
def test_a_bug_in_a_step_of_a_plan_ends_the_run_and_nothing_is_tried_again(wrong, reason):
    robot, lamps = light(wrong)
    with robot:
        end = robot.achieve("(on l1)")
    assert reason in str(end.programming_error)
    assert not end.finished
    assert len(lamps.switched) == 1


def test_a_step_whose_device_fails_is_a_failed_step():
    robot, lamps = light(broken)
    with robot:
        end = robot.achieve("(on l1)")
    (gave_up,) = end.emitted
    assert "lamps.light: SkillError: no power" in gave_up.attributes["reason"]
    assert end.reason == f"gave_up: {gave_up.attributes['reason']}"
    assert (end.finished, end.reached) == (True, False)
    assert len(lamps.switched) > 1


def test_a_device_that_fails_once_does_not_keep_the_goal_from_being_reached():
    robot, _ = light(Once(broken))
    records: list[Record] = []
    robot.listen(records.append)
    with robot:
        assert robot.achieve("(on l1)").reached
    (resumed,) = (record for record in records if record.type == "plan.resumed")
    assert "lamps.light: SkillError: no power" in resumed.data["why"]


def test_a_skill_that_hangs_is_a_failed_step():
    class Deaf(Lamps):
        @skill
        async def light(self, call, lamp: Lamp) -> Lit:  # type: ignore[return]
            await asyncio.Event().wait()

    deaf = Deaf()
    with Robot(
        DOMAIN, [primitive_plot(deaf.skills()["light"], done="lit", implements="switch-on")], [deaf], clock="simulated"
    ) as robot:
        robot.knowledge.apply(Delta(nodes={"l1": "lamp"}, added=(fact("works", "l1"),)), "test")
        (gave_up,) = robot.achieve("(on l1)").emitted
    assert "lamps.light: no outcome within 300 s" in gave_up.attributes["reason"]


def test_a_rule_answers_a_step_whose_skill_fails():
    lamps = Lamps()
    lamps.answer = broken
    holder = parse_plot("""
        plot: light_up
        emits: {ended: {how: text}}
        states:
          lighting:
            goal: (on l1)
            on: {done: lit, no_plan: lit, gave_up: {to: lit, emit: ended, with: {how: ?event.reason}}}
          lit: {final: true}
        rules: [{on: skill_error, do: {then: give_up}}]
    """)
    plot = primitive_plot(lamps.skills()["light"], done="lit", implements="switch-on")
    with Robot(DOMAIN, [plot, holder], [lamps], clock="simulated") as robot:
        robot.knowledge.apply(Delta(nodes={"l1": "lamp"}, added=(fact("works", "l1"),)), "test")
        (ended,) = robot.run("light_up").emitted
    assert ended.attributes["how"] == "lamps.light: SkillError: no power"
    assert lamps.switched == ["l1"]


def test_a_goal_is_given_bounds_and_may_be_prepared():
    robot, lamps = light(lambda _: Outcome("nothing"))
    records: list[Record] = []
    robot.listen(records.append)

    def prepare(sequencer):
        sequencer.change(Delta(added=(fact("broken", "l1"),)), "somebody", after=0.5)

    with robot:
        end = robot.achieve("(on l1)", seconds=5, replans=0, prepare=prepare)
    assert "the budget of 0 new plans is used up" in end.emitted[0].attributes["reason"]
    assert robot.knowledge.ask("(broken l1)")
    assert lamps.switched


@pytest.mark.parametrize("bounds", [{"seconds": 0}, {"seconds": "5"}, {"replans": -1}, {"replans": 1.5}])
def test_bounds_that_make_no_sense_are_refused(bounds):
    robot, _ = light(None)
    (name,) = bounds
    with robot, pytest.raises(InputError, match=f"'{name}' is "):
        robot.achieve("(on l1)", **bounds)


def test_a_component_whose_parameter_nobody_has_said_is_refused_before_anything_runs():
    class LaserParameters(Parameters):
        port: str = parameter(changed_by="profile")
        rate: int = 30
        most: int = 20
        relations = ("(<= ?rate ?most)",)

    class Laser(Component):
        name = "laser"
        parameters: LaserParameters

    with pytest.raises(InputError, match=r"'laser\.port' has no value: its builder leaves it to a profile"):
        Robot("(define (domain d))", [], [Laser()], clock="simulated")

    class BoundParameters(LaserParameters):
        port: str = "ttyS0"

    class Bound(Laser):
        parameters: BoundParameters

    with pytest.raises(InputError, match=r"component 'laser' needs .<= .rate .most., but most is 20, rate is 30"):
        Robot("(define (domain d))", [], [Bound()], clock="simulated")


def test_needs_that_nobody_can_fulfil_are_refused():
    class Dimmer(Component):
        name = "dimmer"
        modes = ("evening",)
        needs: ClassVar = {"evening": ("lamp",)}

    with pytest.raises(InputError, match=r"component 'dimmer' needs a component 'lamp', .* did you mean 'lamps'"):
        Robot(DOMAIN, [HOLDER], [Lamps(), Dimmer()], clock="simulated")


def test_streams_that_have_no_port_are_refused():
    class Meter(Component):
        name = "meter"
        level = Stream({"lumen": "number"}, "lamps.level")

    with pytest.raises(InputError, match="component 'lamps' has no push port 'level'"):
        Robot(DOMAIN, [HOLDER], [Lamps(), Meter()], clock="simulated")
    with pytest.raises(
        InputError, match=r"port 'meter\.level' is wired to 'lamps\.level', and there is no such component"
    ):
        Robot(DOMAIN, [HOLDER], [Meter()], clock="simulated")


WORKER = parse_plot("""
plot: worker
receives: {order: {goal: text}, quit: }
emits: {failed: {kind: symbol, reason: text}, served: }
variables: {goal: {type: text, initial: ""}}
states:
  idle: {on: {order: {to: work, assign: {goal: ?event.goal}}, quit: over}}
  work:
    use: achieve
    with: {goal: ?goal, holder: "", replans: 1, seconds: 5}
    on:
      done: {to: idle, emit: served}
      no_plan: {to: idle, emit: failed, with: {kind: ?event.kind, reason: ?event.reason}}
      gave_up: idle
  over: {final: true}
""")


def test_an_invalid_goal_during_a_run_is_no_plan_and_the_run_continues():
    with Robot(DOMAIN, [WORKER], [], clock="simulated") as robot:
        robot.knowledge.apply(Delta(nodes={"a": "lamp"}), author="me")

        def post(sequencer):
            for number, goal in enumerate(["(onn a)", "(on", "(on zzz)", "(not (on a))"]):
                sequencer.post(Event("order", {"goal": goal}), after=1.0 + number)
            sequencer.post(Event("quit"), after=9)

        end = robot.run("worker", open_ended=True, prepare=post)
    assert (end.finished, end.programming_error) == (True, None)
    assert [one.attributes.get("kind") for one in end.emitted] == ["invalid", "invalid", "invalid", None]
    assert "there is no predicate 'onn'; did you mean 'on'?" in end.emitted[0].attributes["reason"]


def test_a_state_with_a_goal_reads_the_kind_of_no_plan():
    text = """
        plot: top
        emits: {why: {kind: symbol}}
        states:
          s: {goal: (on a), on: {done: e, no_plan: {to: e, emit: why, with: {kind: ?event.kind}}, gave_up: e}}
          e: {final: true}
    """
    with Robot(DOMAIN, [parse_plot(text)], [], clock="simulated") as robot:
        robot.knowledge.apply(Delta(nodes={"a": "lamp"}), author="me")
        end = robot.run("top")
    assert end.emitted[0].attributes == {"kind": "unsolvable"}


def test_an_invalid_goal_of_a_state_is_answered_with_its_file_and_line():
    text = """
        plot: top
        emits: {why: {reason: text}}
        states:
          s:
            goal: (on dock)
            on: {done: e, no_plan: {to: e, emit: why, with: {reason: ?event.reason}}, gave_up: e}
          e: {final: true}
    """
    with Robot(DOMAIN, [parse_plot(text, "top.yaml")], [], clock="simulated") as robot:
        robot.knowledge.apply(Delta(nodes={"a": "lamp"}), author="me")
        end = robot.run("top")
    assert end.emitted[0].attributes["reason"].startswith("top.yaml:6:13: there is no object 'dock'")

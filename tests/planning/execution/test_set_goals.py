"""Goals that components set, e.g. the leaves of a mission tree."""

from __future__ import annotations

import asyncio
from typing import NewType

import pytest

from dsc import Component, Outcome, QueryClient, SkillCall, parse_plot, primitive_plot, run_simulated, skill
from dsc.sequencer.clock import SimulatedEventLoop
from dsc.sequencer.run_end import RunEnd
from dsc.trees import Action, Condition, bind_tree, parse_trees, tree_skill
from knowledge_base import Delta, fact
from planning import Robot

Lamp = NewType("Lamp", str)
DOMAIN = """(define (domain lamps) (:types lamp) (:constants desk hall - lamp)
  (:predicates (lit ?l - lamp) (broken ?l - lamp))
  (:action light :parameters (?l - lamp) :precondition (not (broken ?l)) :effect (lit ?l)))"""
TREE = parse_trees("""
<root BTCPP_format="4">
  <BehaviorTree ID="Evening">
    <Sequence>
      <Reach goal="(lit desk)"/>
      <Fallback><Reach goal="(lit hall)"/><Excuse/></Fallback>
    </Sequence>
  </BehaviorTree>
</root>""")
EVENING = parse_plot("""
plot: evening
states:
  work:
    regions:
      goals: {states: {serve: {use: serve_goals}}}
      mission:
        states:
          mission:
            entry: {trigger: mission.carry_out}
            on: {carried_out: {to: end, emit: well}, not_carried_out: {to: end, emit: badly}}
          end: {final: true}
    on: {well: good, badly: bad}
  good: {final: true}
  bad: {final: true, emit: failed}
emits: {failed: {}}
""")


class Lit(Outcome): ...


class CarriedOut(Outcome): ...


class NotCarriedOut(Outcome): ...


class Lamps(Component):
    name = "lamps"

    def __init__(self):
        super().__init__()
        self.lit = []

    @skill(after_crash="repeat")
    async def light(self, call: SkillCall, l: Lamp) -> Lit:  # noqa: E741  the parameter of the action
        await call.clock.sleep(2.0)
        self.lit.append(l)
        return Lit(observed=Delta(added=(fact("lit", l),)))


class Mission(Component):
    name = "mission"
    goals = QueryClient({"goal": "text"}, answer={"reached": "boolean", "reason": "text"})

    def __init__(self):
        super().__init__()
        self.reasons = []

    async def pursue(self, goal: str) -> Outcome:
        end = await self.goals.ask(goal=goal, within=600)
        self.reasons.append(end["reason"])
        return Outcome("reached" if end["reached"] else "not_reached")

    @tree_skill(success=CarriedOut, failure=NotCarriedOut, after_crash="repeat")
    def carry_out(self, call: SkillCall):
        leaves = {"Reach": Action(self.pursue, ends={"reached"}), "Excuse": Condition(lambda: True)}
        return bind_tree(TREE, leaves)


def lamps_robot(lamps: Lamps, mission: Mission, **options) -> Robot:
    plots = [EVENING, primitive_plot(lamps.skills()["light"], done="lit", implements="light")]
    return Robot(DOMAIN, plots, [lamps, mission], **options)


def test_the_goals_of_a_mission_tree():
    lamps, mission = Lamps(), Mission()
    with lamps_robot(lamps, mission, clock="simulated") as robot:
        end = robot.run("evening")
        assert (end.finished, lamps.lit, mission.reasons) == (True, ["desk", "hall"], ["reached"] * 2)
        assert [goal.state for goal in robot.goals.list("reached", "failed")] == ["reached"] * 2


def test_a_goal_that_cannot_be_reached_fails_its_leaf_with_the_reason():
    lamps, mission = Lamps(), Mission()
    with lamps_robot(lamps, mission, clock="simulated") as robot:
        robot.knowledge.apply("(broken hall)", author="me")
        assert robot.run("evening").finished
    assert lamps.lit == ["desk"]
    assert mission.reasons[0] == "reached"
    assert "hall" in mission.reasons[1]


@pytest.mark.parametrize("second", [0.5, 1.9, 2.5, 3.9])
def test_a_mission_that_a_crash_has_interrupted(tmp_path, second):
    async def begin() -> None:
        kept.append(asyncio.ensure_future(killed.start("evening").task))
        await asyncio.sleep(second)

    kept: list[asyncio.Future[object]] = []  # a killed program cleans nothing up
    killed = lamps_robot(Lamps(), Mission(), store=tmp_path / "run.kb")
    SimulatedEventLoop().run_until_complete(begin())
    killed.knowledge.close()

    async def resume() -> tuple[RunEnd, list[str], list[str]]:
        lamps = Lamps()
        async with lamps_robot(lamps, Mission(), store=tmp_path / "run.kb") as robot:
            end = await robot.resuming()
            goals = robot.goals.list("waiting", "running", "reached", "failed", "withdrawn")
            return end, lamps.lit, [goal.goal for goal in goals if goal.state == "reached"]

    end, lit, reached = run_simulated(resume())
    assert end.finished
    assert lit == (["desk", "hall"] if second < 2 else ["hall"])
    assert set(reached) == {"(lit desk)", "(lit hall)"}


def test_a_mission_that_ends_withdraws_its_goal():
    async def main():
        async with lamps_robot(Lamps(), Mission()) as robot:
            run = robot.start("evening")
            await asyncio.sleep(0.5)
            run.cancel("enough")
            await run
            return [goal.state for goal in robot.goals.list("waiting", "running", "withdrawn")]

    assert run_simulated(main()) == ["withdrawn"]


def test_the_goals_of_a_tree_of_py_trees():
    py_trees = pytest.importorskip("dsc.components.behaviour_trees")

    class WithPyTrees(Mission):
        @py_trees.tree_skill(success=CarriedOut, failure=NotCarriedOut, after_crash="repeat")
        def carry_out(self, call: SkillCall):
            def reach(goal):
                return py_trees.action(goal, lambda: self.pursue(goal), ends={"reached"})

            return py_trees.sequence(
                reach("(lit desk)"), py_trees.fallback(reach("(broken desk)"), reach("(lit hall)"))
            )

    lamps, mission = Lamps(), WithPyTrees()
    with lamps_robot(lamps, mission, clock="simulated") as robot:
        assert [event.name for event in robot.run("evening").emitted] == []
    assert lamps.lit == ["desk", "hall"]
    assert [reason == "reached" for reason in mission.reasons] == [True, False, True]


def test_a_goal_that_is_no_condition():
    class Wrong(Mission):
        async def pursue(self, goal: str) -> Outcome:
            return await super().pursue(goal.replace("lit", "lti"))

    mission = Wrong()
    with lamps_robot(Lamps(), mission, clock="simulated") as robot:
        assert [event.name for event in robot.run("evening").emitted] == ["failed"]
    assert "did you mean 'lit'" in mission.reasons[0]

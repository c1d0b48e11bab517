"""The clean-up table tried out ahead: what the robot believes becomes a world, and physics has the last word."""

import pytest
from small_table import make_world

from domains.clean_up_table import Scenario, deploy
from domains.clean_up_table.bringup import HOME
from domains.clean_up_table.observations import initial_knowledge, learned
from domains.clean_up_table.physics import Physics, believed
from dsc.trace import Record
from knowledge_base import Delta, KnowledgeBase, fact
from planning import Plan, PlanningDomain, PlanStep

DOMAIN = PlanningDomain.from_pddl(HOME / "domain.pddl")


def step(text):
    action, *args = text.split()
    return PlanStep(action, tuple(args))


def seen(world):
    """The world, driven to its table, and what the robot believes after a look at it."""
    kb = KnowledgeBase(DOMAIN.schema)
    kb.apply(initial_knowledge(world.robot_at), "test")
    for result in (world.drive("a", "table"), world.recognise("b", "table")):
        kb.apply(learned(result), "test")
    return kb


PLAN = [
    "pick-up cup1 table", "stack cup1 cup2 one none table", "take-out cup1 cup2 one none table", "put-down cup1 table",
    "check-room cup3 one none table", "pick-up cup3 table", "drive table sink", "throw-away cup3 sink",
]  # fmt: skip


def test_a_plan_is_foreseen_step_by_step_and_changes_nothing():
    world = make_world()
    belief = seen(world)
    before = (belief.version, world.state())
    assert Physics().foresee(Plan(tuple(map(step, PLAN))), belief).valid
    assert (belief.version, world.state()) == before


def test_the_believed_world_is_the_real_one_as_far_as_it_was_seen():
    world = make_world()
    belief = seen(world)
    for name, text in enumerate(PLAN[:2]):
        verb = world.pick_up if text.startswith("pick") else world.stack
        args = text.split()[1:3] if text.startswith("pick") else ("cup1", "cup2", "table")
        belief.apply(learned(verb(str(name), *args)), "test")
    ahead = believed(belief)
    assert ahead.robot_at == world.robot_at
    for item in ahead.items:
        real = world.items[item.name]
        assert (item.kind, item.where, ahead.items.room(item)) == (real.kind, real.where, world.items.room(real))
    hidden = {item.name for item in world.items} - {item.name for item in ahead.items}
    assert hidden == {"can2"}


@pytest.mark.parametrize(
    ("plan", "at", "said"),
    [
        (["pick-up cup1 table", "stack cup1 crisp_can1 one none table"], 1, "a cup does not go into 'crisp_can1'"),
        (["pick-up cup1 shelf"], 0, "the robot is at table, not at shelf"),
        (["pick-up can1 table", "drive table sink", "throw-away can1 sink"], 2, "a can does not go to the sink"),
    ],
)
def test_a_physically_impossible_step_fails_in_the_simulation_with_a_reason(plan, at, said):
    verdict = Physics().foresee(Plan(tuple(map(step, plan))), seen(make_world()))
    assert (verdict.valid, verdict.failing_step) == (False, at)
    assert said in verdict.why


def test_a_plan_that_physics_refuses_is_not_carried_out(planner):
    """Somebody told the robot that cans fit into cups: it would learn at the table, it foresees it instead."""
    records: list[Record] = []
    table = deploy(Scenario.parse("table: {cups: 2, cans: 1}"), 0, 0.0, planner, records.append)
    wrong = tuple(fact("fits", "can1", cup) for cup in ("cup1", "cup2"))
    table.knowledge.apply(Delta(nodes={"can1": "can", "cup1": "cup", "cup2": "cup"}, added=wrong), "bystander")
    report = table.report()
    assert report.goal_reached
    assert not report.skill_failures
    rejected = [record.data for record in records if record.type == "plan.rejected"]
    assert rejected
    assert all("a can does not go into" in one["reason"] for one in rejected)

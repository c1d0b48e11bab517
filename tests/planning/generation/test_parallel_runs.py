"""Random plans carried out side by side, each step in a time of its own: the goal is reached whatever comes first."""

from hypothesis import given, settings
from hypothesis import strategies as st
from order_strategies import Planned, planned
from trace_replay import Replay

from dsc import ActionPlot, Component, Outcome, skill
from dsc.chance import uniform
from dsc.trace import Record
from knowledge_base.language.syntax.text import to_text
from knowledge_base.world.overlay import Overlay
from planning import PlanStep, Robot, plot_from_plan
from planning.ordering.causal_tracing import deordered


class Acted(Outcome): ...


class Everybody(Component):
    """Carries out any step, any number of them at once, and sees what comes of it."""

    name = "everybody"
    concurrent = True

    def __init__(self, domain, world, seed):
        super().__init__()
        self.planning_domain, self.world, self.seed = domain, world, seed

    @skill
    async def act(self, call, action, x="") -> Acted:
        await call.clock.sleep(10 * uniform(self.seed, call.action_id, "duration"))
        step = PlanStep(action, (x,) if x else ())
        return Acted(observed=self.planning_domain.effects(step, self.world))


def plot_for(action):
    given = {parameter.name: f"?{parameter.name}" for parameter in action.parameters}
    trigger = {"trigger": "everybody.act", "with": {"action": action.name, **given}}
    return ActionPlot.model_validate({
        "plot": f"do_{action.name}", "implements": action.name, "parameters": dict.fromkeys(given, "thing"),
        "states": {"act": {"entry": trigger, "on": {"acted": "over"}}, "over": {"final": True}},
    })  # fmt: skip


@settings(max_examples=60, derandomize=True, deadline=None)
@given(planned(), st.integers(0, 3))
def test_a_plan_side_by_side_reaches_its_goal_and_no_step_spoils_another(case: Planned, seed: int):
    world = case.world
    before = Overlay(world.snapshot())
    everybody = Everybody(case.domain, world, seed)
    plots = list(map(plot_for, case.domain.actions.values()))
    robot = Robot(case.domain, plots, [everybody], world, clock="simulated")
    order = deordered(case.plan, case.domain, world, case.goal)
    robot.library.add(plot_from_plan(case.plan, case.domain, robot.library, order=order, shared=["everybody"]))
    replay = Replay(case.domain, before, to_text(case.goal), works_for=lambda author, step: True)
    replay.take(Record(0, 0.0, "plan.found", None, {"steps": list(map(str, case.plan.steps))}))
    robot.listen(replay.take)
    end = robot.run("plan")
    assert (end.finished, end.emitted, end.problem) == (True, (), None)
    assert world.ask(to_text(case.goal))
    assert replay.problems == []
    assert not any(first in order.earlier[second] for first, second in replay.overlapping())

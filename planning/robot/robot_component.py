"""Robots as components: the plots of a robot, and its goals, are skills of another program (S2.6, S2.7, S1.22)."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from dsc.calls import SkillCall
from dsc.components.component import Component
from dsc.dynamic.knowledge_situation import ACHIEVE
from dsc.dynamic.steps import NO_PLAN_KINDS
from dsc.errors import ProgrammingError, SkillError
from dsc.events import GAVE_UP, NO_PLAN, RESERVED
from dsc.model.plot import ActionPlot
from dsc.outcomes import Outcome
from dsc.sequencer.plot_skill import COMPLETED, outcomes_of, plot_around, plot_signature
from dsc.sequencer.relay import Relay
from dsc.sequencer.run_end import RunEnd
from dsc.sequencer.sequencer import Sequencer
from dsc.skills import SkillSignature, check_arguments
from dsc.trace import Record
from knowledge_base.errors import UnknownNameError
from knowledge_base.exchange import delta_of
from planning.execution.shipped_plots import shipped_plots
from planning.robot.robot import Robot
from planning.robot.sharing import plots_of_actions, shared_domain, shared_knowledge, shared_part

_REASON = {"reason": "text"}
GOAL_SKILL = SkillSignature(
    "", ACHIEVE, {"goal": "text"}, {}, {COMPLETED: {}, NO_PLAN: {**_REASON, "kind": NO_PLAN_KINDS}, GAVE_UP: _REASON}
)
"""The skill with which another program gives a robot a goal."""
SHARE = "share_knowledge"
SHARE_SKILL = SkillSignature("", SHARE, {}, {}, {COMPLETED: {}}, after_crash="repeat")
"""The skill with which a robot shares what it knows; later it shares what it learns while it executes a skill."""


class RobotComponent(Component):
    """A component whose skills are the plots of a robot with its own knowledge, planner and devices.

    The robot itself decides what a dynamic state becomes, on its own knowledge. The skill `achieve` plans
    for a goal. Several skills may be executed at a time; they share the robot's components.

    Unless it is private, the component brings the robot's planning domain, and a skill for each planning action, whose
    candidates the robot chooses. So another robot can plan with these actions. The trace of the other robot has the
    states and decisions of this one. Its knowledge receives what this one learns during a skill, and everything by the
    skill `share_knowledge`.

    Args:
        name: the component's name in charts.
        robot: the robot; the component closes it.
        private: whether the robot keeps its domain and knowledge to itself.
    """

    concurrent = True

    def __init__(self, name: str, robot: Robot, *, private: bool = False) -> None:
        super().__init__(name)
        self._robot = robot
        self._shared = None if private else shared_domain(name, robot.domain)
        executing = {} if self._shared is None else plots_of_actions(robot)
        shipped = {plot.name for plot in shipped_plots()}
        plots = [plot for plot in robot.library if plot.name not in shipped and not plot.generated]
        own = {plot.name: plot_signature(name, plot, "sense") for plot in plots} | {ACHIEVE: GOAL_SKILL}
        if self._shared is not None:
            own[SHARE] = SHARE_SKILL
        self._signatures = {key: replace(one, component=name, unlimited=True) for key, one in own.items()}
        self._plots = [
            plot_around(one, executing.get(key))
            for key, one in self._signatures.items() if RESERVED.isdisjoint(one.outcomes)
        ]  # fmt: skip

    async def stop(self) -> None:
        """End the runs of the robot, and close it."""
        for run in self._robot.runs:
            await run.cancel("its host ends")
        self._robot.close()

    def domain_fragment(self) -> str | None:
        """Return the robot's planning domain; `None` if the robot is private."""
        return self._shared

    def plots(self) -> list[ActionPlot]:
        """Return the plots `NAME.PLOT`, with which other plots use those of the robot."""
        return list(self._plots)

    def skills(self) -> dict[str, SkillSignature]:
        """Return the signatures of the plots, of `achieve` and of `share_knowledge`."""
        return dict(self._signatures)

    async def execute(self, skill_name: str, call: SkillCall[Any], arguments: Mapping[str, Any]) -> Outcome:
        """Run the plot, or plan for the goal, and return the last outcome event.

        Earlier events become reports. A cancelled skill ends the run after its exit actions.

        Raises:
            UnknownNameError: there is no such plot.
            InputError: an argument is missing or unknown, or the goal has a mistake.
            SkillError: the run ended before its final state.
            ProgrammingError: code failed in the run.
        """
        if skill_name not in self._signatures:
            message = f"component '{self.name}' has no skill '{skill_name}'"
            raise UnknownNameError(message, found=skill_name, valid=self._signatures)
        check_arguments(self._signatures[skill_name], arguments)
        if skill_name == SHARE:
            return Outcome(COMPLETED, observed=shared_knowledge(self._robot))
        relay = Relay(call)

        def listen(record: Record) -> None:
            if record.type == "knowledge" and self._shared is not None:
                relay.flush()
                call.observe(shared_part(delta_of(dict(record.data)), self._robot))
            relay(record)

        def prepare(sequencer: Sequencer) -> None:
            sequencer.trace.listen(listen)

        if skill_name == ACHIEVE:
            run = self._robot.start(str(arguments["goal"]), prepare=prepare)
        else:
            run = self._robot.start(skill_name, arguments, prepare=prepare)
        try:
            end = await asyncio.shield(run.task)
        except asyncio.CancelledError:
            await run.cancel("its caller has cancelled it")
            raise
        finally:
            relay.flush()
        return _outcome(end, call)


def _outcome(end: RunEnd[Any], call: SkillCall[Any]) -> Outcome:
    """Return the outcome of a run, after reports of its earlier events."""
    if end.programming_error is not None:
        raise ProgrammingError(end.programming_error)
    if end.problem is not None or not end.finished:
        raise SkillError(end.problem or "it did not reach its end")
    *earlier, last = outcomes_of(end.emitted, end.outputs)
    for outcome in earlier:
        call.report(outcome)
    return last

"""Robots as components: the plots of a robot, and its goals, are skills of another program (S2.6, S2.7, S1.22)."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from dsc.calls import SkillCall
from dsc.components.component import Component
from dsc.components.parameters import ParameterValues, parameters_of
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
from planning.robot.robot import Robot
from planning.robot.run import Run
from planning.robot.sharing import (
    confirmed_effects,
    defaults_of,
    own_plots,
    plots_of_actions,
    shared_domain,
    shared_knowledge,
    shared_part,
)

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

    The defaults of the plots are the component's parameters, e.g. `fetch.speed`. A diagnosis has the runs with their
    active states.

    Args:
        name: the component's name in charts.
        robot: the robot, which the caller closes after the component has stopped.
        private: whether the robot keeps its domain and knowledge to itself.
    """

    concurrent = True

    def __init__(self, name: str, robot: Robot, *, private: bool = False) -> None:
        super().__init__(name)
        self._robot = robot
        plots = own_plots(robot.library)
        self.parameter_values = ParameterValues(name, parameters_of(defaults_of(plots), ()))
        self.parameters = self.parameter_values.parameters
        self._shared = None if private else shared_domain(name, robot.domain)
        self._actions = {} if self._shared is None else plots_of_actions(robot)
        own = {plot.name: plot_signature(name, plot, "sense") for plot in own_plots(robot.library)}
        own[ACHIEVE] = GOAL_SKILL
        if self._shared is not None:
            own[SHARE] = SHARE_SKILL
        self._signatures = {key: _in_hull(name, one) for key, one in own.items()}
        self._plots = [
            plot_around(one, self._actions.get(key))
            for key, one in self._signatures.items() if RESERVED.isdisjoint(one.outcomes)
        ]  # fmt: skip

    async def start(self) -> None:
        """Apply the parameters, which the profile of a client may have set."""
        for parameter, value in self.parameters.items():
            self._set_default(parameter, value)

    async def stop(self) -> None:
        """End the runs of the robot."""
        for run in self._robot.runs:
            await run.cancel("its host ends")

    async def configure(self, parameter: str, value: object) -> None:
        """Set the default of a plot's parameter, also for later entries in present runs; raise as `Component`."""
        declared = self.parameter_values.declared
        if parameter in declared:
            self._set_default(parameter, declared[parameter].default if value is None else value)
        await super().configure(parameter, value)

    def _set_default(self, parameter: str, value: object) -> None:
        plot, _, name = parameter.rpartition(".")
        self._robot.library = self._robot.library.with_default(plot, name, value, "operator")
        for run in self._robot.runs:
            run.set_parameter(plot, name, value)

    async def diagnose(self) -> dict[str, Any]:
        """Return the status, with the active states of each run."""
        return {**await super().diagnose(), "runs": [_run_form(run) for run in self._robot.runs]}

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
        given = {key: value for key, value in arguments.items() if value is not None}  # the others have their defaults
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
            run = self._robot.start(skill_name, given, prepare=prepare)
        try:
            end = await asyncio.shield(run.task)
        except asyncio.CancelledError:
            await run.cancel("its caller has cancelled it")
            raise
        finally:
            relay.flush()
        outcome = _outcome(end, call)
        if outcome.event != COMPLETED or skill_name not in self._actions:
            return outcome
        confirmed = confirmed_effects(self._actions[skill_name], given, self._robot)
        return Outcome(COMPLETED, outcome.attributes, confirmed)


def _in_hull(name: str, skill: SkillSignature) -> SkillSignature:
    """Return the signature of a plot in the hull of the component, where the present defaults are unknown."""
    optional = {key: f"optional {str(skill.parameters[key]).removeprefix('optional ')}" for key in skill.defaults}
    parameters = {**skill.parameters, **optional}
    return replace(skill, component=name, parameters=parameters, defaults=dict.fromkeys(optional), unlimited=True)


def _run_form(run: Run[Any]) -> dict[str, Any]:
    """Return the state of a run as plain data, for a diagnosis."""
    state = run.state
    skills = [{"skill": one.skill, "since": one.since, "waits_for": one.waits_for} for one in state.waiting]
    return {"run": run.id, "time": state.time, "active": list(state.active), "skills": skills}


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

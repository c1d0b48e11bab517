"""Plots as skills: a component runs a plot, with separate components and a separate world model (S2.6, S0.9).

In one run, prefer `use`: the plot then shares the knowledge, and its states are part of the chart. A plot as a skill is
closed: its only data are its arguments, outcomes and outputs. Therefore another process can host it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from dsc.calls import SkillCall
from dsc.components.component import Component
from dsc.dynamic.library import Library
from dsc.engine.steps import Step
from dsc.errors import ProgrammingError, SkillError
from dsc.events import Event
from dsc.model.plot import ActionPlot
from dsc.outcomes import Outcome
from dsc.sequencer.clock import LoopClock
from dsc.sequencer.relay import Relay
from dsc.sequencer.sequencer import Sequencer
from dsc.skills import AfterCrash, SkillSignature, check_arguments
from knowledge_base.errors import UnknownNameError
from knowledge_base.language.syntax.expression import Constant
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema import Schema

COMPLETED = "completed"
"""The outcome of a plot with outputs, which are its attributes, and of a plot that emits no event at its end."""


class PlotComponent(Component):
    """A component whose skills are plots.

    Args:
        name: the component's name in charts.
        library: the plots; each is a skill, with its events and `completed` as outcomes.
        components: the components that the plots use.
        knowledge: returns the world model for one execution; by default an empty one.
        after_crash: the treatment of an interrupted plot. A repeated plot starts again, and repeats its actions. The
            actions have their former ids if the plot chooses the same actions in the same order.
    """

    def __init__(
        self,
        name: str,
        library: Library,
        components: Iterable[Component] = (),
        knowledge: Callable[[], KnowledgeBase] = lambda: KnowledgeBase(Schema()),
        after_crash: AfterCrash = "sense",
    ) -> None:
        super().__init__(name)
        self._library = library
        self._components = tuple(components)
        self._knowledge = knowledge
        self._signatures = {plot.name: plot_signature(self.name, plot, after_crash) for plot in library}

    async def stop(self) -> None:
        """Stop the components that the plots have started."""
        for component in reversed(self._components):
            await component.life.retire()

    def skills(self) -> dict[str, SkillSignature]:
        """Return a signature for each plot, by name."""
        return dict(self._signatures)

    def plots(self) -> list[ActionPlot]:
        """Return a plot around each skill, as `plot_around` makes it."""
        return [plot_around(one) for one in self._signatures.values()]

    async def execute(self, skill_name: str, call: SkillCall[Any], arguments: Mapping[str, Any]) -> Outcome:
        """Run the plot to its end, and return its outcome; events that it emits earlier become reports.

        A cancelled plot exits its states.

        Raises:
            UnknownNameError: there is no such plot.
            InputError: an argument is missing or unknown.
            SkillError: the plot ended before its final state.
            ProgrammingError: code failed in the run of the plot.
        """
        if skill_name not in self._signatures:
            message = f"component '{self.name}' has no skill '{skill_name}'"
            raise UnknownNameError(message, found=skill_name, valid=self._signatures)
        check_arguments(self._signatures[skill_name], arguments)
        part_of = f"{call.action_id}/"
        sequencer = Sequencer(
            self._library, self._knowledge(), self._components, LoopClock(), part_of=part_of, run_id=call.run
        )
        ended: list[Outcome] = []

        def receive(step: Step) -> None:
            said = outcomes_of(step.emitted, step.outputs if step.state.finished else None)
            if step.state.finished:
                ended.append(said.pop())
            for outcome in said:
                call.report(outcome)

        relay = Relay(call)
        sequencer.trace.listen(relay)
        sequencer.listen(receive)
        try:
            end = await sequencer.run(skill_name, arguments)
        finally:
            relay.flush()
        if end.programming_error is not None:
            raise ProgrammingError(end.programming_error)
        if not ended or end.problem is not None:
            raise SkillError(end.problem or "it did not reach its end")
        return ended[0]


def outcomes_of(emitted: Iterable[Event], outputs: Mapping[str, Any] | None) -> list[Outcome]:
    """Return the events that a plot has emitted as outcomes; with its outputs, the last one is the plot's end."""
    said = [Outcome(event.name, dict(event.attributes)) for event in emitted]
    return said if outputs is None or (said and not outputs) else [*said, Outcome(COMPLETED, dict(outputs))]


def plot_around(skill: SkillSignature, implements: str | None = None) -> ActionPlot:
    """Return the plot `COMPONENT.PLOT` with which other plots use a plot of a component like their own (S2.6).

    It has the parameters, outcomes and outputs of the skill's plot.

    Args:
        skill: the signature of the skill that runs the plot.
        implements: the planning action that the plot executes.
    """
    outputs = skill.outcomes[COMPLETED]
    completed = {"to": "over", "assign": {name: f"?event.{name}" for name in outputs}}
    ways: dict[str, Any] = {COMPLETED: completed}
    others = {event: attributes for event, attributes in skill.outcomes.items() if event != COMPLETED}
    for event, attributes in others.items():
        ways[event] = {"to": "ended", "emit": event, "with": {name: f"?event.{name}" for name in attributes}}
    given = {"with": {name: f"?{name}" for name in skill.parameters}}
    form = {
        "plot": f"{skill.component}.{skill.name}",
        "parameters": {
            name: {"type": type_, **({} if skill.defaults.get(name) is None else {"default": skill.defaults[name]})}
            for name, type_ in skill.parameters.items()
        },
        "outputs": {name: {"type": type_} for name, type_ in outputs.items()},
        "emits": others,
        "implements": implements,
        "states": {
            "there": {"entry": {"trigger": f"{skill.component}.{skill.name}", **given}, "on": ways},
            "over": {"final": True},
            **({"ended": {"final": True}} if others else {}),
        },
    }
    return ActionPlot.model_validate({key: value for key, value in form.items() if value})


def plot_signature(component: str, plot: ActionPlot, after_crash: AfterCrash) -> SkillSignature:
    """Return the signature of a plot as a skill: its parameters, outcomes and, with `completed`, its outputs."""
    defaults = {name: one.default for name, one in plot.parameters.items() if not one.required}
    return SkillSignature(
        component=component,
        name=plot.name,
        parameters={name: one.type for name, one in plot.parameters.items()},
        defaults={name: value.value if isinstance(value, Constant) else value for name, value in defaults.items()},
        outcomes={
            **{event: dict(attributes or {}) for event, attributes in plot.emits.items()},
            COMPLETED: {name: output.type for name, output in plot.outputs.items()},
        },
        after_crash=after_crash,
    )

"""A plot as a skill: a component of its own runs it, with components and a world model of its own (S2.6, S0.9).

A plot in the same run is better `use`d: it sees the same knowledge, and its states are part of the chart. As a skill a
plot is closed: what it knows it was given, what it found out it emits or hands back. So it can be hosted elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from dsc.calls import Outcome, SkillCall
from dsc.components.component import Component
from dsc.dynamic.library import Library
from dsc.engine.steps import Step
from dsc.model.plot import ActionPlot
from dsc.sequencer.clock import LoopClock
from dsc.sequencer.sequencer import Sequencer
from dsc.skills import AfterCrash, SkillSignature, check_arguments
from knowledge_base.errors import UnknownNameError
from knowledge_base.language.syntax.expression import Constant
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema import Schema

COMPLETED = "completed"
"""The outcome of a plot that has outputs, which are its attributes, or that emits nothing as it comes to its end."""


class PlotComponent(Component):
    """A component whose skills are plots.

    Args:
        name: how charts address it.
        library: the plots; each is a skill, whose outcomes are what it emits, and `completed`.
        components: what the plots use.
        knowledge: makes the world model for one execution; empty if left out.
        after_crash: what may be done about a plot that was under way: it begins anew, and so do the actions in it, with
            the same ids as far as it goes the same way.
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
        self._signatures = {plot.name: _signature(self.name, plot, after_crash) for plot in library}

    def skills(self) -> dict[str, SkillSignature]:
        """A signature for each plot."""
        return dict(self._signatures)

    async def execute(self, skill_name: str, call: SkillCall, arguments: Mapping[str, Any]) -> Outcome:
        """Run the plot to its end; what it emits on the way is reported. Cancelled, it leaves its states.

        Raises:
            UnknownNameError: there is no such plot.
            InputError: an argument is missing or unknown.
            RuntimeError: it ended otherwise than by reaching its end.
        """
        if skill_name not in self._signatures:
            message = f"component '{self.name}' has no skill '{skill_name}'"
            raise UnknownNameError(message, found=skill_name, valid=self._signatures)
        check_arguments(self._signatures[skill_name], arguments)
        part_of = f"{call.action_id}/"
        sequencer = Sequencer(self._library, self._knowledge(), self._components, LoopClock(), part_of=part_of)
        ended: list[Outcome] = []

        def hear(step: Step) -> None:
            said = [Outcome(event.name, dict(event.attributes)) for event in step.emitted]
            if step.state.finished:
                ended.append(said.pop() if said and not step.outputs else Outcome(COMPLETED, dict(step.outputs)))
            for outcome in said:
                call.report(outcome)

        sequencer.listen(hear)
        end = await sequencer.run(skill_name, arguments)
        if not ended or end.problem is not None:
            raise RuntimeError(end.problem or "it did not reach its end")
        return ended[0]


def _signature(component: str, plot: ActionPlot, after_crash: AfterCrash) -> SkillSignature:
    defaults = {name: one.default for name, one in plot.parameters.items() if one.default is not None}
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

"""Rehearsal of a whole run without a robot: scripted skills, simulated time, and all steps for inspection."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from dsc.components.component import Component
from dsc.dynamic.library import Library
from dsc.engine.steps import Step
from dsc.events import Event
from dsc.model.plot import ActionPlot
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.sequencer.run_end import RunEnd
from dsc.sequencer.sequencer import Sequencer
from dsc.testing.fixtures import change_of, world
from dsc.testing.scripted import Call, Replies, ScriptedSkills
from dsc.trace import Record, Trace
from knowledge_base.errors import InputError
from knowledge_base.facts import Delta
from knowledge_base.store import KnowledgeBase

OUTSIDER = "somebody"
"""Author of the changes that a test makes."""
A_DAY = 86400.0
"""Seconds after which a rehearsal ends by default, so that every rehearsal ends."""
MOST_STEPS = 100_000
"""Maximum number of steps, also for a run in which time does not advance."""


@dataclass(frozen=True, slots=True)
class Rehearsal:
    """The record of a rehearsed run.

    Attributes:
        library: the available plots.
        end: the end of the run.
        seconds: duration of the run, in simulated time.
        steps: all macrosteps; see `predicates`.
        calls: the calls of scripted skills, in order.
        records: the trace.
        knowledge: the knowledge at the end.
    """

    library: Library
    end: RunEnd
    seconds: float
    steps: tuple[Step, ...]
    calls: tuple[Call, ...]
    records: tuple[Record, ...]
    knowledge: KnowledgeBase

    @property
    def finished(self) -> bool:
        """Whether the plot reached its final state."""
        return self.end.finished

    @property
    def problem(self) -> str | None:
        """The reason why the plot did not finish, or an error of its last step; else `None`."""
        return self.end.problem

    @property
    def emitted(self) -> tuple[Event, ...]:
        """The plot's outcome events, in order."""
        return self.end.emitted


def rehearse(
    plots: Iterable[ActionPlot],
    plot: str,
    arguments: Mapping[str, Any] | None = None,
    *,
    skills: Mapping[str, Replies] | None = None,
    like: Iterable[Component] = (),
    components: Iterable[Component] = (),
    knowledge: KnowledgeBase | None = None,
    events: Iterable[tuple[float, Event | str]] = (),
    changes: Iterable[tuple[float, Delta | str]] = (),
    until: float = A_DAY,
) -> Rehearsal:
    """Run a plot to its end in simulated time, which takes almost no real time; return the record of the run.

    Args:
        plots: the library, or its plots.
        plot: the name of the plot to run.
        arguments: values for the plot's parameters.
        skills: the answers of scripted skills; see `ScriptedSkills`.
        like: components with the signatures of the scripted skills.
        components: further components to deploy, unchanged.
        knowledge: the world model, which the run changes; see `world`. By default an empty one.
        events: events from outside, each with its second; a name alone has no attributes.
        changes: changes of the knowledge by others, each with its second. A change is a `Delta`, or a PDDL effect on
            the world at the start.
        until: seconds after which the rehearsal ends the run with a problem.

    Raises:
        InputError: the plot is unknown, an argument is wrong, or an event or change is invalid. The error is also
            raised if a called skill has no scripted answer, or does not declare the answer.
        Exception: an exception of a function of the script, e.g. a failed assertion about its call.
    """
    known = knowledge if knowledge is not None else world()
    scripted = ScriptedSkills(known, skills or {}, like)
    steps: list[Step] = []
    records: list[Record] = []

    library = Library(plots)

    def keep(step: Step) -> None:
        steps.append(step)
        if len(steps) > MOST_STEPS:
            raise InputError(f"it still runs after {MOST_STEPS} steps")

    async def run() -> tuple[RunEnd, float]:
        clock = LoopClock()
        trace = Trace(clock.now)
        trace.listen(records.append)
        sequencer = Sequencer(library, known, [*scripted.components, *components], clock, trace)
        sequencer.listen(keep)
        for second, event in events:
            sequencer.post(Event(event) if isinstance(event, str) else event, after=second)
        for second, change in changes:
            sequencer.change(change_of(change, known), OUTSIDER, after=second)
        try:
            async with asyncio.timeout(until):
                end = await sequencer.run(plot, arguments)
        except TimeoutError:
            emitted = tuple(event for step in steps for event in step.emitted)
            end = RunEnd(finished=False, emitted=emitted, problem=f"it still runs after {until:g} s")
        return end, clock.now()

    end, seconds = run_simulated(run())
    scripted.check()
    return Rehearsal(library, end, seconds, tuple(steps), tuple(scripted.calls), tuple(records), known)

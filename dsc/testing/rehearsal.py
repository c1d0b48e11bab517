"""A whole run of a plot without a robot: scripted skills, simulated time, everything that happened at hand."""

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
from dsc.sequencer.sequencer import RunEnd, Sequencer
from dsc.testing.answers import Call, Replies
from dsc.testing.scripted import ScriptedSkills
from dsc.testing.worlds import change_of, world
from dsc.trace import Record, Trace
from knowledge_base.errors import InputError
from knowledge_base.facts import Delta
from knowledge_base.store import KnowledgeBase

SOMEBODY = "somebody"
"""Author of the changes that a test hands in."""
A_DAY = 86400.0
"""Seconds after which a rehearsal ends if nothing else is said: none goes on for ever."""
MOST_STEPS = 100_000
"""Nor does one in which time stands still."""


@dataclass(frozen=True, slots=True)
class Rehearsal:
    """What happened.

    Attributes:
        library: the plots that could be used.
        end: how the run ended.
        seconds: how long it took, in simulated time.
        steps: all macrosteps; see `predicates`.
        calls: the calls of scripted skills, in order.
        records: the trace.
        knowledge: what is known at the end.
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
        """Why it did not, or what went wrong in its last step."""
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
    """Run a plot to its end in simulated time; it takes no real time to speak of.

    Args:
        plots: the library, or its plots.
        plot: the name of the one to run.
        arguments: values for its parameters.
        skills: what scripted skills answer; see `ScriptedSkills`.
        like: components whose signatures the scripted skills keep to.
        components: others to be deployed, as they are.
        knowledge: the world model, which the run changes; see `world`. An empty one if left out.
        events: what comes from outside, each with the second at which it does; a name alone has no attributes.
        changes: how others change the knowledge, each with the second: a change, or a PDDL effect on the world at
            the start.
        until: seconds after which the run is ended, with that as its problem.

    Raises:
        InputError: the plot is unknown, an argument is wrong, an event or change cannot be handed in, or the
            script does not fit: a skill that was called without an answer, an answer that is none of the skill's.
        Exception: what a function of the script raised, e.g. a failed assertion about its call.
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
            sequencer.change(change_of(change, known), SOMEBODY, after=second)
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

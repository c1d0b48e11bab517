"""State machine: stores the state of a running chart and applies the step function to this state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from dsc.engine.automaton import Choice, CompiledReaction, Question
from dsc.engine.binding import find_values
from dsc.engine.idle_state import IdleState, idle_state
from dsc.engine.machine_forms import read_state
from dsc.engine.machine_state import NOTHING, FrameState, MachineState
from dsc.engine.macrostep import Macrostep
from dsc.engine.plot_changes import ActivePlots, keep_plots
from dsc.engine.reaction_choice import follow
from dsc.engine.sensing import read_sensors
from dsc.engine.situation import Chart, Situation
from dsc.engine.steps import NO_CHANGE, Microstep, SendMessage, Step
from dsc.errors import RunawayError
from dsc.events import CYCLE, Event
from knowledge_base.errors import InputError

_new = tuple.__new__
"""Constructor of named tuples without keywords and defaults, which double the time of the usual constructors."""


def move(state: MachineState, root: FrameState, event: Event, situation: Situation) -> Step | None:
    """Return a cached step, or a step that changes only the configuration; `None` if a full macrostep is required."""
    idle = state if isinstance(state, IdleState) else None
    if idle is not None:
        known = idle.steps.get(event.name)
        if known is not None and known.event is event:
            return known
    choices = root.configuration.reactions.choices
    choice = choices.get(event.name)
    if isinstance(choice, Question):
        choice = _evaluate_guards(choice, root, event, situation)
    if not isinstance(choice, CompiledReaction) or not choice.still or root.children:
        return None
    following = choice.following
    after: MachineState
    if idle is not None:
        after = idle_state(root, state.serials, following)
    else:
        serial, compiled, _, variables, activations, children, kept = root
        frame = _new(FrameState, (serial, compiled, following, variables, activations, children, kept))
        after = _new(MachineState, (frame, state.serials, False))
    micro = _new(Microstep, (event, choice.taken, choice.exited, choice.entered, ()))
    step = _new(Step, (after, event, True, (micro,), (), NO_CHANGE, (), (), (), NOTHING, ()))
    if idle is not None and choices[event.name] is choice:
        idle.keep(step, event)
    return step


def _evaluate_guards(question: Question, root: FrameState, event: Event, situation: Situation) -> Choice | None:
    bindings = {**root.variables, **event.bindings()} if event.attributes else root.variables
    choice: Choice = question
    while isinstance(choice, Question):
        try:
            bind = choice.edge.bind
            if bind is None:
                choice = follow(choice, situation.holds(choice.condition, bindings))
            else:
                choice = follow(choice, find_values(bind, situation, bindings) is not None)
        except InputError:  # the full macrostep evaluates the guard again and reports the error
            return None
    return choice


def start(chart: Chart, plot: str, arguments: Mapping[str, Any], situation: Situation, serials: int = 0) -> Step:
    """Enter a plot, run to completion and return this first step.

    Args:
        chart: provider of plots.
        plot: name of the plot to start.
        arguments: values for the plot's parameters, by name.
        situation: the knowledge that conditions and terms read.
        serials: the last serial number of an earlier step; larger numbers keep all action ids distinct.

    Raises:
        InputError: the plot is unknown, or a parameter is missing or unknown.
        RunawayError: the macrostep does not end.
    """
    return Macrostep(chart, situation, MachineState(serials=serials)).start(plot, arguments)


def step(chart: Chart, state: MachineState, event: Event | None, situation: Situation) -> Step:
    """React to one event, run to completion and return the step; the function is pure.

    With `event=None`, e.g. after a change of the knowledge, only transitions without trigger are considered. A machine
    that has not started or has ended handles no event.

    Raises:
        RunawayError: the macrostep does not end.
    """
    if event is not None and event.name == CYCLE:
        state = read_sensors(state, event)
    if state.root is None:
        return Step(state, event, handled=False)
    if event is not None and event.to is None and event.frame is None:
        moved = move(state, state.root, event, situation)
        if moved is not None:
            return moved
    return Macrostep(chart, situation, state).react(event)


@dataclass(slots=True)
class Machine:
    """State machine of one running chart; `step` computes each new state.

    Attributes:
        chart: provider of plots.
        state: the state after the last step.
    """

    chart: Chart
    state: MachineState = field(default_factory=MachineState)

    def start(self, plot: str, arguments: Mapping[str, Any], situation: Situation) -> Step:
        """Start a plot and store the new state; see `start`. Serial numbers continue those of the old state."""
        done = start(self.chart, plot, arguments, situation, self.state.serials)
        self.state = done.state
        return done

    def send(self, event: Event | None, situation: Situation) -> Step:
        """React to one event and store the new state; see `step`."""
        done = step(self.chart, self.state, event, situation)
        self.state = done.state
        return done

    def replace_plots(
        self, library: Chart, before: Mapping[str, Mapping[str, Any]], active: ActivePlots, situation: Situation
    ) -> Step:
        """Apply a change of plots to the running ones, and store the new state.

        Args:
            library: provider of the plots after the change.
            before: the written forms of the changed plots before the change, by name.
            active: the treatment of the running ones.
            situation: the knowledge that conditions and terms read.

        Raises:
            InputError: a running plot cannot continue, or a parameter of a new plot has no value; the state stays.
        """
        form = self.state.to_json()
        if form["root"] is None:
            return Step(self.state, None, handled=False)
        state = read_state({**form, "root": keep_plots(form["root"], before)}, library)
        done = Step(state, None, handled=True)
        if active != "at_next_entry":
            done = Macrostep(self.chart, situation, state).replace_plots(before, active)
        self.state = done.state
        return done

    def is_enabled(self, situation: Situation) -> bool:
        """Return whether a transition without trigger is enabled, or its guard fails; the state is unchanged."""
        try:
            done = step(self.chart, self.state, None, situation)
        except RunawayError:
            return True
        return bool(done.microsteps or done.output or done.errors or done.bugs)

    def entry_messages(self, situation: Situation) -> tuple[SendMessage, ...]:
        """Return the messages that the entry of the active states would send now, the outer states' first."""
        if self.state.root is None:
            return ()
        return Macrostep(self.chart, situation, self.state).entry_messages()

    def leave(self, situation: Situation) -> Step:
        """Exit all active states before the plot has ended; their exit actions stop the skills (S0.15)."""
        if self.state.root is None:
            return Step(self.state, None, handled=False)
        done = Macrostep(self.chart, situation, self.state).leave()
        self.state = done.state
        return done

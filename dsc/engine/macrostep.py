"""Macrostep: microsteps and internal events until no transition is enabled (SCXML 3.13, appendix D: mainEventLoop)."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import partial
from itertools import repeat
from operator import attrgetter
from typing import Any

from dsc.engine.automaton import CompiledReaction, Question, ReactionPart, configuration_of
from dsc.engine.execution import Execution
from dsc.engine.frames import Frame
from dsc.engine.idle_state import state_between
from dsc.engine.machine_state import FrameState, MachineState
from dsc.engine.performing import Performer, file_and_line
from dsc.engine.plot_changes import ActivePlots, replace_plots
from dsc.engine.reaction import reaction_of
from dsc.engine.reaction_choice import choice_of, follow, settle_guard
from dsc.engine.situation import Chart, Situation
from dsc.engine.step_builder import StepBuilder
from dsc.engine.steps import Note, SendMessage, Step
from dsc.engine.tables import Addressed, TransitionEdge, Trigger
from dsc.engine.taken import report
from dsc.engine.transition_selection import Enabled, select
from dsc.errors import RunawayError
from dsc.events import AT_LEAST, ERRORS, EVERY, EXECUTION_ERROR, PROGRAMMING_ERROR, Event, for_all_plots, goes_outwards
from dsc.model.actions import Send
from dsc.model.states import FinalState
from knowledge_base.errors import InputError
from knowledge_base.language.syntax.expression import Expression

MAX_MICROSTEPS = 1000
"""Upper bound of microsteps in one macrostep; a longer macrostep raises `RunawayError`."""
_MOST_STATES = 40
"""Number of microsteps in which an error looks for the round of states that a macrostep repeats."""
_FEW_STATES = 6
_is_spontaneous = attrgetter("configuration.spontaneous")


class Macrostep:
    """A macrostep: selects transitions until none is enabled.

    `Execution` takes the selected transitions, and `Performer` executes their actions.
    """

    __slots__ = ("_broken_guards", "_execution", "_performer", "_results", "_root", "_turn")

    _root: Frame

    def __init__(self, chart: Chart, situation: Situation, state: MachineState) -> None:
        self._results = StepBuilder(state.serials)
        self._performer = Performer(situation, self._results)
        self._execution = Execution(chart, self._performer)
        self._broken_guards: set[tuple[int, TransitionEdge, int]] = set()
        self._turn = 0
        if state.root is not None:
            self._root = Frame(state.root)

    def start(self, plot: str, arguments: Mapping[str, Any]) -> Step:
        """Enter the outermost plot; raise `InputError` if the plot is unknown or its arguments do not fit."""
        self._root = self._execution.enter_plot(self._execution.chart.compiled(plot), arguments)
        self._results.end_microstep(None, ())
        self._rest()
        return self._step(None, handled=True)

    def react(self, event: Event | None) -> Step:
        """Handle the event and run to completion; an event that a waiting state keeps also counts as handled.

        If no state handles the failure of a command, all plots see it as the failure of the component.
        """
        handled = event is not None and self._take(event)
        if event is not None and not handled and (failure := for_all_plots(event)) is not None:
            handled = self._take(failure)
        if event is not None and event.name == EVERY:
            self._next_period(event)
        self._rest()
        return self._step(event, handled=handled)

    def replace_plots(self, names: Collection[str], active: ActivePlots) -> Step:
        """Replace the running plots of these names, and run to completion; errors as for the function."""
        self._root = replace_plots(self._root, self._execution, names, active)
        self._results.end_replacement()
        return self.react(None)

    def entry_messages(self) -> tuple[SendMessage, ...]:
        """Return the messages that the entry of the active states would send; those without a value are omitted."""
        for frame in self._root.frames():
            for index in frame.configuration.active:
                node = frame.compiled.nodes[index]
                self._performer.act(frame, node.name, [one for one in node.entry if isinstance(one, Send)])
        return tuple(one for one in self._step(None, handled=False).output if isinstance(one, SendMessage))

    def leave(self) -> Step:
        """Exit all active states of all plots and return this last step."""
        return self._step(None, handled=False, left=True)

    def _step(self, event: Event | None, *, handled: bool, left: bool = False) -> Step:
        results, execution = self._results, self._execution
        if left or execution.finished:
            self._leave()
            state = MachineState(None, results.serials, execution.finished)
        else:
            state = state_between(self._root.frozen(), results.serials)
        return results.step(state, event, handled=handled, outputs=execution.outputs)

    def _leave(self) -> None:
        self._execution.leave_plot(self._root)
        self._results.end_microstep(None, ())
        for event in self._results.internal:
            if event.name in ERRORS:
                self._record_unhandled(event)

    def _rest(self) -> None:
        """Take transitions without trigger, then handle internal events, until neither is left."""
        internal = self._results.internal
        while not self._execution.finished:
            if self._take_in(self._root.that(_is_spontaneous), None, None):
                continue
            if not internal:
                return
            event = internal.popleft()
            if not self._take(event):
                if event.name in ERRORS:
                    self._record_unhandled(event)
                elif event.to is not None:
                    self._refuse_lost_outcome(event, event.to)

    def _refuse_lost_outcome(self, event: Event, host: int) -> None:
        """Record an error if a plot has ended with this outcome, because its host state would wait without end."""
        found = self._find(host)
        if found is None:
            return
        frame, state = found
        inner = frame.children.get(state)
        if inner is None or inner.compiled.scxml:
            return
        plot = inner.compiled.plot
        ended = any(isinstance(plot.states.get(name), FinalState) for name in inner.configuration.names)
        if ended and event.name in plot.emits:
            state = frame.prefix + state
            self._results.add_error(f"state '{state}' does not handle '{event.name}' of plot '{plot.name}'")

    def _record_unhandled(self, error: Event) -> None:
        """Record an error event that no transition handles.

        In dialect `dsc` the error ends the run; in SCXML it is an ordinary event (SCXML 3.12, 5.10.1).
        """
        # A chart may itself fire an `error` event without the attribute `reason`.
        reason = str(error.attributes.get("reason", "the chart fired 'error' without a reason"))
        if error.name == EXECUTION_ERROR or any(one.compiled.scxml for one in self._root.that(_is_frame(error.frame))):
            self._results.put(Note(error.name, reason))
        elif error.name == PROGRAMMING_ERROR:
            self._results.add_bug(reason)
        else:
            self._results.add_error(reason)

    # -- one event ---------------------------------------------------------------------------------------

    def _take(self, event: Event) -> bool:
        """Run one microstep if the event enables a transition; else keep the event if a waiting state needs it.

        Returns:
            Whether a transition was taken or the event was kept.
        """
        self._performer.event = event
        if event.name not in ERRORS:  # a guard that fails for the error event it caused would repeat without end
            self._turn += 1
        if event.to is not None:
            return self._take_addressed(event, event.to)
        if event.frame is not None:
            return self._take_in(self._root.that(_is_frame(event.frame)), event.name, event)
        return self._take_in(self._root.that(partial(choice_of, trigger=event.name)), event.name, event)

    def _take_addressed(self, event: Event, activation: int) -> bool:
        found = self._find(activation)
        if found is None:
            return False
        frame, state = found
        if event.name == AT_LEAST:
            return self._least_time_passed(frame, state)
        trigger = Addressed(event.name, frame.compiled.index[state], event.exact, event.number, event.inside)
        if self._take_alone(frame, trigger, event):
            return True
        if event.inside and event.name in frame.compiled.plot.emits:
            self._performer.emit(frame, event.name, event.attributes)
            return True
        return goes_outwards(event.name) and self._take_around(frame, event)

    def _take_around(self, frame: Frame, event: Event) -> bool:
        """Offer an unhandled event to each host state, innermost first; return whether a host state handled it."""
        while frame.parent is not None:
            host, frame = frame.host, frame.parent
            trigger = Addressed(event.name, frame.compiled.index[host], exact=False, number=None)
            if self._take_alone(frame, trigger, event):
                return True
        return False

    def _find(self, activation: int) -> tuple[Frame, str] | None:
        """Return the frame and state with this serial number, or `None` if the state is no longer active."""
        for frame in self._root.that(lambda one: activation in one.activations.values()):
            for state, serial in frame.activations.items():
                if serial == activation:
                    return frame, state
        return None

    def _take_in(self, concerned: list[Frame], trigger: Trigger, event: Event | None) -> bool:
        """Run one microstep if a plot in `concerned` has an enabled transition; return whether it handled the event."""
        if len(concerned) == 1:
            return self._take_alone(concerned[0], trigger, event)
        return bool(concerned) and self._take_together(trigger, event)

    def _take_alone(self, frame: Frame, trigger: Trigger, event: Event | None) -> bool:
        choice = choice_of(frame, trigger)
        while isinstance(choice, Question):
            choice = follow(choice, self._holds(frame, choice.edge, choice.condition))
        if choice is None:
            return False
        kept = bool(choice.keeps) and self._keep(frame, choice.keeps, event)
        if not choice.parts:
            return kept
        if len(self._results.microsteps) >= MAX_MICROSTEPS:
            raise self._runaway()
        self._execution.take([(frame, choice)], [*zip(repeat(frame), choice.parts, strict=False)])
        taken = choice.taken_in(frame.compiled, frame.prefix) if frame.prefix else choice.taken
        self._results.end_microstep(event, taken)
        return True

    def _take_together(self, trigger: Trigger, event: Event | None) -> bool:
        """Select transitions across several plots; inner transitions may preempt outer ones (SCXML 3.13)."""
        taken, late = select(self._root, trigger, self._guard)
        kept = [self._keep(one.frame, (one.frame.compiled.nodes[one.edge.source].name,), event) for one in late]
        if not taken:
            return any(kept)
        if len(self._results.microsteps) >= MAX_MICROSTEPS:
            raise self._runaway()
        by_frame: dict[Frame, list[TransitionEdge]] = {}
        for one in taken:
            by_frame.setdefault(one.frame, []).append(one.edge)
        reactions = {frame: reaction_of(frame.configuration, tuple(edges)) for frame, edges in by_frame.items()}
        parts = [(one.frame, _part_of(one, reactions[one.frame])) for one in taken]
        reports = tuple([report(one.edge, one.frame.compiled, one.frame.prefix) for one in taken])
        self._execution.take([*reactions.items()], parts)
        self._results.end_microstep(event, reports)
        return True

    def _runaway(self) -> RunawayError:
        entered = [path for micro in self._results.microsteps[-_MOST_STATES:] for path in micro.entered]
        trail = _last_round(entered)
        around, _, state = trail[-1].rpartition("/") if trail else ("", "", "")
        places = [
            file_and_line(frame.compiled.plot, state) for frame in self._root.frames() if frame.prefix[:-1] == around
        ]
        return RunawayError(f"no rest after {MAX_MICROSTEPS} microsteps; the chart goes round{''.join(places)}", trail)

    # -- guards ------------------------------------------------------------------------------------------

    def _guard(self, frame: Frame, edge: TransitionEdge) -> bool:
        if edge.guard is None:
            return True
        return self._holds(frame, edge, settle_guard(edge, edge.guard, frame.configuration))

    def _holds(self, frame: Frame, edge: TransitionEdge, condition: Expression) -> bool:
        try:
            return self._performer.enables(frame, edge, condition)
        except InputError as error:
            # A guard's error is reported only once in a macrostep, because guards without trigger are evaluated after
            # every microstep. In SCXML the error of a guard with a trigger is reported for each event (SCXML 5.9.1).
            each = frame.compiled.scxml and edge.place[0] == "on"
            broken = (frame.serial, edge, self._turn if each else 0)
            if broken not in self._broken_guards:
                self._broken_guards.add(broken)
                source, guard = frame.compiled.nodes[edge.source].name, f"guard of '{edge.trigger}' in "
                self._performer.fail(frame, source, error, what=guard, part=(*edge.place, "when"))
            return False

    # -- time --------------------------------------------------------------------------------------------

    def _keep(self, frame: Frame, states: Iterable[str], event: Event | None) -> bool:
        """Keep an event for waiting states, given by name; return `False` for a periodic event, which is dropped."""
        if event is None or event.name == EVERY:
            return False
        frame.kept = (*frame.kept, *((state, event) for state in states))
        return True

    def _least_time_passed(self, frame: Frame, state: str) -> bool:
        """Enable the transitions of a state whose least time has passed; first offer the state its kept events."""
        before = frame.configuration
        waiting = before.waiting - {frame.compiled.index[state]}
        frame.configuration = configuration_of(frame.compiled, before.active, waiting, before.history)
        own = frame.activations[state]
        for name, kept in frame.kept:
            if name == state:
                self._results.fire(kept._replace(to=own, exact=True))
        frame.kept = tuple([one for one in frame.kept if one[0] != state])
        return True

    def _next_period(self, event: Event) -> None:
        found = self._find(event.to or 0)
        if found is not None and event.number is not None:
            frame, state = found
            node = frame.compiled.nodes[frame.compiled.index[state]]
            seconds = node.cycles[event.number].seconds
            self._performer.start_timer(frame, node, event.to or 0, EVERY, event.number, seconds)


def _last_round(entered: Sequence[str]) -> Sequence[str]:
    """Return the states since the last one was entered before; without such a round, the last few states."""
    *before, last = entered or ("",)
    return entered[len(before) - 1 - before[::-1].index(last) :] if last in before else entered[-_FEW_STATES:]


def _is_frame(serial: int | None) -> Callable[[Frame | FrameState], bool]:
    return lambda one: one.serial == serial


def _part_of(one: Enabled, reaction: CompiledReaction) -> ReactionPart:
    return next(part for part in reaction.parts if part.edge is one.edge)

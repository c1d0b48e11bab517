"""The reactor: applies each message to machine and knowledge, and records its macrostep; it dispatches nothing."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import replace
from typing import Any

from dsc.calls import OBSERVED, RECORDED
from dsc.components.hooks import contained, programming_error
from dsc.dynamic.knowledge_situation import KnowledgeSituation
from dsc.dynamic.library import Library
from dsc.engine.machine import Machine
from dsc.engine.machine_state import MachineState
from dsc.engine.steps import (
    NO_CHANGE,
    Cancel,
    Output,
    SendLater,
    SendMessage,
    SetParameter,
    SetWire,
    Start,
    StartTimer,
    Step,
)
from dsc.errors import RunawayError
from dsc.events import EVERY, PROGRAMMING_ERROR, RESERVED, SKILL_FAILURES, Event
from dsc.messages import (
    KnowledgeMessage,
    LateMessage,
    Message,
    ParameterMessage,
    PlotsMessage,
    SkillMessage,
    TimerMessage,
    WireMessage,
)
from dsc.model.plot import ActionPlot
from dsc.model.relations import CONFIGURATION, DESIGN
from dsc.reflection import configuration_rows, design_rows, running_plots
from dsc.runs.encoding import signatures_of
from dsc.runs.kept import Kept
from dsc.sequencer.checked_plots import CheckedPlots
from dsc.sequencer.phase_watch import PhaseWatch, described
from dsc.sequencer.step_tracing import StepTracer
from dsc.skills import SkillSignature
from dsc.trace import Trace
from knowledge_base.errors import InputError
from knowledge_base.facts import Delta
from knowledge_base.store import KnowledgeBase
from knowledge_base.tracebacks import raised_at
from knowledge_base.world.fact_index import Args

MOST_CANCELLED = 1_000
"""Upper bound of the number of cancelled skills whose cause is kept, for the trace of late observations."""
MOST_EMITTED = 100
"""Number of outcome events of the plot that are kept: the latest events, and the latest event of each name."""
MOST_UNHEARD = 100
"""Upper bound of the number of failed commands that are reported at the end of a run."""
CHART = "chart"
"""Author of the changes that a plot makes with `tell`."""
StepListener = Callable[[Step], None]
"""Function that is called with each macrostep; it must not block."""


class Reactor:
    """Executor of one macrostep for each message, in a live run and in the replay of a recorded run.

    Args:
        library: the plots at the start of the run.
        knowledge: the world model.
        trace: receives the records.
        phases: measures the phases of a macrostep.
        run: the run that action ids contain, so that they are unique; empty in simulated time.

    Attributes:
        machine: the chart's state.
        library: the present plots of the run.
        plots: the plots that have changed since the start, by name; `None` for a removed plot.
        emitted: the latest outcome events of the plot, in order, see `MOST_EMITTED`.
        problem: the reason to end the run, or the error of its last step; `None` without either.
        programming_error: the programming error that is this reason, else `None`.
        answered_bugs: the programming errors to which the plot has responded.
        outputs: the outputs of the plot by name, after its end.
        unheard: reasons of failed commands that no state has handled, and whose own states were left; at most
            `MOST_UNHEARD`.
        in_vain: activation and number of periods without any effect since the last other message.
        settings: an operator's settings of plots, by plot and parameter.
        relations: the rows of the relations that conditions read, see `dsc.model.relations`.
        renewed: whether the last macrosteps may have changed relations that conditions have read.
        caused_by: by action id, the number of the trace record about the start of a skill that may still answer. Of
            cancelled skills, only the latest `MOST_CANCELLED` are kept.
        listeners: functions that are called with each macrostep, before its actions are dispatched.
    """

    def __init__(
        self,
        library: Library,
        knowledge: KnowledgeBase,
        trace: Trace,
        phases: PhaseWatch | None = None,
        run: str = "",
    ) -> None:
        self._phases = phases or PhaseWatch()
        self._run = run
        self.library = library.copy()
        self._live = knowledge.live_rows
        self.plots: Mapping[str, ActionPlot | None] = {}
        self.knowledge = knowledge
        self._skills: Collection[SkillSignature] | None = None
        self.machine = Machine(CheckedPlots(self.library, knowledge.schema))
        self.trace = trace
        self.tracer = StepTracer(trace)
        trace.blame = lambda error: self._note(error, "a listener of the trace")
        self.listeners: list[StepListener] = []
        self.emitted: tuple[Event, ...] = ()
        self.problem: str | None = None
        self.programming_error: str | None = None
        self.answered_bugs: set[str] = set()
        self.outputs: Mapping[str, Any] = {}
        self.unheard: list[str] = []
        self.in_vain: set[tuple[int, int]] = set()
        self.settings: dict[tuple[str, str], ParameterMessage] = {}
        self.caused_by: dict[str, int] = {}
        self._cancelled: deque[str] = deque()
        self._noted: set[str] = set()
        self._now: float | None = None
        self.relations = {
            **design_rows(lambda: self.library),
            **configuration_rows(
                lambda: self.machine.state.configuration(),  # noqa: PLW0108  of the state at the call
                lambda: running_plots(self.machine.state),
                lambda: self.library,
            ),
        }
        self.renewed = False
        self._told_rows: dict[str, list[Args]] = {}

    def know_skills(self, skills: Collection[SkillSignature] | None) -> None:
        """Check plots given as data also against the deployed skills; `None` if they are unknown."""
        self._skills = skills
        self._change_library({})

    def _change_library(self, plots: Mapping[str, ActionPlot | None]) -> None:
        """Change the plots of the library; plots given as data are checked again."""
        if plots:
            self.library.change(plots)
        self.machine.chart = CheckedPlots(self.library, self.knowledge.schema, self._skills)
        if self._live.read:
            self.renew(DESIGN)

    def restore(self, kept: Kept) -> None:
        """Restore the state after the last macrostep of an interrupted run."""
        self.machine.state = kept.state
        self.emitted = kept.emitted
        self.in_vain = set(kept.in_vain)
        self.problem = kept.problem
        self.programming_error = kept.programming_error
        self.outputs = kept.outputs
        self.plots = kept.plots
        self.library.experience = kept.experience
        self._change_library(kept.plots)
        for setting in kept.settings:
            self._set_default(setting)
        self.caused_by = {one.what.action_id: one.cause for one in kept.pending if isinstance(one.what, Start)}
        states = {}
        for one in kept.pending:
            if isinstance(one.what, Start) and not one.cancelled:
                self.tracer.begun(one.what)
                if found := kept.state.state_of(one.what.activation):
                    states[one.what.action_id] = found[0]
        self.tracer.restore(kept.records, states)

    def moment(self) -> float:
        """Return the second of run time of the last macrostep: that of its first call, so that a replay repeats it."""
        if self._now is None:
            self._now = self.trace.now()
        return self._now

    @property
    def finished(self) -> bool:
        """Whether the plot has reached its final state, and its last step had no error."""
        return self.machine.state.finished and self.problem is None

    def start(self, plot: str, arguments: Mapping[str, Any], serials: int = 0) -> tuple[Output, ...]:
        """Enter the plot, and return its outputs.

        Args:
            plot: the plot's name.
            arguments: values of the plot's parameters.
            serials: the last serial number that earlier runs have used.

        Raises:
            InputError: the plot is unknown, or a parameter is missing or unknown.
        """
        self.machine.state = MachineState(serials=serials)
        self._now = None
        began = self._phases.timer()
        try:
            step = self.machine.start(plot, arguments, KnowledgeSituation(self.knowledge, self.library, self.moment))
            if self._phases.timer() - began > self._phases.limit:
                self._phases.report(step, self._phases.timer() - began)
        except RunawayError as error:
            self.problem = str(error)
            return ()
        try:
            return self._commit(step)
        except InputError as error:
            self.problem = str(error)
            return ()

    def react(self, message: Message) -> tuple[Output, ...]:
        """Execute the macrostep for a message, and return its outputs; an error sets `problem` instead."""
        self._now = None
        try:
            event = self._receive(message)
            before, began = self.machine.state, self._phases.timer()
            said = message.message if isinstance(message, LateMessage) else message
            if isinstance(said, PlotsMessage):
                step = self._change_plots(said)
            else:
                step = self.machine.send(event, KnowledgeSituation(self.knowledge, self.library, self.moment))
            if self._phases.timer() - began > self._phases.limit:
                self._phases.report(step, self._phases.timer() - began)
            if isinstance(said, ParameterMessage) and not said.of_plot:
                step = step._replace(output=(SetParameter(said.owner, said.name, said.value), *step.output))
            elif isinstance(said, WireMessage):
                component, _, port = said.port.partition(".")
                step = step._replace(output=(SetWire(component, port, said.to), *step.output))
            in_vain = isinstance(message, TimerMessage) and step.state == before and _is_vain(step)
            if in_vain or self.in_vain:
                self._note_periods(message, in_vain=in_vain)
            output = self._commit(step)
            if event is not None and not step.handled:
                self._end_unhandled(message, event)
            elif event is not None and event.name == PROGRAMMING_ERROR:
                self.answered_bugs.add(event.attributes["reason"])
        except (RunawayError, InputError) as error:
            self.problem = str(error)
            return ()
        return output

    def is_enabled(self) -> bool:
        """Return whether a transition without trigger could be taken now, or its guard fails."""
        return self.machine.is_enabled(KnowledgeSituation(self.knowledge, self.library, self.moment))

    def observe(self, message: SkillMessage) -> None:
        """Apply the observations of a message that arrives after the last macrostep."""
        self._receive(message)

    def leave(self) -> tuple[Output, ...]:
        """Exit the active states at the end of a run, and return the outputs of exit actions, which stop components."""
        if self.machine.state.root is None:
            return ()
        self._now = None
        try:
            return self._commit(self.machine.leave(KnowledgeSituation(self.knowledge, self.library, self.moment)))
        except InputError as error:
            self.problem = self.problem or str(error)
            return ()

    def entry_messages(self) -> tuple[SendMessage, ...]:
        """Return the messages that the entry of the active states would send now."""
        return self.machine.entry_messages(KnowledgeSituation(self.knowledge, self.library, self.moment))

    def suspend(self) -> tuple[Output, ...]:
        """Exit the active states without a record or a change of knowledge, and return the outputs of exit actions."""
        try:
            return self.machine.leave(KnowledgeSituation(self.knowledge, self.library, self.moment)).output
        except InputError:  # a value of an exit action cannot be computed
            return ()

    def _receive(self, message: Message) -> Event | None:
        """Apply the observations of a message; return its event for the machine, or `None`."""
        if isinstance(message, LateMessage):
            message = message.message
        if isinstance(message, KnowledgeMessage):
            self.trace.cause = None
            self._apply(message.delta, message.author)
            return None
        if isinstance(message, ParameterMessage):
            self.trace.cause = None
            if message.of_plot:
                self._set_default(message)
                self.trace.cause = self.tracer.set_default(message)
            return None
        if isinstance(message, WireMessage | PlotsMessage):
            self.trace.cause = None
            return None
        if isinstance(message, TimerMessage):
            return self._due(message)
        if isinstance(message, SkillMessage):
            return self._answer(message)
        event = message.event if isinstance(message, SendLater) else message
        self.trace.cause = None
        self.trace.cause = self.tracer.event(event, _source(event))
        return event

    def _set_default(self, setting: ParameterMessage) -> None:
        """Change the default of a plot's parameter for later entries."""
        self.settings[setting.owner, setting.name] = setting
        plot = self.library.plot(setting.owner).with_default(setting.name, setting.value, "operator")
        self._change_library({setting.owner: plot})

    def _change_plots(self, message: PlotsMessage) -> Step:
        """Change the plots of the run; a change with which a running plot cannot continue is refused."""
        if message.components and self._skills is not None:
            new = [skill for forms in message.components.values() for skill in signatures_of(forms)]
            self.know_skills([*self._skills, *new])
        situation = KnowledgeSituation(self.knowledge, self.library, self.moment)
        before = {name: self.library.plot(name) if name in self.library else None for name in message.plots}
        forms = {name: plot.to_form() for name, plot in before.items() if plot is not None}
        self._change_library(message.plots)
        try:
            step = self.machine.replace_plots(self.library, forms, message.active, situation)
        except InputError as error:
            self._change_library(before)
            self.trace.cause = self.tracer.plots(message, before, str(error))
            return Step(self.machine.state, None, handled=False)
        self.plots = {**self.plots, **message.plots}
        self.settings = {key: one for key, one in self.settings.items() if key[0] not in message.plots}
        self.trace.cause = self.tracer.plots(message, before)
        return step

    def _due(self, message: TimerMessage) -> Event:
        self.trace.cause = None
        timer = message.timer
        event = Event(timer.event, to=timer.activation, exact=True, number=timer.index)
        if timer.event != EVERY:  # most periods have no effect; for the others, the trace records the step
            self.trace.cause = self.tracer.event(event, "timer")
        return event

    def _answer(self, message: SkillMessage) -> Event | None:
        start, outcome = message.start, message.outcome
        if outcome.event == OBSERVED:
            self.trace.cause = self.caused_by.get(start.action_id)
            self._apply(outcome.observed, start.component)
            return None
        self.trace.cause = self.caused_by.get(start.action_id)
        if outcome.event == RECORDED:
            if found := self.machine.state.state_of(start.activation):
                self.tracer.relay(start, found[0], outcome.attributes.get("lines", ()))
            return None
        if message.final:
            self.tracer.answered(start)
            if message.continues:
                self._forget_causes([start.action_id])
            else:
                self.caused_by.pop(start.action_id, None)
        name = start.names.get(outcome.event, outcome.event)
        event = Event(name, outcome.attributes, to=start.activation, inside=message.activated)
        skill = f"{start.component}.{start.skill}"
        self.trace.cause = self.tracer.event(event, skill, outcome.event, message.conflated)
        if outcome.observed is not NO_CHANGE:
            self._apply(outcome.observed, start.component)
        return event

    def _apply(self, delta: Delta, author: str) -> None:
        if delta:
            try:
                self.knowledge.apply(delta, author)
            except ExceptionGroup as errors:
                self._note(errors, "a listener of the knowledge base")

    def _note(self, error: Exception, observer: str) -> None:
        """Log an error of an observer, one time for each place; an observer must not stop the robot."""
        place = raised_at(error)
        if place in self._noted:
            return
        self._noted.add(place)
        programming_error(error, observer)

    def fail(self, bug: str) -> None:
        """End the run with a programming error."""
        self.problem = self.problem or bug
        self.programming_error = self.programming_error or bug

    def _commit(self, step: Step) -> tuple[Output, ...]:
        """Record the step and apply its changes of knowledge; return its outputs, which may then be dispatched."""
        if self._run and step.output:
            step = step._replace(output=tuple([_of_run(one, self._run) for one in step.output]))
        if self.listeners:
            self._tell(step)
        self.tracer.step(step)
        if step.decisions:
            self.tracer.decisions(step)
        if step.knowledge is not NO_CHANGE:
            self._apply(step.knowledge, CHART)
        for output in step.output:
            if isinstance(output, Start):
                self.caused_by[output.action_id] = self.tracer.started(output)
            elif isinstance(output, Cancel):
                if cancelled := self.tracer.cancelled(output.activation):
                    self._forget_causes(cancelled)
            else:
                self.tracer.told(output)
        if step.emitted:
            self.emitted = _latest((*self.emitted, *step.emitted))
        self.outputs = step.outputs or self.outputs
        if step.errors or step.bugs:
            self._note_errors(step)
        if self._live.read:
            self.renew(CONFIGURATION)
        return step.output

    def renew(self, names: Iterable[str]) -> None:
        """Evaluate the conditions on relations whose rows may have changed."""
        try:
            self.renewed |= self.knowledge.renew_relations(*names)
        except ExceptionGroup as errors:
            self._note(errors, "a listener of the knowledge base")

    def new_rows(self) -> dict[str, list[Args]]:
        """Return the rows of other programs' relations that were read, and have changed, since the last call."""
        found: dict[str, list[Args]] = {}
        for name, rows in self._live.take_new().items():
            listed = [one.args for one in rows]
            if name not in self.relations and self._told_rows.get(name) != listed:
                found[name] = self._told_rows[name] = listed
        return found

    def _note_errors(self, step: Step) -> None:
        if step.errors:
            self.problem = self.problem or "; ".join(step.errors)
        if step.bugs:
            self.fail("; ".join(step.bugs))

    def _tell(self, step: Step) -> None:
        """Call the listeners; an `InputError` of a listener ends the run, and every other error only the listener."""
        for listener in tuple(self.listeners):
            try:
                with contained():
                    listener(step)
            except InputError:
                raise
            except Exception as error:  # noqa: BLE001  # a listener may raise any error
                self._note(error, "a listener of the sequencer")
                self.listeners.remove(listener)

    def _forget_causes(self, cancelled: Iterable[str]) -> None:
        """Forget the causes of the earliest of the cancelled skills; until then, a skill may still observe."""
        self._cancelled.extend(cancelled)
        while len(self._cancelled) > MOST_CANCELLED:
            self.caused_by.pop(self._cancelled.popleft(), None)

    def _note_periods(self, message: Message, *, in_vain: bool) -> None:
        if not isinstance(message, TimerMessage) or not in_vain:
            self.in_vain.clear()
        elif message.timer.event == EVERY:
            self.in_vain.add((message.timer.activation, message.timer.index))

    def _end_unhandled(self, message: Message, event: Event) -> None:
        """End the run if an active state ignores the final answer of its skill, or the failure of its command.

        After an answer, the state would wait without end. A programming error ends the run in any case.
        """
        final = isinstance(message, Event) or (isinstance(message, SkillMessage) and message.final)
        if event.to is None or not final:
            return
        if event.name == PROGRAMMING_ERROR:
            self.fail(event.attributes["reason"])
            return
        caller = self.machine.state.state_of(event.to)
        if caller is None and isinstance(message, Event):
            self._report(event.attributes["reason"])
        elif caller is not None:
            whose = f": {event.attributes['reason']}" if event.name in SKILL_FAILURES else f" of {_skill(message)}"
            self.problem = f"no transition handles '{event.name}'{whose}; the caller is {described(*caller)}"

    def _report(self, reason: str) -> None:
        if reason not in self.unheard and len(self.unheard) < MOST_UNHEARD:
            self.unheard.append(reason)


def _skill(message: Message) -> str:
    return f"{message.start.component}.{message.start.skill}" if isinstance(message, SkillMessage) else ""


def _source(event: Event) -> str:
    """Return what fires an event that is neither an answer nor of a timer: a component, its port, or `outside`."""
    attributes = event.attributes if event.name in RESERVED else {}
    return str(attributes.get("skill") or attributes.get("component") or "outside")


def _is_vain(step: Step) -> bool:
    """Return whether a step only scheduled the next period; with equal state and world, later periods do that too."""
    only_timers = all(isinstance(output, StartTimer) for output in step.output)
    return only_timers and not step.knowledge and not step.emitted


def _latest(events: tuple[Event, ...]) -> tuple[Event, ...]:
    """Return the events without the oldest ones, except the latest event of each name."""
    surplus = len(events) - MOST_EMITTED
    if surplus <= 0:
        return events
    latest = {event.name: index for index, event in enumerate(events)}
    return tuple(event for index, event in enumerate(events) if index >= surplus or latest[event.name] == index)


def _of_run(output: Output, run: str) -> Output:
    """Return the output; the start of a skill has the run in its action id."""
    return replace(output, action_id=f"{run}/{output.action_id}") if isinstance(output, Start) else output

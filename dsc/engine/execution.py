"""One macrostep at work: microsteps, entering and leaving, internal events, until the chart rests (SCXML 3.13)."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from functools import partial
from typing import Any

from dsc.engine.actions import delay_of, evaluate, fill_parameters, output_of
from dsc.engine.compiler import Chart, CompiledPlot, Edge
from dsc.engine.configuration import MachineState
from dsc.engine.entering import Entry, entry_set
from dsc.engine.frames import Frame, freeze, thaw
from dsc.engine.membership import settle
from dsc.engine.selection import Enabled, everything, is_addressed, select
from dsc.engine.situation import Decision, Situation
from dsc.engine.steps import Bound, Cancel, DecisionMade, Microstep, Note, Output, SendLater, StartTimer, Step, Taken
from dsc.errors import RunawayError
from dsc.events import DONE, DONE_STATE, ERROR, ERRORS, EXECUTION_ERROR, NO_CANDIDATE, Event
from dsc.model.actions import Assign, Choose, Emit, ExternalAction, Internal, Log, Tell, Trigger
from dsc.model.states import DynamicState, FinalState, State, SubmachineState
from knowledge_base.errors import InputError
from knowledge_base.facts import Delta
from knowledge_base.language.expression import Expression

MAX_MICROSTEPS = 1000
"""A macrostep that takes more is going round in circles."""
MAX_NESTING = 40
"""Plots inside plots; deeper than that, a plot contains itself without end."""


class Execution:
    """Works on thawed frames; `finish` freezes them into the next state."""

    def __init__(self, chart: Chart, situation: Situation, state: MachineState | None = None) -> None:
        state = state or MachineState()
        self._chart = chart
        self._situation = situation
        self._serials = state.serials
        self._root = thaw(state.root, chart) if state.root else None
        self._finished = state.finished
        self._internal: deque[Event] = deque()
        self._event: Event | None = None
        self._microsteps: list[Microstep] = []
        self._decisions: list[DecisionMade] = []
        self._output: list[Output] = []
        self._emitted: list[Event] = []
        self._errors: list[str] = []
        self._broken_guards: set[tuple[int, int]] = set()
        self._knowledge = Delta()
        self._exited: list[str] = []
        self._entered: list[str] = []
        self._bound: list[Bound] = []

    # -- the macrostep -----------------------------------------------------------------------------------

    def start(self, plot: str, arguments: Mapping[str, Any]) -> None:
        """Enter the outermost plot."""
        compiled = self._chart.compiled(plot)
        self._root = self._new_frame(compiled, arguments, None, -1)
        self._enter_initial(self._root)
        self._record(None, ())
        self._rest()

    def react(self, event: Event | None) -> bool:
        """Take the event, then run to completion; returns whether a transition took the event."""
        assert self._root is not None  # noqa: S101  # `step` answers for a finished machine
        handled = False
        if event is not None and is_addressed(self._root, event):
            handled = self._microstep(event)
        self._rest()
        return handled

    def leave(self) -> None:
        """Leave all active states of all plots."""
        assert self._root is not None  # noqa: S101
        self._exit(everything(self._root))
        self._record(None, ())
        self._root = None
        self._errors += [_reason(event) for event in self._internal if event.name in ERRORS]

    def finish(self, event: Event | None, *, handled: bool) -> Step:
        """The step as a value."""
        if self._finished and self._root is not None:
            self.leave()
        root = freeze(self._root) if self._root else None
        return Step(
            state=MachineState(root, self._serials, self._finished),
            event=event,
            handled=handled,
            microsteps=tuple(self._microsteps),
            decisions=tuple(self._decisions),
            knowledge=self._knowledge,
            output=tuple(self._output),
            emitted=tuple(self._emitted),
            errors=tuple(self._errors),
        )

    def _rest(self) -> None:
        while not self._finished:
            if self._microstep(None):
                continue
            if not self._internal:
                return
            event = self._internal.popleft()
            if not self._microstep(event) and event.name in ERRORS:
                self._errors.append(_reason(event))

    def _microstep(self, event: Event | None) -> bool:
        assert self._root is not None  # noqa: S101
        self._event = event or self._event
        enabled = select(self._root, event, self._guard)
        if not enabled:
            return False
        if len(self._microsteps) >= MAX_MICROSTEPS:
            trail = [path for micro in self._microsteps[-6:] for path in micro.entered]
            raise RunawayError(f"no rest after {MAX_MICROSTEPS} microsteps; the chart goes round", trail)
        taken = tuple(self._taken(one) for one in enabled)
        self._exit(set().union(*(one.left() for one in enabled)))
        for one in enabled:
            self._perform(one.frame, one.edge.effect)
        for one in enabled:
            if one.edge.target is not None:
                self._enter(one.frame, one.domain, one.edge.targets)
        self._record(event, taken)
        return True

    def _guard(self, frame: Frame, edge: Edge) -> bool:
        if edge.guard is None:
            return True
        try:
            return self._holds(frame, edge.guard)
        except InputError as error:
            # Once in a macrostep: a guard without trigger is looked at again after every microstep.
            if (frame.serial, id(edge)) not in self._broken_guards:
                self._broken_guards.add((frame.serial, id(edge)))
                self._fail(frame, f"guard of '{edge.trigger}' in {frame.path(edge.source)}: {error}")
            return False

    def _holds(self, frame: Frame, condition: Expression) -> bool:
        if frame.compiled.scxml:
            condition = settle(condition, frame.is_active)
        return self._situation.holds(condition, self._bindings(frame, self._event))

    def _bindings(self, frame: Frame, event: Event | None) -> dict[str, Any]:
        return {**frame.variables, **event.bindings()} if event else frame.variables

    def _taken(self, one: Enabled) -> Taken:
        target = None if one.edge.target is None else one.frame.path(one.edge.target)
        source, edge = one.frame.path(one.edge.source), one.edge
        return Taken(source, edge.trigger, target, edge.rule, one.frame.compiled.plot.name, edge.place)

    def _record(self, event: Event | None, taken: tuple[Taken, ...]) -> None:
        happened = Microstep(event, taken, tuple(self._exited), tuple(self._entered), tuple(self._bound))
        self._microsteps.append(happened)
        self._exited, self._entered, self._bound = [], [], []

    # -- leaving -----------------------------------------------------------------------------------------

    def _exit(self, left: Iterable[tuple[Frame, int]]) -> None:
        """Inner before outer, later before earlier: the reverse of document order, through all plots."""
        leaving = sorted(left, key=lambda at: at[0].position(at[1]), reverse=True)
        for frame, index in leaving:
            frame.remember(index)
        for frame, index in leaving:
            node = frame.node(index)
            if node.state is not None:
                self._exited.append(frame.path(index))
            if node.timeouts or any(isinstance(action, Trigger) for action in node.entry):
                self._output.append(Cancel(frame.active[index]))
            self._act(frame, index, node.exit)
            frame.children.pop(index, None)
            del frame.active[index]

    # -- entering ----------------------------------------------------------------------------------------

    def _enter_initial(self, frame: Frame) -> None:
        self._enter(frame, 0, (frame.node(0).initial,))

    def _enter(self, frame: Frame, domain: int, targets: tuple[int, ...]) -> None:
        """Enter what leads to the targets, the other regions on the way, and what is inside, in document order."""
        entry = entry_set(frame.compiled, domain, targets, frame.history)
        for index in sorted(entry.nodes):
            self._enter_one(frame, index, entry)
            self._enter_content(frame, index)

    def _enter_one(self, frame: Frame, index: int, entry: Entry) -> None:
        node = frame.node(index)
        frame.active[index] = self._next_serial()
        if node.state is not None:
            self._entered.append(frame.path(index))
        self._act(frame, index, node.entry)
        self._perform(frame, entry.after.get(index, ()))
        for number, (seconds, _) in enumerate(node.timeouts):
            try:
                delay = delay_of(self._value(frame, seconds))
            except InputError as error:
                self._fail(frame, f"{frame.path(index)}: {error}")
            else:
                self._output.append(StartTimer(frame.active[index], number, delay))

    def _enter_content(self, frame: Frame, index: int) -> None:
        state = frame.node(index).state
        if isinstance(state, FinalState):
            if state.emit is not None:
                self._perform(frame, (Emit(emit=state.emit, arguments=state.arguments),))
            self._complete_around(frame, index)
        elif isinstance(state, SubmachineState):
            self._bind_submachine(frame, index, state)
        elif isinstance(state, DynamicState):
            self._bind_dynamic(frame, index, state)
        elif type(state) is State and not frame.compiled.scxml:
            self._done(frame, index)

    def _bind_submachine(self, frame: Frame, index: int, state: SubmachineState) -> None:
        try:
            arguments = {k: self._value(frame, v) for k, v in state.arguments.items()}
            if state.use.startswith("?"):
                compiled = self._chart.bind(frame.variables[state.use[1:]])
            else:
                compiled = self._chart.compiled(state.use)
            inner = self._new_frame(compiled, arguments, frame, index)
        except InputError as error:
            self._fail(frame, f"{frame.path(index)}: {error}")
            return
        self._enter_initial(inner)

    def _bind_dynamic(self, frame: Frame, index: int, state: DynamicState) -> None:
        bindings = self._bindings(frame, self._event)
        try:
            decision = self._situation.choose(state, frame.compiled.plot.name, bindings)
            self._decisions.append(DecisionMade(frame.path(index), decision))
            self._bind_decision(frame, index, decision)
        except InputError as error:
            self._fail(frame, f"{frame.path(index)}: {error}")

    def _bind_decision(self, frame: Frame, index: int, decision: Decision) -> None:
        if decision.satisfied:
            self._done(frame, index)
        elif decision.chosen is None:
            self._internal.append(Event(NO_CANDIDATE, to=frame.active[index]))
        else:
            compiled = self._chart.compiled(decision.chosen)
            inner = self._new_frame(compiled, decision.arguments, frame, index)
            self._enter_initial(inner)

    def _new_frame(
        self, compiled: CompiledPlot, arguments: Mapping[str, Any], parent: Frame | None, host: int
    ) -> Frame:
        variables = fill_parameters(compiled.plot, arguments, self._situation)
        frame = Frame(self._next_serial(), compiled, variables, parent, host)
        if parent is not None:
            if parent.depth >= MAX_NESTING:
                raise RunawayError(f"plots nested deeper than {MAX_NESTING}", [parent.path(host)])
            parent.children[host] = frame
        self._bound.append(Bound(parent.path(host) if parent else "", compiled.plot))
        return frame

    # -- completion --------------------------------------------------------------------------------------

    def _complete_around(self, frame: Frame, final: int) -> None:
        around = frame.node(final).parent
        if around == 0:
            self._plot_finished(frame)
        elif frame.node(around).state is not None:
            self._done(frame, around)
        else:
            orthogonal = frame.node(around).parent
            if all(self._region_finished(frame, region) for region in frame.node(orthogonal).children):
                self._done(frame, orthogonal)

    def _region_finished(self, frame: Frame, region: int) -> bool:
        return any(child in frame.active and frame.node(child).final for child in frame.node(region).children)

    def _plot_finished(self, frame: Frame) -> None:
        if frame.parent is None:
            self._finished = True
        else:
            self._done(frame.parent, frame.host)

    def _done(self, frame: Frame, index: int) -> None:
        if frame.compiled.scxml:
            self._internal.append(Event(DONE_STATE + frame.node(index).name, frame=frame.serial))
        elif DONE in frame.node(index).edges:
            self._internal.append(Event(DONE, to=frame.active[index], exact=True))

    # -- actions -----------------------------------------------------------------------------------------

    def _act(self, frame: Frame, index: int, actions: tuple[ExternalAction | Internal, ...]) -> None:
        activation = frame.active[index]
        for number, action in enumerate(actions):
            try:
                if isinstance(action, Internal):
                    self._internal_action(frame, action)
                else:
                    value = partial(self._value, frame)
                    self._output.append(output_of(action, activation, number, value))
            except InputError as error:
                self._fail(frame, f"{frame.path(index)}: {error}")
                if frame.compiled.scxml:  # an error ends the block (SCXML 4.9)
                    return

    def _perform(self, frame: Frame, actions: Iterable[Internal]) -> None:
        for action in actions:
            try:
                self._internal_action(frame, action)
            except InputError as error:
                self._fail(frame, f"{frame.compiled.plot.name}: {error}")
                if frame.compiled.scxml:
                    return

    def _internal_action(self, frame: Frame, action: Internal) -> None:
        match action:
            case Assign(assign=terms):
                frame.variables.update({name: self._value(frame, term) for name, term in terms.items()})
            case Tell(tell=effect):
                told = self._situation.tell(effect, self._bindings(frame, self._event))
                self._knowledge = self._knowledge.then(told)
            case Emit():
                attributes = {name: self._value(frame, term) for name, term in action.arguments.items()}
                delay = None if action.delay is None else delay_of(self._value(frame, action.delay))
                self._emit(frame, action.emit, attributes, delay)
            case Log(log=parts, label=label):
                self._output.append(Note(label, "".join(str(self._value(frame, part)) for part in parts)))
            case Choose():
                for inner in action.then if self._holds(frame, action.condition) else action.otherwise:
                    self._internal_action(frame, inner)

    def _emit(self, frame: Frame, name: str, attributes: Mapping[str, Any], delay: float | None = None) -> None:
        if delay is not None:
            self._output.append(SendLater(Event(name, attributes, frame=frame.serial), delay))
        elif name not in frame.compiled.plot.emits:
            self._internal.append(Event(name, attributes, frame=frame.serial))
        elif frame.parent is None:
            self._emitted.append(Event(name, attributes))
        elif frame.host in frame.parent.active:
            self._internal.append(Event(name, attributes, to=frame.parent.active[frame.host]))
        # Else the host was left by another transition of this microstep: nobody waits for an outcome any more.

    def _value(self, frame: Frame, term: Any) -> Any:
        return evaluate(term, self._bindings(frame, self._event), self._situation)

    def _fail(self, frame: Frame, reason: str) -> None:
        name = EXECUTION_ERROR if frame.compiled.scxml else ERROR
        self._internal.append(Event(name, {"reason": reason}, frame=frame.serial))

    def _next_serial(self) -> int:
        self._serials += 1
        return self._serials


def _reason(error: Event) -> str:
    # A chart may fire `error` itself, and say nothing.
    return str(error.attributes.get("reason", "the chart fired 'error' without a reason"))

"""Execution of reactions: exit and enter states, bind and unbind plots (SCXML appendix D)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from dsc.engine.determinisation import initial_reaction, leaving_reaction
from dsc.engine.evaluation import fill_parameters
from dsc.engine.frames import Frame
from dsc.engine.machine_state import NOTHING
from dsc.engine.performing import Performer
from dsc.engine.reaction import CompiledReaction, Exit, ReactionPart, StateEntry
from dsc.engine.situation import Decision, Situation
from dsc.engine.steps import Cancel, DecisionMade, PlotBound
from dsc.engine.tables import Chart, CompiledPlot
from dsc.errors import RunawayError
from dsc.events import DONE, DONE_STATE, NO_CANDIDATE, Event
from dsc.model.states import DynamicState, SubmachineState
from knowledge_base.errors import InputError
from knowledge_base.language.syntax.expression import Variable

MAX_NESTING = 40
"""Upper bound of plots inside plots; a deeper chart nests a plot in itself without end."""


class Execution(Performer):
    """Changes running plots according to reactions.

    Attributes:
        chart: provider of plots.
        finished: whether the outermost plot has reached its final state.
    """

    __slots__ = ("chart", "finished")

    def __init__(self, chart: Chart, situation: Situation, serials: int) -> None:
        super().__init__(situation, serials)
        self.chart = chart
        self.finished = False

    def enter_plot(self, compiled: CompiledPlot, arguments: Mapping[str, Any]) -> Frame:
        """Enter a plot as the outermost one; raise `InputError` if the arguments do not fit."""
        frame = self._new_frame(compiled, arguments)
        self._enter_initial(frame)
        return frame

    def leave_plot(self, frame: Frame) -> None:
        """Exit all states of a plot and of the plots inside."""
        self.exit(frame, leaving_reaction(frame.configuration).exits)

    def take(self, frame: Frame, reaction: CompiledReaction) -> None:
        """Exit states, execute actions and enter states for a reaction of one plot."""
        if reaction.exits:
            self.exit(frame, reaction.exits)
        frame.configuration = reaction.following
        self._act_and_enter([(frame, part) for part in reaction.parts])

    def take_together(
        self, reactions: Mapping[Frame, CompiledReaction], parts: Sequence[tuple[Frame, ReactionPart]]
    ) -> None:
        """Take reactions of several plots together; `parts` lists the parts of all, in execution order."""
        leaving = [(frame, one) for frame, reaction in reactions.items() for one in reaction.exits]
        for frame, one in sorted(leaving, key=lambda at: at[0].position(at[1].node.index), reverse=True):
            self.exit(frame, (one,))
        for frame, reaction in reactions.items():
            frame.configuration = reaction.following
        self._act_and_enter(parts)

    def _act_and_enter(self, parts: Sequence[tuple[Frame, ReactionPart]]) -> None:
        """Execute the actions of all transitions before any entry."""
        passed = [self._act(frame, part) if part.acts else NOTHING for frame, part in parts]
        for (frame, part), arguments in zip(parts, passed, strict=True):
            self._enter_part(frame, part, arguments)

    def _act(self, frame: Frame, part: ReactionPart) -> Mapping[str, Any]:
        """Execute the internal actions of a transition; return the arguments for its target."""
        assert part.edge is not None  # noqa: S101  # only a part with a transition has actions
        source = frame.compiled.nodes[part.edge.source].name
        self.act(frame, source, part.effect)
        try:
            return self.values(frame, part.edge.passed)
        except InputError as error:
            self.fail(frame, f"{frame.prefix}{source}: {error}")
            return {}

    # -- leaving -----------------------------------------------------------------------------------------

    def exit(self, frame: Frame, exits: Iterable[Exit]) -> None:
        """Exit nodes in this order; a plot inside a node is exited just before the node."""
        for one in exits:
            node, name = one.node, one.node.name
            if node.holds_plot:
                self._empty(frame, name)
            if node.state is not None:
                self.exited.append(frame.prefix + name)
            if node.addressed:
                self._exit_addressed(frame, one)
            elif one.actions:
                self.act(frame, name, one.actions)

    def _empty(self, frame: Frame, host: str) -> None:
        """Exit the plots inside a state; a plot without exit actions is not thawed."""
        resting = frame.resting.get(host)
        if resting is not None and not resting.children:
            reaction = leaving_reaction(resting.configuration)
            if reaction.silent:
                self.exited += [f"{frame.prefix}{host}/{name}" for name in reaction.exited]
                frame.forget(host)
                return
        inner = frame.child(host)
        if inner is not None:
            self.leave_plot(inner)
            inner.take_out()

    def _exit_addressed(self, frame: Frame, one: Exit) -> None:
        name = one.node.name
        activation = frame.activations[name]
        if one.cancels:
            self.output.append(Cancel(activation))
        self.act(frame, name, one.actions, activation, first=len(one.node.entry))
        frame.activations = {other: serial for other, serial in frame.activations.items() if other != name}
        if frame.kept:
            frame.kept = tuple([waiting for waiting in frame.kept if waiting[0] != name])

    # -- entering ----------------------------------------------------------------------------------------

    def _enter_initial(self, frame: Frame) -> None:
        for part in initial_reaction(frame.compiled).parts:
            self._enter_part(frame, part, NOTHING)

    def _enter_part(self, frame: Frame, part: ReactionPart, passed: Mapping[str, Any]) -> None:
        if not passed:
            for entrance in part.entrances:
                self._enter(frame, entrance, NOTHING)
        elif part.edge is not None:
            target = part.edge.targets[0]
            for entrance in part.entrances:
                self._enter(frame, entrance, passed if entrance.node.index == target else NOTHING)

    def _enter(self, frame: Frame, entrance: StateEntry, passed: Mapping[str, Any]) -> None:
        node, state = entrance.node, entrance.node.state
        activation = 0
        if node.addressed:
            activation = self.next_serial()
            frame.activations = {**frame.activations, node.name: activation}
        if state is not None:
            self.entered.append(frame.prefix + node.name)
        if entrance.actions:
            self.act(frame, node.name, entrance.actions, activation)
        if entrance.after:
            self.act(frame, node.name, entrance.after)
        if node.timed:
            self.start_timers(frame, node, activation)
        if isinstance(state, SubmachineState):
            self._bind_submachine(frame, node.name, state, passed)
        elif isinstance(state, DynamicState):
            self._bind_dynamic(frame, node.name, state, passed)
        if entrance.emits is not None:
            self.act(frame, node.name, (entrance.emits,))
        for completed in entrance.completes:
            self._complete(frame, completed)

    def _bind_submachine(self, frame: Frame, name: str, state: SubmachineState, passed: Mapping[str, Any]) -> None:
        try:
            arguments = passed
            if state.arguments:
                own = {key: term for key, term in state.arguments.items() if key not in passed}
                arguments = {**self.values(frame, own), **passed}
            if state.use.startswith("?"):
                compiled = self.chart.bind(frame.variables[state.use[1:]])
            else:
                compiled = self.chart.compiled(state.use)
            self._bind(frame, name, compiled, arguments)
        except InputError as error:
            self.fail(frame, f"{frame.prefix}{name}: {error}")

    def _bind_dynamic(self, frame: Frame, name: str, state: DynamicState, passed: Mapping[str, Any]) -> None:
        bindings = self.bindings(frame)
        if passed:
            places = {given: Variable(f"passed.{given}") for given in passed}
            state = state.model_copy(update={"arguments": {**state.arguments, **places}})
            bindings = {**bindings, **{f"passed.{given}": value for given, value in passed.items()}}
        try:
            decision = self.situation.choose(state, frame.compiled.plot.name, bindings)
            self.decisions.append(DecisionMade(frame.prefix + name, decision))
            self._bind_decision(frame, name, decision)
        except InputError as error:
            self.fail(frame, f"{frame.prefix}{name}: {error}")

    def _bind_decision(self, frame: Frame, name: str, decision: Decision) -> None:
        if decision.satisfied:
            self._done(frame, frame.compiled.index[name], {})
        elif decision.chosen is None:
            self.internal.append(Event(NO_CANDIDATE, to=frame.activations[name]))
        else:
            self._bind(frame, name, self.chart.compiled(decision.chosen), decision.arguments)

    def _bind(self, frame: Frame, name: str, compiled: CompiledPlot, arguments: Mapping[str, Any]) -> None:
        if frame.depth >= MAX_NESTING:
            raise RunawayError(f"plots nested deeper than {MAX_NESTING}", [frame.prefix + name])
        inner = self._new_frame(compiled, arguments, frame.prefix + name)
        inner.put_into(frame, name)
        self._enter_initial(inner)

    def _new_frame(self, compiled: CompiledPlot, arguments: Mapping[str, Any], path: str = "") -> Frame:
        variables = fill_parameters(compiled.plot, arguments, self.situation)
        self.bound.append(PlotBound(path, compiled.plot))
        return Frame(self.next_serial(), compiled, initial_reaction(compiled).following, variables)

    # -- completion --------------------------------------------------------------------------------------

    def _complete(self, frame: Frame, index: int) -> None:
        if index:
            self._done(frame, index, {})
            return
        outputs = {name: frame.variables[name] for name in frame.compiled.plot.outputs}
        if frame.parent is None:
            self.finished = True
            self.outputs = outputs
        else:
            self._done(frame.parent, frame.parent.compiled.index[frame.host], outputs)

    def _done(self, frame: Frame, index: int, outputs: Mapping[str, Any]) -> None:
        node = frame.compiled.nodes[index]
        if frame.compiled.scxml:
            self.internal.append(Event(DONE_STATE + node.name, outputs, frame=frame.serial))
        elif DONE in node.edges:
            self.internal.append(Event(DONE, outputs, to=frame.activations[node.name], exact=True))

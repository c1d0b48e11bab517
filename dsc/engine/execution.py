"""Execution of reactions: exits and entries of states, with the plots inside them (SCXML appendix D)."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

from dsc.engine.automaton import CompiledReaction, Configuration, Exit, ReactionPart, StateEntry, configuration_of
from dsc.engine.exclusion import failures_of, with_end
from dsc.engine.frames import Frame
from dsc.engine.machine_state import NOTHING, FrameState
from dsc.engine.performing import Performer, fill_parameters
from dsc.engine.reaction import continuing_reaction, initial_reaction, leaving_reaction
from dsc.engine.situation import Chart, Decision
from dsc.engine.steps import Cancel
from dsc.engine.tables import CompiledPlot
from dsc.errors import RunawayError
from dsc.events import DONE, DONE_STATE, NO_CANDIDATE, Event
from dsc.model.states import DynamicState, SubmachineState
from knowledge_base.errors import InputError, SchemaError
from knowledge_base.language.syntax.expression import Variable

MAX_NESTING = 40
"""Upper bound of the depth of nested plots; a plot that contains itself would nest without end."""


class Execution:
    """Executor of reactions: changes the running plots.

    Attributes:
        chart: provider of plots.
        performer: executor of the actions.
        finished: whether the outermost plot has reached its final state.
        outputs: values that the outermost plot returns at its end, by name; empty before the end.
    """

    __slots__ = ("_continuing", "_results", "chart", "finished", "outputs", "performer")

    def __init__(self, chart: Chart, performer: Performer) -> None:
        self.chart = chart
        self.performer = performer
        self._results = performer.results
        self.finished = False
        self.outputs: Mapping[str, Any] = NOTHING
        self._continuing: dict[tuple[Frame, str], Frame] = {}  # plots that are being replaced, by frame and host

    def enter_plot(
        self, compiled: CompiledPlot, arguments: Mapping[str, Any], parent: Frame | None = None, host: str = ""
    ) -> Frame:
        """Enter a plot and return its frame.

        Args:
            compiled: the plot.
            arguments: values for the plot's parameters, by name.
            parent: frame of the plot that contains the host state; `None` for the outermost plot.
            host: name of the host state in `parent`.

        Raises:
            InputError: the arguments do not fit the parameters.
            RunawayError: plots are nested deeper than `MAX_NESTING`.
        """
        performer, initial = self.performer, initial_reaction(compiled)
        path = "" if parent is None else parent.prefix + host
        if parent is not None and parent.depth >= MAX_NESTING:
            raise RunawayError(f"plots nested deeper than {MAX_NESTING}", [path])
        variables = fill_parameters(compiled, arguments, performer.situation)
        self._results.bind(path, compiled.plot)
        state = FrameState(self._results.number(), compiled, initial.following, variables)
        frame = Frame(state, parent, host)
        for entrance in initial.parts[0].entrances:
            self._enter(frame, entrance, NOTHING)
        return frame

    def restart_plot(self, before: Frame, compiled: CompiledPlot, arguments: Mapping[str, Any]) -> Frame:
        """Exit a running plot, enter another one in its place, and return the frame; errors as for `enter_plot`."""
        fill_parameters(compiled, arguments, self.performer.situation)  # an error leaves the running plot unchanged
        self.leave_plot(before)
        before.take_out()
        return self.enter_plot(compiled, arguments, before.parent, before.host)

    def leave_plot(self, frame: Frame) -> None:
        """Exit all states of a plot and of its inner plots."""
        self._exit(frame, leaving_reaction(frame.configuration).exits)

    def take(
        self, reactions: Sequence[tuple[Frame, CompiledReaction]], parts: Sequence[tuple[Frame, ReactionPart]]
    ) -> None:
        """Execute the reactions of one microstep: exits first, then actions of transitions, then entries.

        Args:
            reactions: the reaction of each plot concerned, with the plot's frame.
            parts: the parts of all reactions, in execution order.
        """
        for frame, reaction in reactions:
            if reaction.candidate_ends:
                self._count_failures(frame, reaction)
            if reaction.continues:
                self._take_out(frame, reaction)
        if len(reactions) == 1:
            ((frame, reaction),) = reactions
            self._exit(frame, reaction.exits)
        else:
            leaving = [(frame, one) for frame, reaction in reactions for one in reaction.exits]
            for frame, one in sorted(leaving, key=lambda at: at[0].position(at[1].node.index), reverse=True):
                self._exit(frame, (one,))
        for frame, reaction in reactions:
            frame.configuration = reaction.following
        passed: list[Mapping[str, Any]] = [NOTHING] * len(parts)
        for number, (frame, part) in enumerate(parts):
            if part.acts:
                passed[number] = self._act(frame, part)
        for (frame, part), arguments in zip(parts, passed, strict=True):
            target = part.edge.targets[0] if arguments and part.edge is not None else -1
            for entrance in part.entrances:
                self._enter(frame, entrance, arguments if entrance.node.index == target else NOTHING)

    def _count_failures(self, frame: Frame, reaction: CompiledReaction) -> None:
        """Count the ends of candidates that their dynamic states may exclude after failures."""
        for edge in reaction.candidate_ends:
            node = frame.compiled.nodes[edge.source]
            inner = frame.resting.get(node.name) or frame.children.get(node.name)
            if inner is not None and isinstance(node.state, DynamicState):
                plot, now = inner.compiled.plot, self.performer.situation.now()
                frame.variables = with_end(
                    frame.variables, node.name, node.state, plot, inner.variables, edge.trigger, now
                )

    def _take_out(self, frame: Frame, reaction: CompiledReaction) -> None:
        """Take the plots that continue out of their hosts, so that the exits of the hosts do not exit them."""
        for index in reaction.continues:
            host = frame.compiled.nodes[index].name
            inner = frame.child(host)
            if inner is not None and not inner.compiled.scxml:
                del frame.children[host]
                self._continuing[frame, host] = inner

    def _act(self, frame: Frame, part: ReactionPart) -> Mapping[str, Any]:
        """Execute the internal actions of a transition; return the arguments for its target's plot, by name."""
        assert part.edge is not None  # noqa: S101  # only a part with a transition has actions
        source = frame.compiled.nodes[part.edge.source].name
        self.performer.act(frame, source, part.effect, part=part.edge.place)
        try:
            return self.performer.values(frame, part.edge.passed)
        except InputError as error:
            self.performer.fail(frame, source, error, part=part.edge.place)
            return NOTHING

    # -- leaving -----------------------------------------------------------------------------------------

    def _exit(self, frame: Frame, exits: Iterable[Exit]) -> None:
        """Exit nodes in the order of `exits`; the plot inside a node is exited just before the node."""
        for one in exits:
            node, name = one.node, one.node.name
            if node.holds_plot:
                self._empty(frame, name)
            if node.state is not None:
                self._results.exit(frame.prefix + name)
            if node.addressed:
                self._exit_addressed(frame, one)
            elif one.actions:
                self.performer.act(frame, name, one.actions)

    def _empty(self, frame: Frame, host: str) -> None:
        """Exit the plots inside the state `host`; a frozen plot without exit actions stays frozen."""
        resting = frame.resting.get(host)
        if resting is not None and not resting.children:
            reaction = leaving_reaction(resting.configuration)
            if reaction.silent:
                for name in reaction.exited:
                    self._results.exit(f"{frame.prefix}{host}/{name}")
                frame.forget(host)
                return
        inner = frame.child(host)
        if inner is not None:
            self.leave_plot(inner)
            inner.take_out()

    def _exit_addressed(self, frame: Frame, one: Exit) -> None:
        """End the activation of an exited node: cancel its skills and timers, and drop its kept events."""
        name = one.node.name
        activation = frame.activations[name]
        if one.cancels:
            self._results.put(Cancel(activation))
        if one.actions:
            self.performer.act(frame, name, one.actions, activation, first=len(one.node.entry))
        activations = {**frame.activations}
        del activations[name]
        frame.activations = activations
        if frame.kept:
            frame.kept = tuple([waiting for waiting in frame.kept if waiting[0] != name])

    # -- entering ----------------------------------------------------------------------------------------

    def _enter(self, frame: Frame, entrance: StateEntry, passed: Mapping[str, Any]) -> None:
        performer, node, state = self.performer, entrance.node, entrance.node.state
        activation = 0
        if node.addressed:
            activation = self._results.number()
            frame.activations = {**frame.activations, node.name: activation}
        if state is not None:
            self._results.enter(frame.prefix + node.name)
        if entrance.actions:
            performer.act(frame, node.name, entrance.actions, activation)
        if entrance.after:
            performer.act(frame, node.name, entrance.after)
        if node.timed:
            performer.start_timers(frame, node, activation)
        if node.holds_plot:
            self._bind(frame, node.name, state, passed)
        if entrance.emits is not None:
            performer.act(frame, node.name, (entrance.emits,))
        for completed in entrance.completes:
            self._complete(frame, completed)

    def _bind(self, frame: Frame, name: str, state: object, passed: Mapping[str, Any]) -> None:
        """Enter the plot of a submachine or dynamic state; fire an error event if no plot can be bound."""
        before = self._continuing.pop((frame, name), None) if self._continuing else None
        try:
            if isinstance(state, SubmachineState):
                if state.arguments:
                    own = {key: term for key, term in state.arguments.items() if key not in passed}
                    passed = {**self.performer.values(frame, own), **passed}
                if state.use.startswith("?"):
                    compiled = self.chart.bind(frame.variables[state.use[1:]])
                    self._require_handled(frame, name, compiled)
                else:
                    compiled = self.chart.compiled(state.use)
                if before is None:
                    self.enter_plot(compiled, passed, frame, name)
                else:
                    self.replace_plot(before, compiled, passed, _find_shared_states(before, compiled))
                    before = None
            elif isinstance(state, DynamicState):
                self._bind_decision(frame, name, self._decide(frame, name, state, passed))
        except InputError as error:
            self.performer.fail(frame, name, error)
        if before is not None:
            before.gone = True
            self.leave_plot(before)

    def _require_handled(self, frame: Frame, name: str, inside: CompiledPlot) -> None:
        """Raise `SchemaError` unless a state handles each outcome of a plot given as data; steps of plans may fail."""
        edges = frame.compiled.nodes[frame.compiled.index[name]].edges
        for event in () if inside.plot.generated or frame.compiled.scxml else inside.plot.emits:
            if event not in edges:
                raise SchemaError(f"state '{name}' does not handle '{event}' of plot '{inside.plot.name}'", found=event)

    def replace_plot(
        self,
        before: Frame,
        compiled: CompiledPlot,
        arguments: Mapping[str, Any],
        shared: Collection[str],
        serial: int | None = None,
    ) -> Frame:
        """Enter a plot in place of a running one, and return its frame.

        Variables and outputs that both plots have with one type keep their values.

        Args:
            before: the running plot.
            compiled: the new plot.
            arguments: values for the parameters of the new plot, by name.
            shared: names of active states that continue in the new plot; the others are exited.
            serial: number of the new plot instance; by default a new one.

        Raises:
            InputError: the arguments do not fit the parameters.
        """
        performer, parent = self.performer, before.parent
        variables = dict(fill_parameters(compiled, arguments, performer.situation))
        variables.update(_kept_values(before, compiled))
        targets = _together(compiled, [compiled.index[name] for name in shared])
        reaction = continuing_reaction(compiled, targets)
        staying = {one.node.name for one in reaction.parts[0].entrances if one.node.name in shared}
        exits = leaving_reaction(before.configuration).exits
        before.gone = True
        self._exit(before, [one for one in exits if one.node.name not in staying])
        now = before.frozen()
        self._results.bind("" if parent is None else parent.prefix + before.host, compiled.plot)
        if serial is None:
            serial = self._results.number()
        activations = {name: own for name, own in now.activations.items() if name in staying}
        children = {host: inner for host, inner in now.children.items() if host in staying}
        events = tuple([one for one in now.kept if one[0] in staying])
        configuration = _continuing(reaction.following, before, staying)
        state = FrameState(serial, compiled, configuration, variables, activations, children, events)
        frame = Frame(state, parent, before.host)
        for entrance in reaction.parts[0].entrances:
            if entrance.node.name not in staying:
                self._enter(frame, entrance, NOTHING)
        return frame

    def _decide(self, frame: Frame, name: str, state: DynamicState, passed: Mapping[str, Any]) -> Decision:
        bindings = self.performer.bindings(frame)
        if state.arguments:
            own = {key: term for key, term in state.arguments.items() if key not in passed}
            passed = {**self.performer.values(frame, own), **passed}
        if passed:
            places = {given: Variable(f"passed.{given}") for given in passed}
            state = state.model_copy(update={"arguments": {**state.arguments, **places}})
            bindings = {**bindings, **{f"passed.{given}": value for given, value in passed.items()}}
        failed = failures_of(name, frame.variables) if state.exclude is not None else ()
        decision = self.performer.situation.choose(
            state, frame.compiled.plot.name, bindings, failed, frame.activations.get(name, 0)
        )
        self._results.decide(frame.prefix + name, decision)
        return decision

    def _bind_decision(self, frame: Frame, name: str, decision: Decision) -> None:
        if decision.satisfied:
            self._done(frame, frame.compiled.index[name], {})
        elif decision.chosen is None:
            self._results.fire(Event(NO_CANDIDATE, to=frame.activations[name]))
        else:
            self.enter_plot(self.chart.compiled(decision.chosen), decision.arguments, frame, name)

    # -- completion --------------------------------------------------------------------------------------

    def _complete(self, frame: Frame, index: int) -> None:
        """Fire `done` for a node whose content is complete; index 0, the plot itself, also returns its outputs."""
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
            self._results.fire(Event(DONE_STATE + node.name, outputs, frame=frame.serial))
        elif DONE in node.edges:
            self._results.fire(Event(DONE, outputs, to=frame.activations[node.name], exact=True))


def _kept_values(before: Frame, compiled: CompiledPlot) -> dict[str, Any]:
    """Return the values that a plot keeps in its replacement: of variables and outputs, and failures of candidates."""
    own, known = before.compiled.plot, compiled.types
    declared = {**own.all_variables, **own.outputs}
    kept = {name: before.variables[name] for name, one in declared.items() if known.get(name) == one.type}
    failures = {name: one for name, one in before.variables.items() if name not in {*declared, *own.parameters}}
    return {**kept, **failures}


def _find_shared_states(before: Frame, compiled: CompiledPlot) -> list[str]:
    """Return the names of the active, activated states of a plot that another plot has as states of the same kind."""
    found = []
    for name in before.activations:
        index = compiled.index.get(name)
        if index is not None and compiled.nodes[index].addressed:
            mine = before.compiled.nodes[before.compiled.index[name]]
            if type(mine.state) is type(compiled.nodes[index].state):
                found.append(name)
    return found


def _continuing(following: Configuration, before: Frame, staying: Collection[str]) -> Configuration:
    """Return the configuration in which a staying state waits for its least time only if it has waited before."""
    known, compiled = before.compiled, following.compiled
    over = {compiled.index[name] for name in staying if known.index[name] not in before.configuration.waiting}
    if not following.waiting & over:
        return following
    return configuration_of(compiled, following.active, following.waiting - over, following.history)


def _together(compiled: CompiledPlot, indices: Iterable[int]) -> list[int]:
    """Return the innermost of these nodes that can be active together; of two that exclude each other, the first."""
    found: list[int] = []
    for index in sorted(indices):
        found = [one for one in found if not compiled.inside(index, one)]
        if all(_are_parallel(compiled, one, index) for one in found):
            found.append(index)
    return found


def _are_parallel(compiled: CompiledPlot, one: int, other: int) -> bool:
    """Return whether the innermost node around two nodes has its children active together."""
    around = compiled.nodes[other].around
    return compiled.nodes[next(index for index in compiled.nodes[one].around if index in around)].orthogonal

r"""Event handlers as states and transitions (S1.14).

An interrupting handler adds to each state a transition to a new state with the handler's actions, and a transition
back. All other handlers expand into regions parallel to the whole plot, one region for each event:

    active { plot: ... ended_reached | low_bat: awaited <-> handled }  --> ended

The orthogonal state executes the handlers' `listen` actions on its entry and never again. A second activation would
repeat the event while the event's cause persists. For its inner states, the orthogonal state fires each received event
again, under a separate name.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from dsc.dynamic.fresh_names import FreshNames
from dsc.dynamic.steps import mentioned_in
from dsc.events import DONE
from dsc.model.actions import Emit, Internal, Tell
from dsc.model.plot import ActionPlot, initial_of
from dsc.model.rules import RESUME, Handler
from dsc.model.states import AnyState, CompositeState, FinalState, OrthogonalState, Region, State, SubmachineState
from dsc.model.transitions import Transition, TransitionSource
from knowledge_base.language.syntax.expression import Variable

States = dict[str, AnyState]
_EVENT = "event."
ACTIVE = "active"
"""Name of the orthogonal state that contains the plot and its handlers; a number follows if the name is in use."""


def with_handlers(plot: ActionPlot, written: ActionPlot, added: FreshNames, entrances: Mapping[str, str]) -> ActionPlot:
    """Return the plot with the handlers of the written plot as states and transitions.

    Args:
        plot: the plot with its rules already expanded.
        written: the plot before any expansion, with its handlers.
        added: generator of names for added elements.
        entrances: for a step with insertions before it, the connector through which the step is entered.
    """
    interrupting = [one for one in written.handlers if one.interrupt]
    listening = {one.on: added.event(f"{one.on}_heard", one.on) for one in written.handlers if one.listen is not None}
    handling = _Handling(added, listening)
    if interrupting:
        states = handling.interrupted(plot.states, interrupting, entrances, at_top=True)
        plot = plot.model_copy(update={"states": states})
    plot = plot.model_copy(update={"states": handling.left(plot.states, written.handlers, entrances)})
    if listening or len(interrupting) < len(written.handlers):
        return handling.around(plot, written.handlers)
    return plot


class _Handling:
    def __init__(self, added: FreshNames, listening: Mapping[str, str]) -> None:
        self._added = added
        self._listening = listening
        self._leading: dict[str, str] = {}

    def interrupted(
        self, states: Mapping[str, AnyState], handlers: list[Handler], entrances: Mapping[str, str], *, at_top: bool
    ) -> States:
        """Return the states of a scope with transitions to all handlers and back.

        A composite state is interrupted at its inner states, and an orthogonal state as a whole.
        """
        result: States = {}
        for name, state in states.items():
            if isinstance(state, CompositeState):
                inside = self.interrupted(state.states, handlers, entrances, at_top=False)
                result[name] = state.model_copy(update={"states": inside})
            elif isinstance(state, State):
                result.update(self._interrupt(name, state, handlers, entrances, at_top=at_top))
            else:
                result[name] = state
        return result

    def _interrupt(
        self, name: str, state: State, handlers: list[Handler], entrances: Mapping[str, str], *, at_top: bool
    ) -> States:
        on, more = dict(state.on), dict[str, AnyState]()
        for handler in handlers:
            handled = self._added.state(f"{name}_{handler.on}_handled", _words(handler))
            leading: dict[str, Transition] = {}
            for then in sorted({*handler.do.on.values()} - {RESUME}):
                if at_top:
                    leading[then] = Transition(target=entrances.get(then, then))
                else:  # no transition leaves its scope; this state waits for the transition at the top level
                    waiting = self._added.state(f"{handled}_then_{then}", f"then {then}")
                    more[waiting] = State(about=handler.label)
                    leading[then] = Transition(target=waiting, do=(Emit(emit=self._leaving(then)),))
            more[handled] = self._handled(handler, entrances.get(name, name), leading)
            heard = self._map_event(handler.on)
            on[heard] = (*on.get(heard, ()), _way(handler, handled))
        return {name: state.model_copy(update={"on": on}), **more}

    def left(self, states: Mapping[str, AnyState], handlers: Iterable[Handler], entrances: Mapping[str, str]) -> States:
        """Return the states at the top level with transitions for outcomes that continue at a named state.

        A handler may end deep inside a state or in another region, so an internal event carries the outcome.
        """
        targets = {target for handler in handlers for target in handler.do.on.values()} - {RESUME}
        ways = {self._leaving(one): (Transition(target=entrances.get(one, one)),) for one in sorted(targets)}
        return {
            name: state.model_copy(update={"on": {**state.on, **ways}}) if isinstance(state, State) else state
            for name, state in states.items()
        }

    def _leaving(self, target: str) -> str:
        """Return the name of the internal event that leads to the state `target`."""
        if target not in self._leading:
            self._leading[target] = self._added.event(f"then_{target}", f"then {target}")
        return self._leading[target]

    def around(self, plot: ActionPlot, handlers: Iterable[Handler]) -> ActionPlot:
        """Return a plot with one orthogonal state: a region with `plot`, and a region for each handled event."""
        handlers = list(handlers)
        beside = [handler for handler in handlers if not handler.interrupt]
        around, words = self._added.state(ACTIVE, f"{plot.name} and its handlers"), self._added.words
        reached = {name: self._added.state(f"{name}_reached", name) for name in _ends(plot)}
        words.events.update({event: name for name, event in reached.items()})
        first = initial_of(plot)
        regions = {"plot": Region(states=_inside(plot, reached), initial=reached.get(first, first))}
        for event in dict.fromkeys(handler.on for handler in beside):
            mine = [handler for handler in beside if handler.on == event]
            regions[f"on_{event}"] = Region(states=self._awaiting(event, mine))
        words.states.update({f"{around}:{region}": region.replace("on_", "on ", 1) for region in regions})
        over = {name: _told_its_attributes(end) for name, end in _ends(plot).items()}
        on = {reached[name]: (Transition(target=name),) for name in over}
        for event, heard in self._listening.items():
            mentioned = [mentioned_in(handler) for handler in handlers if handler.on == event]
            on[event] = (_passed_on(heard, frozenset().union(*mentioned)),)
        entry = tuple([handler.listen for handler in handlers if handler.listen is not None])
        active = OrthogonalState(regions=regions, entry=entry, on=on)
        return plot.model_copy(update={"states": {around: active, **over}, "initial": None})

    def _awaiting(self, event: str, handlers: list[Handler]) -> States:
        awaited = self._added.state(f"{event}_awaited", f"waits for {event}")
        ways, more = [], dict[str, AnyState]()
        for handler in handlers:
            handled = None
            if handler.do.acts:
                handled = self._added.state(f"{event}_handled", _words(handler))
                leading = {
                    then: Transition(target=awaited, do=(Emit(emit=self._leaving(then)),))
                    for then in sorted({*handler.do.on.values()} - {RESUME})
                }
                more[handled] = self._handled(handler, awaited, leading)
            ways.append(_way(handler, handled))
        return {awaited: State(on={self._map_event(event): tuple(ways)}), **more}

    def _map_event(self, event: str) -> str:
        return self._listening.get(event, event)

    def _handled(self, handler: Handler, back: str, leading: Mapping[str, Transition]) -> AnyState:
        """Return the state with a handler's actions.

        Args:
            handler: the handler.
            back: target after the handler.
            leading: for each state that an outcome of the handler's plot leads to, the transition.
        """
        do, onward = handler.do, (Transition(target=back),)
        if do.use is None:
            return State(entry=do.command, on={DONE: onward}, about=handler.label)
        ways = {outcome: onward if then == RESUME else (leading[then],) for outcome, then in do.on.items()}
        return SubmachineState(
            use=do.use, arguments=do.arguments, entry=do.command, on={DONE: onward, **ways}, about=handler.label,
            priority=handler.priority, preempt=handler.preempt, handles=True,
        )  # fmt: skip


def _words(handler: Handler) -> str:
    """Return the author's name of a handler; without one, its event."""
    return handler.name or f"handles {handler.on}"


def _ends(plot: ActionPlot) -> dict[str, FinalState]:
    return {name: state for name, state in plot.states.items() if isinstance(state, FinalState)}


def _inside(plot: ActionPlot, reached: Mapping[str, str]) -> States:
    """Return the plot's states for a region.

    In the region, each final state of the plot has the name in `reached` and fires an event of this name.
    """
    inside: States = {}
    for name, state in plot.states.items():
        if isinstance(state, FinalState):
            inside[reached[name]] = FinalState(final=True, emit=reached[name], arguments=state.arguments)
        elif isinstance(state, TransitionSource):
            inside[name] = state.redirected(lambda way: {"target": reached.get(way.target or "", way.target)})
        else:
            inside[name] = state
    return inside


def _told_its_attributes(end: FinalState) -> FinalState:
    """Return a final state of the plot whose outcome carries the attributes of the region's event."""
    return end.model_copy(update={"arguments": {key: Variable(_EVENT + key) for key in end.arguments}})


def _passed_on(heard: str, mentioned: Iterable[str]) -> Transition:
    """Return a transition that fires the event `heard` with the event attributes in `mentioned`."""
    known = sorted(name.removeprefix(_EVENT) for name in mentioned if name.startswith(_EVENT))
    return Transition(target=None, do=(Emit(emit=heard, arguments={key: Variable(_EVENT + key) for key in known}),))


def _way(handler: Handler, target: str | None) -> Transition:
    told: tuple[Internal, ...] = () if handler.do.tell is None else (Tell(tell=handler.do.tell),)
    return Transition(target=target, guard=handler.when, do=told, rule=handler.label)

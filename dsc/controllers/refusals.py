"""Forms of plots that a controller cannot have, each with its place."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager

from dsc.controllers.expressions import RefusedError
from dsc.errors import Finding, PlotError
from dsc.model.actions import Bind, Emit, ExternalAction, Internal, Log, Tell, Trigger, Unwire, Wire, Withdraw, flat
from dsc.model.plot import ActionPlot
from dsc.model.reading import FormPath
from dsc.model.states import AnyState, DynamicState, FinalState, HistoryState, State, SubmachineState
from dsc.model.transitions import Transition
from knowledge_base.errors import SchemaError

CODE = "controller"
"""Code of the findings about forms that a controller cannot have."""
REFUSED_ACTIONS: Mapping[type, str] = {
    Tell: "`tell` changes knowledge; a controller has no knowledge base: use a variable",
    Bind: "`bind` reads knowledge; a controller has no knowledge base",
    Withdraw: "`withdraw` needs delayed events; use a state with `after`",
    Log: "`log` writes text; emit an outcome with numbers",
    Wire: "`wire` needs components; a controller has none",
    Unwire: "`unwire` needs components; a controller has none",
}
"""Reasons against the kinds of actions that a controller cannot have."""


class Refusals:
    """The refused forms of a plot; each is one finding."""

    def __init__(self, plot: ActionPlot) -> None:
        self._plot = plot
        self.findings: list[Finding] = []

    @contextmanager
    def at(self, path: FormPath) -> Iterator[None]:
        """Keep a refusal inside the block, with the place of the form at `path` if the error has no place."""
        try:
            yield
        except RefusedError as error:
            place = error.place if error.place is not None and error.place.source else self._plot.place(path)
            wrong = SchemaError(error.message, place=place, found=error.found, valid=error.valid)
            if not any(str(one.error) == str(wrong) for one in self.findings):
                self.findings.append(Finding(wrong, CODE))

    def raise_all(self) -> None:
        """Raise all refusals as one `PlotError`; without any, do nothing."""
        if self.findings:
            self.findings.sort(key=lambda one: (one.place.line or 0) if one.place else 0)
            raise PlotError(self.findings)

    def add_forms(self) -> None:
        """Refuse the states, transitions and actions that a controller cannot have."""
        for group in ("rules", "handlers"):
            for number in range(len(getattr(self._plot, group))):
                self.refuse((group, number), f"`{group}` use other plots; a controller has one plot")
        for name, state, path in self._plot.walk():
            self._add_state(name, state, path)

    def refuse(self, path: FormPath, message: str) -> None:
        """Refuse the form at a path."""
        with self.at(path):
            raise RefusedError(message)

    def _add_state(self, name: str, state: AnyState, path: FormPath) -> None:
        if isinstance(state, SubmachineState):
            self.refuse((*path, "use"), f"'{name}' uses another plot; write its states here, under `states`")
        if isinstance(state, DynamicState):
            self.refuse(path, f"'{name}' chooses its content from knowledge; a controller has none: use a choice")
        if isinstance(state, State):
            if state.priority is not None or state.preempt:
                self.refuse((*path, "priority"), f"'{name}' has a priority; a controller has no queues for components")
            for key, actions in state.blocks():
                self._add_actions(actions, (*path, key), starts=key == "entry")
        if isinstance(state, HistoryState):
            self._add_actions(state.do, (*path, "do"))
        elif isinstance(state, FinalState):
            self._add_actions(state.entry, (*path, "entry"))
        else:
            for place, _, transition in state.placed_transitions():
                self._add_transition(transition, (*path, *place))

    def _add_transition(self, transition: Transition, path: FormPath) -> None:
        if transition.passed:
            self.refuse((*path, "pass"), "`pass` gives arguments to another plot; assign variables instead")
        if transition.keep:
            self.refuse((*path, "keep"), "`keep` continues another plot; a controller has one plot")
        self._add_actions(transition.effect, path)

    def _add_actions(
        self, actions: Iterable[ExternalAction | Internal], path: FormPath, *, starts: bool = False
    ) -> None:
        for action in flat(actions):
            message = REFUSED_ACTIONS.get(type(action))
            if isinstance(action, Trigger) and not starts:
                message = f"'{action.trigger}' begins when its state is left; begin it in the `entry` of the next state"
            if isinstance(action, Emit) and action.delay is not None:
                message = "`emit` has a `delay`; use a state with `after`"
            if message is not None:
                self.refuse(path, message)

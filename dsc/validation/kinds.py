"""Values of the wrong kind: text where a number is wanted, a place where an item is.

Only what can never fit is found: a name may be any thing, and a variable of a type may hold one of a type below.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from dsc.dynamic.library import Library
from dsc.dynamic.outcomes import outcomes_of
from dsc.errors import Finding
from dsc.model.actions import Assign, Emit, ExternalAction, Internal, Trigger, flat
from dsc.model.plot import ActionPlot, Path
from dsc.model.states import AnyState, DynamicState, FinalState, State, SubmachineState, TimedTransition
from dsc.validation.wiring import Skills
from knowledge_base.errors import SchemaError
from knowledge_base.language.expression import Constant, Term, Variable
from knowledge_base.language.printer import to_text
from knowledge_base.schema import Schema

Kinds = Mapping[str, str | None]
"""Names -> types as they were declared; `None` is anything."""

_VALUES = frozenset({"number", "boolean"})
_WORDS = frozenset({"text", "symbol"})


def check_kinds(plot: ActionPlot, library: Library, schema: Schema | None, skills: Skills) -> Iterator[Finding]:
    """Findings about values that do not fit the types they are given to; SCXML's data have no types."""
    if plot.profile == "dsc":
        yield from _Kinds(plot, library, schema, skills).findings()


class _Kinds:
    def __init__(self, plot: ActionPlot, library: Library, schema: Schema | None, skills: Skills) -> None:
        self._plot, self._library, self._schema, self._skills = plot, library, schema, skills or {}
        self._variables = {name: variable.type for name, variable in plot.variables.items()}
        parameters = {name: parameter.type for name, parameter in plot.parameters.items()}
        self._own: dict[str, str | None] = {**parameters, **self._variables}

    def findings(self) -> Iterator[Finding]:
        for name, parameter in self._plot.parameters.items():
            yield from self._fits(parameter.default, parameter.type, {}, ("parameters", name, "default"))
        for name, variable in self._plot.variables.items():
            yield from self._fits(variable.initial, variable.type, self._own, ("variables", name, "initial"))
        for _, state, path in self._plot.walk():
            if isinstance(state, FinalState):
                yield from self._emitted(state.emit, state.arguments, self._own, path)
            elif isinstance(state, State):
                yield from self._state(state, path)
        for number, rule in enumerate(self._plot.rules):
            if rule.do.use is not None:
                yield from self._given(rule.do.use, rule.do.arguments, ("rules", number, "do"))

    def _state(self, state: State, path: Path) -> Iterator[Finding]:
        if isinstance(state, SubmachineState) and not state.use.startswith("?"):
            yield from self._given(state.use, state.arguments, path)
        elif isinstance(state, DynamicState):
            for name in state.dynamic:
                yield from self._given(name, state.arguments, path)
        for key, actions in (("entry", state.entry), ("exit", state.exit)):
            for position, action in enumerate(actions):
                yield from self._action(action, self._own, (*path, key, position))
        for inside, event, transition in state.placed_transitions():
            scope = {**self._own, **self._attributes(state, event)}
            if isinstance(transition, TimedTransition):
                yield from self._fits(transition.seconds, "number", self._own, (*path, *inside, "seconds"))
            for internal in flat(transition.effect):
                yield from self._action(internal, scope, (*path, *inside))

    def _action(self, action: ExternalAction | Internal, scope: Kinds, path: Path) -> Iterator[Finding]:
        if isinstance(action, Assign):
            yield from self._all(action.assign, self._variables, scope, (*path, "assign"))
        elif isinstance(action, Emit):
            yield from self._emitted(action.emit, action.arguments, scope, path)
        elif isinstance(action, Trigger) and action.trigger in self._skills:
            yield from self._all(
                action.arguments, self._skills[action.trigger].parameters, scope, (*path, "with")
            )

    def _given(self, plot: str, arguments: Mapping[str, Term], path: Path) -> Iterator[Finding]:
        wanted = {name: parameter.type for name, parameter in self._library.plot(plot).parameters.items()}
        yield from self._all(arguments, wanted, self._own, (*path, "with"))

    def _emitted(
        self, event: str | None, arguments: Mapping[str, Term], scope: Kinds, path: Path
    ) -> Iterator[Finding]:
        declared = self._plot.emits.get(event or "")
        yield from self._all(arguments, declared or {}, scope, (*path, "with"))

    def _all(
        self, terms: Mapping[str, Term], wanted: Kinds, scope: Kinds, path: Path
    ) -> Iterator[Finding]:
        for name, term in terms.items():
            yield from self._fits(term, wanted.get(name), scope, (*path, name))

    def _fits(self, term: Term | None, wanted: str | None, scope: Kinds, path: Path) -> Iterator[Finding]:
        given = None if term is None else self._kind(term, scope)
        if term is None or wanted is None or given is None or self._compatible(given, wanted):
            return
        error = SchemaError(
            f"'{path[-1]}' is of type {wanted}, and {to_text(term)} is of type {given}",
            place=self._plot.place(path), found=to_text(term),
        )  # fmt: skip
        yield Finding(error, "value fits")

    def _kind(self, term: Term, scope: Kinds) -> str | None:
        """The type of a term's value as far as it is known."""
        match term:
            case Variable(name):
                return scope.get(name)
            case Constant(bool()):
                return "boolean"
            case Constant(str() as name):
                return "text" if self._schema is None else self._schema.constants.get(name, "text")
            case _:
                return "number"

    def _compatible(self, given: str, wanted: str) -> bool:
        if _VALUES & {given, wanted}:
            return given == wanted or not self._known({given, wanted})
        if self._schema is None or not {given, wanted} <= self._schema.types.keys():
            return True  # a word may name a thing, a plot or a condition
        return self._schema.is_a(given, wanted) or self._schema.is_a(wanted, given)

    def _known(self, types: Iterable[str]) -> bool:
        """Whether a number or truth value can be none of these for certain: misspelt types say nothing."""
        things = frozenset() if self._schema is None else frozenset(self._schema.types)
        return self._schema is None or set(types) <= _VALUES | _WORDS | {"condition", "plot"} | things

    def _attributes(self, state: AnyState, event: str) -> dict[str, str | None]:
        """The types of an event's attributes as `event.name`, if it is known where it comes from."""
        declared: Mapping[str, str | None] | None = outcomes_of(state, self._library).get(event)
        if declared is None:
            declared = self._plot.receives.get(event)
        return {f"event.{name}": kind for name, kind in (declared or {}).items()}

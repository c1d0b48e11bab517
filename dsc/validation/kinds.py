"""Kinds of values: finds text in place of a number, or a place in place of an item.

A finding needs certainty: a name may denote any object, and a variable may hold a value of a subtype.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from dsc.dynamic.library import Library
from dsc.dynamic.steps import Step, contents_of, entered_by
from dsc.errors import Finding
from dsc.model.actions import Assign, Emit, ExternalAction, Internal, Trigger, flat
from dsc.model.plot import ActionPlot, Path
from dsc.model.rules import Reaction
from dsc.model.states import FinalState, State
from dsc.model.transitions import SelectState, TimedTransition, Transition, case_value
from dsc.validation.nesting import Nesting
from dsc.validation.rules import Attributes, RuleScope, Skills, attributes_of
from knowledge_base.errors import SchemaError
from knowledge_base.language.syntax.expression import Constant, Term, Variable
from knowledge_base.language.syntax.text import to_text
from knowledge_base.world.schema import Schema

_VALUES = frozenset({"number", "boolean"})
_WORDS = frozenset({"text", "symbol"})


def check_kinds(
    plot: ActionPlot, library: Library, schema: Schema | None, skills: Skills, nesting: Nesting
) -> Iterator[Finding]:
    """Yield findings about values that do not match their target's type; SCXML's data have no types."""
    if plot.dialect == "dsc":
        yield from _Kinds(plot, library, schema, skills, nesting).findings()


class _Kinds:
    def __init__(
        self, plot: ActionPlot, library: Library, schema: Schema | None, skills: Skills, nesting: Nesting
    ) -> None:
        self._plot, self._library, self._schema, self._nesting = plot, library, schema, nesting
        self._skills = skills or {}
        self._assigned = {name: one.type for name, one in (plot.variables | plot.outputs).items()}
        parameters = {name: parameter.type for name, parameter in plot.parameters.items()}
        self._own: dict[str, str | None] = {**parameters, **self._assigned}

    def findings(self) -> Iterator[Finding]:
        for name, parameter in self._plot.parameters.items():
            yield from self._fits(parameter.default, parameter.type, {}, ("parameters", name, "default"))
        for group, declared in (("variables", self._plot.variables), ("outputs", self._plot.outputs)):
            for name, variable in declared.items():
                yield from self._fits(variable.initial, variable.type, self._own, (group, name, "initial"))
        for _, state, path in self._nesting.states:
            if isinstance(state, State):
                yield from self._state(state, path)
            elif isinstance(state, FinalState):
                yield from self._emitted(state.emit, state.arguments, self._own, path)
            elif isinstance(state, SelectState):
                yield from self._cases(state, path)
            for inside, event, transition in self._nesting.leaving(path):
                if transition.passed or transition.effect or isinstance(transition, TimedTransition):
                    scope = self._scope(state, event) if isinstance(state, State) else self._own
                    yield from self._transition(transition, scope, (*path, *inside))
        yield from self._reactions()

    def _reactions(self) -> Iterator[Finding]:
        """Check the arguments of rules and handlers that read their events, or the steps' arguments."""
        if not (self._plot.rules or self._plot.handlers):
            return
        scopes = RuleScope(self._plot, self._library, self._skills, self._nesting, lambda kind: kind)
        for number, rule in enumerate(self._plot.rules):
            scope, here = {**self._own, **(scopes.of(rule) or {})}, ("rules", number, "do")
            yield from self._used(rule.do, scope, here)
            for entered in entered_by(rule, self._plot, self._library) if rule.do.passed else ():
                yield from self._given(entered, rule.do.passed, scope, (*here, "pass"))
        for number, handler in enumerate(self._plot.handlers):
            scope = {**self._own, **(scopes.attributes(handler) or {})}
            yield from self._used(handler.do, scope, ("handlers", number, "do"))

    def _used(self, do: Reaction, scope: Attributes, path: Path) -> Iterator[Finding]:
        if do.use is not None:
            yield from self._given(self._library.plot(do.use), do.arguments, scope, (*path, "with"))

    def _state(self, state: State, path: Path) -> Iterator[Finding]:
        if isinstance(state, Step) and state.arguments:
            for used in contents_of(state, self._library):
                yield from self._given(used, state.arguments, self._own, (*path, "with"))
        for key, actions in state.blocks() if state.entry or state.exit or state.on_break else ():
            for position, action in enumerate(actions):
                yield from self._action(action, self._own, (*path, key, position))
        if state.at_least is not None:
            yield from self._fits(state.at_least, "number", self._own, (*path, "at_least"))

    def _cases(self, state: SelectState, path: Path) -> Iterator[Finding]:
        """Find cases that can never be taken, because their type differs from the selected value's."""
        selected = self._kind(state.select, self._own)
        for key in state.cases:
            value = case_value(key)
            place = value if isinstance(value, int) else key
            yield from self._fits(Constant(value), selected, {}, (*path, "cases", place), to_text(state.select))

    def _transition(self, transition: Transition, scope: Attributes, path: Path) -> Iterator[Finding]:
        if isinstance(transition, TimedTransition):
            yield from self._fits(transition.seconds, "number", self._own, (*path, "seconds"))
        if transition.passed and transition.target is not None:
            target = self._nesting.state(transition.target)
            for used in contents_of(target, self._library) if isinstance(target, Step) else ():
                yield from self._given(used, transition.passed, scope, (*path, "pass"))
        for action in flat(transition.effect):
            yield from self._action(action, scope, path)

    def _action(self, action: ExternalAction | Internal, scope: Attributes, path: Path) -> Iterator[Finding]:
        if isinstance(action, Assign):
            yield from self._all(action.assign, self._assigned, scope, (*path, "assign"))
        elif isinstance(action, Emit):
            yield from self._emitted(action.emit, action.arguments, scope, path)
        elif isinstance(action, Trigger) and action.trigger in self._skills:
            yield from self._all(action.arguments, self._skills[action.trigger].parameters, scope, (*path, "with"))

    def _given(
        self, used: ActionPlot, arguments: Mapping[str, Term], scope: Attributes, path: Path
    ) -> Iterator[Finding]:
        wanted = {name: parameter.type for name, parameter in used.parameters.items()}
        yield from self._all(arguments, wanted, scope, path)

    def _emitted(
        self, event: str | None, arguments: Mapping[str, Term], scope: Attributes, path: Path
    ) -> Iterator[Finding]:
        declared = self._plot.emits.get(event or "")
        yield from self._all(arguments, declared or {}, scope, (*path, "with"))

    def _all(self, terms: Mapping[str, Term], wanted: Attributes, scope: Attributes, path: Path) -> Iterator[Finding]:
        for name, term in terms.items():
            yield from self._fits(term, wanted.get(name), scope, (*path, name))

    def _fits(
        self, term: Term | None, wanted: str | None, scope: Attributes, path: Path, what: str | None = None
    ) -> Iterator[Finding]:
        given = None if term is None else self._kind(term, scope)
        if term is None or wanted is None or given is None or self._compatible(given, wanted):
            return
        error = SchemaError(
            f"'{what or path[-1]}' is of type {wanted}, and {to_text(term)} is of type {given}",
            place=self._plot.place(path), found=to_text(term),
        )  # fmt: skip
        yield Finding(error, "value fits")

    def _kind(self, term: Term, scope: Attributes) -> str | None:
        """Return the type of a term's value, or `None` if it is unknown."""
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
            return True  # a word may name an object, a plot or a condition
        return self._schema.is_a(given, wanted) or self._schema.is_a(wanted, given)

    def _known(self, types: Iterable[str]) -> bool:
        """Return whether these types exclude numbers and truth values; misspelt types exclude no value."""
        things = frozenset() if self._schema is None else frozenset(self._schema.types)
        return self._schema is None or set(types) <= _VALUES | _WORDS | {"condition", "plot"} | things

    def _scope(self, state: State, event: str) -> Attributes:
        """Return the types of all names that a transition can read: the plot's own, and its event's attributes."""
        attributes = attributes_of(event, state, self._plot, self._library, self._skills) or {}
        return {**self._own, **{f"event.{name}": kind for name, kind in attributes.items()}}

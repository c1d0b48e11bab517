"""Data of plots: variables exist, conditions can be evaluated, arguments match."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property

from dsc.dynamic.library import Library
from dsc.dynamic.steps import Outcomes, Step, answerable, concerns, mentioned_in, outputs_of, terms_of
from dsc.engine.situation import asked_states, settle
from dsc.errors import Finding
from dsc.events import DONE
from dsc.model.actions import (
    Assign,
    Block,
    Choose,
    Emit,
    ExternalAction,
    Internal,
    Log,
    Send,
    Switch,
    Tell,
    Trigger,
    Withdraw,
)
from dsc.model.plot import ActionPlot, Path, PlotParameter, PlotVariable
from dsc.model.rules import CONTINUE, Handler, Reaction, Rule
from dsc.model.states import DynamicState, FinalState, State, SubmachineState
from dsc.model.transitions import Connector, SelectState, TimedTransition, Transition
from dsc.skills import SkillSignature, check_arguments
from dsc.validation.nesting import Nesting
from dsc.validation.rules import RuleScope, Skills, Types, attributes_of
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.language.checking.binding import unbound_error
from knowledge_base.language.checking.check import check, check_effect, check_term
from knowledge_base.language.syntax.effect import Effect, mentioned
from knowledge_base.language.syntax.expression import Expression, Term, free_variables
from knowledge_base.world.schema import Schema

FREE_TYPES = frozenset({"number", "text", "symbol", "boolean", "condition", "plot"})
"""Types of parameters and variables besides those of the schema."""


def check_data(
    plot: ActionPlot, library: Library, schema: Schema | None, skills: Skills, nesting: Nesting
) -> Iterator[Finding]:
    """Yield findings about variables, types, conditions, effects and arguments."""
    yield from _Data(plot, library, schema, skills, nesting).findings()


class _Data:
    def __init__(
        self, plot: ActionPlot, library: Library, schema: Schema | None, skills: Skills, nesting: Nesting
    ) -> None:
        self._plot = plot
        self._library = library
        self._schema = schema
        self._skills = skills
        self._nesting = nesting
        self._assigned = {**plot.variables, **plot.outputs}
        declared: dict[str, PlotParameter | PlotVariable] = {**plot.parameters, **self._assigned}
        self._types: dict[str, str | None] = {name: self._type(one.type) for name, one in declared.items()}
        self._rules = RuleScope(plot, library, skills, nesting, self._type)

    def findings(self) -> Iterator[Finding]:
        yield from self._declarations()
        if self._plot.when is not None:
            own = {name: self._types[name] for name in self._plot.parameters}
            yield from self._condition(self._plot.when, own, ("when",))
        for _, state, path in self._nesting.states:
            if isinstance(state, State):
                yield from self._state(state, path)
            elif isinstance(state, FinalState):
                yield from self._terms(state.arguments.items(), None, (*path, "with"))
                yield from self._internal(state.entry, None, (*path, "entry"))
            elif isinstance(state, Connector):
                yield from self._connector(state, path)
            else:
                yield from self._internal(state.do, None, (*path, "do"))
        for number, rule in enumerate(self._plot.rules):
            yield from self._rule(rule, ("rules", number))
        for number, handler in enumerate(self._plot.handlers):
            yield from self._handler(handler, ("handlers", number))

    def _rule(self, rule: Rule, path: Path) -> Iterator[Finding]:
        scope = self._rules.of(rule)
        if scope is None:
            yield self._rules.never(rule, path)
            return
        far = list(self._rules.out_of_reach(rule, mentioned_in(rule), path))
        if far:
            yield from far
            return
        if rule.when is not None:
            yield from self._condition(rule.when, scope, (*path, "when"))
        yield from self._reaction(rule.do, scope, (*path, "do"))
        yield from self._only(rule.do.passed, scope, (*path, "do", "pass"))
        if rule.on is not None and rule.then == CONTINUE:
            yield from self._continued(rule, scope, (*path, "do", "then"))

    def _handler(self, handler: Handler, path: Path) -> Iterator[Finding]:
        yield from self._rules.check(handler, path)
        attributes = self._rules.attributes(handler)
        read = frozenset(mentioned(handler.do.tell)) if handler.do.tell is not None else frozenset()
        for part in (handler.when, *handler.do.arguments.values()):
            read |= frozenset() if part is None else free_variables(part)
        unknown = {name: None for name in read if name.startswith("event.")} if attributes is None else attributes
        scope = {**self._types, **unknown}
        if handler.when is not None:
            yield from self._condition(handler.when, scope, (*path, "when"))
        yield from self._reaction(handler.do, scope, (*path, "do"))
        if handler.listen is not None:
            yield from self._external(handler.listen, (*path, "listen"))

    def _reaction(self, do: Reaction, scope: Types, path: Path) -> Iterator[Finding]:
        if do.tell is not None:
            yield from self._effect(do.tell, scope, (*path, "tell"))
        yield from self._only(do.arguments, scope, (*path, "with"))
        for position, command in enumerate(do.command):
            yield from self._only(terms_of(command), scope, (*path, "command", position))

    def _continued(self, rule: Rule, event: Types, path: Path) -> Iterator[Finding]:
        """Check a `continue` response: the rule's event lacks the outputs that `done` would provide."""
        for name, state, outcomes in self._handing_back:
            if rule.on in outcomes and concerns(rule, name, state, self._library):
                for transition in state.on.get(DONE, ()):
                    yield from self._transition(transition, event, path)

    @cached_property
    def _handing_back(self) -> list[tuple[str, Step, Outcomes]]:
        """Return the states with outputs at `done`, with their outcomes."""
        states = ((name, state) for name, state, _ in self._nesting.states if isinstance(state, Step))
        return [(n, s, answerable(s, self._library)) for n, s in states if outputs_of(s, self._library)]

    # -- parts of a plot ---------------------------------------------------------------------------------

    def _declarations(self) -> Iterator[Finding]:
        if self._schema is None:
            return
        valid = FREE_TYPES | set(self._schema.types)
        declared: dict[str, Mapping[str, PlotParameter | PlotVariable]] = {
            "parameters": self._plot.parameters, "variables": self._plot.variables, "outputs": self._plot.outputs,
        }  # fmt: skip
        for kind, declarations in declared.items():
            for name, declaration in declarations.items():
                if declaration.type not in valid:
                    error = UnknownNameError(
                        f"there is no type '{declaration.type}'",
                        place=self._plot.place((kind, name)), found=declaration.type, valid=valid,
                    )  # fmt: skip
                    yield Finding(error, "known type")

    def _state(self, state: State, path: Path) -> Iterator[Finding]:
        for key, actions in state.blocks():
            for position, action in enumerate(actions):
                if isinstance(action, Internal):
                    yield from self._internal((action,), None, (*path, key, position))
                else:
                    yield from self._external(action, (*path, key, position))
        for inside, event, transition in self._nesting.leaving(path):
            if transition.guard is not None or transition.passed or transition.effect:
                attributes = self._event_types(state, event) if event in state.on else None
                yield from self._transition(transition, attributes, (*path, *inside))
            if isinstance(transition, TimedTransition):
                yield from self._terms([("seconds", transition.seconds)], None, (*path, *inside))
        if state.at_least is not None:
            yield from self._terms([("at_least", state.at_least)], None, path)
        if isinstance(state, SubmachineState | DynamicState):
            yield from self._terms(state.arguments.items(), None, (*path, "with"))
        if isinstance(state, DynamicState) and state.goal is not None:
            yield from self._condition(state.goal, self._types, (*path, "goal"))

    def _connector(self, connector: Connector, path: Path) -> Iterator[Finding]:
        # The event before a connector is unknown at validation.
        if isinstance(connector, SelectState):
            yield from self._terms([("select", connector.select)], None, path)
        for inside, _, transition in self._nesting.leaving(path):
            yield from self._transition(transition, None, (*path, *inside))

    def _transition(self, transition: Transition, attributes: Types | None, path: Path) -> Iterator[Finding]:
        if transition.guard is not None:
            scope = self._scope(attributes, transition.guard)
            yield from self._condition(transition.guard, scope, (*path, "when"))
        yield from self._terms(transition.passed.items(), attributes, (*path, "pass"))
        yield from self._internal(transition.effect, attributes, path)

    def _internal(self, actions: Iterable[Internal], attributes: Types | None, path: Path) -> Iterator[Finding]:
        for action in actions:
            if isinstance(action, Tell):
                yield from self._effect(action.tell, self._scope(attributes, action.tell), (*path, "tell"))
            elif isinstance(action, Assign):
                yield from self._assign(action, (*path, "assign"))
                yield from self._terms(action.assign.items(), attributes, (*path, "assign"))
            elif isinstance(action, Emit):
                yield from self._terms(action.arguments.items(), attributes, (*path, "with"))
                later = [("delay", action.delay), ("id", action.id)]
                yield from self._terms([(key, term) for key, term in later if term is not None], attributes, path)
                if action.into is not None:
                    yield from self._known_variable(action.into, (*path, "into"))
            elif isinstance(action, Withdraw):
                yield from self._terms([("withdraw", action.withdraw)], attributes, path)
            elif isinstance(action, Log):
                yield from self._terms([("log", part) for part in action.log], attributes, path)
            elif isinstance(action, Choose):
                scope = self._scope(attributes, action.condition)
                yield from self._condition(action.condition, scope, (*path, "if"))
                yield from self._internal(action.then, attributes, (*path, "then"))
                yield from self._internal(action.otherwise, attributes, (*path, "else"))
            elif isinstance(action, Block):
                yield from self._internal(action.block, attributes, (*path, "block"))

    def _assign(self, action: Assign, path: Path) -> Iterator[Finding]:
        for name in action.assign:
            yield from self._known_variable(name, (*path, name))

    def _known_variable(self, name: str, path: Path) -> Iterator[Finding]:
        if name not in self._assigned:
            error = UnknownNameError(
                f"there is no variable '{name}'", place=self._plot.place(path), found=name, valid=self._assigned
            )
            yield Finding(error, "declared variable")

    def _external(self, action: ExternalAction, path: Path) -> Iterator[Finding]:
        if isinstance(action, Switch):
            return
        if isinstance(action, Send):
            yield from self._terms(action.arguments.items(), None, (*path, "with"))
            return
        if not isinstance(action, Trigger):
            yield from self._terms([("to", action.to)], None, path)
            return
        yield from self._terms(action.arguments.items(), None, (*path, "with"))
        signature = None if self._skills is None else self._skills.get(action.trigger)
        if signature is not None:
            yield from self._skill_arguments(signature, action, path)

    def _skill_arguments(self, signature: SkillSignature, action: Trigger, path: Path) -> Iterator[Finding]:
        try:
            check_arguments(signature, action.arguments)
        except InputError as error:
            here = (*path, "with", error.found) if error.found else (*path, "trigger")
            yield Finding(_at(error, self._plot, here), "skill arguments")

    # -- the language ------------------------------------------------------------------------------------

    def _condition(self, condition: Expression, scope: Types, path: Path) -> Iterator[Finding]:
        for name in asked_states(condition):
            if name not in self._nesting.names:
                error = UnknownNameError(
                    f"there is no state '{name}'", place=self._plot.place(path),
                    found=name, valid=self._nesting.names,
                )  # fmt: skip
                yield Finding(error, "condition")
        if self._plot.dialect == "scxml":
            condition = settle(condition, lambda _: True)
        if self._schema is not None:
            try:
                check(condition, self._schema, scope)
            except InputError as error:
                yield Finding(_at(error, self._plot, path), "condition")
            return
        for name in sorted(free_variables(condition) - scope.keys()):
            yield Finding(_at(unbound_error(name, None, scope), self._plot, path), "condition")

    def _effect(self, effect: Effect, scope: Types, path: Path) -> Iterator[Finding]:
        if self._schema is not None:
            try:
                check_effect(effect, self._schema, scope)
            except InputError as error:
                yield Finding(_at(error, self._plot, path), "effect")
            return
        for name in sorted(mentioned(effect) - scope.keys()):
            yield Finding(_at(unbound_error(name, None, scope), self._plot, path), "effect")

    def _terms(self, terms: Iterable[tuple[str, Term]], attributes: Types | None, path: Path) -> Iterator[Finding]:
        for key, term in terms:
            yield from self._only({key: term}, self._scope(attributes, term), path)

    def _only(self, terms: Mapping[str, Term], scope: Types, path: Path) -> Iterator[Finding]:
        for key, term in terms.items():
            unknown = sorted(free_variables(term) - set(scope))
            if not unknown and self._schema is not None and self._plot.dialect == "dsc":
                yield from self._term(term, scope, (*path, key))
            for name in unknown:
                error = UnknownNameError(
                    f"there is no variable '?{name}' here", place=self._plot.place((*path, key)),
                    found=name, valid=scope,
                )  # fmt: skip
                yield Finding(error, "declared variable")

    def _term(self, term: Term, scope: Types, path: Path) -> Iterator[Finding]:
        try:
            check_term(term, self._schema or Schema(), scope)
        except InputError as error:
            yield Finding(_at(error, self._plot, path), "term")

    def _scope(self, attributes: Types | None, used: Expression | Term | Effect | None) -> dict[str, str | None]:
        """Return the visible variables; for an unknown event, all of its attributes that the expression uses."""
        if attributes is not None:
            return {**self._types, **attributes}
        names = mentioned(used) if used is not None else frozenset()
        return {**self._types, **{name: None for name in names if name.startswith("event.")}}

    def _event_types(self, state: State, event: str) -> Types | None:
        """Return an event's attribute types as `event.name`; `None` if they are unknown."""
        found = attributes_of(event, state, self._plot, self._library, self._skills)
        if found is None:
            return None
        return {f"event.{name}": self._type(kind) if kind else None for name, kind in found.items()}

    def _type(self, name: str) -> str | None:
        if name in {"number", "text", "boolean"}:
            return name
        return name if self._schema is not None and name in self._schema.types else None


def _at(error: InputError, plot: ActionPlot, path: Path) -> InputError:
    """Return the error at the place of its text; its own place is relative to that text."""
    error.place = plot.place(path) or error.place
    return error

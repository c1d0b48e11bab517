"""Checks of data in plots: variables exist, conditions can be evaluated, and values fit their types.

A finding about a type is reported only if the value can never fit. A name may denote any object, and the value of a
variable may have a subtype.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

from dsc.conversions import Conversion
from dsc.data_types import ANY, data_type, names_in
from dsc.dynamic.steps import (
    Outcomes,
    Step,
    answerable,
    concerns,
    contents_of,
    entered_by,
    mentioned_in,
    outputs_of,
    terms_of,
)
from dsc.engine.binding_types import element_type, with_types
from dsc.errors import Finding
from dsc.events import DONE
from dsc.model import actions
from dsc.model.data_forms import is_literal, literal_parts
from dsc.model.language import term_text
from dsc.model.plot import ActionPlot, Path
from dsc.model.rules import CONTINUE, Handler, Reaction, Rule
from dsc.model.states import DynamicState, FinalState, HistoryState, State
from dsc.model.transitions import CHOICE, SelectState, TimedTransition, Transition, TransitionSource
from dsc.skills import SkillSignature, check_arguments
from dsc.type_words import in_words
from dsc.validation.language_checks import LanguageChecker
from dsc.validation.rules import RuleScope, attributes_of, read_as
from dsc.validation.subject import Subject, Types
from dsc.validation.type_checks import FREE_TYPES, TypeChecker, inside_optional
from knowledge_base.errors import InputError
from knowledge_base.language.syntax.effect import Effect, mentioned
from knowledge_base.language.syntax.expression import (
    Arithmetic,
    Call,
    Constant,
    Expression,
    Term,
    Variable,
)
from knowledge_base.language.syntax.text import to_text

_ANY: Types = {}
_FINDS = {"bind": "one value", "bind_all": "a list of values"}
_OF_PYTHON = {"bool": "boolean", "float": "number", "int": "integer", "str": "text"}
"""Types of Python that authors write by mistake, with the types of plots."""


def check_data(subject: Subject) -> Iterator[Finding]:
    """Yield findings about variables, types, conditions, effects and arguments."""
    yield from _Data(subject).findings()


class _Data:
    """Check of every condition, effect and term of a plot in its scope: the types of all readable names.

    An event's attributes have names such as `event.item`. The scope `None` stands for an unknown event, of which any
    attribute may be read.
    """

    def __init__(self, subject: Subject) -> None:
        self._subject, self._plot, self._library = subject, subject.plot, subject.library
        self._schema = subject.schema
        self._checker = TypeChecker(subject.schema, subject.records)
        self._skills = subject.skills or {}
        self._assigned, self._own = subject.assigned, subject.types
        self._rules = RuleScope(subject)
        self._language = LanguageChecker(subject, self._checker)

    def findings(self) -> Iterator[Finding]:
        yield from self._declarations()
        if self._plot.when is not None:
            yield from self._condition(self._plot.when, _types(self._plot), ("when",))
        for name, term in self._plot.scores().items():
            yield from self._term(term, _types(self._plot), (name,), "number")
        for _, state, path in self._subject.states:
            if isinstance(state, State):
                yield from self._state(state, path)
            elif isinstance(state, FinalState):
                declared = self._plot.emits.get(state.emit or "")
                yield from self._terms(state.arguments, None, (*path, "with"), declared or _ANY)
                yield from self._actions(state.entry, None, (*path, "entry"))
            elif isinstance(state, HistoryState):
                yield from self._actions(state.do, None, (*path, "do"))
            elif isinstance(state, SelectState):
                yield from self._selection(state, path)
            if isinstance(state, TransitionSource):
                yield from self._leaving(state, path)
        for number, rule in enumerate(self._plot.rules):
            yield from self._rule(rule, ("rules", number))
        for number, handler in enumerate(self._plot.handlers):
            yield from self._handler(handler, ("handlers", number))

    # -- parts of a plot ---------------------------------------------------------------------------------

    def _declarations(self) -> Iterator[Finding]:
        plot = self._plot
        for name, parameter in plot.parameters.items():
            yield from self._type_exists(parameter.type, ("parameters", name))
            yield from self._fits(parameter.default, parameter.type, _ANY, ("parameters", name, "default"))
        for group, declared in (("variables", plot.variables), ("outputs", plot.outputs)):
            for name, variable in declared.items():
                yield from self._type_exists(variable.type, (group, name))
                yield from self._fits(variable.initial, variable.type, self._own, (group, name, "initial"))
        for place, values in ({} if plot.robot is None else plot.robot.assignments).items():
            yield from self._terms(values, self._own, ("robot", *place), self._assigned)
        for group, events in (("types", plot.types), ("emits", plot.emits), ("receives", plot.receives)):
            for event, attributes in events.items():
                for name, kind in (attributes or {}).items():
                    yield from self._type_exists(kind, (group, event, name))

    def _type_exists(self, text: str, path: Path) -> Iterator[Finding]:
        if self._schema is None:
            return
        for name in names_in(data_type(text)):
            if not self._checker.knows(name):
                valid = {*FREE_TYPES, *self._schema.types, *self._subject.records}
                message, meant = f"there is no type '{name}'", _OF_PYTHON.get(name)
                if meant is not None:
                    yield self._subject.finding(path, "known-type", message, f"write {meant}", found=name)
                    continue
                yield self._subject.finding(path, "known-type", message, found=name, valid=valid)

    def _state(self, state: State, path: Path) -> Iterator[Finding]:
        for key, block in state.blocks():
            yield from self._actions(block, None, (*path, key), numbered=True)
        if state.at_least is not None:
            yield from self._term(state.at_least, None, (*path, "at_least"), "number")
        if isinstance(state, Step):
            yield from self._check_given(state.arguments, None, (*path, "with"), contents_of(state, self._library))
        if isinstance(state, DynamicState):
            if state.goal is not None:
                yield from self._condition(state.goal, self._own, (*path, "goal"), planned=True)
            for number, condition in enumerate(state.situation):
                yield from self._condition(condition, self._own, (*path, "situation", number))

    def _selection(self, state: SelectState, path: Path) -> Iterator[Finding]:
        """Yield findings about the selected term, and about cases whose type differs from the term's type."""
        yield from self._term(state.select, None, (*path, "select"))
        selected = self._kind(state.select, self._own)
        for inside, value, _ in state.written_cases():
            yield from self._fits(Constant(value), selected, _ANY, (*path, *inside), to_text(state.select))

    def _leaving(self, state: TransitionSource, path: Path) -> Iterator[Finding]:
        ways = self._subject.leaving(path)
        if isinstance(state, SelectState):  # `_selection` checks the comparisons with the cases
            ways = tuple(((*path, *inside), CHOICE, case) for inside, _, case in state.written_cases()) + ways[-1:]
        for here, event, transition in ways:
            if isinstance(transition, TimedTransition):
                yield from self._term(transition.seconds, None, (*here, "seconds"), "number")
            if transition.has_guard or transition.passed or transition.effect:
                # Validation cannot determine the event that led to a connector.
                attributes = None
                if isinstance(state, State) and event in state.on:
                    attributes = attributes_of(self._subject, event, state)
                scope = None if attributes is None else {**self._own, **read_as("event.", attributes)}
                yield from self._transition(transition, scope, here)

    def _transition(self, transition: Transition, scope: Types | None, path: Path) -> Iterator[Finding]:
        if transition.guard is not None:
            yield from self._condition(transition.guard, scope, (*path, "when"), guard=not transition.bind)
        if transition.bind or transition.bind_all:
            yield from self._bindings(transition, scope, path)
        if transition.passed:
            contents = self._subject.contents(transition.target)
            yield from self._check_given(transition.passed, scope, (*path, "pass"), contents)
        yield from self._actions(transition.effect, scope, path)

    def _bindings(self, transition: Transition, scope: Types | None, path: Path) -> Iterator[Finding]:
        """Yield findings about the variables, conditions and terms of `bind`, `bind_all` and `order_by`."""
        for key, conditions in (("bind", transition.bind), ("bind_all", transition.bind_all)):
            for name in conditions:
                yield from self._variable(name, (*path, key, name))
                kind = inside_optional(data_type(self._assigned.get(name, ANY)))
                if name in self._assigned and (kind.kind == "list") != (key == "bind_all"):
                    other = "bind" if key == "bind_all" else "bind_all"
                    message = f"'{name}' is {in_words(str(kind))}, and `{key}` finds {_FINDS[key]}"
                    yield self._subject.finding((*path, key, name), "bindings", message, f"use `{other}`")
        for bind in (action for action in transition.effect if isinstance(action, actions.Bind)):
            key = "bind_all" if bind.every else "bind"
            kinds = {
                name: str(element_type(data_type(self._assigned[name]), every=bind.every))
                for name in bind.names
                if name in self._assigned
            }
            written = transition.bind_all if bind.every else transition.bind
            for name in bind.names:
                names = {**self._scope(scope, written[name]), **kinds}
                yield from self._language.condition(written[name], names, (*path, key, name))
            typed = with_types(bind, self._assigned, self._subject.records)
            names = {**self._scope(scope, typed.condition), **kinds}
            yield from self._language.answers(typed.condition, names, bind.names, (*path, key))
            for number, term in enumerate(bind.order_by):
                yield from self._term(term, names, (*path, "order_by", number), "number")

    def _actions(
        self, block: Iterable[actions.Internal | actions.ExternalAction], scope: Types | None, path: Path,
        *, numbered: bool = False,
    ) -> Iterator[Finding]:  # fmt: skip
        for position, action in enumerate(block):
            yield from self._action(action, scope, (*path, position) if numbered else path)

    def _action(  # noqa: C901, PLR0912  # a table by kind
        self, action: actions.Internal | actions.ExternalAction, scope: Types | None, path: Path
    ) -> Iterator[Finding]:
        match action:
            case actions.Tell(tell=effect):
                yield from self._effect(effect, scope, (*path, "tell"))
            case actions.Bind() | actions.Perform() | actions.StartActivity() | actions.StopActivity():
                pass  # see `_bindings` and `check_robot`
            case actions.Assign(assign=values):
                for name in values:
                    yield from self._variable(name, (*path, "assign", name))
                yield from self._terms(values, scope, (*path, "assign"), self._assigned)
            case actions.Emit(emit=event, arguments=values):
                yield from self._terms(values, scope, (*path, "with"), self._plot.emits.get(event) or _ANY)
                later = {"delay": action.delay, "id": action.id}
                yield from self._terms({key: term for key, term in later.items() if term is not None}, scope, path)
                if action.into is not None:
                    yield from self._variable(action.into, (*path, "into"))
            case actions.Withdraw(withdraw=sent):
                yield from self._term(sent, scope, (*path, "withdraw"))
            case actions.Log(log=parts):
                for part in parts:
                    yield from self._term(part, scope, (*path, "log"))
            case actions.Choose(condition=condition, then=then, otherwise=otherwise):
                yield from self._condition(condition, scope, (*path, "if"))
                yield from self._actions(then, scope, (*path, "then"))
                yield from self._actions(otherwise, scope, (*path, "else"))
            case actions.Block(block=inside):
                yield from self._actions(inside, scope, (*path, "block"))
            case actions.Configure(to=value) | actions.Wire(to=value):
                yield from self._term(value, scope, (*path, "to"))
            case actions.Send(send=port, arguments=values):
                yield from self._arguments(self._message(port), values, scope, path, "send")
            case actions.Switch() | actions.Unwire():
                pass
            case actions.Trigger(trigger=skill, arguments=values):
                yield from self._arguments(self._skills.get(skill), values, scope, path, "trigger")

    def _message(self, port: str) -> SkillSignature | None:
        """Return the parts of a message; `None` if they are unknown, or for a message that another check reports."""
        component, _, name = port.partition(".")
        interface = self._subject.interfaces.get(component)
        return None if interface is None else (interface.messages or {}).get(name)

    def _arguments(
        self, signature: SkillSignature | None, values: Mapping[str, Term], scope: Types | None, path: Path, key: str
    ) -> Iterator[Finding]:
        """Yield findings about the arguments for a skill, or the parts of a message, whose port is at `key`."""
        yield from self._terms(values, scope, (*path, "with"), _ANY if signature is None else signature.parameters)
        if signature is None:
            return
        try:
            check_arguments(signature, values)
        except InputError as error:
            here = (*path, "with", error.found) if error.found else (*path, key)
            yield self._subject.caught(error, here, "skill-arguments")

    def _variable(self, name: str, path: Path) -> Iterator[Finding]:
        if name in self._plot.parameters:
            message = f"'{name}' is a parameter, which the plot only reads; assign a variable"
            yield self._subject.finding(path, "declared-variable", message, found=name)
        elif self._plot.robot is not None and name in self._plot.robot.read_only:
            message = f"'{name}' is {self._plot.robot.read_only[name]}, which the plot only reads; assign a motor"
            yield self._subject.finding(path, "declared-variable", message, found=name)
        elif name not in self._assigned:
            message, called = f"there is no variable '{name}'", self._call_of(name)
            fix = f"the knowledge has this value: `tell: (assign {called} ...)`" if called else ""
            yield self._subject.finding(path, "declared-variable", message, fix, found=name, valid=self._assigned)

    # -- rules and handlers ------------------------------------------------------------------------------

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
        if rule.do.passed:
            entered = entered_by(rule, self._plot, self._library)
            yield from self._check_given(rule.do.passed, scope, (*path, "do", "pass"), entered)
        if rule.on is not None and any(one.then == CONTINUE for one in rule.continuations):
            yield from self._check_continued(rule, {**self._own, **scope}, (*path, "do", "then"))

    def _handler(self, handler: Handler, path: Path) -> Iterator[Finding]:
        yield from self._rules.check(handler, path)
        attributes = self._rules.attributes(handler)
        scope = None if attributes is None else {**self._own, **attributes}
        if handler.when is not None:
            yield from self._condition(handler.when, scope, (*path, "when"))
        yield from self._reaction(handler.do, scope, (*path, "do"))
        if handler.listen is not None:
            yield from self._action(handler.listen, None, (*path, "listen"))

    def _reaction(self, do: Reaction, scope: Types | None, path: Path) -> Iterator[Finding]:
        if do.tell is not None:
            yield from self._effect(do.tell, scope, (*path, "tell"))
        contents = [] if do.use is None else [self._library.plot(do.use)]
        yield from self._check_given(do.arguments, scope, (*path, "with"), contents)
        for position, command in enumerate(do.command):
            yield from self._terms(terms_of(command), scope, (*path, "command", position))

    def _check_continued(self, rule: Rule, scope: Types, path: Path) -> Iterator[Finding]:
        """Yield findings about a `continue` response whose event lacks outputs that transitions on `done` read."""
        for name, state, outcomes in self._returning:
            if rule.on in outcomes and concerns(rule, name, state, self._library):
                for transition in state.on.get(DONE, ()):
                    yield from self._transition(transition, scope, path)

    @cached_property
    def _returning(self) -> list[tuple[str, Step, Outcomes]]:
        """Return name, state and outcomes of each step that returns outputs with `done`."""
        steps = [(name, state) for name, state, _ in self._subject.steps if outputs_of(state, self._library)]
        return [(name, state, answerable(state, self._library)) for name, state in steps]

    # -- the language ------------------------------------------------------------------------------------

    def _condition(
        self, condition: Expression, scope: Types | None, path: Path, *, planned: bool = False, guard: bool = False
    ) -> Iterator[Finding]:
        names = self._scope(scope, condition)
        yield from self._language.condition(condition, names, path, planned=planned, guard=guard)

    def _effect(self, effect: Effect, scope: Types | None, path: Path) -> Iterator[Finding]:
        yield from self._language.effect(effect, self._scope(scope, effect), path)

    def _check_given(
        self, terms: Mapping[str, Term], scope: Types | None, path: Path, used: Iterable[ActionPlot]
    ) -> Iterator[Finding]:
        """Yield findings about the arguments for a plot, or for several candidates."""
        wanted = [_types(plot) for plot in used]
        for name, term in terms.items():
            kinds = dict.fromkeys(types[name] for types in wanted if name in types)
            yield from self._term(term, scope, (*path, name), *kinds)

    def _terms(
        self, terms: Mapping[str, Term], scope: Types | None, path: Path, wanted: Types = _ANY
    ) -> Iterator[Finding]:
        for key, term in terms.items():
            yield from self._term(term, scope, (*path, key), wanted.get(key))

    def _term(self, term: Term, scope: Types | None, path: Path, *wanted: str | None) -> Iterator[Finding]:
        if is_literal(term):
            yield from self._literal(term, scope, path, *wanted)
            return
        if isinstance(term, Call) and term.function in self._library.conversions:
            yield from self._conversion(self._library.conversions[term.function], term, scope, path, *wanted)
            return
        if isinstance(term, Call) and self._is_unknown(term.function):
            message = f"there is no function or conversion '{term.function}'"
            valid = {*self._library.conversions, *(self._schema.functions if self._schema is not None else ())}
            yield self._subject.finding(path, "term", message, found=term.function, valid=valid)
            return
        names = self._scope(scope, term)
        if isinstance(term, Arithmetic) and self._library.conversions:
            yield from self._operands(term, scope, path)
            term = replace(term, args=tuple(map(self._operand, term.args)))
        read = yield from self._language.term(term, names, path)
        if read is None:
            return
        for kind in wanted:
            yield from self._fits(term, kind, read, path)

    def _is_unknown(self, function: str) -> bool:
        return self._schema is not None and function != "size" and function not in self._schema.functions

    def _literal(self, term: Term, scope: Types | None, path: Path, *wanted: str | None) -> Iterator[Finding]:
        """Yield findings about the parts of a list or record."""
        try:
            parts = literal_parts(term) or {}
        except InputError as error:
            yield self._subject.caught(error, path, "term")
            return
        for text in wanted or (None,):
            types = self._checker.parts_of(text, parts, is_list=isinstance(term, Call) and term.function == "list")
            if isinstance(types, str):
                message = f"'{path[-1]}' is of type {text}, and {term_text(term)} {types}"
                yield self._subject.finding(path, "value-fits", message, found=term_text(term))
                continue
            for name, part in parts.items():
                yield from self._term(part, scope, (*path, int(name) if name.isdecimal() else name), types.get(name))

    def _conversion(
        self, called: Conversion[..., Any], term: Call, scope: Types | None, path: Path, *wanted: str | None
    ) -> Iterator[Finding]:
        """Yield findings about the arguments and the result of a conversion."""
        try:
            called.require_arguments(len(term.args))
        except InputError as error:
            yield self._subject.caught(error, path, "term")
            return
        for (name, kind), part in zip(called.parameters.items(), term.args, strict=False):
            yield from self._term(part, scope, (*path, name), kind)
        for kind in wanted:
            yield from self._fits(term, kind, _ANY, path)

    def _operands(self, term: Arithmetic, scope: Types | None, path: Path) -> Iterator[Finding]:
        """Yield findings about the conversions among the operands of arithmetic."""
        for part in term.args:
            if isinstance(part, Call) and part.function in self._library.conversions:
                yield from self._term(part, scope, path, "number")

    def _operand(self, term: Term) -> Term:
        called = isinstance(term, Call) and term.function in self._library.conversions
        return Constant(0, place=term.place) if called else term

    def _scope(self, scope: Types | None, used: Expression | Term | Effect) -> Types:
        """Return the scope; for `None`, an unknown event, the plot's names and all attributes that `used` reads."""
        if scope is not None:
            return scope
        attributes = [name for name in mentioned(used) if name.startswith("event.")]
        return {**self._own, **dict.fromkeys(attributes)} if attributes else self._own

    # -- types -------------------------------------------------------------------------------------------

    def _meant(self, word: object, scope: Types) -> str:
        """Return how plots write a variable or function of this name; empty for another word."""
        if word in scope:
            return f"write ?{word}"
        called = self._call_of(str(word))
        return f"write {called}" if called else ""

    def _call_of(self, name: str) -> str:
        """Return a call of the function with this name, e.g. `(need ?r)`; empty without such a function."""
        function = None if self._schema is None else self._schema.functions.get(name)
        return "" if function is None else f"({' '.join([name, *(f'?{one.name}' for one in function.parameters)])})"

    def _fits(
        self, term: Term | None, wanted: str | None, scope: Types, path: Path, what: str | None = None
    ) -> Iterator[Finding]:
        """Yield a finding about a value whose type does not fit; data in dialect `scxml` have no types."""
        if term is not None and is_literal(term):
            yield from self._literal(term, scope, path, wanted)
            return
        if isinstance(term, Variable) and self._plot.robot is not None:
            value = self._plot.robot.constants.get(term.name)
            term = term if value is None else Constant(value)
        given = None if term is None or wanted is None or not self._subject.strict else self._kind(term, scope)
        if term is None or wanted is None or given is None:
            return
        name, kind = what or path[-1], data_type(wanted)
        named = wanted in (self._schema.types if self._schema is not None else ())
        if named and isinstance(term, Constant) and isinstance(term.value, str) and term.value != term.value.lower():
            message = f"'{name}' is of type {wanted}, and the name of an object is in lower case"
            lower = term.value.lower()
            yield self._subject.finding(path, "value-fits", message, f"write {lower}", found=term.value)
        different = self._checker.difference(data_type(given), kind)
        if different is not None:
            message = f"'{name}' is of type {wanted}, and {to_text(term)} is {different}"
            fix = self._meant(term.value, {**self._own, **scope}) if isinstance(term, Constant) else ""
            yield self._subject.finding(path, "value-fits", message, fix, found=to_text(term))
        elif isinstance(term, Constant) and all(map(self._checker.knows, names_in(kind))):
            try:
                kind.check(f"'{name}'", term.value, self._subject.records)
            except InputError as error:
                yield self._subject.caught(error, path, "value-fits")
                return
            if isinstance(term.value, str):
                yield from self._language.unknown_object(term.value, wanted, {**self._own, **scope}, path)

    def _kind(self, term: Term, scope: Types) -> str | None:
        """Return the type of a term's value, or `None` if it is unknown."""
        match term:
            case Variable(name):
                return scope.get(name)
            case Constant(str() as name):
                return "text" if self._schema is None else self._schema.constants.get(name, "text")
            case Constant(value):
                return "boolean" if isinstance(value, bool) else "number"
            case Call(function):
                return self._result(function)
            case Arithmetic(operator=operator):
                return "geometry" if operator == "geometry" else "number"

    def _result(self, function: str) -> str | None:
        """Return the type of the values of a conversion, or of a function of the world."""
        if function in self._library.conversions:
            return self._library.conversions[function].result
        schema = self._schema
        return schema.result(function) if schema is not None and function in schema.functions else "number"


def _types(plot: ActionPlot) -> dict[str, str]:
    return {name: parameter.type for name, parameter in plot.parameters.items()}

"""Data: variables that exist, conditions that can be evaluated, arguments that fit."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from dsc.dynamic.library import Library
from dsc.dynamic.outcomes import outcomes_of
from dsc.engine.membership import asked_states, settle
from dsc.errors import Finding
from dsc.model.actions import Assign, Choose, Emit, ExternalAction, Internal, Log, Switch, Tell, Trigger
from dsc.model.plot import ActionPlot, Parameter, Path, Variable
from dsc.model.states import AnyState, DynamicState, FinalState, State, SubmachineState, TimedTransition, Transition
from dsc.skills import SkillSignature, check_arguments
from dsc.validation.wiring import Skills
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.language.binding import unbound_error
from knowledge_base.language.check import check, check_effect, check_term
from knowledge_base.language.effect import Add, AllOf, Delete, Effect, ForEach, When
from knowledge_base.language.effect import Assign as Change
from knowledge_base.language.expression import Expression, Term, free_variables
from knowledge_base.schema import Schema

FREE_TYPES = frozenset({"number", "text", "symbol", "boolean", "condition", "plot"})
"""Types of parameters and variables besides those of the schema."""

Types = Mapping[str, str | None]


def check_data(
    plot: ActionPlot, library: Library, schema: Schema | None, skills: Skills
) -> Iterator[Finding]:
    """Findings about variables, types, conditions, effects and arguments."""
    yield from _Data(plot, library, schema, skills).findings()


class _Data:
    def __init__(self, plot: ActionPlot, library: Library, schema: Schema | None, skills: Skills) -> None:
        self._plot = plot
        self._library = library
        self._schema = schema
        self._skills = skills
        declared: dict[str, Parameter | Variable] = {**plot.parameters, **plot.variables}
        self._types: dict[str, str | None] = {name: self._type(one.type) for name, one in declared.items()}
        self._sources = [outcomes for _, state, _ in plot.walk() if (outcomes := outcomes_of(state, library))]
        self._sources += [other.emits for other in library if other.implements]

    def findings(self) -> Iterator[Finding]:
        yield from self._declarations()
        if self._plot.when is not None:
            own = {name: self._types[name] for name in self._plot.parameters}
            yield from self._condition(self._plot.when, own, ("when",))
        for _, state, path in self._plot.walk():
            if isinstance(state, State):
                yield from self._state(state, path)
            elif isinstance(state, FinalState):
                yield from self._terms(state.arguments.items(), None, (*path, "with"))
                yield from self._internal(state.entry, None, (*path, "entry"))
            else:
                yield from self._internal(state.do, None, (*path, "do"))
        for number, rule in enumerate(self._plot.rules):
            path = ("rules", number)
            event = self._rule_event(rule.on)
            if event is None:
                yield self._unknown_event(rule.on, (*path, "on"))
                continue
            # Rules travel to generated plots, where the holder's variables do not exist.
            if rule.when is not None:
                yield from self._condition(rule.when, event, (*path, "when"))
            if rule.do.tell is not None:
                yield from self._effect(rule.do.tell, event, (*path, "do", "tell"))
            yield from self._only(rule.do.arguments, event, (*path, "do", "with"))
            if rule.do.use is not None:
                used = self._library.plot(rule.do.use)
                yield from self._arguments(used.name, used.parameters, set(rule.do.arguments), (*path, "do", "with"))

    # -- parts of a plot ---------------------------------------------------------------------------------

    def _declarations(self) -> Iterator[Finding]:
        if self._schema is None:
            return
        valid = FREE_TYPES | set(self._schema.types)
        for kind, declarations in (("parameters", self._plot.parameters), ("variables", self._plot.variables)):
            for name, declaration in declarations.items():
                if declaration.type not in valid:
                    error = UnknownNameError(
                        f"there is no type '{declaration.type}'",
                        place=self._plot.place((kind, name)), found=declaration.type, valid=valid,
                    )  # fmt: skip
                    yield Finding(error, "known type")

    def _state(self, state: State, path: Path) -> Iterator[Finding]:
        for key, actions in (("entry", state.entry), ("exit", state.exit)):
            for position, action in enumerate(actions):
                if isinstance(action, Internal):
                    yield from self._internal((action,), None, (*path, key, position))
                else:
                    yield from self._external(action, (*path, key, position))
        for inside, event, transition in state.placed_transitions():
            attributes = self._event_types(state, event) if event in state.on else None
            yield from self._transition(transition, attributes, (*path, *inside))
            if isinstance(transition, TimedTransition):
                yield from self._terms([("seconds", transition.seconds)], None, (*path, *inside))
        if isinstance(state, SubmachineState):
            yield from self._terms(state.arguments.items(), None, (*path, "with"))
            if not state.use.startswith("?"):
                used = self._library.plot(state.use)
                yield from self._arguments(used.name, used.parameters, set(state.arguments), (*path, "with"))
        if isinstance(state, DynamicState):
            yield from self._dynamic(state, path)

    def _dynamic(self, state: DynamicState, path: Path) -> Iterator[Finding]:
        yield from self._terms(state.arguments.items(), None, (*path, "with"))
        candidates = [self._library.plot(name) for name in state.dynamic]
        taken = {name for plot in candidates for name in plot.parameters}
        for plot in candidates:
            own = set(state.arguments) & set(plot.parameters)
            yield from self._arguments(plot.name, plot.parameters, own, (*path, "with"))
        for name in state.arguments:
            if name not in taken:
                error = UnknownNameError(
                    f"no candidate has a parameter '{name}'",
                    place=self._plot.place((*path, "with", name)), found=name, valid=taken,
                )  # fmt: skip
                yield Finding(error, "candidates conform")
        if state.goal is not None:
            yield from self._condition(state.goal, self._types, (*path, "goal"))

    def _transition(self, transition: Transition, attributes: Types | None, path: Path) -> Iterator[Finding]:
        scope = self._scope(attributes, transition.guard)
        if transition.guard is not None:
            yield from self._condition(transition.guard, scope, (*path, "when"))
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
                if action.delay is not None:
                    yield from self._terms([("delay", action.delay)], attributes, path)
            elif isinstance(action, Log):
                yield from self._terms([("log", part) for part in action.log], attributes, path)
            elif isinstance(action, Choose):
                scope = self._scope(attributes, action.condition)
                yield from self._condition(action.condition, scope, (*path, "if"))
                yield from self._internal(action.then, attributes, (*path, "then"))
                yield from self._internal(action.otherwise, attributes, (*path, "else"))

    def _assign(self, action: Assign, path: Path) -> Iterator[Finding]:
        for name in action.assign:
            if name not in self._plot.variables:
                error = UnknownNameError(
                    f"there is no variable '{name}'", place=self._plot.place((*path, name)),
                    found=name, valid=self._plot.variables,
                )  # fmt: skip
                yield Finding(error, "declared variable")

    def _external(self, action: ExternalAction, path: Path) -> Iterator[Finding]:
        if isinstance(action, Switch):
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

    def _arguments(
        self, plot: str, parameters: Mapping[str, Parameter], given: set[str], path: Path
    ) -> Iterator[Finding]:
        for name in sorted(given - set(parameters)):
            error: InputError = UnknownNameError(
                f"plot '{plot}' has no parameter '{name}'",
                place=self._plot.place((*path, name)), found=name, valid=parameters,
            )  # fmt: skip
            yield Finding(error, "known parameter")
        for name, parameter in parameters.items():
            if name not in given and parameter.default is None:
                error = InputError(f"plot '{plot}' needs its parameter '{name}'", place=self._plot.place(path))
                yield Finding(error, "parameters are given", f"add `{name}: …` under `with`")

    # -- the language ------------------------------------------------------------------------------------

    def _condition(self, condition: Expression, scope: Types, path: Path) -> Iterator[Finding]:
        asked = asked_states(condition)
        states = {name for name, _, _ in self._plot.walk()} if asked else set()
        for name in asked:
            if name not in states:
                error = UnknownNameError(
                    f"there is no state '{name}'", place=self._plot.place(path), found=name, valid=states
                )
                yield Finding(error, "condition")
        if self._plot.profile == "scxml":
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

    def _terms(
        self, terms: Iterable[tuple[str, Term]], attributes: Types | None, path: Path
    ) -> Iterator[Finding]:
        for key, term in terms:
            yield from self._only({key: term}, self._scope(attributes, term), path)

    def _only(self, terms: Mapping[str, Term], scope: Types, path: Path) -> Iterator[Finding]:
        for key, term in terms.items():
            unknown = sorted(free_variables(term) - set(scope))
            if not unknown and self._schema is not None and self._plot.profile == "dsc":
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
        """Visible variables; where the event cannot be known, any of its attributes may be used."""
        if attributes is not None:
            return {**self._types, **attributes}
        names = mentioned(used) if used is not None else frozenset()
        return {**self._types, **{name: None for name in names if name.startswith("event.")}}

    def _event_types(self, state: State, event: str) -> Types | None:
        """Attribute types of an event as `event.name`; `None` if they are not known."""
        declared = outcomes_of(state, self._library)
        found: Mapping[str, str | None] | None = None
        if event in declared:
            found = declared[event] or {}
        elif event in self._plot.receives:
            found = self._plot.receives[event] or {}
        else:
            found = self._skill_event(state, event)
        if found is None:
            return None
        return {f"event.{name}": self._type(kind) if kind else None for name, kind in found.items()}

    def _skill_event(self, state: AnyState, event: str) -> Mapping[str, str | None] | None:
        if self._skills is None or not isinstance(state, State):
            return None
        for action in state.entry:
            if isinstance(action, Trigger) and action.trigger in self._skills:
                for original, attributes in self._skills[action.trigger].outcomes.items():
                    if action.names.get(original, original) == event:
                        return attributes
        return None

    def _rule_event(self, event: str) -> Types | None:
        """The attributes a rule's event has wherever it can come from, also from steps of a plan."""
        found: dict[str, str | None] = {}
        known = False
        for outcomes in self._sources:
            if event in outcomes:
                known = True
                for name, kind in (outcomes[event] or {}).items():
                    found[f"event.{name}"] = self._type(kind)
        return found if known else None

    def _unknown_event(self, event: str, path: Path) -> Finding:
        valid = {name for _, state, _ in self._plot.walk() for name in outcomes_of(state, self._library)}
        valid |= {name for plot in self._library if plot.implements for name in plot.emits}
        error = UnknownNameError(
            f"no state of this plot can end with '{event}'", place=self._plot.place(path), found=event, valid=valid
        )
        return Finding(error, "rule event")

    def _type(self, name: str) -> str | None:
        if name in {"number", "text", "boolean"}:
            return name
        return name if self._schema is not None and name in self._schema.types else None


def mentioned(part: Expression | Term | Effect) -> frozenset[str]:
    """The variables that a condition, term or effect mentions and does not itself bind."""
    if isinstance(part, Add | Delete):
        return free_variables(part.atom)
    if isinstance(part, AllOf):
        return frozenset().union(*(mentioned(inner) for inner in part.parts))
    if isinstance(part, ForEach):
        return mentioned(part.effect) - {variable.name for variable in part.variables}
    if isinstance(part, When):
        return free_variables(part.condition) | mentioned(part.effect)
    if isinstance(part, Change):
        return free_variables(part.call) | free_variables(part.value)
    return free_variables(part)


def _at(error: InputError, plot: ActionPlot, path: Path) -> InputError:
    """The error at the place of the text it is about; its own place counts inside that text."""
    error.place = plot.place(path) or error.place
    return error

"""Rules and handlers: names exist, and rules read only available values (S1.4, S1.14)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import chain

from dsc.dynamic.library import Library
from dsc.dynamic.steps import Outcomes, Step, answerable, concerns, contents_of, outcomes_of, outputs_of
from dsc.errors import Finding
from dsc.events import DONE, FAILURES
from dsc.model.actions import Trigger
from dsc.model.plot import ActionPlot, Path, PlotParameter, PlotVariable
from dsc.model.rules import ENTER, RESPONSES, RETRY, STEP, Handler, Rule
from dsc.model.states import DynamicState, State
from dsc.skills import SkillSignature
from dsc.validation.nesting import Nesting
from knowledge_base.errors import SchemaError, UnknownNameError

Attributes = Mapping[str, str | None]
"""Names -> declared types; `None` is any type."""
Skills = Mapping[str, SkillSignature] | None
"""The deployed skills by `component.skill`; `None` if unknown."""


def attributes_of(event: str, state: State, plot: ActionPlot, library: Library, skills: Skills) -> Attributes | None:
    """Return the attributes of an event that a state of the plot takes; `None` if they are unknown."""
    declared = outcomes_of(state, library)
    if event in declared:
        return declared[event] or {}
    if event in plot.receives:
        return plot.receives[event] or {}
    if event == DONE:
        return outputs_of(state, library)
    return _of_skill(event, state, skills or {})


def _of_skill(event: str, state: State, skills: Mapping[str, SkillSignature]) -> Attributes | None:
    for action in state.entry:
        if isinstance(action, Trigger) and action.trigger in skills:
            for original, attributes in skills[action.trigger].outcomes.items():
                if action.names.get(original, original) == event:
                    return attributes
    return None


Types = Mapping[str, str | None]


class RuleScope:
    """Names and types that the rules and handlers of one plot can read.

    Args:
        plot, library, skills, nesting: as elsewhere in the validator.
        type_: returns the kind of a declared type.
    """

    def __init__(
        self, plot: ActionPlot, library: Library, skills: Skills, nesting: Nesting, type_: Callable[[str], str | None]
    ) -> None:
        self._plot, self._library, self._skills = plot, library, skills or {}
        self._type = type_
        self._declared = frozenset({*plot.parameters, *plot.variables, *plot.outputs})
        self._steps = {name: state for name, state, _ in nesting.states if isinstance(state, Step)}
        planned = any(isinstance(state, DynamicState) and state.goal is not None for state in self._steps.values())
        self._implementing = [other for other in library if other.implements] if planned else []
        ways = (way for _, _, path in nesting.states for _, _, way in nesting.leaving(path))
        self._fired = {event for way in ways for event in way.emitted if event not in plot.emits}  # those leave it

    def of(self, rule: Rule) -> Types | None:
        """Return names and types; `None` if the rule's event never happens at its states."""
        steps = {**self._own(rule), **self._arguments(rule)}
        if rule.on is None:
            return steps
        sources = [outcomes[rule.on] or {} for outcomes in self._sources(rule) if rule.on in outcomes]
        types = [{name: self._type(kind) for name, kind in one.items()} for one in sources]
        event = {f"event.{name}": _common(name, types) for name in dict.fromkeys(chain.from_iterable(types))}
        return {**event, **steps} if sources else None

    def in_plans(self, rule: Rule) -> bool:
        """Return whether it may answer for steps of plans that are made for goals of this plot."""
        named = [plot for plot in self._implementing if not rule.steps or plot.implements in rule.steps]
        return any(rule.on is None or rule.on in FAILURES or rule.on in plot.emits for plot in named)

    def out_of_reach(self, rule: Rule, read: Iterable[str], path: Path) -> Iterator[Finding]:
        """Yield findings about variables of the plot in a rule that answers for steps of plans."""
        for name in sorted(self._declared.intersection(read) if self.in_plans(rule) else ()):
            error = SchemaError(
                f"'?{name}' is a variable of this plot; a rule that answers for steps of plans cannot read it",
                place=self._plot.place(path), found=f"?{name}",
            )  # fmt: skip
            fix = "a fact says it as well; or name with `of` steps that are states of this plot"
            yield Finding(error, "declared variable", fix)

    def never(self, rule: Rule, path: Path) -> Finding:
        """Return the finding about a rule whose event never happens at its states."""
        valid = {event for outcomes in self._sources(rule) for event in outcomes}
        what = " or ".join(f"'{name}'" for name in rule.of) or "no state of this plot"
        verb = "cannot" if rule.of else "can"
        error = UnknownNameError(
            f"{what} {verb} end with '{rule.on}'", place=self._plot.place((*path, "on")), found=rule.on, valid=valid
        )
        return Finding(error, "rule event")

    def attributes(self, handler: Handler) -> Types | None:
        """Return the attributes of a handler's event; `None` if they are unknown."""
        if handler.on in self._plot.receives:
            declared = self._plot.receives[handler.on] or {}
            return {f"event.{name}": self._type(kind) for name, kind in declared.items()}
        listen = handler.listen
        if listen is None or listen.trigger not in self._skills:
            return None
        outcomes = self._skills[listen.trigger].outcomes
        found = (outcomes[event] for event in outcomes if listen.names.get(event, event) == handler.on)
        attributes = next(found, None)
        return None if attributes is None else {
            f"event.{name}": self._type(kind) if kind else None for name, kind in attributes.items()
        }  # fmt: skip

    def check(self, handler: Handler, path: Path) -> Iterator[Finding]:
        """Yield findings about the source of a handler's event."""
        known = {*self._plot.receives, *self._fired}
        listen = handler.listen
        if listen is None:
            if handler.on not in known:
                error = UnknownNameError(
                    f"nothing here fires the event '{handler.on}'",
                    place=self._plot.place((*path, "on")), found=handler.on, valid=known,
                )  # fmt: skip
                fix = "events from outside are declared under `receives`, those of components come by `listen`"
                yield Finding(error, "known event", fix)
        elif self._skills:
            yield from self._listened(handler, path)

    def _listened(self, handler: Handler, path: Path) -> Iterator[Finding]:
        listen = handler.listen
        assert listen is not None  # noqa: S101  # the caller has checked it
        place = self._plot.place((*path, "listen", "trigger"))
        signature = self._skills.get(listen.trigger)
        if signature is None:
            message = f"no component offers the skill '{listen.trigger}'"
            unknown = UnknownNameError(message, place=place, found=listen.trigger, valid=self._skills)
            yield Finding(unknown, "known skill")
            return
        brought = [listen.names.get(event, event) for event in signature.outcomes]
        if handler.on not in brought:
            message = f"'{listen.trigger}' does not bring the event '{handler.on}'"
            other = UnknownNameError(message, place=place, found=handler.on, valid=brought)
            yield Finding(other, "known event")

    def _own(self, rule: Rule) -> Types:
        """Return the plot's variables, if the rule may read them."""
        if self.in_plans(rule):
            return {}
        plot = self._plot
        declared: dict[str, PlotParameter | PlotVariable] = {**plot.parameters, **plot.variables, **plot.outputs}
        return {name: self._type(declared[name].type) for name in declared}

    def _sources(self, rule: Rule) -> Iterator[Outcomes]:
        for name, state in self._steps.items():
            if concerns(rule, name, state, self._library):
                yield answerable(state, self._library)
        for plot in self._implementing:
            if not rule.of or plot.implements in rule.of:
                yield plot.emits

    def _arguments(self, rule: Rule) -> Types:
        """Return the arguments that all steps named by the rule share."""
        given = list(self._given(rule))
        common = [name for name in given[0] if all(name in one for one in given)] if given else []
        return {STEP + name: _common(name, given) for name in common}

    def _given(self, rule: Rule) -> Iterator[dict[str, str | None]]:
        if not rule.steps:
            return
        for name, state in self._steps.items():
            if concerns(rule, name, state, self._library):
                types = {n: p.type for plot in contents_of(state, self._library) for n, p in plot.parameters.items()}
                yield {n: self._type(types[n]) if n in types else None for n in state.arguments}
        for plot in self._implementing:
            if plot.implements in rule.steps:
                yield {name: self._type(one.type) for name, one in plot.parameters.items()}


def _common(name: str, sources: Iterable[Types]) -> str | None:
    """Return the type of a name in all its sources; `None` if they differ."""
    types = {one[name] for one in sources if name in one}
    return types.pop() if len(types) == 1 else None


def check_rules(plot: ActionPlot, library: Library, nesting: Nesting) -> Iterator[Finding]:
    """Yield findings about names in rules and handlers."""
    if plot.handlers and plot.dialect != "dsc":
        error = SchemaError("handlers are for plots of dialect dsc", place=plot.place(("handlers",)))
        yield Finding(error, "dialect", "write what they do as transitions")
    names = set(nesting.names)
    steps = names | {other.implements for other in library if other.implements}
    for number, rule in enumerate(plot.rules):
        path: Path = ("rules", number)
        yield from _used(plot, rule.do.use, path, library)
        if not (plot.generated and rule.outcome in plot.emits):  # else the state is in the plot that holds the goal
            yield from _response(plot, rule, path, names)
        key = "of" if rule.on is not None else rule.place
        for position, name in enumerate(rule.steps):
            if name not in steps:
                yield _no_step(plot, name, (*path, key, position), library, steps)
    for number, handler in enumerate(plot.handlers):
        path = ("handlers", number)
        yield from _used(plot, handler.do.use, path, library)
        if handler.interrupt and not handler.do.acts:
            error = SchemaError("a handler that only tells something interrupts nothing", place=plot.place(path))
            yield Finding(error, "handler", "leave `interrupt` out, or say what to `use`")


def _no_step(plot: ActionPlot, name: str, path: Path, library: Library, steps: set[str]) -> Finding:
    """Return the finding about a missing step; if it names a plot, list the names by which rules refer to it."""
    place = plot.place(path)
    if name not in library:
        message = f"there is no state '{name}', nor a plot that implements an action of that name"
        return Finding(UnknownNameError(message, place=place, found=name, valid=steps), "rule")
    states = ((own, state) for own, state, _ in plot.walk() if isinstance(state, Step))
    holding = [own for own, state in states if name in {used.name for used in contents_of(state, library)}]
    action = library.plot(name).implements
    names = [*(f"state '{own}'" for own in holding), *([f"planning action '{action}'"] if action else [])]
    spoken = f", here {' or '.join(names)}" if names else ", and no state here holds it"
    message = f"'{name}' is a plot; a rule names steps by their state or planning action{spoken}"
    return Finding(SchemaError(message, place=place, found=name), "rule")


def _response(plot: ActionPlot, rule: Rule, path: Path, names: set[str]) -> Iterator[Finding]:
    valid = names.union(RESPONSES[rule.place])
    if rule.then not in valid:
        where = "" if rule.on is not None else f" {rule.place} a step"
        error = UnknownNameError(
            f"a rule cannot '{rule.then}'{where}", place=plot.place((*path, "do", "then")), found=rule.then, valid=valid
        )
        yield Finding(error, "rule response")
    elif rule.do.passed and rule.then not in names | {RETRY, ENTER}:
        message = f"arguments are passed by a rule whose response is '{rule.then}'"
        wrong = SchemaError(message, place=plot.place((*path, "do", "pass")))
        yield Finding(wrong, "arguments are taken", "pass them with `retry`, or to a state")


def _used(plot: ActionPlot, name: str | None, path: Path, library: Library) -> Iterator[Finding]:
    if name is not None and name not in library:
        yield unknown_plot(plot, (*path, "do", "use"), name, library)


def unknown_plot(plot: ActionPlot, path: Path, name: str, library: Library) -> Finding:
    """Return the finding about a missing plot."""
    valid = {other.name for other in library}
    error = UnknownNameError(f"there is no plot '{name}'", place=plot.place(path), found=name, valid=valid)
    return Finding(error, "known plot")

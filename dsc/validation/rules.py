"""Checks of rules and handlers: names exist, and rules read only available values (S1.4, S1.14)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain

from dsc.dynamic.steps import (
    COMPONENT_EVENTS,
    Outcomes,
    answerable,
    answers_in_plans,
    concerns,
    contents_of,
    outcomes_of,
    outputs_of,
)
from dsc.errors import Finding
from dsc.events import CYCLE, DONE
from dsc.model.actions import Trigger
from dsc.model.plot import Path
from dsc.model.rules import ENTER, RESPONSES, RESUME, RETRY, STEP, Handler, Response, Rule
from dsc.model.states import State
from dsc.validation.subject import Subject, Types


def check_rules(subject: Subject) -> Iterator[Finding]:
    """Yield findings about unknown names in rules and handlers."""
    plot = subject.plot
    if plot.handlers and not subject.strict:
        message = "handlers are for plots of dialect dsc"
        yield subject.finding(("handlers",), "dialect", message, "write what they do as transitions")
    for path, do in subject.reactions():
        if do.use is not None and do.use not in subject.library:
            yield subject.unknown_plot((*path, "use"), do.use)
    steps = subject.names.keys() | {other.implements for other in subject.library if other.implements}
    for number, rule in enumerate(plot.rules):
        yield from _rule(subject, rule, ("rules", number), steps)
    for number, handler in enumerate(plot.handlers):
        yield from _handler(subject, handler, ("handlers", number))


def _rule(subject: Subject, rule: Rule, path: Path, steps: set[str]) -> Iterator[Finding]:
    plot = subject.plot
    places: list[Path] = [("then",), *(("on", event) for event in rule.do.on)]
    for place, one in zip(places, rule.continuations, strict=True):
        if not (plot.generated and one.outcome in plot.emits):  # otherwise the plot with the goal contains the state
            yield from _response(subject, one, (*path, "do"), place)
    key = "of" if rule.on is not None else rule.place
    for position, name in enumerate(rule.steps):
        if name not in steps:
            yield _no_step(subject, name, (*path, key, position), steps)


def _handler(subject: Subject, handler: Handler, path: Path) -> Iterator[Finding]:
    if handler.interrupt and not handler.do.acts:
        message = "a handler that only tells something interrupts nothing"
        yield subject.finding(path, "handlers", message, "remove `interrupt`, or name a plot to `use`")
    valid = {RESUME, *subject.plot.states}
    for outcome, then in handler.do.on.items():
        if then not in valid:
            message = f"a handler cannot '{then}' after its plot"
            yield subject.finding((*path, "do", "on", outcome), "rule-response", message, found=then, valid=valid)


def _no_step(subject: Subject, name: str, path: Path, steps: set[str]) -> Finding:
    """Return the finding about a missing step; for the name of a plot, it lists the valid names of the plot's steps."""
    if name not in subject.library:
        message = f"there is no state '{name}', nor a plot that implements an action of that name"
        return subject.finding(path, "rule", message, found=name, valid=steps)
    plot = subject.library.plot(name)
    holding = (own for own, state, _ in subject.steps if plot in contents_of(state, subject.library))
    names = [f"state '{own}'" for own in holding]
    if plot.implements:
        names.append(f"planning action '{plot.implements}'")
    spoken = f", here {' or '.join(names)}" if names else ", and no state here holds it"
    message = f"'{name}' is a plot; a rule names steps by their state or planning action{spoken}"
    return subject.finding(path, "rule", message, found=name)


def _response(subject: Subject, rule: Rule, path: Path, key: Path) -> Iterator[Finding]:
    valid = subject.names.keys() | set(RESPONSES[rule.place])
    if rule.then not in valid:
        where = "" if rule.on is not None else f" {rule.place} a step"
        message = f"a rule cannot '{rule.then}'{where}"
        yield subject.finding((*path, *key), "rule-response", message, found=rule.then, valid=valid)
    elif rule.do.passed and rule.then not in subject.names.keys() | {RETRY, ENTER}:
        message = f"arguments are passed by a rule whose response is '{rule.then}'"
        fix = "pass them with `retry`, or to a state"
        yield subject.finding((*path, "pass"), "arguments-are-taken", message, fix)


# -- names that transitions, rules and handlers can read -----------------------------------------------------


def attributes_of(subject: Subject, event: str, state: State) -> Types | None:
    """Return the types of the attributes of an event at a state; `None` if the attributes are unknown."""
    declared = outcomes_of(state, subject.library)
    if event in declared:
        return declared[event] or {}
    if event == CYCLE and subject.plot.robot is not None:
        return {}  # the sensors are read as variables
    if event in subject.plot.receives:
        return subject.plot.receives[event] or {}
    if event in COMPONENT_EVENTS:
        return COMPONENT_EVENTS[event] or {}
    if event == DONE:
        return outputs_of(state, subject.library)
    triggers = (action for action in state.entry if isinstance(action, Trigger))
    return next((found for one in triggers if (found := _brought_by(subject, one, event)) is not None), None)


def _brought_by(subject: Subject, trigger: Trigger, event: str) -> Types | None:
    """Return the types of the attributes of a skill's event; `None` if the event or skill is unknown."""
    signature = (subject.skills or {}).get(trigger.trigger)
    outcomes = {} if signature is None else signature.outcomes
    return next((outcomes[one] for one in outcomes if trigger.names.get(one, one) == event), None)


def read_as(prefix: str, types: Types) -> Types:
    """Return the types by the names that terms read: `prefix` precedes each name."""
    return {prefix + name: kind for name, kind in types.items()}


class RuleScope:
    """Names, with declared types, that the rules and handlers of one plot can read."""

    def __init__(self, subject: Subject) -> None:
        self._subject, self._library, plot = subject, subject.library, subject.plot
        self._implementing = [one for one in self._library if one.implements] if subject.planned else []
        # A declared outcome is an event for the host state, not for this plot.
        self._fired = {event for _, _, way in subject.ways() for event in way.emitted if event not in plot.emits}

    def of(self, rule: Rule) -> Types | None:
        """Return the types of the names that a rule can read; `None` if its event never occurs at its states."""
        names = {**({} if self._in_plans(rule) else self._subject.types), **self._arguments(rule)}
        if rule.on is None:
            return names
        sources = [outcomes[rule.on] or {} for outcomes in self._sources(rule) if rule.on in outcomes]
        event = {name: _common(name, sources) for name in chain.from_iterable(sources)}
        return {**read_as("event.", event), **names} if sources else None

    def out_of_reach(self, rule: Rule, read: Iterable[str], path: Path) -> Iterator[Finding]:
        """Yield findings about variables that a rule reads although it applies to steps of plans, other plots."""
        for name in sorted(self._subject.types.keys() & set(read) if self._in_plans(rule) else ()):
            message = f"'?{name}' is a variable of this plot; a rule that answers for steps of plans cannot read it"
            fix = "read a fact instead; or name with `of` steps that are states of this plot"
            yield self._subject.finding(path, "declared-variable", message, fix, found=f"?{name}")

    def never(self, rule: Rule, path: Path) -> Finding:
        """Return the finding about a rule whose event never occurs at its states."""
        what = " or ".join(f"'{name}'" for name in rule.of) or "no state of this plot"
        message = f"{what} {'cannot' if rule.of else 'can'} end with '{rule.on}'"
        valid = set(chain.from_iterable(self._sources(rule)))
        return self._subject.finding((*path, "on"), "rule-event", message, found=rule.on, valid=valid)

    def attributes(self, handler: Handler) -> Types | None:
        """Return the types of the attributes of a handler's event; `None` if the attributes are unknown."""
        if handler.on in self._subject.plot.receives:
            return read_as("event.", self._subject.plot.receives[handler.on] or {})
        listen = handler.listen
        if listen is None and handler.on in COMPONENT_EVENTS:
            return read_as("event.", COMPONENT_EVENTS[handler.on] or {})
        brought = None if listen is None else _brought_by(self._subject, listen, handler.on)
        return None if brought is None else read_as("event.", brought)

    def check(self, handler: Handler, path: Path) -> Iterator[Finding]:
        """Yield findings about the source of a handler's event."""
        known, skills, listen = {*self._subject.plot.receives, *self._fired}, self._subject.skills, handler.listen
        if listen is None:
            if handler.on not in known and handler.on not in COMPONENT_EVENTS:
                asked = Rule(on=handler.on, do=Response())
                if any(handler.on in outcomes for outcomes in self._sources(asked)):
                    message = f"a handler answers no outcome of a step, as '{handler.on}' is"
                    fix = "answer it by a rule, under `rules`"
                    yield self._subject.finding((*path, "on"), "known-event", message, fix, found=handler.on)
                    return
                message = f"nothing here fires the event '{handler.on}'"
                fix = "events from outside are declared under `receives`, those of components come by `listen`"
                yield self._subject.finding((*path, "on"), "known-event", message, fix, found=handler.on, valid=known)
        elif skills and listen.trigger not in skills:
            yield unknown_skill(self._subject, (*path, "listen", "trigger"), listen)
        elif skills:
            brought = [listen.names.get(event, event) for event in skills[listen.trigger].outcomes]
            if handler.on not in brought:
                message = f"'{listen.trigger}' does not bring the event '{handler.on}'"
                here = (*path, "listen", "trigger")
                yield self._subject.finding(here, "known-event", message, found=handler.on, valid=brought)

    def _in_plans(self, rule: Rule) -> bool:
        """Return whether a rule may apply to steps of plans for this plot's goals."""
        return self._subject.planned and answers_in_plans(rule, self._library)

    def _sources(self, rule: Rule) -> Iterator[Outcomes]:
        for name, state, _ in self._subject.steps:
            if concerns(rule, name, state, self._library):
                yield answerable(state, self._library)
        yield from (plot.emits for plot in self._implementing if not rule.of or plot.implements in rule.of)

    def _arguments(self, rule: Rule) -> Types:
        """Return the types of the arguments that all steps of a rule have in common."""
        given = list(self._find_given(rule)) if rule.steps else []
        common = [name for name in given[0] if all(name in one for one in given)] if given else []
        return {STEP + name: _common(name, given) for name in common}

    def _find_given(self, rule: Rule) -> Iterator[Types]:
        for name, state, _ in self._subject.steps:
            if concerns(rule, name, state, self._library):
                contents = contents_of(state, self._library)
                types = {name: one.type for plot in contents for name, one in plot.parameters.items()}
                yield {name: types.get(name) for name in state.arguments}
        for plot in self._implementing:
            if plot.implements in rule.steps:
                yield {name: one.type for name, one in plot.parameters.items()}


def unknown_skill(subject: Subject, path: Path, trigger: Trigger) -> Finding:
    """Return the finding about a trigger whose component or skill is missing."""
    message, found = f"no component offers the skill or event '{trigger.trigger}'", trigger.trigger
    component, _, method = found.partition(".")
    interface = subject.interfaces.get(component)
    if interface is not None and (fix := interface.remedy("skill", component, method)):
        return subject.finding(path, "known-skill", message, fix, found=found)
    return subject.finding(path, "known-skill", message, found=found, valid=subject.skills or ())


def _common(name: str, sources: Iterable[Types]) -> str | None:
    """Return the type of a name if all its sources declare an equal type; else `None`."""
    types = {one[name] for one in sources if name in one}
    return types.pop() if len(types) == 1 else None

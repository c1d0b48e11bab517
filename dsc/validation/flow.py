"""Checks of events: each outcome has a transition, and each event of a transition or action is known."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from collections.abc import Set as AbstractSet
from dataclasses import dataclass

from dsc.dynamic.responses import limit_of
from dsc.dynamic.steps import Step, answerable, answers_in_plans, concerns, is_open, is_planned, outcomes_of
from dsc.errors import Finding
from dsc.events import DONE, EXECUTIVES, NO_CANDIDATE, RESERVED, SKILL_FAILURES, TIMERS
from dsc.model.actions import Trigger
from dsc.model.plot import ActionPlot, Path
from dsc.model.rules import GIVE_UP, RESUME, Rule
from dsc.model.states import AnyState, FinalState, State
from dsc.model.transitions import Connector
from dsc.validation.reach import check_completion, circle_of
from dsc.validation.rules import unknown_skill
from dsc.validation.subject import Skills, Subject
from knowledge_base.errors import InputError


def check_wiring(subject: Subject) -> Iterator[Finding]:
    """Yield findings about outcomes without a transition, unknown events and targets of rules."""
    try:
        expanded = subject.library.expanded(subject.plot)
    except InputError as error:
        yield Finding(error, "rules")
        return
    wired = {name: state for name, state, _ in expanded.walk()}
    traffic = _traffic(subject)
    emits, receives = subject.plot.emits, subject.plot.receives
    yield from (_report_reserved(subject, event, ("emits", event)) for event in emits if event in EXECUTIVES)
    yield from (_report_reserved(subject, event, ("receives", event)) for event in receives if event in RESERVED)
    yield from _rule_targets(subject)
    yield from _cyclic_omissions(subject, expanded)
    yield from _outcomes_of_reactions(subject)
    for name, state, path in subject.states:
        if isinstance(state, FinalState):
            yield from _final(subject, state, path)
        if subject.strict:
            yield from _emissions(subject, path, traffic)
        if not isinstance(state, State):
            continue
        outcomes = outcomes_of(state, subject.library)
        if outcomes or state.entry:  # otherwise the state has no outcome that needs a transition
            handled = _find_handled([wired[name], *subject.around(path)])
            yield from _outcomes(subject, name, outcomes, handled, path)
            yield from _skills(subject, name, state, path, handled, traffic)
        if subject.strict:  # SCXML allows events without a transition or without a source
            yield from _known_events(subject, state, path, traffic)
    if subject.strict:
        yield from check_completion(subject, wired)


def _report_reserved(subject: Subject, event: str, path: Path) -> Finding:
    message = f"the event '{event}' is fired by the executive itself"
    return subject.finding(path, "reserved-event", message, "give yours another name", found=event)


def _rule_targets(subject: Subject) -> Iterator[Finding]:
    """Yield findings about rules whose target is not in the scope of a state to which the rule applies."""
    library, plot = subject.library, subject.plot
    rules = [] if plot.generated else plot.rules
    leading = [(n, one) for n, rule in enumerate(rules) for one in rule.continuations if one.leads_away]
    for scope in plot.scopes() if leading else ():
        steps = [(name, state) for name, state in scope.states.items() if isinstance(state, Step)]
        for number, rule in leading:
            for name, state in steps if rule.then not in scope.states else ():
                answers = rule.on is None or rule.on in answerable(state, library)
                here = answers and concerns(rule, name, state, library)
                if here or (is_planned(state) and answers_in_plans(rule, library)):
                    where = f"{'' if here else 'a plan at '}'{name}'"
                    yield subject.finding(
                        ("rules", number, "do", "then"), "no-border-crossing",
                        f"the rule's way from {where} to '{rule.then}' crosses a border",
                        "name the states of the rule with `of`", found=rule.then, valid=scope.states,
                    )  # fmt: skip


def _outcomes_of_reactions(subject: Subject) -> Iterator[Finding]:
    """Yield findings about unknown and unhandled outcomes of the plots that rules and handlers use.

    In a plan, an unhandled outcome causes a new plan, so a rule only for steps of plans may omit it.
    """
    for path, do in subject.reactions():
        if do.use is None or do.use not in subject.library:
            continue
        outcomes = subject.library.plot(do.use).emits
        valid = {*outcomes, *SKILL_FAILURES}
        for event in do.on.keys() - valid:
            message = f"plot '{do.use}' has no outcome '{event}'"
            yield subject.finding((*path, "on", event), "known-outcome", message, found=event, valid=valid)
        if path[0] == "rules" and not _answers_here(subject, subject.plot.rules[int(path[1])]):
            continue
        for event in outcomes.keys() - do.on.keys():
            message = f"nothing handles the outcome '{event}' of plot '{do.use}'"
            then = RESUME if path[0] == "handlers" else GIVE_UP
            fix = f"add `on: {{{event}: {then}}}` here, or the name of a state instead of `{then}`"
            yield subject.finding((*path, "use"), "every-outcome-is-wired", message, fix)


def _answers_here(subject: Subject, rule: Rule) -> bool:
    """Return whether a rule may respond to a state that the plot's author wrote."""
    if subject.plot.generated:
        return False
    here = (state for name, state, _ in subject.steps if concerns(rule, name, state, subject.library))
    return any(rule.on is None or rule.on in answerable(state, subject.library) for state in here)


def _cyclic_omissions(subject: Subject, expanded: ActionPlot) -> Iterator[Finding]:
    """Yield a finding about a cycle of steps if rules may skip every step of the cycle."""
    if not any(rule.before for rule in subject.plot.rules):
        return
    connectors = ((name, state) for name, state, _ in expanded.walk() if isinstance(state, Connector))
    if circle_of({name: [way.target or "" for _, way in state.transitions()] for name, state in connectors}):
        message = "these rules may skip all steps of a cycle without end"
        fix = "let `then` lead to a state where a run can rest"
        yield subject.finding(("rules",), "connectors-lead-on", message, fix)


def _find_handled(states: Iterable[AnyState]) -> dict[str, bool]:
    """Return for each event whether one of its transitions has no guard, so that the event is always handled."""
    found: dict[str, bool] = {}
    for state in states:
        if isinstance(state, State):
            for event, transitions in state.on.items():
                found[event] = found.get(event, False) or any(not t.has_guard for t in transitions)
    return found


def _outcomes(
    subject: Subject, name: str, outcomes: Iterable[str], handled: Mapping[str, bool], path: Path, other: str = "a rule"
) -> Iterator[Finding]:
    for event in outcomes:
        if handled.get(event):
            continue
        if event in handled:
            why, fix = _not_always(subject.plot, event)
            message = f"state '{name}' may not handle its outcome '{event}': {why}"
        else:
            sources = subject.contents(name) if is_open(subject.state(name), subject.library) else []
            whose = "".join(f" of plot '{one.name}'" for one in sources if event in one.emits)
            message = f"state '{name}' does not handle its outcome '{event}'{whose}"
            fix = f"add `{event}: STATE` under `on`, or {other}"
        yield subject.finding((*path, "on", event), "every-outcome-is-wired", message, fix)


def _not_always(plot: ActionPlot, event: str) -> tuple[str, str]:
    """Return the reason why a handled outcome is not always handled, with a remedy."""
    answers = [rule for rule in plot.rules if rule.on == event and rule.when is None and limit_of(rule) is not None]
    if not answers:
        return "every transition has a guard", "add a last transition or rule without `when`"
    often, then = limit_of(answers[-1]), answers[-1].then
    return f"the rule that answers it with '{then}' does so {often} times", f"add a last rule that does not '{then}'"


def _skills(
    subject: Subject, name: str, state: State, path: Path, handled: Mapping[str, bool], traffic: _Traffic
) -> Iterator[Finding]:
    for position, action in enumerate(state.entry) if subject.skills is not None else ():
        if not isinstance(action, Trigger):
            continue
        here = (*path, "entry", position)
        if action.trigger not in (subject.skills or ()):
            yield unknown_skill(subject, (*here, "trigger"), action)
            continue
        outcomes = (subject.skills or {})[action.trigger].outcomes
        for renamed in action.names:
            if renamed not in outcomes:
                message = f"skill '{action.trigger}' has no outcome '{renamed}'"
                yield subject.finding((*here, "as", renamed), "known-outcome", message, found=renamed, valid=outcomes)
        events = [action.names.get(event, event) for event in outcomes]
        yield from (_report_reserved(subject, event, (*here, "trigger")) for event in events if event in EXECUTIVES)
        is_event = (subject.skills or {})[action.trigger].pattern == "event"
        if is_event:
            yield from _visible_outside(subject, action, here)
            elsewhere = traffic.received_in(path).union(subject.plot.emits)
            events = [event for event in events if event not in elsewhere]
        remaining = [event for event in events if event not in EXECUTIVES]
        other = "`{}` instead of STATE to ignore it" if is_event else "a rule"
        yield from _outcomes(subject, name, remaining, handled, path, other)


def _visible_outside(subject: Subject, action: Trigger, path: Path) -> Iterator[Finding]:
    """Yield findings about the attributes of a component event that the plot declares under `emits` (S0.6)."""
    for event, attributes in (subject.skills or {})[action.trigger].outcomes.items():
        name = action.names.get(event, event)
        if name in subject.plot.emits:
            yield from _attributes(subject, name, set(attributes), (*path, "trigger"))


@dataclass(frozen=True, slots=True)
class _Traffic:
    """The events of a plot.

    Attributes:
        anywhere: events that every state may receive.
        inside: events of a state's content, its skills and its inner states, by the state's path.
        heard: events for which the plot has a transition.
        received_at: events for which the state at a path has a transition.
        activated: component events by the path of the state that activates them; states inside see them, too.
    """

    anywhere: AbstractSet[str]
    inside: Mapping[Path, AbstractSet[str]]
    heard: AbstractSet[str]
    received_at: Mapping[Path, AbstractSet[str]]
    activated: Mapping[Path, AbstractSet[str]]

    def received_in(self, path: Path) -> set[str]:
        """Return the events for which a state inside the state at `path` has a transition."""
        return {event for at, events in self.received_at.items() if at[: len(path)] == path != at for event in events}

    def activated_around(self, path: Path) -> set[str]:
        """Return the component events of the states around the state at `path`."""
        return {event for at, events in self.activated.items() if path[: len(at)] == at != path for event in events}


def _traffic(subject: Subject) -> _Traffic:
    anywhere = {*(RESERVED - TIMERS), *subject.plot.all_receives}
    # A transition that fires its own event needs another source of it.
    anywhere.update(event for _, trigger, way in subject.ways() for event in way.emitted if event != trigger)
    inside: defaultdict[Path, set[str]] = defaultdict(set)
    heard: set[str] = {handler.on for handler in subject.plot.handlers}
    received_at: dict[Path, AbstractSet[str]] = {}
    activated: dict[Path, AbstractSet[str]] = {}
    for _, state, path in subject.states:
        if isinstance(state, State):
            heard.update(state.on)
            received_at[path] = state.on.keys()
            if events := skill_events(state, subject.skills, "event"):
                activated[path] = events
            if ends := {*outcomes_of(state, subject.library), *skill_events(state, subject.skills)}:
                for place in subject.way_to(path):
                    inside[place] |= ends
    return _Traffic(anywhere, inside, heard, received_at, activated)


def skill_events(state: State, skills: Skills, pattern: str | None = None) -> set[str]:
    """Return the events of the skills that a state triggers, or only of those with a pattern."""
    triggers = [one for one in state.entry if isinstance(one, Trigger) and one.trigger in (skills or ())]
    return {
        t.names.get(event, event)
        for t in triggers
        if pattern in {None, (skills or {})[t.trigger].pattern}
        for event in (skills or {})[t.trigger].outcomes
    }


def _known_events(subject: Subject, state: State, path: Path, traffic: _Traffic) -> Iterator[Finding]:
    if is_open(state, subject.library):  # its plot is known later, and may fire the event
        return
    if subject.skills is None and any(isinstance(a, Trigger) for a in state.entry):
        return
    inside = traffic.inside.get(path, frozenset()) | traffic.activated_around(path)
    for event in state.on:
        if event not in traffic.anywhere and event not in inside:
            valid = (traffic.anywhere | inside) - RESERVED | {DONE}
            fix = "events from outside are declared under `receives`"
            message = f"nothing here fires the event '{event}'"
            yield subject.finding((*path, "on", event), "known-event", message, fix, found=event, valid=valid)


def _emissions(subject: Subject, path: Path, traffic: _Traffic) -> Iterator[Finding]:
    emits = subject.plot.emits
    for way, _, transition in subject.leaving(path):
        for fired in transition.emitted:
            here = (*way, "emit")
            if fired in RESERVED and fired not in emits:
                yield _report_reserved(subject, fired, here)
            elif fired not in emits and fired not in traffic.heard:
                message = f"the plot does not declare the outcome '{fired}', and no state listens to it"
                valid = set(emits) | traffic.heard - {DONE, NO_CANDIDATE}
                fix = "declare it under `emits`"
                yield subject.finding(here, "declared-outcome", message, fix, found=fired, valid=valid)
            elif fired in emits and fired == transition.emit:
                yield from _attributes(subject, fired, set(transition.arguments), here)


def _final(subject: Subject, state: FinalState, path: Path) -> Iterator[Finding]:
    fired, emits, here = state.emit, subject.plot.emits, (*path, "emit")
    if fired is not None and fired not in emits:
        message, fix = f"the plot does not declare the outcome '{fired}'", "declare it under `emits`"
        yield subject.finding(here, "declared-outcome", message, fix, found=fired, valid=emits)
    elif fired is not None:
        yield from _attributes(subject, fired, set(state.arguments), here)


def _attributes(subject: Subject, event: str, given: set[str], path: Path) -> Iterator[Finding]:
    declared = set(subject.plot.emits[event] or ())
    for name in sorted(given ^ declared):
        message = f"attribute '{name}' of the outcome '{event}' "
        if name in declared:
            yield subject.finding(path, "outcome-attributes", message + "is missing", found=name)
        else:
            yield subject.finding(path, "outcome-attributes", message + "is not declared", found=name, valid=declared)

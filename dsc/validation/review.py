"""What is allowed and hardly meant: what can never happen, and candidates that overlap or leave gaps.

Every warning is certain about the form of the conditions, whatever the world is like; see
`knowledge_base.language.contradiction`. Where that cannot decide, nothing is said.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain, groupby, islice

from dsc.dynamic.library import Library
from dsc.dynamic.outcomes import answerable
from dsc.dynamic.steps import Step, concerns
from dsc.errors import Finding
from dsc.model.connectors import Connector
from dsc.model.plot import ActionPlot, Path
from dsc.model.rules import CONTINUE, ENTER, REPLAN, RETRY, Handler, Rule
from dsc.model.states import CompositeState, DynamicState, State
from dsc.validation.candidates import review_candidates
from dsc.validation.library import MAX_FINDINGS
from dsc.validation.nesting import Nesting
from knowledge_base.errors import SchemaError
from knowledge_base.language.contradiction import contradictory
from knowledge_base.language.expression import TRUE, Expression, Not

MOST = 32
"""Conditions looked at together; what comes after more than that is only looked at alone."""


def review_plot(plot: ActionPlot, library: Library) -> list[Finding]:
    """Warnings about a plot that `validate_plot` finds nothing wrong with, at most `MAX_FINDINGS`."""
    if plot.profile != "dsc":
        return []
    nesting = Nesting(plot)
    checks = [
        _rules(plot, library, nesting), _handlers(plot, nesting), _transitions(plot, nesting),
        review_candidates(plot, library, nesting),
    ]  # fmt: skip
    return list(islice(chain.from_iterable(checks), MAX_FINDINGS))


def _rules(plot: ActionPlot, library: Library, nesting: Nesting) -> Iterator[Finding]:
    steps = {name: state for name, state, _ in nesting.states if isinstance(state, Step)}
    planned = any(isinstance(state, DynamicState) and state.goal is not None for state in steps.values())
    for number, rule in enumerate(plot.rules):
        earlier = [one for one in plot.rules[:number] if _comes_before(one, rule)]
        why = _never(rule.when, [one.when for one in earlier])
        if why is None and rule.on is not None and not planned and _settled(rule, rule.on, steps, library):
            why = f"every state that can end with '{rule.on}' answers it itself"
        if why is not None:
            why += _listed(earlier)
            yield _warning(plot, ("rules", number), f"the rule '{rule.label}' can never answer: {why}", "rules")


def _handlers(plot: ActionPlot, nesting: Nesting) -> Iterator[Finding]:
    """Those that interrupt, and those beside what goes on, have nothing to do with each other."""
    for number, handler in enumerate(plot.handlers):
        same = (one for one in plot.handlers[:number] if one.on == handler.on)
        earlier = [one for one in same if one.interrupt == handler.interrupt]
        why = _never(handler.when, [one.when for one in earlier])
        if why is None and handler.interrupt and handler.listen is None and _all_answer(handler.on, nesting):
            why = f"every state answers '{handler.on}' itself"
        if why is not None:
            message = f"the '{handler.label}' can never answer: {why}{_listed(earlier)}"
            yield _warning(plot, ("handlers", number), message, "handlers")


def _all_answer(event: str, nesting: Nesting) -> bool:
    """Whether each state that would be interrupted takes the event, whatever its conditions say."""
    resting = [state for _, state, _ in nesting.states if isinstance(state, State)]
    own = [state for state in resting if not isinstance(state, CompositeState)]
    return all(any(way.guard is None for way in state.on.get(event, ())) for state in own)


def _listed(earlier: Sequence[Rule] | Sequence[Handler]) -> str:
    return "; before it: " + ", ".join(f"'{one.label}'" for one in earlier) if earlier else ""


def _comes_before(earlier: Rule, later: Rule) -> bool:
    """Whether the later one is not asked any more where the earlier one has answered, however often that was."""
    if (earlier.place, earlier.on) != (later.place, later.on):
        return False
    if earlier.steps and not (later.steps and set(later.steps) <= set(earlier.steps)):
        return False
    bounded = earlier.do.limit is not None or earlier.then in {RETRY, REPLAN}
    goes_on = (earlier.place, earlier.then) in {("before", ENTER), ("after", CONTINUE)}
    return not (bounded or goes_on)


def _settled(rule: Rule, event: str, steps: dict[str, Step], library: Library) -> bool:
    """Whether the states that a rule is for need no rule for its event."""
    mine = [state for name, state in steps.items() if concerns(rule, name, state, library)]
    able = [state for state in mine if event in answerable(state, library)]
    return bool(able) and all(any(way.guard is None for way in state.on.get(event, ())) for state in able)


def _transitions(plot: ActionPlot, nesting: Nesting) -> Iterator[Finding]:
    for name, state, path in nesting.states:
        if not isinstance(state, State | Connector):
            continue
        ways = [one for one in nesting.leaving(path) if one[0][0] in {"on", "always", "choice"}]
        for (key, trigger), group in groupby(ways, key=lambda one: (one[0][0], one[1])):
            guards: list[Expression | None] = []
            for inside, _, way in group:
                why = _never(way.guard, guards)
                if why is not None:
                    which = f"transition on '{trigger}'" if key == "on" else "transition"
                    message = f"this {which} out of '{name}' is never taken: {why}"
                    yield _warning(plot, (*path, *inside), message, "transitions")
                guards.append(way.guard)


def _never(condition: Expression | None, earlier: Sequence[Expression | None]) -> str | None:
    """Why something never happens that needs this condition and comes after others with theirs."""
    if condition is not None and contradictory(condition):
        return "its condition cannot hold"
    others = [Not(one or TRUE) for one in earlier]
    if None in earlier or (0 < len(others) <= MOST and contradictory(condition or TRUE, *others)):
        return "whenever its condition holds, one before it does"
    return None


def _warning(plot: ActionPlot, path: Path, message: str, rule: str) -> Finding:
    error = SchemaError(message, place=plot.place(path))
    return Finding(error, rule, "leave it out, or say when it is meant", "warning")

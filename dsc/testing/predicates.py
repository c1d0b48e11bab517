"""Predicates over a step, or over all steps of a run, for use in `assert`.

A state is identified by its name or by its path from the outermost plot, e.g. `clear/execute/step_2`. A `Rehearsal` or
`DryRun` has its library. Predicates over such a run raise `UnknownNameError` for a state, trigger, rule or skill of no
plot, because the predicate could never be true.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Protocol

from dsc.engine.steps import Microstep, SetParameter, Start, Step, SwitchMode
from dsc.engine.taken import Taken
from dsc.events import AFTER, EVERY
from dsc.model.actions import Trigger, flat
from dsc.model.plot import ActionPlot
from dsc.model.states import AnyState, State
from dsc.model.transitions import TransitionSource
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.facts import Fact
from knowledge_base.language.syntax.effect import Add, AllOf, Delete, Effect, NumericEffect
from knowledge_base.language.syntax.expression import Atom, Call, Constant
from knowledge_base.language.syntax.text import parse_effect


class HasSteps(Protocol):
    """A run with its steps and its plots, e.g. a `Rehearsal` or a `DryRun`."""

    @property
    def library(self) -> Iterable[ActionPlot]:
        """All plots that the run may have used."""
        ...

    @property
    def steps(self) -> Sequence[Step]:
        """All steps, in order."""
        ...


Run = Step | Iterable[Step] | HasSteps
"""Subject of a predicate: one step, several steps, or an object with steps."""


def entered(run: Run, state: str) -> bool:
    """Return whether the state was entered."""
    _check(run, state)
    return any(step.entered(state) for step in _steps(run))


def exited(run: Run, state: str) -> bool:
    """Return whether the state was exited."""
    _check(run, state)
    return any(step.exited(state) for step in _steps(run))


def trail(run: Run) -> tuple[str, ...]:
    """Return the paths of all entered states, in order."""
    return tuple(path for micro in _microsteps(run) for path in micro.entered)


def took(
    run: Run,
    source: str | None = None,
    trigger: str | None = None,
    target: str | None = None,
    *,
    rule: str | None = None,
) -> bool:
    """Return whether a transition was taken; `None` matches any value.

    Args:
        run: the steps.
        source: the transition's source state.
        trigger: the transition's event, `after` or `always`.
        target: the transition's target state.
        rule: label of the contingency rule that generated the transition, e.g. `no_path: wait, retry`.
    """
    _check(run, source, target, trigger=trigger, rule=rule)
    return any(
        (source is None or _has_name(taken.source, source))
        and (trigger is None or taken.trigger == trigger)
        and (target is None or _has_name(taken.target, target))
        and (rule is None or taken.rule == rule)
        for taken in _list_taken(run)
    )


def consumed(run: Run, event: str, /, **attributes: Any) -> bool:
    """Return whether a transition handled such an event, from outside or inside; omitted attributes match any value."""
    _check(run, trigger=event)
    return any(_is_event(micro.event, event, attributes) for micro in _microsteps(run))


def ignored(run: Run, event: str, /, **attributes: Any) -> bool:
    """Return whether such an event arrived and no transition handled it."""
    return any(_is_event(step.event, event, attributes) and not step.handled for step in _steps(run))


def emitted(run: Run, event: str, /, **attributes: Any) -> bool:
    """Return whether the outermost plot emitted such an outcome; for inner plots, see `consumed`."""
    return any(_is_event(one, event, attributes) for step in _steps(run) for one in step.emitted)


def started(run: Run, skill: str, /, **arguments: Any) -> bool:
    """Return whether the skill (`component.skill`) was started; omitted arguments match any value."""
    _check(run, skill=skill)
    return any(
        f"{output.component}.{output.skill}" == skill and _has(output.arguments, arguments)
        for output in _outputs(run)
        if isinstance(output, Start)
    )


def configured(run: Run, parameter: str, value: Any) -> bool:
    """Return whether a component's parameter (`component.parameter`) was set to the value."""
    return any(
        f"{output.component}.{output.parameter}" == parameter and output.value == value
        for output in _outputs(run)
        if isinstance(output, SetParameter)
    )


def switched(run: Run, component: str, mode: str) -> bool:
    """Return whether a chart switched the component to the mode."""
    return any(
        (output.component, output.mode) == (component, mode)
        for output in _outputs(run)
        if isinstance(output, SwitchMode)
    )


def chose(run: Run, state: str, plot: str | None) -> bool:
    """Return whether a dynamic state chose the plot; `None` means that no candidate fitted."""
    _check(run, state)
    return any(
        _has_name(made.state, state) and made.decision.chosen == plot and not made.decision.satisfied
        for step in _steps(run)
        for made in step.decisions
    )


def told(run: Run, what: str) -> bool:
    """Return whether one step made the whole change, e.g. `(and (tidy cup) (not (seen cup)))`.

    A number is written as in an effect: `(assign (failures cup) 2)` matches the result of any arithmetic.

    Raises:
        InputError: a part is not a fact, a negated fact, or an assigned number.
    """
    wanted = tuple(_parts(parse_effect(what)))
    return any(all(_tells(step, part) for part in wanted) for step in _steps(run))


def _steps(run: Run) -> Iterable[Step]:
    if isinstance(run, Step):
        return (run,)
    return run if isinstance(run, Iterable) else run.steps


def _microsteps(run: Run) -> Iterator[Microstep]:
    return (micro for step in _steps(run) for micro in step.microsteps)


def _list_taken(run: Run) -> Iterator[Taken]:
    return (taken for micro in _microsteps(run) for taken in micro.taken)


def _outputs(run: Run) -> Iterator[Any]:
    return (output for step in _steps(run) for output in step.output)


def _has_name(path: str | None, state: str) -> bool:
    return path is not None and (path == state or path.endswith("/" + state))


def _has(values: Any, wanted: dict[str, Any]) -> bool:
    return all(name in values and values[name] == value for name, value in wanted.items())


def _is_event(event: Any, name: str, attributes: dict[str, Any]) -> bool:
    return event is not None and event.name == name and _has(event.attributes, attributes)


def _parts(effect: Effect) -> Iterator[Add | Delete | NumericEffect]:
    if isinstance(effect, AllOf):
        for part in effect.parts:
            yield from _parts(part)
    elif isinstance(effect, Add | Delete) or (isinstance(effect, NumericEffect) and effect.operator == "assign"):
        yield effect
    else:
        raise InputError("a change consists of facts, (not FACT) and (assign (FUNCTION ...) NUMBER)")


def _tells(step: Step, part: Add | Delete | NumericEffect) -> bool:
    if isinstance(part, NumericEffect):
        value = part.value.value if isinstance(part.value, Constant) else None
        return step.knowledge.values.get(_fact(part.call)) == value
    return _fact(part.atom) in (step.knowledge.added if isinstance(part, Add) else step.knowledge.removed)


def _fact(form: Atom | Call) -> Fact:
    name = form.predicate if isinstance(form, Atom) else form.function
    for argument in form.args:
        if not isinstance(argument, Constant):
            raise InputError(f"'{argument}' has no value; a change contains only objects and numbers")
    return Fact(name, tuple(argument.value for argument in form.args if isinstance(argument, Constant)))


def _check(
    run: Run, *states: str | None, trigger: str | None = None, rule: str | None = None, skill: str | None = None
) -> None:
    """Raise `UnknownNameError` for a name that cannot occur in a run with plots; a state may also be a path."""
    if isinstance(run, Step | Iterable):
        return
    # The bound plots include plots of rules and planners.
    bound = (bound.plot for micro in _microsteps(run) for bound in micro.bound)
    known = _KnownNames([*run.library, *bound])
    known.check("state", (name for state in states if state is not None for name in state.split("/")))
    known.check("transition on", (trigger,))
    known.check("rule", (rule,))
    known.check("skill", (skill,))


class _KnownNames:
    """Names of the states, triggers, rules and skills (`component.skill`) of some plots.

    If a plot handles events by prefix (SCXML 3.12.1), any trigger is known.
    """

    def __init__(self, plots: Iterable[ActionPlot]) -> None:
        self._by_prefix = False
        self._names: dict[str, set[str | None]] = {
            "state": {None}, "transition on": {None, AFTER, EVERY, "always"}, "rule": {None}, "skill": {None},
        }  # fmt: skip
        for plot in plots:
            self._by_prefix |= plot.dialect == "scxml"
            self._names["rule"].update(rule.label for rule in plot.rules)
            self._names["rule"].update(handler.label for handler in plot.handlers)
            for name, state, _ in plot.walk():
                self._names["state"].add(name)
                self._add(state)

    def _add(self, state: AnyState) -> None:
        if not isinstance(state, TransitionSource):
            return
        for trigger, transition in state.transitions():
            self._names["transition on"].add(trigger)
            self._names["rule"].add(transition.rule)
        actions = flat((*state.entry, *state.exit, *state.on_break)) if isinstance(state, State) else ()
        self._names["skill"].update(action.trigger for action in actions if isinstance(action, Trigger))

    def check(self, kind: str, names: Iterable[str | None]) -> None:
        """Raise `UnknownNameError` for an unknown name; `None` is always known."""
        valid = self._names[kind]
        for name in names:
            if name not in valid and not (kind == "transition on" and self._by_prefix):
                known = (one for one in valid if one is not None)
                raise UnknownNameError(f"no plot of this run has a {kind} '{name}'", found=name, valid=known)

"""Questions about a step, or about all steps of a run, that read well behind `assert`.

States are named by their name or by their path from the outermost plot, e.g. `clear/execute/step_2`. Of a run that
knows its library (`Rehearsal`, `DryRun`), a question about a state, trigger, rule or skill that no plot has is an
`UnknownNameError`: the answer could only be no.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Protocol

from dsc.engine.steps import Microstep, SetParameter, Start, Step, SwitchMode, Taken
from dsc.model.plot import ActionPlot
from dsc.testing.vocabulary import KnownNames
from knowledge_base.errors import InputError
from knowledge_base.facts import Fact
from knowledge_base.language.effect import Add, AllOf, Delete, Effect, NumericEffect
from knowledge_base.language.expression import Atom, Call, Constant
from knowledge_base.language.parser import parse_effect


class HasSteps(Protocol):
    """A run that keeps its steps and its plots: a `Rehearsal`, a `DryRun`."""

    @property
    def library(self) -> Iterable[ActionPlot]:
        """All plots that it may have used."""
        ...

    @property
    def steps(self) -> Sequence[Step]:
        """In order."""
        ...


Run = Step | Iterable[Step] | HasSteps
"""What can be asked about: one step, several, or whatever has them."""


def entered(run: Run, state: str) -> bool:
    """Whether the state was entered."""
    _check(run, state=state)
    return any(step.entered(state) for step in _steps(run))


def exited(run: Run, state: str) -> bool:
    """Whether the state was left."""
    _check(run, state=state)
    return any(step.exited(state) for step in _steps(run))


def trail(run: Run) -> tuple[str, ...]:
    """The paths of all states that were entered, in order."""
    return tuple(path for micro in _microsteps(run) for path in micro.entered)


def took(
    run: Run,
    source: str | None = None,
    trigger: str | None = None,
    target: str | None = None,
    *,
    rule: str | None = None,
) -> bool:
    """Whether a transition was taken; what is left out may be anything.

    Args:
        run: the steps.
        source: the state it leaves from.
        trigger: its event, `after` or `always`.
        target: the state it leads to.
        rule: label of the contingency rule it comes from, e.g. `no_path: wait, retry`.
    """
    for state in (source, target):
        _check(run, state=state, trigger=trigger, rule=rule)
    return any(
        (source is None or _named(taken.source, source))
        and (trigger is None or taken.trigger == trigger)
        and (target is None or _named(taken.target, target))
        and (rule is None or taken.rule == rule)
        for taken in _taken(run)
    )


def consumed(run: Run, event: str, /, **attributes: Any) -> bool:
    """Whether a transition took such an event, from outside or fired within; attributes left out may be anything."""
    _check(run, trigger=event)
    return any(_is_event(micro.event, event, attributes) for micro in _microsteps(run))


def ignored(run: Run, event: str, /, **attributes: Any) -> bool:
    """Whether such an event came and no transition took it."""
    return any(_is_event(step.event, event, attributes) and not step.handled for step in _steps(run))


def emitted(run: Run, event: str, /, **attributes: Any) -> bool:
    """Whether the outermost plot ended with, or emitted, such an outcome; see `consumed` for those further in."""
    return any(_is_event(one, event, attributes) for step in _steps(run) for one in step.emitted)


def started(run: Run, skill: str, /, **arguments: Any) -> bool:
    """Whether the skill (`component.skill`) was started; arguments left out may be anything."""
    _check(run, skill=skill)
    return any(
        f"{output.component}.{output.skill}" == skill and _has(output.arguments, arguments)
        for output in _outputs(run)
        if isinstance(output, Start)
    )


def configured(run: Run, parameter: str, value: Any) -> bool:
    """Whether a component's parameter (`component.parameter`) was set to the value."""
    return any(
        f"{output.component}.{output.parameter}" == parameter and output.value == value
        for output in _outputs(run)
        if isinstance(output, SetParameter)
    )


def switched(run: Run, component: str, mode: str) -> bool:
    """Whether the component was put into the mode."""
    return any(
        (output.component, output.mode) == (component, mode)
        for output in _outputs(run)
        if isinstance(output, SwitchMode)
    )


def chose(run: Run, state: str, plot: str | None) -> bool:
    """Whether a dynamic state chose the plot; `None`: no candidate fitted."""
    _check(run, state=state)
    return any(
        _named(made.state, state) and made.decision.chosen == plot and not made.decision.satisfied
        for step in _steps(run)
        for made in step.decisions
    )


def told(run: Run, what: str) -> bool:
    """Whether one step told the knowledge base all of it, e.g. `(and (tidy cup) (not (seen cup)))`.

    A number is written as in an effect: `(assign (failures cup) 2)` is what came out of any arithmetic.

    Raises:
        InputError: it is not made of facts, facts that no longer hold, and numbers.
    """
    wanted = tuple(_parts(parse_effect(what)))
    return any(all(_tells(step, part) for part in wanted) for step in _steps(run))


def _check(run: Run, **names: str | None) -> None:
    if isinstance(run, Step | Iterable):
        return
    bound = (bound.plot for micro in _microsteps(run) for bound in micro.bound)  # with what rules and planners added
    KnownNames([*run.library, *bound]).check(**names)


def _steps(run: Run) -> Iterable[Step]:
    if isinstance(run, Step):
        return (run,)
    return run if isinstance(run, Iterable) else run.steps


def _microsteps(run: Run) -> Iterator[Microstep]:
    return (micro for step in _steps(run) for micro in step.microsteps)


def _taken(run: Run) -> Iterator[Taken]:
    return (taken for micro in _microsteps(run) for taken in micro.taken)


def _outputs(run: Run) -> Iterator[Any]:
    return (output for step in _steps(run) for output in step.output)


def _named(path: str | None, state: str) -> bool:
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
        raise InputError("what was told is asked for as facts, (not FACT) and (assign (FUNCTION ...) NUMBER)")


def _tells(step: Step, part: Add | Delete | NumericEffect) -> bool:
    if isinstance(part, NumericEffect):
        value = part.value.value if isinstance(part.value, Constant) else None
        return step.knowledge.values.get(_fact(part.call)) == value
    return _fact(part.atom) in (step.knowledge.added if isinstance(part, Add) else step.knowledge.removed)


def _fact(form: Atom | Call) -> Fact:
    name = form.predicate if isinstance(form, Atom) else form.function
    for argument in form.args:
        if not isinstance(argument, Constant):
            raise InputError(f"'{argument}' has no value; what was told has none but things and numbers in it")
    return Fact(name, tuple(argument.value for argument in form.args if isinstance(argument, Constant)))

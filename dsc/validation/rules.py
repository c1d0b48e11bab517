"""Names in rules and handlers: states, planning actions, plots and responses that exist (S1.4, S1.14)."""

from __future__ import annotations

from collections.abc import Iterator

from dsc.dynamic.library import Library
from dsc.dynamic.steps import Step, contents_of
from dsc.errors import Finding
from dsc.model.plot import ActionPlot, Path
from dsc.model.rules import ENTER, RESPONSES, RETRY, Rule
from dsc.validation.nesting import Nesting
from knowledge_base.errors import SchemaError, UnknownNameError


def check_rules(plot: ActionPlot, library: Library, nesting: Nesting) -> Iterator[Finding]:
    """Findings about names in rules and handlers."""
    if plot.handlers and plot.profile != "dsc":
        error = SchemaError("handlers are for plots of profile dsc", place=plot.place(("handlers",)))
        yield Finding(error, "profile", "write what they do as transitions")
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
    """The finding about a step that is not there: of a plot's name, with the names by which it is spoken of."""
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
    """The finding about a plot that is not there."""
    valid = {other.name for other in library}
    error = UnknownNameError(f"there is no plot '{name}'", place=plot.place(path), found=name, valid=valid)
    return Finding(error, "known plot")

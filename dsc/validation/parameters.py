"""Parameters of plots keep to their roles: values are in range, and said only by who may say them (S1.11)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from dsc.dynamic.library import Library
from dsc.dynamic.steps import Step, contents_of, entered_by
from dsc.errors import Finding
from dsc.model.plot import ActionPlot, Parameter, Path
from dsc.model.ranges import Who, refuse_change
from dsc.validation.nesting import Nesting
from knowledge_base.errors import InputError, SchemaError
from knowledge_base.language.expression import Constant, Term


def check_parameters(plot: ActionPlot, library: Library, nesting: Nesting) -> Iterator[Finding]:
    """Findings about the roles of a plot's own parameters, and about what it hands to others."""
    for name, parameter in plot.parameters.items():
        yield from _own(plot, name, parameter)
    for _, state, path in nesting.states:
        if isinstance(state, Step) and state.arguments:
            for used in contents_of(state, library):
                yield from _handed(plot, used, state.arguments, "plots", (*path, "with"))
        for inside, _, way in nesting.leaving(path):
            target = nesting.state(way.target) if way.passed and way.target is not None else None
            for used in contents_of(target, library) if isinstance(target, Step) else ():
                yield from _handed(plot, used, way.passed, "plots", (*path, *inside, "pass"))
    yield from _by_rules(plot, library)


def _by_rules(plot: ActionPlot, library: Library) -> Iterator[Finding]:
    for group, reactions in (("rules", [r.do for r in plot.rules]), ("handlers", [h.do for h in plot.handlers])):
        for number, do in enumerate(reactions):
            if do.use is not None:
                yield from _handed(plot, library.plot(do.use), do.arguments, "rules", (group, number, "do", "with"))
    for number, rule in enumerate(plot.rules):
        for one in entered_by(rule, plot, library) if rule.do.passed else ():
            yield from _handed(plot, one, rule.do.passed, "rules", ("rules", number, "do", "pass"))


def _own(plot: ActionPlot, name: str, parameter: Parameter) -> Iterator[Finding]:
    here: Path = ("parameters", name)
    for problem in parameter.range.problems():
        yield Finding(SchemaError(f"parameter '{name}': {problem}", place=plot.place(here)), "parameter roles")
        return
    if parameter.default is None:
        if parameter.changed_by != "plots":
            message = f"'{name}' needs a default, as not everybody who uses the plot may say its value"
            error = SchemaError(message, place=plot.place(here))
            yield Finding(error, "parameter roles", "a profile may say another one")
    elif isinstance(parameter.default, Constant) and parameter.bounded:
        yield from _fits(plot, f"{plot.name}.{name}", parameter, parameter.default, (*here, "default"))


def _handed(
    plot: ActionPlot, used: ActionPlot, arguments: Mapping[str, Term], who: Who, path: Path
) -> Iterator[Finding]:
    for name, term in arguments.items():
        parameter = used.parameters.get(name)
        if parameter is None:  # it is for another candidate, or a finding of its own
            continue
        full, here = f"{used.name}.{name}", (*path, name)
        try:
            refuse_change(full, who, parameter.changed_by)
        except SchemaError as refused:
            refused.place = plot.place(here)
            yield Finding(refused, "parameter roles", "say it in a profile, or let `changed_by` allow it")
            continue
        if isinstance(term, Constant) and parameter.bounded:
            yield from _fits(plot, full, parameter, term, here)


def _fits(plot: ActionPlot, name: str, parameter: Parameter, term: Constant, path: Path) -> Iterator[Finding]:
    try:
        parameter.range.check(name, term.value)
    except InputError as error:
        error.place = plot.place(path)
        yield Finding(error, "parameter roles")

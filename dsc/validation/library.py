"""Validator: executes all checks of a plot, or of all plots of a library."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from itertools import chain, islice

from dsc.dynamic.library import Library
from dsc.errors import Finding, PlotError
from dsc.model.plot import ActionPlot
from dsc.model.rules import Rule
from dsc.skills import SkillSignature
from dsc.validation.arguments import check_arguments, check_outputs, check_parameters
from dsc.validation.commands import check_commands
from dsc.validation.data import check_data
from dsc.validation.flow import check_wiring
from dsc.validation.reach import check_reach
from dsc.validation.shape import check_size, check_structure
from dsc.validation.subject import Components, Subject, by_trigger
from dsc.validation.watched_conditions import check_watched_conditions
from knowledge_base.errors import InputError
from knowledge_base.language.checking.inputs import require, require_several
from knowledge_base.world.schema import Schema

MAX_FINDINGS = 50
"""Upper bound of findings about one plot: authors read no more, and each finding needs a search for similar names."""
_CHECKS = (
    check_reach, check_wiring, check_arguments, check_parameters, check_outputs, check_data, check_commands,
    check_watched_conditions,
)  # fmt: skip


def validate_library(
    library: Library,
    schema: Schema | None,
    skills: Iterable[SkillSignature] | None,
    components: Components | None = None,
) -> list[Finding]:
    """Return the findings about all plots of a library; see `validate_plot`."""
    _require_parts(library, schema)
    known = None if skills is None else _require_signatures(skills)
    return [finding for plot in library for finding in validate_plot(plot, library, schema, known, components)]


def validate_plot(
    plot: ActionPlot,
    library: Library,
    schema: Schema | None = None,
    skills: Iterable[SkillSignature] | None = None,
    components: Components | None = None,
    *,
    objects: Mapping[str, str] | None = None,
    thorough: bool = False,
) -> list[Finding]:
    """Return the findings about a plot, at most `MAX_FINDINGS`; empty for a valid plot.

    Args:
        plot: the plot to check.
        library: provider of the plots to which the plot refers.
        schema: declared types and predicates; with `None`, types and conditions are not checked.
        skills: the deployed skills; with `None`, triggers are not checked.
        components: names of the deployed components, or their interfaces by name; with `None`, `set`, `send`
            and `switch` are not checked.
        objects: types of the objects with which a run begins, by name; with `None`, names of objects are not checked.
        thorough: whether a plot with an unsound structure is checked further; a mistake may then have two findings.

    Raises:
        InputError: an argument is of another type.
    """
    require(plot, ActionPlot, "a plot is an ActionPlot, as load_plot and parse_plot give it")
    _require_parts(library, schema)
    signatures = None if skills is None else by_trigger(_require_signatures(skills))
    subject = Subject(plot, library, schema, signatures, components, objects)
    for check in (check_structure, check_size):
        findings = list(islice(check(subject), MAX_FINDINGS))
        if findings:  # the other checks would report these mistakes again, or take too long
            return _with_others(findings, subject) if thorough else findings
    return list(islice(chain.from_iterable(check(subject) for check in _CHECKS), MAX_FINDINGS))


def _with_others(findings: list[Finding], subject: Subject) -> list[Finding]:
    """Return findings about the structure with those of checks that need no sound structure, for each place the first.

    A check may be unable to read a plot of unsound structure; then its findings come after the structure is repaired.
    """
    found = {finding.place: finding for finding in reversed(findings)}
    for check in (check_data, check_commands, check_watched_conditions, _check_outcomes):
        with suppress(InputError, LookupError):
            for finding in islice(check(subject), MAX_FINDINGS):
                found.setdefault(finding.place, finding)
    return [*findings, *(one for one in found.values() if one not in findings)][:MAX_FINDINGS]


def _check_outcomes(subject: Subject) -> Iterator[Finding]:
    """Yield the findings about unanswered outcomes; a rule whose target does not exist still answers."""
    plot = subject.plot
    rules = [rule if not rule.leads_away or rule.then in subject.names else _here(rule) for rule in plot.rules]
    copied = plot.model_copy(update={"rules": tuple(rules)})
    again = Subject(copied, subject.library, subject.schema, subject.skills, subject.components, subject.objects)
    return (finding for finding in check_wiring(again) if finding.code == "every-outcome-is-wired")


def _here(rule: Rule) -> Rule:
    return rule.model_copy(update={"do": rule.do.model_copy(update={"then": None})})


def _require_parts(library: object, schema: object) -> None:
    require(library, Library, "the plots are given as a Library, made by Library(plots)")
    if schema is not None:
        require(schema, Schema, "a schema is a Schema; Schema.parse reads its text")


def _require_signatures(skills: Iterable[SkillSignature]) -> list[SkillSignature]:
    require_several(skills, "the signatures of skills")
    skills = list(skills)
    for one in skills:
        require(one, SkillSignature, "a skill is known by its SkillSignature, as the skills() of a component give it")
    return skills


def raise_findings(findings: list[Finding]) -> None:
    """Raise all findings as one `PlotError`; an empty list raises no error."""
    if findings:
        raise PlotError(findings)

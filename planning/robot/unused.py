"""Parts of a robot without an effect: plots that nothing uses, and predicates that nothing makes true."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator
from typing import Any

from dsc.errors import Finding
from dsc.model.plot import ActionPlot
from knowledge_base.errors import SchemaError
from knowledge_base.language.syntax.effect import Form, parts_of_form
from knowledge_base.language.syntax.expression import Atom
from knowledge_base.view import View
from planning.model.domain import PlanningDomain

_WORD = re.compile(r"[\w-]+")
_QUOTED = re.compile(r"[\"']([\w-]+)[\"']")
_CONDITIONS = frozenset({"goal", "when", "priority", "utility", "cost"})


def quoted_names(sources: Iterable[str]) -> frozenset[str]:
    """Return the names in quotes in texts of Python files, which may be plots or predicates."""
    return frozenset(_QUOTED.findall("\n".join(sources)))


def unused_plots(plots: Collection[ActionPlot], main: str | None, quoted: Collection[str]) -> Iterator[Finding]:
    """Yield a warning for each candidate, a plot with `when`, that implements no action and is named nowhere else.

    A plot without `when` may be run by its name, and one with `offers` may be found by a plot that arrives later.

    Args:
        plots: the plots of the robot.
        main: the plot with which a run begins.
        quoted: the names in Python files, see `quoted_names`.
    """
    words = {plot.name: {text for _, text in _texts(plot.to_form())} for plot in plots}
    for plot in plots:
        others = set[str]().union(*(found for name, found in words.items() if name != plot.name))
        is_candidate = plot.when is not None and plot.implements is None and not plot.offers
        if is_candidate and plot.name not in {main, *quoted, *others}:
            message = f"nothing chooses the plot '{plot.name}', which has a condition `when`"
            error = SchemaError(message, place=plot.place(("plot",)), found=plot.name)
            fix = "name it under `dynamic`, or say which planning action it `implements`"
            yield Finding(error, "used-plot", fix, "warning")


def never_true(
    plots: Collection[ActionPlot], domain: PlanningDomain, world: View, quoted: Collection[str]
) -> Iterator[Finding]:
    """Yield a warning for each predicate that a plot or action reads and that no part of the robot makes true.

    Args:
        plots: the plots of the robot.
        domain: the planning domain.
        world: the initial knowledge.
        quoted: the names in Python files, see `quoted_names`.
    """
    changed = {one.predicate for one in world.facts()}.union(quoted)
    read = dict[str, str]()
    for plot in plots:
        for key, text in _texts(plot.to_form()):
            words = dict.fromkeys(_WORD.findall(text), f"plot '{plot.name}'")
            if key in _CONDITIONS:
                read = {**words, **read}
            elif key == "tell":
                changed.update(words)
    for action in domain.actions.values():
        changed.update(_predicates(action.effect))
        read = {**dict.fromkeys(_predicates(action.precondition), f"planning action '{action.name}'"), **read}
    schema = domain.schema
    defined = {*schema.computed, *(axiom.predicate for axiom in (*domain.axioms, *schema.axioms))}
    for name, signature in schema.predicates.items():
        if name in read and name not in changed | defined:
            message = f"nothing makes {signature} true, and {read[name]} reads it"
            fix = "it is in no initial fact, no effect, no `tell` and no `fact(...)`"
            yield Finding(SchemaError(message, place=signature.place, found=name), "made-true", fix, "warning")


def _texts(form: Any, key: str = "") -> Iterator[tuple[str, str]]:
    """Yield each text in a form with the nearest key."""
    if isinstance(form, dict):
        for name, part in form.items():
            yield from _texts(part, name)
    elif isinstance(form, list):
        for part in form:
            yield from _texts(part, key)
    elif isinstance(form, str):
        yield key, form


def _predicates(form: Form) -> set[str]:
    own = {form.predicate} if isinstance(form, Atom) else set[str]()
    return own.union(*map(_predicates, parts_of_form(form)))

"""Plots given as data, checked as plots of the library are before a state runs them (S2.7)."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from dsc.dynamic.library import Library
from dsc.engine.tables import CompiledPlot
from dsc.model.plot import ActionPlot
from dsc.skills import SkillSignature
from dsc.validation import validate_plot
from dsc.validation.library import raise_findings
from knowledge_base.world.schema import Schema


class CheckedPlots:
    """A `Chart` of a library's plots that checks each plot given as data, except those made from plans.

    The check reads only plots, schema and skills, which the store keeps, so that a replay has the same result.

    Args:
        library: the plots.
        schema: the declared types and predicates.
        skills: the deployed skills; `None` if more may be deployed, so that triggers are not checked.
    """

    def __init__(self, library: Library, schema: Schema, skills: Collection[SkillSignature] | None = None) -> None:
        self._library = library
        self._schema = schema
        self._skills = skills
        self._accepted: set[CompiledPlot] = set()

    def compiled(self, name: str) -> CompiledPlot:
        """Return the compiled plot of that name; raise `UnknownNameError` if there is none."""
        return self._library.compiled(name)

    def bind(self, form: Mapping[str, Any] | str) -> CompiledPlot:
        """Return the compiled plot for data in the written form, or the library's plot of this name.

        Raises:
            InputError: the data are not a plot, or the plot does not pass the validator, or no plot has this name.
        """
        compiled = self._library.bind(form)
        if isinstance(form, str):
            return compiled
        if not compiled.plot.generated and compiled not in self._accepted:
            plot = ActionPlot.model_validate(form)
            raise_findings(validate_plot(plot, self._library, self._schema, self._skills))
            self._accepted.add(compiled)
        return compiled

"""Library of plots: returns plots by name, expands their rules and caches their compiled tables (S0.9).

A substitute must have an interface that fits all host states of the original (S0.1).
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from copy import copy
from typing import Any

from dsc.annotations import FoundRecords, add_records
from dsc.conversions import Conversion, conversions_by_name
from dsc.data_types import Records
from dsc.dynamic.experience import NO_EXPERIENCE
from dsc.dynamic.rule_expansion import expand
from dsc.engine.tables import CompiledPlot, compile_plot
from dsc.events import RESERVED
from dsc.model.plot import ActionPlot
from dsc.model.ranges import Who
from knowledge_base.errors import InputError, SchemaError, UnknownNameError
from knowledge_base.user_objects import shown

MOST_BOUND = 64
"""Upper bound of cached compiled plots that were given as data.

The cache serves retries, which bind an equal plan again. The bound limits memory in a long run with many plans.
"""

MOST_EXPECTED = 4
"""Upper bound of plots that this process has made from plans and not yet bound."""


class Library:
    """A collection of plots by name; provides the engine with compiled plots.

    Attributes:
        records: the records that types of plots may name: those that plots or components declare.
        conversions: the functions that terms of the plots may call.
        experience: the tries of candidates for learned choices.
    """

    def __init__(self, plots: Iterable[ActionPlot] = (), conversions: Iterable[Conversion[..., Any]] = ()) -> None:
        self._plots: dict[str, ActionPlot] = {}
        self._compiled: dict[str, CompiledPlot] = {}
        self._bound: dict[str, CompiledPlot] = {}
        self._made: dict[str, ActionPlot] = {}
        self.records: FoundRecords = {}
        self.experience = NO_EXPERIENCE
        self.conversions = conversions_by_name(conversions)
        for one in self.conversions.values():
            self.declare(one.records)
        self._received: frozenset[str] | None = None
        if isinstance(plots, ActionPlot | str) or not isinstance(plots, Iterable):
            raise InputError(f"a library is made of a list of plots, not of {shown(plots)[:60]}")
        for plot in plots:
            self.add(plot)

    @property
    def plots(self) -> Mapping[str, ActionPlot]:
        """The plots by name; a change replaces this mapping, so that caches may identify the content by it."""
        return self._plots

    def __iter__(self) -> Iterator[ActionPlot]:
        """Yield all plots, in the order in which they were added."""
        return iter(self._plots.values())

    def __contains__(self, name: object) -> bool:
        """Return whether the library has a plot of that name."""
        return name in self._plots

    def add(self, plot: ActionPlot) -> None:
        """Add a plot under its name.

        Raises:
            InputError: the value is not a plot.
            SchemaError: the library already has a plot of this name.
        """
        if not isinstance(plot, ActionPlot):
            raise InputError(f"a plot is an ActionPlot, as load_plot and parse_plot give it, not {shown(plot)}")
        if self._plots.get(plot.name, plot) != plot:
            raise SchemaError(
                f"two different plots are named '{plot.name}'", place=plot.place(("plot",)), found=plot.name
            )
        self.change({plot.name: plot})

    def copy(self) -> Library:
        """Return a library with the same plots and tables; later changes of one of the two leave the other unchanged.

        Both share records and conversions.
        """
        return copy(self)  # `change` replaces the mappings that both share

    def change(self, plots: Mapping[str, ActionPlot | None]) -> None:
        """Install, replace and remove plots by name; `None` removes a plot. Running plots keep their tables.

        Raises:
            SchemaError: a plot declares a record of the library with other fields.
        """
        for plot in plots.values():
            if plot is not None:
                self.declare(plot.types)
        present = {**self._plots, **plots}
        self._plots = {name: plot for name, plot in present.items() if plot is not None}
        self._received = None
        named, bound = self._compiled.items(), self._bound.items()  # copies keep these mappings
        self._compiled = {name: one for name, one in named if self._stays(self._plots.get(name), one)}
        self._bound = {key: one for key, one in bound if self._stays(_read(json.loads(key)), one)}

    def _stays(self, plot: ActionPlot | None, compiled: CompiledPlot) -> bool:
        """Return whether the tables of a plot still express its expansion."""
        try:
            return plot is not None and self.expanded(plot) == compiled.plot
        except InputError:
            return False

    def declare(self, records: Records) -> None:
        """Add records; raise `SchemaError` for a second record of one name with other fields."""
        add_records(self.records, records)

    def plot(self, name: str) -> ActionPlot:
        """Return the plot of that name, without expansion; raise `UnknownNameError` if there is none."""
        found = self._plots.get(name)
        if found is None:
            raise UnknownNameError(f"there is no plot '{name}'", found=name, valid=self._plots)
        return found

    def require_receiver(self, event: str) -> None:
        """Raise `UnknownNameError` unless a plot declares the event under `receives`; SCXML plots match by prefix."""
        if self._received is None:
            self._received = frozenset[str]().union(*(plot.receives for plot in self))
        if event not in self._received and all(plot.dialect == "dsc" for plot in self):
            valid = self._received - RESERVED
            raise UnknownNameError(f"no plot receives the event '{event}'", found=event, valid=valid)

    def substitute(self, name: str, plot: ActionPlot) -> Library:
        """Return a new library in which `plot` replaces the plot of that name; this library is unchanged.

        All plots that refer to the name use the new plot. A substitute thus replaces a whole branch, e.g. for a test.

        Raises:
            UnknownNameError: the library has no plot of that name.
            SchemaError: a host state of the old plot could not contain the new plot; see `substitute_for`.
        """
        other = self.copy()
        other.change({name: substitute_for(self.plot(name), plot)})
        return other

    def with_default(self, plot: str, name: str, value: object, who: Who) -> Library:
        """Return a new library in which a plot's parameter has another default, set by the role `who`.

        Both share the tables of all other plots.

        Raises:
            UnknownNameError: the library has no such plot, or the plot has no such parameter.
            InputError: the value does not fit the parameter, or `who` may not set the parameter.
        """
        other = self.copy()
        other.change({plot: self.plot(plot).with_default(name, value, who)})
        return other

    def expanded(self, plot: ActionPlot) -> ActionPlot:
        """Return the plot with its rules and handlers as states and transitions; see `expand`."""
        return expand(plot, self)

    def implementing(self, planning_action: str) -> tuple[ActionPlot, ...]:
        """Return the plots that implement a planning action, in the order of the library; empty if there are none."""
        return tuple(plot for plot in self if plot.implements == planning_action)

    def compiled(self, name: str) -> CompiledPlot:
        """Return the compiled plot of that name; raise `UnknownNameError` if there is none."""
        if name not in self._compiled:
            self._compiled[name] = self._compile(self.expanded(self.plot(name)))
        return self._compiled[name]

    def _compile(self, plot: ActionPlot, form: Mapping[str, Any] | None = None) -> CompiledPlot:
        return compile_plot(plot, form, self.records, self.conversions)

    def expect(self, plot: ActionPlot) -> None:
        """Cache a plot; a later `bind` of its unchanged written form then need not read the form."""
        self._made[plot.text] = plot
        if len(self._made) > MOST_EXPECTED:
            del self._made[next(iter(self._made))]

    def bind(self, form: Mapping[str, Any] | str) -> CompiledPlot:
        """Return the compiled plot for data in the written form, or of this name; equal data share their tables.

        Raises:
            InputError: the data are not a plot, or the plot refers to unknown plots, or no plot has this name.
        """
        if isinstance(form, str):
            return self.compiled(form)
        if not isinstance(form, Mapping):  # the value of a variable may have any type
            raise InputError(f"the value to be bound is not a plot: {form!r}")
        key = json.dumps(form)  # keys stay unsorted, because the order of states is part of a plot
        compiled = self._bound.pop(key, None)
        if compiled is None:
            compiled = self._compile(self.expanded(self._made.get(key) or _read(form)), form)
        self._bound[key] = compiled  # the least recently used plot is dropped first
        if len(self._bound) > MOST_BOUND:
            del self._bound[next(iter(self._bound))]
        return compiled


def _read(form: Mapping[str, Any]) -> ActionPlot:
    try:
        return ActionPlot.model_validate(form)
    except InputError as error:
        raise InputError(f"the value to be bound is not a plot: {error}") from error


_ROLE = ("when", "offers", "priority", "utility", "cost", "implements", "effects", "confirm")
"""Fields of a plot's role as a candidate or planning action; a substitute without a role has the original's role."""


def substitute_for(original: ActionPlot, substitute: ActionPlot) -> ActionPlot:
    """Return the substitute under the original's name, with the original's role if the substitute declares none.

    The role consists of the condition as a candidate, and of the planning action with the treatment of its effects. The
    result declares every outcome of the original, so that the host states' transitions remain valid.

    Raises:
        SchemaError: a host state of the original could not contain the substitute.
    """
    require_substitute(original, substitute)
    role = {key: getattr(original, key) for key in _ROLE if key not in substitute.model_fields_set}
    emits = {**original.emits, **substitute.emits}
    return substitute.model_copy(update={"name": original.name, "emits": emits, **role})


def require_substitute(original: ActionPlot, substitute: ActionPlot) -> None:
    """Raise an error if a host state of the original could not contain the substitute.

    A host state may pass all parameters of the original, or only the required parameters. It handles the original's
    outcomes.

    Raises:
        SchemaError: the interfaces differ; the message reports the difference.
    """
    for name, parameter in original.parameters.items():
        own = substitute.parameters.get(name)
        if own is None:
            raise _refusal(original, substitute, f"lacks its parameter '{name}'", name, substitute.parameters)
        if own.type != parameter.type:
            different = f"takes '{name}' as '{own.type}', not as '{parameter.type}'"
            raise _refusal(original, substitute, different, own.type, (parameter.type,))
    for name, parameter in substitute.parameters.items():
        given = name in original.parameters and original.parameters[name].required
        if parameter.required and not given:
            needs = f"needs the parameter '{name}', which holders need not give"
            raise _refusal(original, substitute, needs, name, original.parameters)
    for name, output in original.outputs.items():
        if name not in substitute.outputs or substitute.outputs[name].type != output.type:
            lacking = f"does not return '{name}' as '{output.type}'"
            raise _refusal(original, substitute, lacking, name, substitute.outputs)
    for event, attributes in substitute.emits.items():
        if event not in original.emits:
            new = f"emits '{event}', which no holder has wired"
            raise _refusal(original, substitute, new, event, original.emits)
        for name in original.emits[event] or ():
            if name not in (attributes or {}):
                lacking = f"emits '{event}' without its attribute '{name}'"
                raise _refusal(original, substitute, lacking, name, attributes or ())


def _refusal(original: ActionPlot, substitute: ActionPlot, why: str, found: str, valid: Iterable[str]) -> InputError:
    message = f"'{substitute.name}' cannot replace '{original.name}': it {why}"
    return SchemaError(message, place=substitute.place(("plot",)), found=found, valid=valid)

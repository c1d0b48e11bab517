"""Declarations of the data of a plot: parameters, variables and outputs, with their types."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, Field, model_validator

from dsc.data_types import data_type
from dsc.model.language import Frozen, Setting, TermField
from dsc.model.ranges import Range, Who
from knowledge_base.errors import InputError


def _type_text(text: str) -> str:
    try:
        return str(data_type(text))
    except InputError as error:
        raise ValueError(str(error)) from None


TypeText = Annotated[str, AfterValidator(_type_text)]
"""Field type of a type of data as text, see `dsc.data_types`."""


class _Declaration(Frozen):
    """A declaration of a type; the type alone is the short form of the declaration."""

    type: TypeText

    @model_validator(mode="before")
    @classmethod
    def _short_form(cls, value: Any) -> Any:
        return {"type": value} if isinstance(value, str) else value


class PlotParameter(_Declaration):
    """An input parameter of a plot, with the roles that may set its value (S1.11).

    Attributes:
        type: the type of the values, see `dsc.data_types`; other names are types of the knowledge base's schema.
        default: value if no role sets another value; without one, only an `optional` parameter may be omitted.
        least, most: lower and upper bound of a number, inclusive; `None` means no bound.
        among: the allowed values; empty means any.
        changed_by: the last role that may set the value; all earlier roles may set it, too. In order: `nobody`;
            `profile`, before a run; `operator`, during a run; `rules` and handlers that use the plot; `plots` that use
            the plot.
    """

    default: TermField | None = None
    least: float | None = Field(default=None, strict=True)
    most: float | None = Field(default=None, strict=True)
    among: tuple[Setting, ...] = ()
    changed_by: Who = "plots"

    @property
    def required(self) -> bool:
        """Whether a use of the plot must give the parameter a value."""
        return self.default is None and not self.type.startswith("optional ")

    @property
    def range(self) -> Range:
        """The allowed values of the parameter."""
        kind = data_type(self.type).kind
        return Range("number" if kind == "integer" else self.type, self.least, self.most, self.among, kind == "integer")

    @property
    def bounded(self) -> bool:
        """Whether the parameter has a bound or a list of allowed values."""
        return self.least is not None or self.most is not None or bool(self.among)


class PlotVariable(_Declaration):
    """A variable or output of a plot; its value exists only while the plot runs (S0.7)."""

    initial: TermField | None = None

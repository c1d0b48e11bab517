"""Comparison of the types of data, where values of one type enter a place of another type.

A difference counts only if no value of the one type has the other: a name may denote any object, and a subtype is
possible.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

from dsc.data_types import ANY, WORDS, DataType, Records, data_type
from knowledge_base.world.schema import Schema

FREE_TYPES = ("number", "integer", "boolean", "geometry", *WORDS, ANY)
"""Types that data of plots may have in addition to the types of the schema and the records."""


@dataclass(frozen=True, slots=True)
class TypeChecker:
    """Comparison of types with the names of a schema and of records.

    Attributes:
        schema: the types of objects; `None` if unknown.
        records: the records by name.
    """

    schema: Schema | None
    records: Records

    def knows(self, name: str) -> bool:
        """Return whether the name of a type exists; without a schema, any name may."""
        return self.schema is None or name in FREE_TYPES or name in self.schema.types or name in self.records

    def difference(self, given: DataType, wanted: DataType) -> str | None:
        """Return why no value of one type has the other, e.g. `of type text`; `None` if a value may have both."""
        given, wanted = inside_optional(given), inside_optional(wanted)
        one, other = self._form(given), self._form(wanted)
        if one is None or other is None:
            return None
        if one != other or not self._overlap(given, wanted, one):
            return f"of type {given}"
        if given.unit and wanted.unit and given.unit != wanted.unit:
            return f"in {given.unit}"
        return None

    def is_word(self, kind: DataType) -> bool:
        """Return whether the values are words whose type is unknown to conditions: a choice, symbol or condition."""
        kind = inside_optional(kind)
        words = kind.kind == "choice" and self._form(kind) == "word"
        return words or kind.name in {"symbol", "condition", "plot"}

    def parts_of(self, text: str | None, parts: Collection[str], *, is_list: bool) -> Mapping[str, str | None] | str:
        """Return the types of the parts of a list or record that enters a type; or, as text, why it does not fit."""
        kind = None if text is None else inside_optional(data_type(text))
        form = None if kind is None else self._form(kind)
        if kind is None or form is None:
            return {}
        if is_list != (form in {"list", "geometry"}) or form not in {"list", "geometry", "map", "record"}:
            return f"is a {'list' if is_list else 'record'}"
        if form != "record":
            inner = "number" if form == "geometry" else kind.inner and str(kind.inner)
            return dict.fromkeys(parts, inner or None)
        fields = self.records[kind.name]
        for name in parts:
            if name not in fields:
                return f"has the part '{name}', which a {kind.name} lacks; its parts are {', '.join(fields)}"
        for name, own in fields.items():
            if name not in parts and (own is None or data_type(own).kind != "optional"):
                return f"lacks the part '{name}'"
        return fields

    def _form(self, kind: DataType) -> str | None:
        """Return the form of the values of a type; `None` for any form."""
        if kind.kind == "name":
            if kind.name in self.records:
                return "record"
            return "word" if kind.name != ANY and self.knows(kind.name) else None
        if kind.kind == "choice":
            forms = {_form_of(value) for value in kind.values}
            return forms.pop() if len(forms) == 1 else None
        return "number" if kind.kind == "integer" else kind.kind

    def _overlap(self, given: DataType, wanted: DataType, form: str) -> bool:
        """Return whether a value of one type may have the other type, for types of one form."""
        if form == "record":
            return given.name == wanted.name or self.records[given.name] == self.records[wanted.name]
        if form in {"list", "map"}:
            inside = given.inner, wanted.inner
            return None in inside or self.difference(inside[0], inside[1]) is None  # type: ignore[arg-type]
        if given.kind == wanted.kind == "choice":
            return not set(given.values).isdisjoint(wanted.values)
        if form == "number":
            return _bounds_overlap(given, wanted)
        return form != "word" or self._names_overlap(given.name, wanted.name)

    def _names_overlap(self, given: str, wanted: str) -> bool:
        schema = self.schema
        if schema is None or not {given, wanted} <= schema.types.keys():
            return True  # a word may be the name of an object, a plot or a condition
        return schema.is_a(given, wanted) or schema.is_a(wanted, given)


def inside_optional(kind: DataType) -> DataType:
    """Return the type of a value of an optional type that is set; any other type unchanged."""
    return kind.inner if kind.kind == "optional" and kind.inner is not None else kind


def _form_of(value: object) -> str:
    return "boolean" if isinstance(value, bool) else "word" if isinstance(value, str) else "number"


def _bounds_overlap(one: DataType, other: DataType) -> bool:
    least = [kind.least for kind in (one, other) if kind.least is not None]
    most = [kind.most for kind in (one, other) if kind.most is not None]
    return not least or not most or max(least) <= min(most)


def language_type(text: str, schema: Schema) -> str | None:
    """Return the type of a value for the checks of conditions; `None` if these know no such type."""
    kind = inside_optional(data_type(text))
    if kind.kind in {"number", "integer"}:
        return "number"
    if kind.kind == "boolean":
        return "boolean"
    if kind.kind == "name" and (kind.name == "text" or kind.name in schema.types):
        return kind.name
    return None

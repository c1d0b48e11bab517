"""Types of data in plots: numbers, texts, objects, enumerations, lists, maps, records, optional values (S2.21).

A type is written as text, e.g. `number from 0 to 100 in %`, `list of item`, `left | right` or `optional text`.
Values are plain JSON data, so that a store, a trace and another process have equal values.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Literal

from dsc.type_words import bound_text, brief, choice_text, choice_values, collapse_blanks, in_words, not_a_type
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.facts import GEOMETRY, MOST_NUMBERS
from knowledge_base.spelling import is_plain_name
from knowledge_base.user_objects import shown

Kind = Literal["number", "integer", "boolean", "name", "geometry", "choice", "list", "map", "optional"]
Records = Mapping[str, Mapping[str, str | None]]
"""The records by name: the type of each field as text; `None` accepts any plain data."""
NO_RECORDS: Records = {}
MOST_ELEMENTS = 10_000
"""The maximum number of elements in a list or map; a text has at most ten times as many characters."""
DEEPEST = 64
"""The maximum number of levels of a type, and of a value."""
_LONGEST_FOUND = 80
WORDS = ("text", "symbol", "condition", "plot")
"""Types of texts. Other names are types of the domain, whose values are names of objects, or records."""
_LEVELS = re.compile(r"(?:(?:list|map) of |optional )*")
_NUMBER = re.compile(r"(number|integer)( from \S+)?( to \S+)?( in \S.*)?")
_NOT_IN_NAMES = frozenset("[]<>,")
_TEXT = frozenset((str,))
_EXACT: Mapping[str, frozenset[type]] = {
    "number": frozenset((int, float)), "integer": frozenset((int,)), "boolean": frozenset((bool,)),
    **dict.fromkeys(WORDS, _TEXT), "plot": frozenset((str, dict)),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class DataType:
    """A type of data.

    Attributes:
        kind: the form of the type.
        name: for the kind `name`, the name of the type.
        inner: the type of the elements of a list or map, or of a given optional value.
        values: the values of a `choice`.
        least, most: bounds of a number, inclusive; `None` means no bound.
        unit: the unit of a number; empty without one.
        exact: classes of which each value has the type, so that most values need no `check`.
    """

    kind: Kind
    name: str = ""
    inner: DataType | None = None
    values: tuple[str | int | float | bool, ...] = ()
    least: float | None = None
    most: float | None = None
    unit: str = ""
    exact: frozenset[type] = field(default=frozenset(), init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        if self.least is None and self.most is None:
            found = _EXACT.get(self.name if self.kind == "name" else self.kind, frozenset())
            object.__setattr__(self, "exact", found)

    def __str__(self) -> str:
        """Return the type as `data_type` reads it."""
        match self.kind:
            case "name":
                return self.name
            case "list" | "map":
                return f"{self.kind} of {self.inner or ANY}"
            case "optional":
                return f"optional {self.inner or ANY}"
            case "choice":
                return " | ".join(map(choice_text, self.values)) + (" |" if len(self.values) == 1 else "")
            case _:
                least = "" if self.least is None else f" from {bound_text(self.least)}"
                most = "" if self.most is None else f" to {bound_text(self.most)}"
                return f"{self.kind}{least}{most}" + (f" in {self.unit}" if self.unit else "")

    def check(self, subject: str, value: Any, records: Records = NO_RECORDS, at: str = "") -> Any:
        """Return the value as plain data of this type: an integer for `integer`, and `None` for an unset optional.

        Whether an object of that name exists depends on the world, see `objects`.

        Args:
            subject: the owner of the value in messages, e.g. `'fetch.item'`.
            value: the value.
            records: the known records.
            at: the path of the value inside of the subject's value, e.g. `0.pose`.

        Raises:
            InputError: the value does not have the type; the message names the part that differs.
        """
        if at.count(".") > DEEPEST:
            raise InputError(f"{subject} has more than {DEEPEST} levels")
        if self.kind == "optional":
            return None if value is None or self.inner is None else self.inner.check(subject, value, records, at)
        if self.kind == "name" and self.name in records:
            return self._record(subject, value, records, at)
        where = f"{subject} at {at}" if at else subject
        if self.kind in {"list", "map"}:
            return self._elements(subject, where, value, records, at)
        return self._scalar(where, value)

    def _scalar(self, where: str, value: Any) -> Any:
        match self.kind:
            case "choice":
                return self._choose(where, value)
            case "boolean":
                self._require(isinstance(value, bool), where, value)
            case "geometry":
                numbers = isinstance(value, list | tuple) and 0 < len(value) <= MOST_NUMBERS
                self._require(numbers and all(map(_is_number, value)), where, value)
                return list(value)
            case "name":
                return self._word(where, value)
            case _:
                return self._number(where, value)
        return value

    def _elements(self, subject: str, where: str, value: Any, records: Records, at: str) -> Any:
        if self.kind == "list":
            self._require(isinstance(value, list | tuple), where, value)
            inside = enumerate(_require_size(where, value))
            return [self._inside(subject, one, records, _path(at, place)) for place, one in inside]
        self._require(isinstance(value, Mapping) and all(isinstance(key, str) for key in value), where, value)
        own = _require_size(where, value).items()
        return {key: self._inside(subject, one, records, _path(at, key)) for key, one in own}

    def _inside(self, subject: str, value: Any, records: Records, at: str) -> Any:
        return value if self.inner is None else self.inner.check(subject, value, records, at)

    def _choose(self, where: str, value: Any) -> Any:
        for one in self.values:
            if one == value and isinstance(one, bool) == isinstance(value, bool):
                return one
        message = f"{where} is one of {', '.join(map(choice_text, self.values))}, not {brief(value)}"
        raise InputError(message, found=str(value), valid=map(str, self.values))

    def _word(self, where: str, value: Any) -> Any:
        if self.name != ANY:
            self._require(isinstance(value, str) or (self.name == "plot" and isinstance(value, Mapping)), where, value)
            if isinstance(value, str):
                _require_size(where, value)
        return value

    def _record(self, subject: str, value: Any, records: Records, at: str) -> dict[str, Any]:
        fields = records[self.name]
        where = f"{subject} at {at}" if at else subject
        if not isinstance(value, Mapping):
            raise InputError(f"{where} is a {self.name} with {', '.join(fields)}, not {brief(value)}")
        for given in value:
            if given not in fields:
                message = f"{where} is a {self.name}, which has no field {shown(given)}"
                raise UnknownNameError(message, found=str(given), valid=fields)
        checked = {}
        for own, text in fields.items():
            wanted = None if text is None else data_type(text)
            one = value.get(own)
            if one is not None:
                checked[own] = one if wanted is None else wanted.check(subject, one, records, _path(at, own))
            elif wanted is None or wanted.kind != "optional":
                raise InputError(f"{where} is a {self.name}, and its field '{own}' is missing")
        return checked

    def _number(self, where: str, value: Any) -> Any:
        fits = _is_number(value) and (self.kind == "number" or not value % 1)
        fits = fits and (self.least is None or value >= self.least) and (self.most is None or value <= self.most)
        self._require(fits, where, value)
        return int(value) if self.kind == "integer" else value

    def _require(self, fits: bool, where: str, value: Any) -> None:  # noqa: FBT001
        if not fits:
            found = "and has no value" if value is None else f"not {brief(value)}"
            raise InputError(f"{where} is {in_words(str(self))}, {found}", found=str(value))


ANY = "any"
"""The type of any plain data."""


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < math.inf


def _require_size(where: str, value: Any) -> Any:
    most = MOST_ELEMENTS * (10 if isinstance(value, str) else 1)
    if len(value) > most:
        raise InputError(f"{where} has {len(value)} elements; at most {most} are possible")
    return value


@lru_cache(maxsize=4096)
def data_type(text: str) -> DataType:
    """Return the type that a text states.

    Raises:
        InputError: the text is not a type; the message names the form that is nearest.
    """
    words = collapse_blanks(text)
    levels = _LEVELS.match(words)
    if levels is not None and levels[0].count(" of ") + levels[0].count("optional ") > DEEPEST:
        raise InputError(f"a type has at most {DEEPEST} levels", found=words[:_LONGEST_FOUND])
    for kind in ("list", "map"):
        if words.startswith(f"{kind} of "):
            return DataType(kind, inner=_inner(words.removeprefix(f"{kind} of ")))
    if words.startswith("optional "):
        return DataType("optional", inner=data_type(words.removeprefix("optional ")))
    if "|" in words:
        return DataType("choice", values=choice_values(words))
    if words in {"boolean", GEOMETRY}:
        return DataType(words)  # type: ignore[arg-type]  # both are kinds
    if (number := _NUMBER.fullmatch(words)) is not None:
        return _number_type(words, *number.groups())
    if not is_plain_name(words) or not _NOT_IN_NAMES.isdisjoint(words):
        raise not_a_type(words)
    return DataType("name", name=words)


def _inner(text: str) -> DataType | None:
    return None if text == ANY else data_type(text)


def _number_type(text: str, kind: str, least: str | None, most: str | None, unit: str | None) -> DataType:
    try:
        low = None if least is None else float(least.removeprefix(" from "))
        high = None if most is None else float(most.removeprefix(" to "))
    except ValueError:
        raise InputError(
            f"'{text}' is not a type: a bound is a number, as in `{kind} from 0 to 5`", found=text
        ) from None
    if not all(math.isfinite(bound) for bound in (low, high) if bound is not None):
        raise InputError(f"'{text}' is not a type: a bound is a finite number", found=text)
    if low is not None and high is not None and not low <= high:
        raise InputError(f"'{text}' has no values: no number is {low:g} or more and {high:g} or less", found=text)
    unit = "" if unit is None else unit.removeprefix(" in ")
    return DataType("integer" if kind == "integer" else "number", least=low, most=high, unit=unit)


def check_all(
    subject: str, owner: str, values: dict[str, Any], declared: Mapping[str, str | None], records: Records
) -> None:
    """Convert the values in place to their declared types.

    Args:
        subject: the owner of a value in messages, with `{name}` and `{owner}`.
        owner: the name of the plot, event or skill that declares the types.
        values: the values by name.
        declared: the types by name; other values are unchanged.
        records: the known records.

    Raises:
        InputError: a value does not have its type.
    """
    for name, value in values.items():
        text = declared.get(name)
        if text is not None:
            wanted = data_type(text)
            if type(value) not in wanted.exact:
                values[name] = wanted.check(subject.format(name=name, owner=owner), value, records)


def names_in(wanted: DataType) -> Iterator[str]:
    """Yield the names that a type contains: types of the domain, records and words."""
    if wanted.kind == "name":
        yield wanted.name
    elif wanted.inner is not None:
        yield from names_in(wanted.inner)


def objects_in(wanted: DataType, value: Any, records: Records, at: str = "") -> Iterator[tuple[str, Any, str]]:
    """Yield path, value and type of each part of a checked value that is the name of an object."""
    if value is None:
        return
    if wanted.kind == "name" and wanted.name in records:
        for own, text in records[wanted.name].items():
            if text is not None:
                yield from objects_in(data_type(text), value.get(own), records, _path(at, own))
    elif wanted.kind == "name":
        if wanted.name not in {*WORDS, ANY}:
            yield at, value, wanted.name
    elif wanted.inner is not None and wanted.kind == "optional":
        yield from objects_in(wanted.inner, value, records, at)
    elif wanted.inner is not None:
        inside = value.items() if isinstance(value, Mapping) else enumerate(value)
        for key, one in inside:
            yield from objects_in(wanted.inner, one, records, _path(at, key))


def _path(at: str, key: object) -> str:
    return f"{at}.{key}" if at else str(key)

"""Types of the data that conditions, terms and effects read: the counterpart of the values in a run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType

from dsc.data_types import DataType, Records, data_type
from dsc.model.data_forms import DataReader
from dsc.validation.subject import Types
from knowledge_base.errors import InputError, Place, UnknownNameError
from knowledge_base.language.checking.binding import unbound_error
from knowledge_base.language.syntax.expression import Constant, Term, Variable

_COLLECTIONS = ("list", "map", "geometry")


class TypeReader:
    """The types of a plot's variables and of an event's attributes, as a `DataReader`.

    Args:
        scope: the types by name; `None` means any type.
        records: the records by name.

    Attributes:
        read: the types of the parts of values that have been read, by the names of their variables.
    """

    def __init__(self, scope: Types, records: Records, own: Mapping[str, str] = MappingProxyType({})) -> None:
        self._scope = scope
        self._records = records
        self._own = own
        self._used: set[str] = set()
        self.read: dict[str, str | None] = {}

    def term(self, variable: Variable) -> Term:
        """See `DataReader`; the variable of a part is unchanged, and its type is noted."""
        kind = self._kind_if_set(variable.name, variable.place)
        if kind is not None and (kind.kind in _COLLECTIONS or kind.name in self._records):
            message = f"'?{variable.name}' is of type {kind}, and a condition reads its parts"
            raise InputError(message, place=variable.place, found=variable.name)
        renamed = self._name_in_scope(variable.name)
        if renamed not in self._scope and self.leads_to_part(variable.name):
            self.read[renamed] = None if kind is None else str(kind)
        return Variable(renamed, place=variable.place)

    def kind(self, name: str, place: Place | None = None) -> str | None:
        """Return the type of a variable or of a part of its value; `None` if it is unknown.

        Raises:
            UnknownNameError: a record has no such field, or the value has no parts.
        """
        found = self._kind(name, place)
        return None if found is None else str(found)

    def is_collection(self, name: str) -> bool:
        """See `DataReader`."""
        kind = self._kind_if_set(name)
        return kind is not None and kind.kind in _COLLECTIONS

    def size(self, name: str) -> Term:
        """See `DataReader`."""
        self._kind(name)
        return Constant(0)

    def is_set(self, name: str) -> bool:
        """See `DataReader`."""
        self._require(name)
        return True

    def elements(self, name: str, variable: str) -> Iterator[DataReader]:
        """See `DataReader`; one reader stands for all elements."""
        self._require(name)
        kind = self._kind_if_set(name)
        if kind is not None and kind.kind not in _COLLECTIONS:
            raise InputError(f"'?{name}' is of type {kind}, and has no elements", found=name)
        element = None if kind is None or kind.inner is None else str(kind.inner)
        if kind is not None and kind.kind != "list":
            element = "text" if kind.kind == "map" else "number"
        # Two quantifiers may give one name to elements of different types.
        inside = f"{name}.{variable}" if variable in self._used or variable in self._scope else variable
        self._used.add(variable)
        self.read[inside] = element
        yield self._inside({**self._scope, inside: element}, {**self._own, variable: inside})

    def without(self, names: frozenset[str]) -> DataReader:
        """See `DataReader`."""
        scope = {name: kind for name, kind in self._scope.items() if name not in names}
        own = {name: inside for name, inside in self._own.items() if name not in names}
        return self._inside(scope, own)

    def _inside(self, scope: Types, own: Mapping[str, str]) -> TypeReader:
        inner = TypeReader(scope, self._records, own)
        inner.read, inner._used = self.read, self._used
        return inner

    def leads_to_part(self, name: str) -> bool:
        """Return whether a name begins with that of a variable of the scope."""
        head = self._name_in_scope(name)
        while head not in self._scope:
            head, dot, _ = head.rpartition(".")
            if not dot:
                return False
        return True

    def _require(self, name: str) -> None:
        if not self.leads_to_part(name):
            raise unbound_error(name, None, self._scope)

    def _name_in_scope(self, name: str) -> str:
        head, dot, rest = name.partition(".")
        return f"{self._own[head]}{dot}{rest}" if head in self._own else name

    def _kind_if_set(self, name: str, place: Place | None = None) -> DataType | None:
        """Return the type of a value that is set."""
        kind = self._kind(name, place)
        return kind.inner if kind is not None and kind.kind == "optional" else kind

    def _kind(self, name: str, place: Place | None = None) -> DataType | None:
        name = self._name_in_scope(name)
        head, parts = name, list[str]()
        while head not in self._scope:
            if "." not in head:
                return None  # a variable of a quantifier, or an unbound one, which the language reports
            head, _, part = head.rpartition(".")
            parts.insert(0, part)
        text = self._scope[head]
        kind = None if text is None else data_type(text)
        for part in parts:
            kind = None if kind is None else self._part(f"?{head}", kind, part, place)
            head = f"{head}.{part}"
        return kind

    def _part(self, name: str, kind: DataType, part: str, place: Place | None) -> DataType | None:
        if kind.kind == "optional" and kind.inner is not None:
            return self._part(name, kind.inner, part, place)
        if kind.kind == "map" or (kind.kind == "list" and part.isdecimal()):
            return kind.inner
        if kind.kind == "geometry" and part.isdecimal():
            return data_type("number")
        fields = self._records.get(kind.name, {})
        if part not in fields:
            message = f"'{name}' is of type {kind}, and has no part '{part}'"
            raise UnknownNameError(message, place=place, found=part, valid=fields)
        text = fields[part]
        return None if text is None else data_type(text)

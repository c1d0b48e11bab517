"""Forms of conditions, terms and effects that read lists, maps, records and optional values of plots (S2.21).

- `?event.items.0.pose` is a part of a value: an element of a list by its number, of a map or record by its name.
- `(size ?items)` is the number of elements of a list or map.
- `(in ?x ?items)` is true if a list has the element, or a map the key.
- `(forall (?o - ?items) ...)` and `(exists (?o - ?items) ...)` go through the elements of a list or the keys of a map.
- `(is-set ?x)` is true if an optional value is given.
- `(list ?a 3)` and `(record item ?a score 0.5)` are values; in YAML also `[?a, 3]` and `{item: ?a, score: 0.5}`.

Plain forms replace these before an evaluation. For other values, `in` is a predicate and `size` a function.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any, Protocol

from knowledge_base.errors import InputError, Place, UnknownNameError
from knowledge_base.language.syntax.effect import Add, AllOf, Delete, Effect, ForEach, Form, When, parts_of_form
from knowledge_base.language.syntax.expression import (
    TRUE,
    And,
    Atom,
    Call,
    Comparison,
    Constant,
    Exists,
    Expression,
    Forall,
    Imply,
    Not,
    Or,
    Term,
    TypedVariable,
    Variable,
)

_FALSE = Or(())
PLAIN: dict[int, Form] = {}
"""Forms that read no data, by their identity: a test that costs no call, for the conditions of most plots."""
_MOST_PLAIN = 4096


def literal_parts(term: Term) -> dict[str, Term] | None:
    """Return the parts of a list by number, or of a record by name; `None` for another term.

    Raises:
        InputError: a record has a part without a name.
    """
    match term:
        case Call("list", args):
            return {str(number): part for number, part in enumerate(args)}
        case Call("record", args):
            names = [one.value if isinstance(one, Constant) else None for one in args[::2]]
            if len(args) % 2 or not all(isinstance(name, str) for name in names):
                raise InputError("a record has names and values: (record item ?a score 0.5)", place=term.place)
            return dict(zip(map(str, names), args[1::2], strict=True))
        case _:
            return None


def literal(parts: Mapping[str, Term]) -> Call:
    """Return the term for a record of these parts."""
    return Call("record", tuple(one for name, part in parts.items() for one in (Constant(name), part)))


def literal_value(term: Term, value_of: Callable[[Term], Any]) -> Any:
    """Return the value of a list or record; `value_of` returns the values of its parts."""
    found = {name: value_of(part) for name, part in (literal_parts(term) or {}).items()}
    return list(found.values()) if isinstance(term, Call) and term.function == "list" else found


def is_literal(term: Term) -> bool:
    """Return whether a term is a list or record."""
    return isinstance(term, Call) and term.function in ("list", "record")


def reads_data(form: Form) -> bool:
    """Return whether a condition, term or effect may contain one of these forms; `PLAIN` keeps those that do not."""
    if PLAIN.get(id(form)) is form:
        return False
    reads = _reads_data(form)
    if not reads:
        if len(PLAIN) >= _MOST_PLAIN:
            PLAIN.clear()
        PLAIN[id(form)] = form
    return reads


def _reads_data(form: Form) -> bool:
    match form:
        case Variable(name):
            return name.count(".") > name.startswith("event.")
        case Atom("in", (_, Variable())) | Atom("is-set", (Variable(),)) | Call("size", (Variable(),)):
            return True
        case Exists(variables, _) | Forall(variables, _) | ForEach(variables, _) if any(map(list_of, variables)):
            return True
        case _:
            return any(map(_reads_data, parts_of_form(form)))


def list_of(variable: TypedVariable) -> str | None:
    """Return the name of the list whose elements a quantified variable goes through; `None` for objects."""
    return next((name[1:] for name in variable.types if name.startswith("?")), None)


class DataReader(Protocol):
    """The data that the forms read: values in a run, or types in a check.

    Each method raises `InputError` for a name that leads to no value, or to one of another kind.
    """

    def term(self, variable: Variable) -> Term:
        """Return the plain term for a variable: a constant for a part of a value, or the variable itself."""
        ...

    def is_collection(self, name: str) -> bool:
        """Return whether a name leads to a list or map."""
        ...

    def size(self, name: str) -> Term:
        """Return the number of elements of a list or map."""
        ...

    def is_set(self, name: str) -> bool:
        """Return whether a name leads to a given value."""
        ...

    def elements(self, name: str, variable: str) -> Iterator[DataReader]:
        """Yield a reader for each element, which is the value of `variable`."""
        ...

    def without(self, names: frozenset[str]) -> DataReader:
        """Return a reader in whose scope the names are objects of a quantifier."""
        ...


def plain_term(term: Term, data: DataReader) -> Term:
    """Return the term without these forms; errors as for `DataReader`."""
    match term:
        case Variable():
            return data.term(term)
        case Call("size", (Variable(name),)) if data.is_collection(name):
            return data.size(name)
        case Constant():
            return term
        case _:
            return replace(term, args=tuple(plain_term(arg, data) for arg in term.args))


def plain_condition(e: Expression, data: DataReader) -> Expression:  # noqa: PLR0911  # a table by form
    """Return the condition without these forms; errors as for `DataReader`."""
    match e:
        case Atom("is-set", (Variable(name),)):
            return TRUE if data.is_set(name) else _FALSE
        case Atom("in", (first, Variable(name))) if data.is_collection(name):
            return _membership(e, plain_term(first, data), name, data)
        case Exists() | Forall():
            return _quantified_condition(e, data)
        case And(parts) | Or(parts):
            return replace(e, parts=tuple(plain_condition(part, data) for part in parts))
        case Not(body):
            return replace(e, body=plain_condition(body, data))
        case Imply(premise, conclusion):
            return replace(e, premise=plain_condition(premise, data), conclusion=plain_condition(conclusion, data))
        case Comparison(_, left, right):
            return replace(e, left=plain_term(left, data), right=plain_term(right, data))
        case _:
            return replace(e, args=tuple(plain_term(arg, data) for arg in e.args))


def _membership(e: Atom, wanted: Term, name: str, data: DataReader) -> Expression:
    element = Variable("element", place=e.place)
    each = (one.term(element) for one in data.elements(name, "element"))
    return Or(tuple(Comparison("=", wanted, one, place=e.place) for one in each))


def _quantified_condition(e: Exists | Forall, data: DataReader) -> Expression:
    found = _through_list(e.variables)
    if found is None:
        return replace(e, body=plain_condition(e.body, data.without(frozenset(v.name for v in e.variables))))
    variable, name, rest = found
    inside = replace(e, variables=rest) if rest else e.body
    parts = tuple(plain_condition(inside, one) for one in data.elements(name, variable.name))
    return And(parts, place=e.place) if isinstance(e, Forall) else Or(parts, place=e.place)


def plain_effect(effect: Effect, data: DataReader) -> Effect:
    """Return the effect without these forms; errors as for `DataReader`."""
    match effect:
        case Add(atom) | Delete(atom):
            return replace(effect, atom=replace(atom, args=tuple(plain_term(arg, data) for arg in atom.args)))
        case AllOf(parts):
            return replace(effect, parts=tuple(plain_effect(part, data) for part in parts))
        case When(condition, inner):
            return replace(effect, condition=plain_condition(condition, data), effect=plain_effect(inner, data))
        case ForEach(variables, inner):
            found = _through_list(variables)
            if found is None:
                own = frozenset(v.name for v in variables)
                return replace(effect, effect=plain_effect(inner, data.without(own)))
            variable, name, rest = found
            inside = replace(effect, variables=rest) if rest else inner
            return AllOf(tuple(plain_effect(inside, one) for one in data.elements(name, variable.name)))
        case _:
            call = replace(effect.call, args=tuple(plain_term(arg, data) for arg in effect.call.args))
            return replace(effect, call=call, value=plain_term(effect.value, data))


def _through_list(
    variables: tuple[TypedVariable, ...],
) -> tuple[TypedVariable, str, tuple[TypedVariable, ...]] | None:
    """Return the first variable that goes through a list, the list, and the other variables."""
    for variable in variables:
        if (name := list_of(variable)) is not None:
            return variable, name, tuple(other for other in variables if other is not variable)
    return None


class Values:
    """The values of a plot's variables and of an event's attributes, as a `DataReader`.

    Args:
        bindings: the values by name.
        own: the names whose values are elements of a list.
    """

    def __init__(self, bindings: Mapping[str, Any], own: frozenset[str] = frozenset()) -> None:
        self._bindings = bindings
        self._own = own

    def term(self, variable: Variable) -> Term:
        """See `DataReader`."""
        name = variable.name
        if name not in self._own and (name in self._bindings or "." not in name):
            return variable
        value = self.value(name, variable.place)
        if not isinstance(value, str | int | float | bool):
            found = "has no value" if value is None else "is a list, map or record, and a condition reads its parts"
            raise InputError(f"'?{name}' {found}", place=variable.place, found=name)
        return Constant(value, quoted=isinstance(value, str), place=variable.place)

    def value(self, name: str, place: Place | None = None) -> Any:
        """Return the value of a variable, or the part of a value that its name leads to; an unset part is `None`.

        Raises:
            UnknownNameError: there is no such variable, or the value has no such part.
        """
        if name in self._bindings:
            return self._bindings[name]
        head, parts = name, list[str]()
        while "." in head:
            head, _, part = head.rpartition(".")
            parts.insert(0, part)
            if head in self._bindings:
                return _part(f"?{head}", self._bindings[head], parts)
        raise UnknownNameError(f"variable '?{name}' has no value here", place=place, found=name, valid=self._bindings)

    def is_collection(self, name: str) -> bool:
        """See `DataReader`."""
        try:
            return isinstance(self.value(name), list | Mapping)
        except UnknownNameError:  # a variable of a quantifier
            return False

    def size(self, name: str) -> Term:
        """See `DataReader`."""
        return Constant(len(self.value(name)))

    def is_set(self, name: str) -> bool:
        """See `DataReader`."""
        return self.value(name) is not None

    def elements(self, name: str, variable: str) -> Iterator[DataReader]:
        """See `DataReader`."""
        found = self.value(name)
        if not isinstance(found, list | Mapping):
            raise InputError(f"'?{name}' is {found!r}, and has no elements", found=name)
        for one in found:
            yield Values({**self._bindings, variable: one}, self._own | {variable})

    def without(self, names: frozenset[str]) -> DataReader:
        """See `DataReader`."""
        return Values({name: value for name, value in self._bindings.items() if name not in names}, self._own - names)


def _part(name: str, value: Any, parts: list[str]) -> Any:
    for part in parts:
        if isinstance(value, list) and part.isdecimal() and int(part) < len(value):
            value = value[int(part)]
        elif isinstance(value, Mapping):
            value = value.get(part)
        elif value is not None:
            has = f"has {len(value)} elements" if isinstance(value, list) else f"is {value!r}"
            raise UnknownNameError(f"'{name}' {has}, and no part '{part}'", found=part)
        name = f"{name}.{part}"
    return value

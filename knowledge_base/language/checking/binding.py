"""Free variables of conditions: those with values found by the condition, those that must be bound, and errors.

An atom finds values, unless its predicate is computed; `not`, `imply`, `forall` and comparisons only test values. A
variable that occurs in no such atom has no answers to list (safe queries in the sense of Datalog).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from knowledge_base.errors import InputError, Place, SchemaError, UnknownNameError
from knowledge_base.facts import Value
from knowledge_base.language.checking.vocabulary import VALUE_TYPES, Vocabulary
from knowledge_base.language.syntax.expression import (
    And,
    Atom,
    Call,
    Exists,
    Expression,
    Or,
    Term,
    TypedVariable,
    Variable,
    free_variables,
    parts_of,
    variable_place,
)

_NONE: frozenset[str] = frozenset()


def found_variables(e: Expression, schema: Vocabulary, bound: frozenset[str] = _NONE) -> frozenset[str]:
    """Return the free variables of `e` that `e` finds values for, if the variables in `bound` have values already."""
    match e:
        case Atom(name, _) if name in schema.computed:
            return _NONE
        case Atom(_, args):
            return frozenset(a.name for a in args if isinstance(a, Variable))
        case And(parts):
            return _NONE.union(*(found_variables(p, schema, bound) for p in parts))
        case Or(parts) if parts:
            branches = [found_variables(p, schema, bound) | bound for p in parts]
            return branches[0].intersection(*branches[1:])
        case Exists(variables, body):
            own = {v.name for v in variables}
            return found_variables(body, schema, bound | own) - own
        case _:
            return _NONE


def object_variables(
    variables: tuple[TypedVariable, ...], body: Expression, schema: Vocabulary
) -> tuple[TypedVariable, ...]:
    """Return the variables of `(exists variables body)` whose choices are objects.

    A variable without a type that `body` finds in rows of a live relation, or as text or number in facts, has
    the values there.
    """
    found = row_variables(variables, body, schema)
    return tuple(v for v in variables if v.name not in found) if found else variables


def row_variables(variables: tuple[TypedVariable, ...], body: Expression, schema: Vocabulary) -> frozenset[str]:
    """Return the variables of `(exists variables body)` whose choices are values in rows, see `object_variables`."""
    untyped = frozenset(v.name for v in variables if not v.types)
    rows = untyped.intersection(_in_rows(body, schema)) if untyped else untyped
    return rows.intersection(found_variables(body, schema)) if rows else rows


def _in_rows(e: Expression | Term, schema: Vocabulary) -> Iterator[str]:
    """Yield the variables that are arguments of live relations, or texts, numbers and truth values in facts."""
    for part in parts_of(e):
        yield from _in_rows(part, schema)
    if isinstance(e, Atom) and not schema.is_type(e.predicate, len(e.args)):
        known = schema.predicate(e.predicate, e.place)
        for parameter, arg in zip(known.parameters, e.args, strict=False):  # `check` compares the number of arguments
            if isinstance(arg, Variable) and (known.live or not set(VALUE_TYPES).isdisjoint(parameter.types)):
                yield arg.name


def only_tested(e: Expression, schema: Vocabulary, bound: frozenset[str] = _NONE) -> frozenset[str]:
    """Return the free variables of `e` that are not in `bound` and that no part of `e` finds values for."""
    return free_variables(e) - found_variables(e, schema, bound) - bound


def check_answers(e: Expression, bound: frozenset[str], schema: Vocabulary) -> None:
    """Raise `InputError` if the query `e` can only test one of its free variables that are not in `bound`."""
    for name in sorted(only_tested(e, schema, bound)):
        kind = next(_types(e, name, schema), "object")
        raise InputError(
            f"the variable '?{name}' occurs only under 'not', in a comparison, computed predicate or part of an "
            f"'or', and finds no values; name its type, e.g. ({kind} ?{name})",
            place=variable_place(e, name),
        )


def _types(e: Expression | Term, name: str, schema: Vocabulary) -> Iterator[str]:
    """Yield the types of objects that the variable must have, according to its places in `e`."""
    for part in parts_of(e):
        yield from _types(part, name, schema)
    if isinstance(e, Atom) and schema.is_type(e.predicate, len(e.args)):
        if e.args == (Variable(name),):
            yield e.predicate
    elif isinstance(e, Atom | Call):
        known = schema.function(e.function) if isinstance(e, Call) else schema.predicate(e.predicate)
        for parameter, arg in zip(known.parameters, e.args, strict=False):  # `check` compares the number of arguments
            if isinstance(arg, Variable) and arg.name == name:
                yield from (t for t in parameter.types if t in schema.types)


def check_bound(e: Expression | Term, bindings: Mapping[str, Value]) -> None:
    """Raise an error unless all free variables of `e` have values that may be arguments of facts.

    Raises:
        UnknownNameError: a variable has no value.
        SchemaError: the value of a variable is a geometry.
    """
    for name in sorted(free_variables(e)):
        if isinstance(bindings.get(name), tuple):
            hint = "write it into the condition: (geometry ...)"
            raise SchemaError(f"'?{name}' cannot be a geometry; {hint}", place=variable_place(e, name))
        if not isinstance(bindings.get(name), Value):
            known = [one for one, value in bindings.items() if isinstance(value, Value)]
            raise unbound_error(name, variable_place(e, name), known)


def unbound_error(name: str, place: Place | None, bound: Iterable[str]) -> UnknownNameError:
    """Return the error for a free variable in a condition that must be true or false."""
    said, valid = f"the variable '?{name}' is not bound", [f"?{known}" for known in bound]
    if "." not in name:  # `?event.item` is a part of a value, which no quantifier binds
        said += f"; to ask whether there is one, use (exists (?{name}) ...)"
    return UnknownNameError(said, place=place, found=f"?{name}", valid=valid)

"""Declarations that the language reads: types, constants, predicates, functions. A `Schema` is a `Vocabulary`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from knowledge_base.errors import Place, SchemaError
from knowledge_base.facts import Content
from knowledge_base.language.syntax.expression import Atom, Term, TypedVariable

ROOT_TYPE = "object"
VALUE_TYPES = ("number", "text", "boolean")
"""Types of arguments that are values, not things; they have no subtypes, and no quantifier ranges over them."""

Read = Term | Atom
"""An input of a computed predicate: the value of a term, or the truth of an atom."""


@dataclass(frozen=True, slots=True)
class Signature:
    """A predicate's or function's name and the parameters it takes, in order.

    `result` is the type of a function's value, one of `UNSET`; a predicate has none.
    """

    name: str
    parameters: tuple[TypedVariable, ...] = ()
    result: str | None = None
    place: Place | None = field(default=None, compare=False, repr=False)

    @property
    def arity(self) -> int:
        """The number of arguments it takes."""
        return len(self.parameters)

    def __str__(self) -> str:
        """As declared: `(on ?a - item ?b - place)`, `(label ?a - item) - text`."""
        typed = (f"?{p.name} - {' or '.join(p.types or (ROOT_TYPE,))}" for p in self.parameters)
        result = "" if self.result in (None, "number") else f" - {self.result}"
        return "(" + " ".join([self.name, *typed]) + ")" + result

    def means(self, other: Signature) -> bool:
        """Whether both take the same types in the same order and have one result; parameters may have other names."""
        mine, others = ([p.types for p in s.parameters] for s in (self, other))
        return mine == others and self.result == other.result


class Computing(Protocol):
    """A predicate that is computed from its inputs."""

    @property
    def name(self) -> str:
        """The name."""

    @property
    def parameters(self) -> tuple[TypedVariable, ...]:
        """The parameters."""

    @property
    def reads(self) -> tuple[Read, ...]:
        """Its inputs, over the parameters."""

    def inputs(self, args: tuple[Term, ...]) -> tuple[Read, ...]:
        """The inputs for the arguments `args`."""

    def refused(self, place: Place | None = None) -> SchemaError:
        """The error for asserting, retracting or watching it."""

    def judge(self, values: Sequence[object]) -> bool:
        """The truth for these inputs.

        Raises:
            InputError: it cannot be computed.
        """


class Vocabulary(Protocol):
    """The types, constants, predicates and functions that texts may name; equality is identity."""

    @property
    def types(self) -> Mapping[str, str | None]:
        """Each type's parent."""

    @property
    def constants(self) -> Mapping[str, str]:
        """Things that every world has, with their types."""

    @property
    def predicates(self) -> Mapping[str, Signature]:
        """The predicates whose facts are asserted."""

    @property
    def functions(self) -> Mapping[str, Signature]:
        """The functions, by name."""

    @property
    def functional(self) -> frozenset[str]:
        """The predicates whose last argument depends on the others."""

    @property
    def computed(self) -> Mapping[str, Computing]:
        """The predicates that are computed."""

    def is_a(self, type_name: str, ancestor: str) -> bool:
        """Whether everything of type `type_name` is of type `ancestor`; a type is its own ancestor."""

    def fits(self, type_name: str, wanted: Iterable[str]) -> bool:
        """Whether `type_name` is one of the `wanted` types; none wanted means any object."""

    def fitting(self, wanted: tuple[str, ...]) -> frozenset[str]:
        """All types that fit the `wanted` ones."""

    def subtypes(self, type_name: str) -> tuple[str, ...]:
        """`type_name` and all types below it, in the order declared."""

    def require_type(self, name: str, place: Place | None = None) -> None:
        """Raise `UnknownNameError` unless `name` is a type of things."""

    def require_argument_type(self, name: str, place: Place | None = None) -> None:
        """Raise `UnknownNameError` unless `name` is a type of things or of values."""

    def is_type(self, name: str, arity: int) -> bool:
        """Whether an atom of that name and number of arguments tests a type."""

    def predicate(self, name: str, place: Place | None = None) -> Signature:
        """The predicate of that name, which may be a computed one.

        Raises:
            UnknownNameError: there is none.
            SchemaError: it is a function.
        """

    def told(self, name: str, place: Place | None = None) -> Signature:
        """The predicate of that name, if its facts can be asserted; errors as `predicate`, and for a computed one."""

    def function(self, name: str, place: Place | None = None) -> Signature:
        """The function of that name.

        Raises:
            UnknownNameError: there is none.
        """

    def result(self, function: str, place: Place | None = None) -> str:
        """The type of the function's value; raises `UnknownNameError` as `function`."""

    def unset(self, function: str) -> Content:
        """The value of the function where it is not set; raises `UnknownNameError` as `function`."""

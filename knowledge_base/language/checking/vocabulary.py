"""Declarations that the language reads: types, constants, predicates, functions. A `Schema` is a `Vocabulary`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from knowledge_base.errors import Place, SchemaError
from knowledge_base.facts import Content
from knowledge_base.language.syntax.expression import Atom, Expression, Term, TypedVariable

ROOT_TYPE = "object"
VALUE_TYPES = ("number", "text", "boolean")
"""Types of arguments that are values, not objects; these types have no subtypes, and quantifiers exclude them."""

Read = Term | Atom
"""An input of a computed predicate: the value of a term, or the truth of an atom."""


def _alternatives(parameter: TypedVariable) -> str:
    return " or ".join(parameter.types or (ROOT_TYPE,))


@dataclass(frozen=True, slots=True)
class Signature:
    """The name of a predicate or function, with its parameters in order.

    Attributes:
        name: the name.
        parameters: the parameters.
        result: the type of a function's value, one of `UNSET`; `None` for a predicate.
        place: place of the declaration.
        live: whether a running program provides the facts; a name without quotes is then also a text.
        kind: the kind of its arcs: the name of the domain, or of the fragment of a domain, that declares it (S4.17).
    """

    name: str
    parameters: tuple[TypedVariable, ...] = ()
    result: str | None = None
    place: Place | None = field(default=None, compare=False, repr=False)
    live: bool = False
    kind: str = field(default="", compare=False)

    @property
    def arity(self) -> int:
        """Number of parameters."""
        return len(self.parameters)

    def __str__(self) -> str:
        """Return the declaration as text: `(on ?a - item ?b - place)`, `(label ?a - item) - text`."""
        typed = (f"?{p.name}{'' if self.live else f' - {_alternatives(p)}'}" for p in self.parameters)
        result = "" if self.result in (None, "number") else f" - {self.result}"
        return "(" + " ".join([self.name, *typed]) + ")" + result

    def means(self, other: Signature) -> bool:
        """Return whether both have the same types of parameters in the same order, and the same result.

        The names of the parameters may differ.
        """
        mine, others = ([p.types for p in s.parameters] for s in (self, other))
        return mine == others and self.result == other.result


class Computing(Protocol):
    """A predicate whose truth is computed from its inputs."""

    @property
    def name(self) -> str:
        """Name of the predicate."""

    @property
    def parameters(self) -> tuple[TypedVariable, ...]:
        """Parameters of the predicate."""

    @property
    def reads(self) -> tuple[Read, ...]:
        """Inputs of the predicate, as terms and atoms over the parameters."""

    def inputs(self, args: tuple[Term, ...]) -> tuple[Read, ...]:
        """Return the inputs for the arguments `args`."""

    def refused(self, place: Place | None = None) -> SchemaError:
        """Return the error for asserting, retracting or watching the predicate."""

    def judge(self, values: Sequence[object]) -> bool:
        """Return the truth of the predicate for these input values.

        Raises:
            InputError: the truth cannot be computed.
        """


class Vocabulary(Protocol):
    """The types, constants, predicates and functions that texts may use; equality is identity."""

    @property
    def types(self) -> Mapping[str, str | None]:
        """Name to parent of each type."""

    @property
    def constants(self) -> Mapping[str, str]:
        """Objects that every world contains, with their types."""

    @property
    def predicates(self) -> Mapping[str, Signature]:
        """Predicates with asserted facts, by name."""

    @property
    def functions(self) -> Mapping[str, Signature]:
        """Functions by name."""

    @property
    def functional(self) -> frozenset[str]:
        """Predicates whose last argument depends on the other arguments."""

    @property
    def computed(self) -> Mapping[str, Computing]:
        """Computed predicates by name."""

    def expanded(self, e: Expression) -> Expression:
        """Return the condition with the definitions of derived predicates; recursive predicates stay."""

    def require_defined(self, e: Expression) -> None:
        """Raise `SchemaError` if the condition reads a recursive derived predicate."""

    def is_a(self, type_name: str, ancestor: str) -> bool:
        """Return whether `ancestor` is `type_name` or one of its ancestors."""

    def fits(self, type_name: str, wanted: Iterable[str]) -> bool:
        """Return whether `type_name` is one of the `wanted` types or their subtypes.

        An empty `wanted` accepts any object.
        """

    def fitting(self, wanted: tuple[str, ...]) -> frozenset[str]:
        """Return all types that match the `wanted` types."""

    def subtypes(self, type_name: str) -> tuple[str, ...]:
        """Return `type_name` and all types below it, in the order of their declaration."""

    def require_type(self, name: str, place: Place | None = None) -> None:
        """Raise `UnknownNameError` unless `name` is a type of objects."""

    def require_argument_type(self, name: str, place: Place | None = None) -> None:
        """Raise `UnknownNameError` unless `name` is a type of objects or of values."""

    def is_type(self, name: str, arity: int) -> bool:
        """Return whether an atom with that name and number of arguments tests a type."""

    def predicate(self, name: str, place: Place | None = None) -> Signature:
        """Return the predicate of that name, which may be a computed predicate.

        Raises:
            UnknownNameError: the predicate is not declared.
            SchemaError: a function or a type has that name.
        """

    def told(self, name: str, place: Place | None = None) -> Signature:
        """Return the predicate of that name if its facts can be asserted.

        Errors as for `predicate`; a computed predicate is a `SchemaError`.
        """

    def function(self, name: str, place: Place | None = None) -> Signature:
        """Return the function of that name.

        Raises:
            UnknownNameError: the function is not declared.
        """

    def result(self, function: str, place: Place | None = None) -> str:
        """Return the type of the function's value; errors as for `function`."""

    def unset(self, function: str) -> Content:
        """Return the value of the function before the first assignment; errors as for `function`."""

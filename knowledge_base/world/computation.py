"""Computed predicates: Python functions of facts and values, e.g. `(near ?a ?b)` of two positions.

A computed predicate declares the facts and values that it reads. An installed condition is evaluated again when one of
them changes, and only then.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from graphlib import CycleError, TopologicalSorter
from typing import Any, Generic, ParamSpec

from knowledge_base.errors import InputError, Place, SchemaError, described, text_of
from knowledge_base.language.checking.vocabulary import Read
from knowledge_base.language.syntax.expression import Atom, Call, Term, TypedVariable, free_variables, substitute
from knowledge_base.language.syntax.text import parse_term, to_text
from knowledge_base.pddl.domain_text import parse_declaration

MOST_NESTED = 8
"""Most computed predicates that read one through the other; each multiplies the cost of the first."""

_Inputs = ParamSpec("_Inputs")
_SOURCE = "@computed"


@dataclass(frozen=True, slots=True, eq=False)
class Computed(Generic[_Inputs]):
    """A predicate with its truth from a function of inputs; made by `computed`.

    It can be called like the function. A read such as `(clean ?a)` is a function's value until a schema resolves it as
    a predicate.

    Attributes:
        name: the predicate's name.
        parameters: its parameters.
        reads: its inputs, over the parameters.
        function: takes their values in order and returns the truth.
        place: the place of its declaration.
    """

    name: str
    parameters: tuple[TypedVariable, ...]
    reads: tuple[Read, ...]
    function: Callable[_Inputs, bool]
    place: Place | None = field(default=None, repr=False)

    def __call__(self, *args: _Inputs.args, **kwargs: _Inputs.kwargs) -> bool:
        """Call the function."""
        return self.function(*args, **kwargs)

    def inputs(self, args: tuple[Term, ...]) -> tuple[Read, ...]:
        """Return its inputs for the arguments `args`."""
        given = {p.name: arg for p, arg in zip(self.parameters, args, strict=True)}
        return tuple(substitute(read, given) for read in self.reads)

    def resolved(self, predicates: Callable[[str, int], bool]) -> Computed[_Inputs]:
        """Return the same with resolved reads.

        Args:
            predicates: tells whether a name with a number of arguments is a predicate or type.
        """
        return replace(self, reads=tuple(_resolved(read, predicates) for read in self.reads))

    def refused(self, place: Place | None = None) -> SchemaError:
        """Return the error for asserting, retracting or watching it."""
        inputs = ", ".join(map(to_text, self.reads)) or "nothing"
        return SchemaError(
            f"'{self.name}' is computed and has no facts; tell and watch its inputs: {inputs}",
            place=place,
        )

    def judge(self, values: Sequence[object]) -> bool:
        """Return its truth for these inputs.

        Raises:
            InputError: the function raised an exception, or did not return a truth value.
        """
        function: Callable[..., object] = self.function
        try:
            truth = function(*values)
        except (Exception, SystemExit, GeneratorExit) as error:  # none of them may end the program
            raise InputError(described(error)) from error
        if type(truth) is not bool:
            raise InputError(f"true or false is expected, and its function gave {text_of(truth, repr)}")
        return truth


def computed(declaration: str, *, reads: Sequence[str] = ()) -> Callable[[Callable[_Inputs, bool]], Computed[_Inputs]]:
    """Make a function a predicate; `Schema.with_computed` declares it.

    The function must depend on its inputs alone; other changes have no effect on conditions.

    Args:
        declaration: the predicate as PDDL declares it: `(near ?a ?b - thing)`.
        reads: for each argument of the function a term, e.g. `(x ?a)` for its value, or an atom, e.g. `(clean ?a)` for
            its truth. Their variables are the predicate's parameters.

    Raises:
        ParseError: the declaration cannot be parsed, or a read is neither a term nor an atom.
        SchemaError: a read has another variable, or the function takes another number of arguments.
    """
    declared = parse_declaration(declaration, _SOURCE)
    parsed = tuple(parse_term(read, _SOURCE) for read in reads)
    names = [p.name for p in declared.parameters]
    for read in parsed:
        for name in sorted(free_variables(read) - set(names)):
            raise SchemaError(
                f"'?{name}' in {to_text(read)} is not a parameter of '{declared.name}'",
                place=read.place, found=f"?{name}", valid=[f"?{n}" for n in names],
            )  # fmt: skip

    def declare(function: Callable[_Inputs, bool]) -> Computed[_Inputs]:
        if not _takes(function, len(parsed)):
            raise SchemaError(
                f"the function of '{declared.name}' does not take {len(parsed)} arguments, one for each read",
                place=declared.place,
            )
        return Computed(declared.name, declared.parameters, parsed, function, declared.place)

    return declare


def in_reading_order(known: Mapping[str, Computed[Any]]) -> list[Computed[Any]]:
    """Return all of them, each after those that it reads.

    Raises:
        SchemaError: they read each other in a cycle, or more than `MOST_NESTED` one through the other.
    """
    read = {
        name: [r.predicate for r in of.reads if isinstance(r, Atom) and r.predicate in known]
        for name, of in known.items()
    }
    try:
        names = list(TopologicalSorter(read).static_order())
    except CycleError as error:
        cycle = error.args[1]
        raise SchemaError(f"computed predicates in a cycle: {' - '.join(cycle)}", place=known[cycle[0]].place) from None
    nested: dict[str, int] = {}
    for name in names:
        nested[name] = 1 + max((nested[other] for other in read[name]), default=0)
        if nested[name] > MOST_NESTED:
            message = f"'{name}' reads computed predicates more than {MOST_NESTED} deep, one through the other"
            raise SchemaError(message, place=known[name].place)
    return [known[name] for name in names]


def _takes(function: Callable[..., object], count: int) -> bool:
    try:
        signature = inspect.signature(function)
    except ValueError:  # a function in C without a signature
        return True
    try:
        signature.bind(*range(count))
    except TypeError:
        return False
    return True


def _resolved(read: Read, predicates: Callable[[str, int], bool]) -> Read:
    if isinstance(read, Call) and predicates(read.function, len(read.args)):
        return Atom(read.function, read.args, place=read.place)
    return read

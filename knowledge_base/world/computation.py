"""Computed predicates: Python functions of facts and values, e.g. `(near ?a ?b)` of two positions.

A computed predicate declares the facts and values that it reads. An installed condition with the predicate is evaluated
again only after a change of these inputs.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from graphlib import CycleError, TopologicalSorter
from typing import Any, Generic, ParamSpec

from knowledge_base.errors import Place, SchemaError, UserCodeError
from knowledge_base.language.checking.vocabulary import Read
from knowledge_base.language.syntax.expression import Atom, Call, Term, TypedVariable, free_variables, substitute
from knowledge_base.language.syntax.text import parse_term, to_text
from knowledge_base.pddl.domain_text import parse_declaration
from knowledge_base.tracebacks import raised_at
from knowledge_base.user_objects import described, text_of

MOST_NESTED = 8
"""Maximum nesting of computed predicates that read each other.

Each level multiplies the cost of an evaluation.
"""

_Inputs = ParamSpec("_Inputs")
_SOURCE = "@computed"


@dataclass(frozen=True, slots=True, eq=False)
class Computed(Generic[_Inputs]):
    """A predicate whose truth a function computes from inputs; the decorator `computed` creates it.

    A call of the `Computed` object calls the function. A read such as `(clean ?a)` denotes the value of a function
    until a schema resolves it as a predicate.

    Attributes:
        name: name of the predicate.
        parameters: parameters of the predicate.
        reads: the inputs, as terms and atoms over the parameters.
        function: receives the values of the inputs in order and returns the truth.
        place: the place of the declaration.
    """

    name: str
    parameters: tuple[TypedVariable, ...]
    reads: tuple[Read, ...]
    function: Callable[_Inputs, bool]
    place: Place | None = field(default=None, repr=False)

    def __call__(self, *args: _Inputs.args, **kwargs: _Inputs.kwargs) -> bool:
        """Call the function with these arguments."""
        return self.function(*args, **kwargs)

    def inputs(self, args: tuple[Term, ...]) -> tuple[Read, ...]:
        """Return the inputs for the arguments `args`."""
        given = {p.name: arg for p, arg in zip(self.parameters, args, strict=True)}
        return tuple(substitute(read, given) for read in self.reads)

    def resolved(self, predicates: Callable[[str, int], bool]) -> Computed[_Inputs]:
        """Return this computed predicate with reads that are resolved as functions or predicates.

        Args:
            predicates: returns whether a name with a number of arguments is a predicate or type.
        """
        return replace(self, reads=tuple(_resolve(read, predicates) for read in self.reads))

    def refused(self, place: Place | None = None) -> SchemaError:
        """Return the error for asserting, retracting or watching the computed predicate."""
        inputs = ", ".join(map(to_text, self.reads)) or "nothing"
        return SchemaError(
            f"'{self.name}' is computed and has no facts; tell and watch its inputs: {inputs}",
            place=place,
        )

    def judge(self, values: Sequence[object]) -> bool:
        """Return the truth of the predicate for these input values.

        Raises:
            UserCodeError: the function raised an exception, or did not return `True` or `False`.
        """
        function: Callable[..., object] = self.function
        try:
            truth = function(*values)
        except (Exception, SystemExit, GeneratorExit) as error:  # user code must not end the program
            raise UserCodeError(f"{described(error)}{raised_at(error)}") from error
        if type(truth) is not bool:
            code = getattr(inspect.unwrap(function), "__code__", None)
            where = "" if code is None else f" ({code.co_filename}:{code.co_firstlineno})"
            raise UserCodeError(f"true or false is expected, and its function gave {text_of(truth, repr)}{where}")
        return truth


def computed(declaration: str, *, reads: Sequence[str] = ()) -> Callable[[Callable[_Inputs, bool]], Computed[_Inputs]]:
    """Return a decorator that makes a function a computed predicate; `Schema.with_computed` declares it.

    The result of the function must depend only on its inputs; no other change evaluates conditions again.

    Args:
        declaration: the predicate in PDDL's notation: `(near ?a ?b - thing)`.
        reads: one input for each argument of the function: a term, e.g. `(x ?a)`, for its value, or an atom, e.g.
            `(clean ?a)`, for its truth. The variables must be parameters of the predicate.

    Raises:
        ParseError: the declaration cannot be parsed, or a read is neither a term nor an atom.
        SchemaError: a read contains another variable, or the function has another number of arguments.
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
    """Return all computed predicates in an order in which each follows the predicates that it reads.

    Raises:
        SchemaError: the predicates read each other in a cycle, or the nesting exceeds `MOST_NESTED`.
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
    except ValueError:  # a C function without a signature
        return True
    try:
        signature.bind(*range(count))
    except TypeError:
        return False
    return True


def _resolve(read: Read, predicates: Callable[[str, int], bool]) -> Read:
    if isinstance(read, Call) and predicates(read.function, len(read.args)):
        return Atom(read.function, read.args, place=read.place)
    return read

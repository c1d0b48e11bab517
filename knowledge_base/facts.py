"""Facts, values and changes: skills observe them, transactions write them, and listeners receive them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from knowledge_base.errors import InputError, Place, SchemaError
from knowledge_base.spelling import brief_repr, value_text

Value = str | int | float | bool
VALUE_TYPES = frozenset({str, int, float, bool})
"""Types of a fact's argument and of a bound variable: the name of an object, a number, a truth value."""

Geometry = tuple[float, ...]
"""A position, a pose or a matrix as finite numbers; the function's name determines their meaning. `()` is unknown."""
Content = Value | Geometry
"""Value of a function: the symbolic or geometric content of an arc (S4.3)."""

GEOMETRY = "geometry"
MOST_NUMBERS = 16
"""Maximum number of numbers in a geometry: a 4x4 matrix."""

UNSET: Mapping[str, Content] = {"number": 0, "text": "", "boolean": False, GEOMETRY: ()}
"""The types of a function's value (PDDL 3.1's typed results), each with the value before the first assignment."""

_SAID = {
    "number": "a number",
    "text": "text",
    "boolean": "true or false",
    GEOMETRY: f"a geometry, a tuple of at most {MOST_NUMBERS} numbers",
}


@dataclass(frozen=True, slots=True)
class Fact:
    """A predicate that is true for its arguments, e.g. `Fact("on", ("cup3", "table1"))`."""

    predicate: str
    args: tuple[Value, ...] = ()

    def __repr__(self) -> str:
        """Return the call of `fact` with these values."""
        return f"fact({', '.join(map(repr, (self.predicate, *self.args)))})"

    def __str__(self) -> str:
        """Return the fact in the language: `(on cup3 table1)`."""
        return "(" + " ".join([self.predicate, *map(value_text, self.args)]) + ")"


def fact(predicate: str, *args: Value) -> Fact:
    """Return a `Fact`: `fact("on", "cup3", "table1")`."""
    return Fact(predicate, args)


@dataclass(frozen=True, slots=True)
class Delta:
    """A change of the world model as a value: applied as a whole or not at all.

    Replacements are applied before removals, and removals before additions, as in PDDL effects. A world refuses a
    change with one fact that is both removed and added.

    Attributes:
        nodes: new objects, name to type; a known object with its type has no effect.
        removed: facts that become false; a false fact has no effect.
        added: facts that become true.
        values: new values of functions; the key contains the function and its arguments.
        removed_nodes: objects to remove, with all their facts and values. These objects are removed first: an object
            that is also in `nodes` becomes a new object. An unknown object has no effect.
        replaced: facts that become true, while facts that differ only in the last argument become false.
            `fact("at", "cup1", "shelf")` ends each other place of the cup. Always empty in an effective change.
    """

    nodes: Mapping[str, str] = field(default_factory=dict)
    removed: tuple[Fact, ...] = ()
    added: tuple[Fact, ...] = ()
    values: Mapping[Fact, Content] = field(default_factory=dict)
    removed_nodes: tuple[str, ...] = ()
    replaced: tuple[Fact, ...] = ()

    def __repr__(self) -> str:
        """Return the constructor's call without empty parts."""
        return brief_repr(self)

    def __bool__(self) -> bool:
        """Return whether the change contains anything."""
        return bool(self.nodes or self.removed or self.added or self.values or self.removed_nodes or self.replaced)

    def __len__(self) -> int:
        """Return the number of objects, facts and values in the change."""
        facts = len(self.removed) + len(self.added) + len(self.replaced)
        return len(self.nodes) + facts + len(self.values) + len(self.removed_nodes)

    def then(self, later: Delta) -> Delta:
        """Return this change followed by `later`, as one change.

        If `later` removes an object, the result omits the replacements of this change that contain that object.
        """
        undone, gone = set(later.removed), set(later.removed_nodes)
        reassigned = {(r.predicate, r.args[:-1]) for r in later.replaced}
        added = [
            a for a in self.added
            if a not in undone and gone.isdisjoint(a.args) and (a.predicate, a.args[:-1]) not in reassigned
        ]  # fmt: skip
        replaced = [
            r for r in self.replaced if gone.isdisjoint(r.args) and (r.predicate, r.args[:-1]) not in reassigned
        ]
        redone = {*later.added, *later.replaced}
        removed = [r for r in self.removed if r not in redone] + [r for r in later.removed if r not in later.added]
        return Delta(
            nodes={**{n: t for n, t in self.nodes.items() if n not in gone}, **later.nodes},
            removed=tuple(dict.fromkeys(removed)),
            added=tuple(dict.fromkeys([*added, *later.added])),
            values={**{f: v for f, v in self.values.items() if gone.isdisjoint(f.args)}, **later.values},
            removed_nodes=tuple(dict.fromkeys([*self.removed_nodes, *later.removed_nodes])),
            replaced=(*replaced, *later.replaced),
        )


@dataclass(frozen=True, slots=True)
class Change:
    """The effect of one committed transaction, without the facts that were true or false already.

    Attributes:
        version: the version of the knowledge base after the change; consecutive versions differ by one.
        author: the author, e.g. a component's name.
        delta: the effective change.
        time: time of the commit, in seconds of the knowledge base's clock; later changes never have an earlier time.
            Equality ignores the time.
    """

    version: int
    author: str
    delta: Delta
    time: float = field(default=0.0, compare=False)


def require_content(content: object, result: str, what: object, place: Place | None = None) -> None:
    """Raise an error unless `content` is a valid value of a function with the type `result`.

    Args:
        content: the value.
        result: the type of the function's result, one of `UNSET`.
        what: the function with its arguments, for messages.
        place: the place of the value in a text.

    Raises:
        SchemaError: `content` has another type.
        InputError: a number is not finite, or a text cannot be written to a file.
    """
    if not _is(content, result):
        convertible = result == "number" and hasattr(content, "__float__") and not isinstance(content, bool)
        hint = "; convert it with float(...)" if convertible else ""  # e.g. a scalar of numpy
        raise SchemaError(f"{what} is {_SAID[result]}, not {content!r}{hint}", place=place)
    numbers = content if isinstance(content, tuple) else (content,)
    for number in numbers:
        if isinstance(number, str):
            require_writable(number, what, place)
        else:
            require_finite(number, what, place)


def require_writable(text: str, what: object, place: Place | None = None) -> None:
    """Raise `InputError` if the text contains surrogates (half characters), which UTF-8 cannot encode."""
    if text.isascii():
        return
    try:
        text.encode()
    except UnicodeEncodeError:
        raise InputError(f"{what} is text that can be written to a file, not {text!a}", place=place) from None


def require_finite(number: float, what: object, place: Place | None = None) -> None:
    """Raise `InputError` for an infinity, a NaN, or an integer that is too large for a file."""
    try:
        if math.isfinite(number):
            return
    except OverflowError:
        raise InputError(f"{what} is a number of at most 1e308", place=place) from None
    raise InputError(f"{what} is a finite number, not {number}", place=place)


def _is(content: object, result: str) -> bool:
    match result:
        case "number":
            return _is_number(content)
        case "text":
            return isinstance(content, str)
        case "boolean":
            return isinstance(content, bool)
        case _:
            return isinstance(content, tuple) and len(content) <= MOST_NUMBERS and all(map(_is_number, content))


def _is_number(content: object) -> bool:
    return isinstance(content, int | float) and not isinstance(content, bool)

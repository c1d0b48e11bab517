"""Facts and changes as values: what skills observe, transactions write and listeners hear."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from knowledge_base.spelling import value_text

Value = str | int | float | bool
VALUE_TYPES = frozenset({str, int, float, bool})
"""What a fact's argument or a bound variable may be: an object's name, a number, a truth value."""

Geometry = tuple[float, ...]
"""A position, a pose, a matrix: finite numbers whose meaning the function's name says; `()` is unknown."""
Content = Value | Geometry
"""What a function may be worth: the symbolic or geometric content of an arc (S4.3)."""


@dataclass(frozen=True, slots=True)
class Fact:
    """A predicate that holds of its arguments, e.g. `Fact("on", ("cup3", "table1"))`."""

    predicate: str
    args: tuple[Value, ...] = ()

    def __str__(self) -> str:
        """In the language: `(on cup3 table1)`."""
        return "(" + " ".join([self.predicate, *map(value_text, self.args)]) + ")"


def fact(predicate: str, *args: Value) -> Fact:
    """`fact("on", "cup3", "table1")`, the everyday way to write a `Fact`."""
    return Fact(predicate, args)


@dataclass(frozen=True, slots=True)
class Delta:
    """A change of the world model as a value: applied as a whole or not at all.

    Replacements come before removals, and those before additions, as in PDDL effects, so that a fact in both
    stays true.

    Attributes:
        nodes: things that are there now, name -> type; naming a known one again with its type is fine.
        removed: facts that hold no longer; one that did not hold is fine.
        added: facts that hold now.
        values: what functions are worth now, by function and arguments.
        removed_nodes: things that are there no longer, nor any fact or value about them; this comes first
            of all, so that a thing in `nodes` too begins anew. One that was not there is fine.
        replaced: facts that hold now, and none any more that differs from them only in the last argument:
            `fact("at", "cup1", "shelf")` whatever it was at before. What really changes has no part in it.
    """

    nodes: Mapping[str, str] = field(default_factory=dict)
    removed: tuple[Fact, ...] = ()
    added: tuple[Fact, ...] = ()
    values: Mapping[Fact, Content] = field(default_factory=dict)
    removed_nodes: tuple[str, ...] = ()
    replaced: tuple[Fact, ...] = ()

    def __bool__(self) -> bool:
        """Whether it says anything at all."""
        return bool(self.nodes or self.removed or self.added or self.values or self.removed_nodes or self.replaced)

    def __len__(self) -> int:
        """How many things, facts and values it names."""
        facts = len(self.removed) + len(self.added) + len(self.replaced)
        return len(self.nodes) + facts + len(self.values) + len(self.removed_nodes)

    def then(self, later: Delta) -> Delta:
        """This change followed by `later`, as one change.

        A replacement that names a thing which `later` removes is forgotten with it.
        """
        undone, gone = set(later.removed), set(later.removed_nodes)
        anew = {(r.predicate, r.args[:-1]) for r in later.replaced}
        added = [
            a for a in self.added
            if a not in undone and gone.isdisjoint(a.args) and (a.predicate, a.args[:-1]) not in anew
        ]  # fmt: skip
        replaced = [r for r in self.replaced if gone.isdisjoint(r.args) and (r.predicate, r.args[:-1]) not in anew]
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
    """What one committed transaction really changed (facts already so are not in it).

    Attributes:
        version: the knowledge base's version after it; versions count up by one.
        author: who changed it, e.g. a component's name.
        delta: the effective change.
        time: when, in seconds of the knowledge base's clock; it never runs backwards. Not compared.
    """

    version: int
    author: str
    delta: Delta
    time: float = field(default=0.0, compare=False)

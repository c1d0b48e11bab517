"""Pending changes on top of a world, which itself is left alone."""

from __future__ import annotations

from collections.abc import Iterator

from knowledge_base.facts import Content, Delta, Fact, Value
from knowledge_base.language.checking.vocabulary import Vocabulary
from knowledge_base.language.evaluation.world import World
from knowledge_base.world.change_checks import check_delta, rivals
from knowledge_base.world.index import FactIndex


class Overlay:
    """A `World` that is `base` with changes: a transaction's view, a step of a plan tried out.

    The base must not change in what the overlay touches while the overlay is in use.
    """

    def __init__(self, base: World) -> None:
        self._base = base
        self._schema = base.schema
        self._added = FactIndex()
        self._removed: dict[Fact, None] = {}
        self._values: dict[Fact, Content] = {}
        self._nodes: dict[str, str] = {}
        self._gone: dict[str, None] = {}

    @property
    def schema(self) -> Vocabulary:
        """What may be said about it: as of the base."""
        return self._schema

    @property
    def delta(self) -> Delta:
        """All changes so far as one, without those that change nothing."""
        return Delta(
            nodes=dict(self._nodes),
            removed=tuple(self._removed),
            added=tuple(self._added),
            values=dict(self._values),
            removed_nodes=tuple(self._gone),
        )

    def apply(self, delta: Delta) -> None:
        """Change the view, as a whole or, with an error, not at all.

        Raises:
            InputError: a name that is not declared or not there, a wrong type or number of arguments.
        """
        check_delta(delta, self)
        for name in delta.removed_nodes:
            self._remove_node(name)
        for name, type_name in delta.nodes.items():
            if self.type_of(name) is None:
                self._nodes[name] = type_name
        for fact in delta.replaced:
            for rival in rivals(fact, self):
                self._remove(rival)
            self._add(fact)
        for fact in delta.removed:
            self._remove(fact)
        for fact in delta.added:
            self._add(fact)
        for fluent, content in delta.values.items():
            self._set(fluent, content)

    def holds(self, predicate: str, args: tuple[Value, ...]) -> bool:
        """Whether the fact is true with the changes."""
        if self._added.holds(predicate, args):
            return True
        return self._base.holds(predicate, args) and Fact(predicate, args) not in self._removed

    def match(self, predicate: str, pattern: tuple[Value | None, ...]) -> list[tuple[Value, ...]]:
        """The arguments of all facts that agree with `pattern`; those of the base come first."""
        kept = list(self._base.match(predicate, pattern))
        if self._removed:
            kept = [args for args in kept if Fact(predicate, args) not in self._removed]
        return [*kept, *self._added.match(predicate, pattern)]

    def estimate(self, predicate: str, pattern: tuple[Value | None, ...]) -> int:
        """At most how many facts agree with `pattern`; a base that cannot count is taken to have none."""
        below = getattr(self._base, "estimate", None)
        own = self._added.estimate(predicate, pattern)
        return own + below(predicate, pattern) if below else own

    def value(self, function: str, args: tuple[Value, ...]) -> Content:
        """What the function is worth with the changes."""
        pending = self._values.get(Fact(function, args))
        return self._base_value(Fact(function, args)) if pending is None else pending

    def reference(self, function: str, args: tuple[Value, ...]) -> str | None:
        """Where what the function is worth comes from, if a source of the base feeds it."""
        below = getattr(self._base, "reference", None)
        begins_anew = self._gone and not self._gone.keys().isdisjoint(args)
        return below(function, args) if below and not begins_anew else None

    def objects(self, type_name: str) -> list[str]:
        """The things of that type or a subtype; those of the base come first."""
        kept = [name for name in self._base.objects(type_name) if name not in self._gone]
        return kept + [name for name, own in self._nodes.items() if self.schema.is_a(own, type_name)]

    def type_of(self, name: str) -> str | None:
        """The thing's type; `None` if there is no such thing."""
        if name in self._nodes:
            return self._nodes[name]
        return None if name in self._gone else self._base.type_of(name)

    def _base_value(self, fluent: Fact) -> Content:
        begins_anew = self._gone and not self._gone.keys().isdisjoint(fluent.args)
        return self._schema.unset(fluent.predicate) if begins_anew else self._base.value(fluent.predicate, fluent.args)

    def _add(self, fact: Fact) -> None:
        if self._gone and not self._gone.keys().isdisjoint(fact.args):  # went with its thing, so it is said again
            self._added.add(fact)
        elif fact in self._removed:
            del self._removed[fact]
        elif not self._base.holds(fact.predicate, fact.args):
            self._added.add(fact)

    def _remove(self, fact: Fact) -> None:
        if fact in self._added:
            self._added.discard(fact)
        elif self._base.holds(fact.predicate, fact.args):
            self._removed[fact] = None

    def _set(self, fluent: Fact, content: Content) -> None:
        if content == self._base_value(fluent):
            self._values.pop(fluent, None)
        else:
            self._values[fluent] = content

    def _remove_node(self, name: str) -> None:
        for fact in list(self._about(name)):
            self._remove(fact)
        self._values = {f: v for f, v in self._values.items() if name not in f.args}
        self._nodes.pop(name, None)
        if self._base.type_of(name) is not None:
            self._gone[name] = None

    def _about(self, name: str) -> Iterator[Fact]:
        for predicate, signature in self.schema.predicates.items():
            for position in range(signature.arity):
                pattern = tuple(name if i == position else None for i in range(signature.arity))
                for args in self.match(predicate, pattern):
                    yield Fact(predicate, args)

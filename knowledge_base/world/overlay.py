"""Pending changes on top of a world, and the checks of a change before its application."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from knowledge_base.errors import MAX_NAME, InputError, SchemaError, UnknownNameError, shortened
from knowledge_base.facts import Content, Delta, Fact, Value, require_content, require_finite, require_writable
from knowledge_base.language.checking.check import check_arity, value_fits
from knowledge_base.language.checking.vocabulary import ROOT_TYPE, VALUE_TYPES, Signature, Vocabulary
from knowledge_base.language.evaluation.world_protocol import World, WorldDefaults
from knowledge_base.language.syntax.expression import TypedVariable
from knowledge_base.spelling import A_NAME_IS, is_name, nearest_name
from knowledge_base.world.fact_index import FactIndex

_Key = tuple[str, tuple[Value, ...]]


class Overlay(WorldDefaults):
    """A `World` with pending changes, e.g. in a transaction or for a simulated plan step.

    While the overlay is in use, the facts and values of the base that the overlay changes must stay unchanged.

    Args:
        base: the world below the changes; the overlay never changes it.
        added: facts that are true in the overlay from the beginning.

    Attributes:
        schema: the declarations of the base.
    """

    def __init__(self, base: World, added: FactIndex | None = None) -> None:
        self.schema: Vocabulary = base.schema
        self._base = base
        self._added = FactIndex() if added is None else added
        self._removed: dict[Fact, None] = {}
        self._values: dict[Fact, Content] = {}
        self._nodes: dict[str, str] = {}
        self._gone: dict[str, None] = {}

    @property
    def delta(self) -> Delta:
        """All pending changes as one effective change."""
        return Delta(
            nodes=dict(self._nodes),
            removed=tuple(self._removed),
            added=tuple(self._added),
            values=dict(self._values),
            removed_nodes=tuple(self._gone),
        )

    def apply(self, delta: Delta) -> None:
        """Apply a change to the overlay as a whole, or raise an error without effect.

        Raises:
            InputError: an undeclared or unknown name, a wrong type or a wrong number of arguments.
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
        """Return whether the fact is true after the pending changes."""
        if self._added.holds(predicate, args):
            return True
        return self._base.holds(predicate, args) and Fact(predicate, args) not in self._removed

    def match(self, predicate: str, pattern: tuple[Value | None, ...]) -> list[tuple[Value, ...]]:
        """Return the arguments of all facts that match `pattern`; facts of the base come first."""
        kept = list(self._base.match(predicate, pattern))
        if self._removed:
            kept = [args for args in kept if Fact(predicate, args) not in self._removed]
        return [*kept, *self._added.match(predicate, pattern)]

    def estimate(self, predicate: str, pattern: tuple[Value | None, ...]) -> int:
        """Return an upper bound of the number of matching facts."""
        return self._added.estimate(predicate, pattern) + self._base.estimate(predicate, pattern)

    def value(self, function: str, args: tuple[Value, ...]) -> Content:
        """Return the value of the function after the pending changes."""
        pending = self._values.get(Fact(function, args))
        return self._base_value(Fact(function, args)) if pending is None else pending

    def reference(self, function: str, args: tuple[Value, ...]) -> str | None:
        """Return the reference of the source that is bound to the function, or `None`."""
        is_recreated = self._gone and not self._gone.keys().isdisjoint(args)
        return None if is_recreated else self._base.reference(function, args)

    def publishes(self, function: str) -> bool:
        """Return whether a transform tree answers the function, and receives its new values."""
        return self._base.publishes(function)

    def require_publishable(self, values: Mapping[Fact, Content]) -> None:
        """Raise an error if a transform tree refuses one of these values, together with the pending ones."""
        self._base.require_publishable({**self._values, **values})

    def objects(self, type_name: str) -> list[str]:
        """Return the objects of that type and its subtypes; objects of the base come first."""
        kept = [name for name in self._base.objects(type_name) if name not in self._gone]
        return kept + [name for name, own in self._nodes.items() if self.schema.is_a(own, type_name)]

    def type_of(self, name: str) -> str | None:
        """Return the type of the object; `None` if the object is unknown."""
        if name in self._nodes:
            return self._nodes[name]
        return None if name in self._gone else self._base.type_of(name)

    def _base_value(self, fluent: Fact) -> Content:
        is_recreated = self._gone and not self._gone.keys().isdisjoint(fluent.args)
        return self.schema.unset(fluent.predicate) if is_recreated else self._base.value(fluent.predicate, fluent.args)

    def _add(self, fact: Fact) -> None:
        if self._gone and not self._gone.keys().isdisjoint(fact.args):  # the removal of the object removed the fact too
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
        is_new = content != self._base_value(fluent)
        if not (is_new or (isinstance(content, tuple) and content and self.publishes(fluent.predicate))):
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


def rivals(fact: Fact, world: World) -> Iterator[Fact]:
    """Return the true facts that differ from `fact` only in the last argument."""
    found = world.match(fact.predicate, (*fact.args[:-1], None))
    return (Fact(fact.predicate, args) for args in list(found) if args != fact.args)


def require_single(delta: Delta, world: World) -> None:
    """Raise an error if `delta`, applied to `world`, makes two facts true that exclude each other.

    Raises:
        SchemaError: two replacements or two facts of a functional predicate differ only in the last argument. The
            message contains both facts.
    """
    replaced = _group(delta.replaced)
    for facts in replaced.values():
        _require_one(facts, "are two replacements of the same")
    functional = world.schema.functional
    if not functional:
        return
    removed, gone = set(delta.removed), set(delta.removed_nodes)
    added = _group(f for f in delta.added if f.predicate in functional)
    for key, facts in added.items():
        before = replaced.get(key) or rivals(next(iter(facts)), world)
        stay = [f for f in before if f not in removed and gone.isdisjoint(f.args)]
        _require_one({**dict.fromkeys(stay), **facts}, f"cannot both be true, as '{key[0]}' is functional; use replace")


def _group(facts: Iterable[Fact]) -> dict[_Key, dict[Fact, None]]:
    found: dict[_Key, dict[Fact, None]] = {}
    for fact in facts:
        found.setdefault((fact.predicate, fact.args[:-1]), {})[fact] = None
    return found


def _require_one(facts: dict[Fact, None], wrong: str) -> None:
    if len(facts) > 1:
        first, second, *_ = facts
        raise SchemaError(f"{first} and {second} {wrong}")


def _require_consistent(delta: Delta) -> None:
    """Raise an error if a fact is to become both false and true; a removed object may become a new one."""
    gone = set(delta.removed_nodes)
    removed = {fact: position for position, fact in enumerate(delta.removed) if gone.isdisjoint(fact.args)}
    for name, facts in (("added", delta.added), ("replaced", delta.replaced)):
        for position, fact in enumerate(facts):
            if fact in removed:
                places = f"removed[{removed[fact]}] and {name}[{position}]"
                raise InputError(f"the change contradicts itself: {fact} is {places}", found=str(fact))


def check_delta(delta: Delta, world: World) -> None:
    """Raise an error unless `delta` can be applied to `world`.

    Raises:
        UnknownNameError: an undeclared type, predicate or function, or an unknown object.
        SchemaError: wrong arguments, a second type of an object, or a second fact of a functional predicate. The error
            is also raised for a new value of a function that is bound to a source.
        TransformError: a value that the transform tree of its function refuses.
        InputError: a number that is not finite, a new object with a name that PDDL cannot spell, or a fact that is both
            removed and added.
    """
    if delta.removed and (delta.added or delta.replaced):
        _require_consistent(delta)
    schema, admission = world.schema, _Admission(delta, world)
    # One change may remove facts together with their objects.
    before = _Admission(replace(delta, removed_nodes=()), world) if delta.removed_nodes else admission
    for name, type_name in delta.nodes.items():
        admission.node(name, type_name)
    for fact in (*delta.added, *delta.replaced):
        admission.fact(fact, schema.told(fact.predicate))
    for fact in delta.removed:
        before.fact(fact, schema.told(fact.predicate))
    for fluent, content in delta.values.items():
        admission.fact(fluent, schema.function(fluent.predicate))
        require_content(content, schema.result(fluent.predicate), fluent)
        if delta.removed_nodes and not set(delta.removed_nodes).isdisjoint(fluent.args):
            continue  # the new object has no source
        if (source := world.reference(fluent.predicate, fluent.args)) is not None:
            raise SchemaError(f"{fluent} is fed by '{source}' and cannot be set")
    _require_publishable(delta.values, world)
    for name in delta.removed_nodes:
        if name in schema.constants and name not in delta.nodes:
            raise SchemaError(f"'{name}' is a constant of the domain and cannot be removed")
    for fact in delta.replaced:
        _require_replaceable(fact, schema)
    if delta.replaced or schema.functional:
        require_single(delta, world)


def _require_publishable(values: Mapping[Fact, Content], world: World) -> None:
    if any(isinstance(content, tuple) for content in values.values()):
        world.require_publishable(values)


def check_fluent(fluent: Fact, world: World) -> None:
    """Raise an error unless the function is declared and accepts these arguments.

    Raises:
        UnknownNameError: an undeclared function, or an unknown object.
        SchemaError: a wrong number of arguments, or a wrong type.
    """
    _Admission(Delta(), world).fact(fluent, world.schema.function(fluent.predicate))


def _require_replaceable(fact: Fact, schema: Vocabulary) -> None:
    if not fact.args:
        raise SchemaError(f"{fact} has no argument that could be replaced")
    if len(fact.args) == 1 and fact.predicate not in schema.functional:
        others = f"all other facts of '{fact.predicate}', which is not functional"
        raise SchemaError(f"{fact} would replace {others}; retract those that hold no longer")


class _Admission:
    """Check of the parts of a change against the objects of a world and of the change itself."""

    def __init__(self, delta: Delta, world: World) -> None:
        self.delta = delta
        self.world = world
        self.schema = world.schema
        self.type_of = self.changed_type_of if delta.nodes or delta.removed_nodes else world.type_of

    def node(self, name: str, type_name: str) -> None:
        if not isinstance(name, str) or not name:
            raise InputError(f"a thing's name is text that is not empty, not {name!r}")
        self.schema.require_type(type_name)
        known = None if name in self.delta.removed_nodes else self.world.type_of(name)
        if known is None and not is_name(name):  # stores of older versions may contain such names
            meant = nearest_name(name)
            raise InputError(
                f"{shortened(repr(name), MAX_NAME)} cannot be the name of a thing: {A_NAME_IS}",
                found=name, valid=[meant] if meant else (),
            )  # fmt: skip
        if known is not None and known != type_name:
            raise SchemaError(f"'{name}' is of type '{known}' and cannot become '{type_name}'")

    def fact(self, fact: Fact, signature: Signature) -> None:
        if len(fact.args) != len(signature.parameters):
            check_arity(signature, len(fact.args))
        for parameter, value in zip(signature.parameters, fact.args, strict=True):
            known = self.type_of(value) if isinstance(value, str) else None
            if known is None or (known not in parameter.types and known not in self.schema.fitting(parameter.types)):
                self.other_argument(value, known, parameter, fact)

    def other_argument(self, value: Value, known: str | None, parameter: TypedVariable, fact: Fact) -> None:
        """Check an argument that is not an object of the right type; only a value of the right type is valid."""
        wanted = parameter.types or (ROOT_TYPE,)
        if value_fits(value, wanted):
            what = f"the argument '?{parameter.name}' of {fact.predicate}"
            if isinstance(value, str):
                require_writable(value, what)
            else:
                require_finite(value, what)
            return
        expected = f"the argument '?{parameter.name}' of {fact} is of type {' or '.join(wanted)}"
        if known is not None:
            raise SchemaError(f"{expected}, and '{value}' is of type {known}", found=str(value))
        if not isinstance(value, str) or set(wanted) <= set(VALUE_TYPES):
            raise SchemaError(f"{expected}, not {value!r}")
        raise UnknownNameError(f"there is no object '{value}', used in {fact}", found=value, valid=self.things(wanted))

    def changed_type_of(self, name: str) -> str | None:
        new = self.delta.nodes.get(name)
        return self.world.type_of(name) if new is None and name not in self.delta.removed_nodes else new

    def things(self, types: Iterable[str]) -> set[str]:
        known = {t for t in types if t not in VALUE_TYPES}
        return {name for t in known for name in self.world.objects(t)} | self.delta.nodes.keys()

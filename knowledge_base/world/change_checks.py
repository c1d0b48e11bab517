"""Checks of a change: every name declared, every argument of the right type, functional predicates single."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

from knowledge_base.content import require_content, require_finite, require_writable
from knowledge_base.errors import MAX_NAME, InputError, SchemaError, UnknownNameError, shortened
from knowledge_base.facts import Delta, Fact, Value
from knowledge_base.language.checking.check import check_arity, value_fits
from knowledge_base.language.checking.vocabulary import ROOT_TYPE, VALUE_TYPES, Signature, Vocabulary
from knowledge_base.language.evaluation.world import World
from knowledge_base.language.syntax.expression import TypedVariable
from knowledge_base.spelling import A_NAME_IS, is_name, nearest_name

_Key = tuple[str, tuple[Value, ...]]


def rivals(fact: Fact, world: World) -> Iterator[Fact]:
    """The facts that hold and differ from `fact` in nothing but the last argument."""
    found = world.match(fact.predicate, (*fact.args[:-1], None))
    return (Fact(fact.predicate, args) for args in list(found) if args != fact.args)


def require_single(delta: Delta, world: World) -> None:
    """Raise an error if after `delta`, applied to `world`, two facts say different things of the same.

    Raises:
        SchemaError: two replacements of the same, or two facts of a functional predicate; both are named.
    """
    replaced = _grouped(delta.replaced)
    for facts in replaced.values():
        _require_one(facts, "are two replacements of the same")
    functional = world.schema.functional
    if not functional:
        return
    removed, gone = set(delta.removed), set(delta.removed_nodes)
    added = _grouped(f for f in delta.added if f.predicate in functional)
    for key, facts in added.items():
        before = replaced.get(key) or rivals(next(iter(facts)), world)
        stay = [f for f in before if f not in removed and gone.isdisjoint(f.args)]
        _require_one({**dict.fromkeys(stay), **facts}, f"cannot both be true, as '{key[0]}' is functional; use replace")


def _grouped(facts: Iterable[Fact]) -> dict[_Key, dict[Fact, None]]:
    found: dict[_Key, dict[Fact, None]] = {}
    for fact in facts:
        found.setdefault((fact.predicate, fact.args[:-1]), {})[fact] = None
    return found


def _require_one(facts: dict[Fact, None], wrong: str) -> None:
    if len(facts) > 1:
        first, second, *_ = facts
        raise SchemaError(f"{first} and {second} {wrong}")


def check_delta(delta: Delta, world: World) -> None:
    """Raise an error unless `delta` can be applied to `world`.

    Raises:
        UnknownNameError: an undeclared type, predicate or function, or a thing that is not there.
        SchemaError: a wrong number of arguments, a wrong type, a second type for a thing, a second fact of a
            functional predicate, a value that a source feeds.
        InputError: a number that is not finite, a new thing's name that PDDL cannot say.
    """
    admission = _Admission(delta, world)
    # Facts may be removed together with the things they are about.
    before = _Admission(replace(delta, removed_nodes=()), world) if delta.removed_nodes else admission
    reference = getattr(world, "reference", None)
    for name, type_name in delta.nodes.items():
        admission.node(name, type_name)
    for fact in (*delta.added, *delta.replaced):
        admission.fact(fact, world.schema.told(fact.predicate))
    for fact in delta.removed:
        before.fact(fact, world.schema.told(fact.predicate))
    for fluent, content in delta.values.items():
        admission.fact(fluent, world.schema.function(fluent.predicate))
        require_content(content, world.schema.result(fluent.predicate), fluent)
        if delta.removed_nodes and not set(delta.removed_nodes).isdisjoint(fluent.args):
            continue  # it begins anew, without a source
        if reference is not None and (source := reference(fluent.predicate, fluent.args)) is not None:
            raise SchemaError(f"{fluent} is fed by '{source}' and cannot be set")
    for name in delta.removed_nodes:
        if name in world.schema.constants and name not in delta.nodes:
            raise SchemaError(f"'{name}' is a constant of the domain and cannot be removed")
    for fact in delta.replaced:
        _require_replaceable(fact, world.schema)
    if delta.replaced or world.schema.functional:
        require_single(delta, world)


def check_fluent(fluent: Fact, world: World) -> None:
    """Raise an error unless there is such a function and it takes such arguments.

    Raises:
        UnknownNameError: an undeclared function, or a thing that is not there.
        SchemaError: a wrong number of arguments, a wrong type.
    """
    _Admission(Delta(), world).fact(fluent, world.schema.function(fluent.predicate))


def _require_replaceable(fact: Fact, schema: Vocabulary) -> None:
    if not fact.args:
        raise SchemaError(f"{fact} has no argument that could be replaced")
    if len(fact.args) == 1 and fact.predicate not in schema.functional:
        others = f"all other facts of '{fact.predicate}', which is not functional"
        raise SchemaError(f"{fact} would replace {others}; retract those that hold no longer")


class _Admission:
    def __init__(self, delta: Delta, world: World) -> None:
        self.delta = delta
        self.world = world
        self.schema = world.schema
        self.type_of = self.changed_type_of if delta.nodes or delta.removed_nodes else self.known_type_of

    def node(self, name: str, type_name: str) -> None:
        if not isinstance(name, str) or not name:
            raise InputError(f"a thing's name is text that is not empty, not {name!r}")
        self.schema.require_type(type_name)
        known = None if name in self.delta.removed_nodes else self.world.type_of(name)
        if known is None and not is_name(name):  # older stores may have such things
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
        fitting, type_of = self.schema.fitting, self.type_of
        for parameter, value in zip(signature.parameters, fact.args, strict=True):
            known = type_of(value)
            if known is None or known not in fitting(parameter.types):
                self.other_argument(value, known, parameter, fact)

    def other_argument(self, value: Value, known: str | None, parameter: TypedVariable, fact: Fact) -> None:
        """It is no thing of the right type, so it is a value or a mistake."""
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

    def known_type_of(self, value: Value) -> str | None:
        return self.world.type_of(value) if isinstance(value, str) else None

    def changed_type_of(self, value: Value) -> str | None:
        if not isinstance(value, str):
            return None
        new = self.delta.nodes.get(value)
        if new is not None or value in self.delta.removed_nodes:
            return new
        return self.world.type_of(value)

    def things(self, types: Iterable[str]) -> set[str]:
        known = {t for t in types if t not in VALUE_TYPES}
        return {name for t in known for name in self.world.objects(t)} | self.delta.nodes.keys()

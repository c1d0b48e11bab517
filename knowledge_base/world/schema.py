"""Schema of a world: types, constants, predicates and functions of a PDDL domain."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from knowledge_base.errors import Place, SchemaError, UnknownNameError, nearest
from knowledge_base.facts import GEOMETRY, UNSET, Content
from knowledge_base.language.checking.check import check_reads
from knowledge_base.language.checking.relations import relation, relation_names, require_fact
from knowledge_base.language.checking.vocabulary import ROOT_TYPE, VALUE_TYPES, Signature
from knowledge_base.language.syntax.expression import KEYWORDS, Expression
from knowledge_base.language.syntax.sexpr import TypedName
from knowledge_base.pddl.domain_text import DeclarationText, DomainText, parse_domain, read_domain
from knowledge_base.world.axioms import Axiom, checked_axiom
from knowledge_base.world.computation import Computed, in_reading_order
from knowledge_base.world.derived import Definitions

MAX_TYPES = 10_000
MAX_TYPE_DEPTH = 100
"""Maximum depth of types below `object`: every type stores all its ancestors."""

Declared = tuple[str, Place | None]
"""A declaration as written, and its place."""


@dataclass(frozen=True, slots=True, eq=False)
class Schema:
    """The declarations of a world; every instance is consistent. Equality is identity.

    Attributes:
        types: name to parent of each type; `object` is always present and has no parent.
        constants: objects that every world of this schema contains, with their types.
        predicates: signatures of the predicates, by name.
        functions: signatures of the functions, by name; the default type of a value is `number`.
        places: places of the declarations of types and constants, for messages.
        functional: predicates whose last argument depends on the other arguments, see `with_functional`.
        computed: computed predicates, by name; no world or store contains facts of them.
        axioms: definitions of derived predicates. Conditions read a derived predicate by its definition; a recursive
            one, only planning computes.

    Raises:
        SchemaError: a declared type, parameter or constant refers to an unknown type; types form a cycle; or a name is
            used twice. The error is also raised for a computed predicate with invalid reads.
    """

    types: Mapping[str, str | None] = field(default_factory=dict)
    constants: Mapping[str, str] = field(default_factory=dict)
    predicates: Mapping[str, Signature] = field(default_factory=dict)
    functions: Mapping[str, Signature] = field(default_factory=dict)
    places: Mapping[str, Place] = field(default_factory=dict, repr=False)
    functional: frozenset[str] = frozenset()
    computed: Mapping[str, Computed[Any]] = field(default_factory=dict)
    axioms: tuple[Axiom, ...] = ()
    _definitions: Definitions = field(init=False, repr=False)
    _ancestors: Mapping[str, tuple[str, ...]] = field(init=False, repr=False)
    _unset: Mapping[str, Content] = field(init=False, repr=False)
    _fitting: dict[tuple[str, ...], frozenset[str]] = field(init=False, repr=False, default_factory=dict)

    def __post_init__(self) -> None:
        if self.types.get(ROOT_TYPE) not in (None, ROOT_TYPE):
            raise SchemaError("'object' is the type of all things", place=self.places.get(ROOT_TYPE))
        if len(self.types) > MAX_TYPES:
            raise SchemaError(f"{len(self.types)} types are declared; a schema has at most {MAX_TYPES}")
        parents = {ROOT_TYPE: None, **{t: p for t, p in self.types.items() if t != ROOT_TYPE}}
        copies: dict[str, Mapping[str, object]] = {
            "types": {t: p or (None if t == ROOT_TYPE else ROOT_TYPE) for t, p in parents.items()},
            "constants": dict(self.constants),
            "predicates": dict(self.predicates),
            "functions": {n: f if f.result else replace(f, result="number") for n, f in self.functions.items()},
            "places": dict(self.places),
            "computed": {name: of.resolved(self._is_asked) for name, of in self.computed.items()},
        }
        for name, copy in copies.items():
            object.__setattr__(self, name, copy)
        object.__setattr__(self, "_ancestors", {t: tuple(self._lineage(t)) for t in self.types})
        self._check_names()
        self._check_types()
        self._check_computed()
        self._check_functional()
        object.__setattr__(self, "_definitions", Definitions(self.axioms, self.predicates, typed=True))
        object.__setattr__(self, "_unset", {name: UNSET[self.result(name)] for name in self.functions})

    @classmethod
    def from_pddl(cls, path: str | Path) -> Schema:
        """Return the schema of a PDDL domain file.

        Raises:
            InputError: the file cannot be read, or does not declare a consistent schema.
        """
        return cls.from_text(read_domain(Path(path)))

    @classmethod
    def parse(cls, text: str, source: str | None = None) -> Schema:
        """Return the schema of a PDDL domain given as text.

        Raises:
            InputError: the text is not a domain, or does not declare a consistent schema.
        """
        return cls.from_text(parse_domain(text, source))

    @classmethod
    def from_text(cls, domain: DomainText) -> Schema:
        """Return the schema with the declarations of a parsed domain.

        Raises:
            SchemaError: two declarations contradict each other; the message contains both places.
        """
        types = typed_names((*domain.types, *domain.implied_types()), "type")
        constants = typed_names(domain.constants, "constant")
        schema = cls(
            types={name: declared.types[0] for name, declared in types.items()},
            constants={name: declared.types[0] for name, declared in constants.items()},
            predicates=_signatures(domain.predicates, "predicate"),
            functions=_signatures(domain.functions, "function"),
            places={name: declared.place for name, declared in {**types, **constants}.items()},
        )
        return schema.with_axioms(checked_axiom(axiom, schema) for axiom in domain.axioms)

    def with_axioms(self, axioms: Iterable[Axiom]) -> Schema:
        """Return this schema with more definitions of derived predicates.

        Raises:
            SchemaError: a predicate follows from its own negation.
        """
        new = tuple(dict.fromkeys((*self.axioms, *axioms)))
        return self if new == self.axioms else replace(self, axioms=new)

    def expanded(self, e: Expression) -> Expression:
        """Return the condition with the definitions of derived predicates; recursive predicates stay."""
        return self._definitions.expanded(e)

    def require_defined(self, e: Expression) -> None:
        """Raise `SchemaError` if the condition reads a recursive derived predicate, which only planning computes."""
        atom = self._definitions.recursive_part(e)
        if atom is not None:
            message = f"'{atom.predicate}' is a recursive derived predicate, which only goals and planning actions read"
            raise SchemaError(message, place=atom.place)

    def with_functional(self, *predicates: str) -> Schema:
        """Return this schema with functional predicates: two true facts never differ only in the last argument.

        With `schema.with_functional("robot-at", "at")`, each robot and each object is at one place at a time.

        Raises:
            UnknownNameError: a predicate is not declared.
            SchemaError: a predicate has no arguments.
        """
        return replace(self, functional=self.functional.union(predicates))

    @property
    def kinds(self) -> dict[str, str]:
        """The kinds of arcs by predicate and function; empty for a declaration without a kind."""
        return {one.name: one.kind for one in (*self.predicates.values(), *self.functions.values())}

    def merged(self, other: Schema) -> Schema:
        """Return a schema with the declarations of both schemas.

        Raises:
            SchemaError: the schemas declare a name differently.
        """
        for kind, mine, theirs in (
            ("type", self.types, other.types),
            ("constant", self.constants, other.constants),
        ):
            for name, declared in mine.items():
                if theirs.get(name, declared) != declared:
                    mine_at = f"{name} - {declared}", self.places.get(name)
                    theirs_at = f"{name} - {theirs[name]}", other.places.get(name)
                    raise _twice(kind, name, mine_at, theirs_at)
        both = (*self.predicates.values(), *other.predicates.values())
        functions = (*self.functions.values(), *other.functions.values())
        return Schema(
            types={**self.types, **other.types},
            constants={**self.constants, **other.constants},
            predicates=_unite(both, "predicate"),
            functions=_unite(functions, "function"),
            places={**other.places, **self.places},
            functional=self.functional | other.functional,
            axioms=tuple(dict.fromkeys((*self.axioms, *other.axioms))),
        ).with_computed(*self.computed.values(), *other.computed.values())

    def with_computed(self, *predicates: Computed[Any]) -> Schema:
        """Return this schema with more computed predicates; a predicate that is declared already has no effect.

        Raises:
            UnknownNameError: a predicate reads a function, predicate or type that is not declared.
            SchemaError: a name is in use, or reads do not match the types of the parameters. The error is also raised
                if computed predicates read each other in a cycle or too deeply.
        """
        known = dict(self.computed)
        for one in predicates:
            if known.setdefault(one.name, one).function is not one.function:
                first, second = ("by one function", known[one.name].place), ("by another", one.place)
                raise _twice("computed predicate", one.name, first, second)
        return replace(self, computed=known)

    def is_a(self, type_name: str, ancestor: str) -> bool:
        """Return whether `ancestor` is `type_name` or one of its ancestors."""
        return ancestor in self._ancestors.get(type_name, ()) or (type_name == ancestor and type_name in VALUE_TYPES)

    def fits(self, type_name: str, wanted: Iterable[str]) -> bool:
        """Return whether `type_name` is one of the `wanted` types or their subtypes.

        An empty `wanted` accepts any object.
        """
        return type_name in self.fitting(tuple(wanted))

    def fitting(self, wanted: tuple[str, ...]) -> frozenset[str]:
        """Return all types that match the `wanted` types.

        The result is cached, since each argument of a change needs it.
        """
        found = self._fitting.get(wanted)
        if found is None:
            all_types = (*self.types, *VALUE_TYPES)
            found = frozenset(t for t in all_types if any(self.is_a(t, w) for w in wanted or (ROOT_TYPE,)))
            self._fitting[wanted] = found
        return found

    def subtypes(self, type_name: str) -> tuple[str, ...]:
        """Return `type_name` and all types below it, in the order of their declaration."""
        return tuple(t for t in self.types if self.is_a(t, type_name))

    def ancestors(self, type_name: str) -> tuple[str, ...]:
        """Return `type_name` and all types above it, up to `object`.

        Raises:
            UnknownNameError: the type is not declared.
        """
        self.require_type(type_name)
        return self._ancestors[type_name]

    def require_type(self, name: str, place: Place | None = None) -> None:
        """Raise `UnknownNameError` unless `name` is a type of objects."""
        if name.startswith("?"):
            raise SchemaError(f"'{name}' would be a list, which only plots have; here a type is needed", place=place)
        if name not in self.types:
            raise UnknownNameError(f"there is no type '{name}'", place=place, found=name, valid=self.types)

    def require_argument_type(self, name: str, place: Place | None = None) -> None:
        """Raise `UnknownNameError` unless `name` is a type of objects or of values."""
        if name not in VALUE_TYPES:
            self.require_type(name, place)

    def is_type(self, name: str, arity: int) -> bool:
        """Return whether an atom with that name and number of arguments tests a type.

        If a predicate with one argument has the name of a type, the atom denotes the predicate. PDDL likewise
        distinguishes the names of types and predicates.
        """
        return arity == 1 and name in self.types and name not in self.predicates

    def predicate(self, name: str, place: Place | None = None) -> Signature:
        """Return the predicate of that name, which may be a computed predicate.

        Raises:
            UnknownNameError: the predicate is not declared; the message suggests predicates, types and keywords.
            SchemaError: a function or a type has that name.
        """
        found = self.predicates.get(name)
        if found is not None:
            return found
        if name not in self.computed:
            live = relation(name)
            if live is not None:
                return live
            if name in self.functions:
                hint = f"compare its value: (= ({name} ...) VALUE); a Delta has it among its `values`"
                raise SchemaError(f"'{name}' is a function; {hint}", place=place)
            if name in self.types:
                said = f"'{name}' is a type, which a condition tests of one thing: ({name} THING)"
                raise SchemaError(f"{said}; a new thing gets its type with its name", place=place)
            if ":" in name and not relation_names():
                message = f"'{name}' is a relation of a running program, and here is only the state of a world"
                raise SchemaError(message, place=place, found=name)
            own = (*self.predicates, *self.computed, *self.types)
            every = (*own, *KEYWORDS, *relation_names())
            valid = every if nearest(name, every) is not None or not own else own
            raise UnknownNameError(f"there is no predicate '{name}'", place=place, found=name, valid=valid)
        of = self.computed[name]
        return Signature(of.name, of.parameters, place=of.place)

    def told(self, name: str, place: Place | None = None) -> Signature:
        """Return the predicate of that name, which must not be a computed predicate.

        Raises:
            UnknownNameError: the predicate is not declared.
            SchemaError: the predicate is computed, or derived and not recursive.
        """
        found = self.predicates.get(name)
        if name in self._definitions.axioms and name not in self._definitions.recursive:
            defined = self._definitions.axioms[name][0].place
            where = f" (at {defined})" if defined else ""
            message = f"'{name}' is derived{where}; change the facts from which it follows"
            raise SchemaError(message, place=place)
        if found is not None:
            return found
        if name in self.computed:
            raise self.computed[name].refused(place)
        require_fact(name, place)
        return self.predicate(name, place)

    def function(self, name: str, place: Place | None = None) -> Signature:
        """Return the function of that name.

        Raises:
            UnknownNameError: the function is not declared.
        """
        found = self.functions.get(name)
        if found is None:
            raise UnknownNameError(f"there is no function '{name}'", place=place, found=name, valid=self.functions)
        return found

    def result(self, function: str, place: Place | None = None) -> str:
        """Return the type of the function's values; errors as for `function`."""
        return self.function(function, place).result or "number"

    def unset(self, function: str) -> Content:
        """Return the value of the function before the first assignment; errors as for `function`."""
        found = self._unset.get(function)
        return UNSET[self.result(function)] if found is None else found

    def _lineage(self, type_name: str) -> Iterator[str]:
        seen: dict[str, None] = {}
        here: str | None = type_name
        while here is not None:
            if len(seen) > MAX_TYPE_DEPTH:
                said = f"the type '{type_name}' is more than {MAX_TYPE_DEPTH} levels below 'object'"
                raise SchemaError(said, place=self.places.get(type_name))
            if here in seen:
                cycle = " - ".join([*list(seen)[list(seen).index(here) :], here])
                raise SchemaError(f"types in a cycle: {cycle}", place=self.places.get(type_name))
            if here not in self.types:
                raise SchemaError(
                    f"the type '{type_name}' has an unknown parent '{here}'",
                    place=self.places.get(type_name),
                    found=here,
                    valid=self.types.keys() - seen.keys(),
                )
            seen[here] = None
            yield here
            here = self.types[here]

    def _check_names(self) -> None:
        for name in UNSET:
            if name in self.types:
                raise SchemaError(f"'{name}' is a type of values, not of things", place=self.places.get(name))
        for name, signature in self.predicates.items():
            if name in self.functions:
                raise SchemaError(
                    f"the function '{name}' has the name of a predicate{_at(signature.place)}",
                    place=self.functions[name].place,
                )

        for name, of in self.computed.items():
            if name in self.predicates or name in self.functions or name in self.types or name in KEYWORDS:
                raise SchemaError(f"the name of the computed predicate '{name}' is in use already", place=of.place)

    def _check_computed(self) -> None:
        for of in in_reading_order(self.computed):
            check_reads(of, self)

    def _is_asked(self, name: str, arity: int) -> bool:
        """Return whether the name denotes a predicate or a type, not a function."""
        return name in self.predicates or name in self.computed or (arity == 1 and name in self.types)

    def _check_types(self) -> None:
        for name, type_name in self.constants.items():
            self._known(type_name, f"the constant '{name}'", self.places.get(name), values=False)
        for function in self.functions.values():
            if function.result not in UNSET:
                raise SchemaError(
                    f"the function '{function.name}' has an unknown type of result",
                    place=function.place, found=function.result, valid=UNSET,
                )  # fmt: skip
        computed = map(self.predicate, self.computed)
        for signature in (*self.predicates.values(), *self.functions.values(), *computed):
            for parameter in signature.parameters:
                for type_name in parameter.types:
                    owner = f"the parameter '?{parameter.name}' of '{signature.name}'"
                    self._known(type_name, owner, parameter.place or signature.place, values=True)

    def _check_functional(self) -> None:
        for name in sorted(self.functional):
            signature = self.predicate(name)
            if not signature.arity:
                raise SchemaError(f"'{name}' has no argument that others could settle", place=signature.place)

    def _known(self, type_name: str, owner: str, place: Place | None, *, values: bool) -> None:
        if type_name in self.types or (values and type_name in VALUE_TYPES):
            return
        if type_name == GEOMETRY:
            raise SchemaError(f"{owner} cannot be a geometry; only the value of a function can", place=place)
        raise SchemaError(f"{owner} has an unknown type '{type_name}'", place=place, found=type_name, valid=self.types)


def _at(place: Place | None) -> str:
    return f" (at {place})" if place else ""


def _twice(kind: str, name: str, first: Declared, second: Declared) -> SchemaError:
    said = f"the {kind} '{name}' is declared differently before: {first[0]}{_at(first[1])}, and here {second[0]}"
    return SchemaError(said, place=second[1])


def typed_names(names: Iterable[TypedName], kind: str) -> dict[str, TypedName]:
    """Return the names that one file declares, each with its single type.

    A second declaration with another type replaces the type `object`.

    Raises:
        SchemaError: a name has two types; the message contains both places.
    """
    found: dict[str, TypedName] = {}
    for name, types, place in names:
        if len(types) > 1:
            raise SchemaError(f"the {kind} '{name}' can have only one type", place=place)
        declared = TypedName(name, types or (ROOT_TYPE,), place)
        first = found.setdefault(name, declared)
        if first.types == (ROOT_TYPE,):  # every object has the type `object`
            found[name] = declared
        elif declared.types not in (first.types, (ROOT_TYPE,)):
            before = f"{name} - {first.types[0]}", first.place
            raise _twice(kind, name, before, (f"{name} - {declared.types[0]}", place))
    return found


def agreed_names(files: Iterable[Iterable[TypedName]], kind: str) -> tuple[TypedName, ...]:
    """Return the names that several files declare.

    Unlike in `typed_names`, `object` differs from every other type.

    Raises:
        SchemaError: a name has different types; the message contains both places.
    """
    found: dict[str, TypedName] = {}
    for names in files:
        for name, declared in typed_names(names, kind).items():
            first = found.setdefault(name, declared)
            if first.types != declared.types:
                before = f"{name} - {first.types[0]}", first.place
                raise _twice(kind, name, before, (f"{name} - {declared.types[0]}", declared.place))
    return tuple(found.values())


def _signatures(declarations: Iterable[DeclarationText], kind: str) -> dict[str, Signature]:
    return _unite((Signature(d.name, d.parameters, d.result, d.place, kind=d.domain) for d in declarations), kind)


def _unite(signatures: Iterable[Signature], kind: str) -> dict[str, Signature]:
    found: dict[str, Signature] = {}
    for signature in signatures:
        first = found.setdefault(signature.name, signature)
        if not first.means(signature):
            raise _twice(kind, signature.name, (str(first), first.place), (str(signature), signature.place))
    return found

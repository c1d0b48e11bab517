"""Compatibility of schemas: a store or world can be read with an extension of its schema."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from knowledge_base.errors import Place, SchemaError, SchemaMismatchError, nearest
from knowledge_base.facts import Delta
from knowledge_base.language.checking.vocabulary import ROOT_TYPE, Signature
from knowledge_base.world.overlay import require_single
from knowledge_base.world.schema import Schema
from knowledge_base.world.state import WorldState


def require_extension(written: Schema, given: Schema, place: Place | None = None) -> None:
    """Raise an error unless `given` has every declaration of `written`, unchanged.

    `given` may have more types, constants, predicates, functions and functional predicates. The names of parameters may
    differ.

    Raises:
        SchemaMismatchError: `given` is not an extension. The error lists all differences, with the nearest name of
            `given` for a missing name.
    """
    foreign = _list_declared(written).isdisjoint(_list_declared(given))
    found = [
        *_differences("type", written.types, given.types, hint=not foreign),
        *_differences("constant", written.constants, given.constants, hint=not foreign),
        *_differences("predicate", _shapes(written.predicates), _shapes(given.predicates), hint=not foreign),
        *_differences("function", _shapes(written.functions), _shapes(given.functions), hint=not foreign),
        *(
            f"the predicate '{name}' was functional, now it is not"
            for name in sorted(written.functional & given.predicates.keys() - given.functional)
        ),
    ]
    if found:
        said = "it is about another domain" if foreign else "the schema is another one"
        raise SchemaMismatchError(found, place=place, said=said)


def _list_declared(schema: Schema) -> set[str]:
    return {*schema.types, *schema.constants, *schema.predicates, *schema.functions} - {ROOT_TYPE}


def require_functional(state: WorldState, place: Place | None) -> None:
    """Raise an error if two facts exclude each other under a predicate that the extended schema declares functional.

    Raises:
        SchemaMismatchError: two facts exclude each other; the message contains both.
    """
    try:
        require_single(Delta(added=tuple(state.facts)), state)
    except SchemaError as error:
        raise SchemaMismatchError([error.message], place=place) from None


def missing_constants(state: WorldState, place: Place | None) -> Delta:
    """Return the change that adds the constants of the extended schema.

    Raises:
        SchemaMismatchError: the world has an object with the name of a constant, but another type.
    """
    known, constants = state.nodes, state.schema.constants
    wrong = [
        f"the constant '{name}' is an object of type '{known[name]}' there, not '{type_name}'"
        for name, type_name in constants.items()
        if known.get(name, type_name) != type_name
    ]
    if wrong:
        raise SchemaMismatchError(wrong, place=place)
    return Delta(nodes={name: t for name, t in constants.items() if name not in known})


def _differences(
    kind: str, written: Mapping[str, str | None], given: Mapping[str, str | None], *, hint: bool
) -> Iterator[str]:
    for name, declared in written.items():
        if name not in given:
            meant = nearest(name, given.keys() - written.keys()) if hint else None
            yield f"the {kind} '{name}' is missing" + (f" (nearest: '{meant}')" if meant else "")
        elif given[name] != declared:
            yield f"the {kind} '{name}' was declared '{declared}', now it is '{given[name]}'"


def _shapes(signatures: Mapping[str, Signature]) -> dict[str, str | None]:
    """Return each signature as text: the types of the arguments, and of the function's value."""
    return {
        name: " ".join([name, *("/".join(p.types or (ROOT_TYPE,)) for p in signature.parameters)])
        + ("" if signature.result in (None, "number") else f" - {signature.result}")
        for name, signature in signatures.items()
    }

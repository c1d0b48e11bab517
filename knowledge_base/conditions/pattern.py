"""What a watch is about: which changes touch a pattern such as `(on ?o table)`."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.facts import Change, Delta, Value
from knowledge_base.language.checking.check import check_arity
from knowledge_base.language.syntax.expression import Atom, Constant, Expression, Variable
from knowledge_base.world.schema import Schema

Touches = Callable[[Change], bool]


def touches(pattern: Expression, params: Mapping[str, Value], schema: Schema) -> Touches:
    """Whether a change says something about `pattern`: a predicate, function or type with arguments.

    A variable without a value in `params` stands for anything, the same wherever it is repeated. Things that
    are removed touch the functions they may have had a number in.

    Raises:
        InputError: the pattern is something else.
        UnknownNameError: there is no predicate, function or type of that name.
        SchemaError: a wrong number of arguments.
    """
    if not isinstance(pattern, Atom) or not all(isinstance(a, Variable | Constant) for a in pattern.args):
        raise InputError("a pattern is one predicate, function or type, as in (on ?o table)", place=pattern.place)
    name, fits = pattern.predicate, _Fits(pattern, params)
    if schema.is_type(name, len(pattern.args)):
        return lambda change: _typed(change.delta, name, schema, fits)
    if name in schema.functions:
        check_arity(schema.functions[name], len(pattern.args), pattern.place)
        return lambda change: _numbered(change.delta, name, fits)
    if name in schema.computed:
        raise schema.computed[name].refused(pattern.place)
    if name not in schema.predicates:
        valid = (*schema.predicates, *schema.functions, *schema.types)
        message = f"there is no predicate, function or type '{name}'"
        raise UnknownNameError(message, place=pattern.place, found=name, valid=valid)
    check_arity(schema.predicates[name], len(pattern.args), pattern.place)
    return lambda change: any(
        f.predicate == name and fits(f.args) for facts in (change.delta.removed, change.delta.added) for f in facts
    )


class _Fits:
    """Whether arguments agree with a pattern's."""

    def __init__(self, pattern: Atom, params: Mapping[str, Value]) -> None:
        first: dict[str, int] = {}
        self.fixed: dict[int, Value] = {}
        self._equal: list[tuple[int, int]] = []
        for position, arg in enumerate(pattern.args):
            if isinstance(arg, Constant):
                self.fixed[position] = arg.value
            elif isinstance(arg, Variable) and arg.name in params:
                self.fixed[position] = params[arg.name]
            elif isinstance(arg, Variable) and first.setdefault(arg.name, position) != position:
                self._equal.append((first[arg.name], position))
        self.count = len(pattern.args)

    def __call__(self, args: tuple[Value, ...]) -> bool:
        if any(args[i] != value for i, value in self.fixed.items()):
            return False
        return all(args[i] == args[j] for i, j in self._equal)

    def may_contain(self, name: str) -> bool:
        return name in self.fixed.values() or len(self.fixed) < self.count


def _typed(delta: Delta, name: str, schema: Schema, fits: _Fits) -> bool:
    """Of removed things the type is not known any more."""
    return any(schema.is_a(own, name) and fits((thing,)) for thing, own in delta.nodes.items()) or any(
        fits((thing,)) for thing in delta.removed_nodes
    )


def _numbered(delta: Delta, name: str, fits: _Fits) -> bool:
    return any(f.predicate == name and fits(f.args) for f in delta.values) or any(
        fits.may_contain(thing) for thing in delta.removed_nodes
    )

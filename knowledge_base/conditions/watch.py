"""Watches: the committed changes that match a pattern such as `(on ?o table)`, as an asynchronous iterator."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from threading import Lock
from types import TracebackType
from typing import Self

from knowledge_base.conditions.notification import Waiters
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.facts import Change, Delta, Value
from knowledge_base.language.checking.check import check_arity
from knowledge_base.language.checking.inputs import fitted_names, require_condition, require_params
from knowledge_base.language.syntax.expression import Atom, Constant, Expression, Variable
from knowledge_base.language.syntax.text import parse_condition
from knowledge_base.user_objects import shown
from knowledge_base.world.schema import Schema

Touches = Callable[[Change], bool]
"""A function that returns whether a change matches a pattern."""


@dataclass(frozen=True, slots=True)
class Missed:
    """A gap in a watch with a slow reader: the changes after version `since` up to and including `until`.

    Attributes:
        since: the latest version up to which the reader has received all changes.
        until: the latest version in the gap; the next item is after this version.
    """

    since: int
    until: int


class Watch:
    """An asynchronous iterator over later changes; see `KnowledgeBase.watch`.

    One or several tasks of any event loop may read the watch. `close` ends the iteration, and so does the end of a
    `with` block.

    Raises:
        InputError: `limit` is not a positive whole number, or `pattern` is not a pattern.
    """

    def __init__(
        self, pattern: str | Expression | None, params: Mapping[str, Value], schema: Schema, version: int, limit: int
    ) -> None:
        if isinstance(limit, bool) or not isinstance(limit, int) or limit < 1:
            raise InputError(f"a watch keeps at least one change for its reader, not {shown(limit)}")
        self._touches = None if pattern is None else _touching(pattern, params, schema)
        self._limit = limit
        self._told = version
        self._queue: deque[Change] = deque()
        self._missed: Missed | None = None
        self._waiters: Waiters[None] = Waiters()
        self._guard = Lock()
        self._closed = False
        self._unsubscribe: Callable[[], None] | None = None

    def follow(self, unsubscribe: Callable[[], None]) -> None:
        """Store `unsubscribe`, which `close` calls to end the notifications."""
        self._unsubscribe = unsubscribe

    def receive(self, change: Change) -> None:
        """Queue a change for the readers if it matches; the knowledge base calls this method from any thread."""
        if self._touches is not None and not self._touches(change):
            return
        with self._guard:
            if len(self._queue) >= self._limit:
                since = self._missed.since if self._missed else self._told
                self._missed = Missed(since, change.version)
                self._queue.clear()
            else:
                self._queue.append(change)
            self._waiters.answer(None)

    def close(self) -> None:
        """End the watch and the iterations of its readers."""
        if self._unsubscribe is not None:
            self._unsubscribe()
        with self._guard:
            self._closed = True
            self._queue.clear()
            self._missed = None
            self._waiters.answer(None)

    def __aiter__(self) -> Watch:
        return self

    async def __anext__(self) -> Change | Missed:
        """Return the next change that matches the pattern, or a gap (`Missed`)."""
        while True:
            with self._guard:
                if (item := self._take()) is not None:
                    return item
                if self._closed:
                    raise StopAsyncIteration
                future = self._waiters.join()
            try:
                await future
            finally:
                with self._guard:
                    self._waiters.leave(future)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _take(self) -> Change | Missed | None:
        if self._missed is not None:
            missed, self._missed = self._missed, None
            self._told = missed.until
            return missed
        if self._queue:
            change = self._queue.popleft()
            self._told = change.version
            return change
        return None


def _touching(pattern: str | Expression, params: Mapping[str, Value], schema: Schema) -> Touches:
    require_condition(pattern)
    require_params(params)
    parsed = parse_condition(pattern) if isinstance(pattern, str) else pattern
    return touches(parsed, dict(zip(fitted_names(parsed, params), params.values(), strict=True)), schema)


def touches(pattern: Expression, params: Mapping[str, Value], schema: Schema) -> Touches:
    """Return a function that returns whether a change matches `pattern`.

    A pattern is a predicate, function or type with arguments. A variable without a value in `params` matches any value;
    if the variable occurs twice, both arguments must be equal. The removal of an object matches the functions that may
    have had a value for that object.

    Raises:
        InputError: `pattern` is not a pattern.
        UnknownNameError: no predicate, function or type has that name.
        SchemaError: a wrong number of arguments.
    """
    if not isinstance(pattern, Atom) or not all(isinstance(a, Variable | Constant) for a in pattern.args):
        raise InputError("a pattern is one predicate, function or type, as in (on ?o table)", place=pattern.place)
    name, fits = pattern.predicate, _Fits(pattern, params)
    if schema.is_type(name, len(pattern.args)):
        return lambda change: _has_type(change.delta, name, schema, fits)
    if name in schema.functions:
        check_arity(schema.functions[name], len(pattern.args), pattern.place)
        return lambda change: _has_number(change.delta, name, fits)
    if name in schema.computed:
        raise schema.computed[name].refused(pattern.place)
    if name not in schema.predicates:
        valid = (*schema.predicates, *schema.functions, *schema.types)
        message = f"there is no predicate, function or type '{name}'"
        raise UnknownNameError(message, place=pattern.place, found=name, valid=valid)
    check_arity(schema.told(name, pattern.place), len(pattern.args), pattern.place)
    return lambda change: any(
        f.predicate == name and fits(f.args) for facts in (change.delta.removed, change.delta.added) for f in facts
    )


class _Fits:
    """Test whether arguments match the arguments of a pattern."""

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


def _has_type(delta: Delta, name: str, schema: Schema, fits: _Fits) -> bool:
    """Return whether the change matches the type.

    The removal of an object matches every type, as the type of the object is unknown.
    """
    return any(schema.is_a(own, name) and fits((thing,)) for thing, own in delta.nodes.items()) or any(
        fits((thing,)) for thing in delta.removed_nodes
    )


def _has_number(delta: Delta, name: str, fits: _Fits) -> bool:
    return any(f.predicate == name and fits(f.args) for f in delta.values) or any(
        fits.may_contain(thing) for thing in delta.removed_nodes
    )

"""Conversion functions: pure functions of Python that compute values of terms in plots (S2.21).

```python
@conversion
def best(items: list[Detection]) -> Item:
    return max(items, key=lambda one: one.score).item
```

A bundle lists its conversions; a plot calls one as `(best ?event.items)`.
"""

from __future__ import annotations

import hashlib
import inspect
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import CodeType
from typing import Any, Generic, ParamSpec, TypeVar

from dsc.annotations import FoundRecords, evaluated, names_around, type_of
from dsc.data_types import Records, data_type
from dsc.python_values import Builder, plain_value, typed_parameters
from dsc.run_log import run_logger
from knowledge_base.errors import InputError, Place, SchemaError, tolerated
from knowledge_base.spelling import is_plain_name
from knowledge_base.user_objects import described

LONGEST = 0.05
"""Seconds after which a conversion is reported in the log, as no event is processed meanwhile."""
RESERVED = frozenset({"list", "record", "size", "geometry"})
"""The words of terms that conversions cannot have as names."""
_LOG = run_logger(__package__)
_P = ParamSpec("_P")
_R = TypeVar("_R")


@dataclass(frozen=True, eq=False)
class Conversion(Generic[_P, _R]):
    """A function that terms of plots call.

    Attributes:
        name: the name of the function.
        body: the function itself.
        parameters: the types of the parameters by name, in order; `None` accepts any value.
        required: the number of parameters without a default, which come first.
        result: the type of the result; `None` for any plain data.
        records: the records in these types.
        builders: functions that make the values of Python for arguments with records or enumerations.
        digest: a hash of the function's code, by which a resumed run recognizes another version.
    """

    name: str
    body: Callable[_P, _R]
    parameters: Mapping[str, str | None]
    required: int
    result: str | None
    records: Records
    builders: Mapping[str, Builder]
    digest: str

    def __call__(self, *args: _P.args, **kwargs: _P.kwargs) -> _R:
        """Call the function, as any other function of Python."""
        return self.body(*args, **kwargs)

    def require_arguments(self, count: int) -> None:
        """Raise `InputError` unless the function can be called with that number of arguments."""
        if not self.required <= count <= len(self.parameters):
            wanted = f"({' '.join([self.name, *(f'?{name}' for name in self.parameters)])})"
            raise InputError(
                f"conversion '{self.name}' is called as {wanted}; found {count} arguments", found=self.name
            )

    def value(self, arguments: Sequence[Any], records: Records) -> Any:
        """Return the result for plain data, as plain data.

        Raises:
            InputError: an argument or the result does not have its type, or the function raises an exception.
        """
        self.require_arguments(len(arguments))
        made = []
        for (name, text), one in zip(self.parameters.items(), arguments, strict=False):
            place = f"the argument '{name}' of conversion '{self.name}'"
            checked = one if text is None else data_type(text).check(place, one, records)
            build = self.builders.get(name)
            made.append(checked if build is None else build(checked))
        began = time.perf_counter()
        try:
            found = plain_value(self.body(*made))  # type: ignore[call-arg]  # the arguments are checked
        except Exception as error:
            raise InputError(f"conversion '{self.name}': {described(error)}") from error
        if (took := time.perf_counter() - began) > LONGEST:
            code = inspect.unwrap(self.body).__code__
            where = f"{code.co_filename}:{code.co_firstlineno}"
            _LOG.warning("conversion '%s' took %.2f s, in which the run stood still (%s)", self.name, took, where)
        wanted = f"the result of conversion '{self.name}'"
        return found if self.result is None else data_type(self.result).check(wanted, found, records)


Conversions = Mapping[str, Conversion[..., Any]]
"""Conversions by name."""


def conversion(body: Callable[_P, _R]) -> Conversion[_P, _R]:
    """Declare a function as a conversion; its annotations are the types of its parameters and result.

    The function must be pure: equal arguments have equal results, and it changes nothing. It runs inside a macrostep; a
    duration above `LONGEST` is reported. A resumed run requires an unchanged function.

    Raises:
        SchemaError: the function is a coroutine, has no return annotation, or its name is not a name of plots.
    """
    code = inspect.unwrap(body).__code__
    with tolerated():
        try:
            return _declare(body, code)
        except InputError as error:
            error.place = error.place or Place(code.co_filename, code.co_firstlineno)
            raise
    return Conversion(body.__name__, body, {}, 0, None, {}, {}, "")  # the caller collects errors


def _declare(body: Callable[_P, _R], code: CodeType) -> Conversion[_P, _R]:
    name = body.__name__
    if not is_plain_name(name) or name in RESERVED:
        raise SchemaError(f"a conversion cannot be named '{name}': plots call it by a name in lower case", found=name)
    if inspect.iscoroutinefunction(body):
        raise SchemaError(f"conversion '{name}' is a coroutine, and a macrostep waits for nothing: write `def`")
    signature, names = inspect.signature(body), names_around(inspect.unwrap(body).__globals__)
    if signature.return_annotation is inspect.Signature.empty:
        raise SchemaError(f"conversion '{name}' has no return annotation, which is the type of its result")
    records = FoundRecords()
    types, builders = typed_parameters(body, 0, names, records)
    result = type_of(evaluated(signature.return_annotation, names, f"the result of '{name}'"), records)
    required = sum(one.default is inspect.Parameter.empty for one in signature.parameters.values())
    return Conversion(name, body, types, required, result, records, builders, _digest(code))


def _digest(code: CodeType) -> str:
    """Return a hash of a function's instructions and constants, which does not depend on the place in the file."""
    inner = [_digest(one) if isinstance(one, CodeType) else repr(one) for one in code.co_consts]
    text = "\n".join([code.co_code.hex(), *inner, *code.co_names])
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def conversions_by_name(found: Iterable[Conversion[..., Any]]) -> Conversions:
    """Return conversions by name.

    Raises:
        InputError: a value is not a conversion.
        SchemaError: two different conversions have one name.
    """
    named: dict[str, Conversion[..., Any]] = {}
    for one in found:
        if not isinstance(one, Conversion):
            raise InputError(f"{one!r} is not a conversion: decorate the function with `@conversion`")
        if named.setdefault(one.name, one) is not one:
            raise SchemaError(f"two conversions are named '{one.name}'", found=one.name)
    return named

"""Facts that Python code of a robot makes: `fact("robot-in", room)` names a declared predicate or function."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterable, Iterator
from pathlib import Path

from dsc.errors import Finding
from knowledge_base.errors import InputError, Place, SchemaError, UnknownNameError
from knowledge_base.language.checking.check import check_arity
from knowledge_base.origin import parse_program
from knowledge_base.world.schema import Schema

_OTHERS = frozenset({"dsc", "planning", "knowledge_base", "builtins", "abc", "typing"})


def sources_of(parts: Iterable[object]) -> list[Path]:
    """Return the Python files of the classes of these objects, with the other files of their packages.

    The result has no file of the library itself.
    """
    kinds = {kind for part in parts for kind in type(part).__mro__ if kind.__module__.partition(".")[0] not in _OTHERS}
    found: dict[Path, None] = {}
    for kind in sorted(kinds, key=lambda kind: (kind.__module__, kind.__qualname__)):
        file = inspect.getsourcefile(kind)
        if file is not None:
            package = "." in kind.__module__
            found.update(dict.fromkeys(sorted(Path(file).parent.glob("*.py")) if package else [Path(file)]))
    return list(found)


def wrong_facts(files: Iterable[Path], schema: Schema) -> Iterator[Finding]:
    """Yield a finding for each `fact(...)` with an undeclared name, or with another number of arguments."""
    for file in files:
        try:
            tree = parse_program(file.read_text("utf-8"))
        except (OSError, SyntaxError, ValueError):  # another finding reports it
            continue
        for call in ast.walk(tree):
            if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "fact":
                mistake = _mistake(call, schema, Place(str(file), call.lineno, call.col_offset + 1))
                yield from () if mistake is None else (Finding(mistake, "fact"),)


def _mistake(call: ast.Call, schema: Schema, place: Place) -> InputError | None:
    named = call.args[0] if call.args else None
    if not isinstance(named, ast.Constant) or not isinstance(named.value, str):
        return None
    name, given = named.value, len(call.args) - 1
    if name in schema.computed or schema.is_type(name, given):
        return None
    declared = schema.predicates.get(name) or schema.functions.get(name)
    if declared is None:
        valid = (*schema.predicates, *schema.functions)
        return UnknownNameError(f"there is no predicate or function '{name}'", place=place, found=name, valid=valid)
    if any(isinstance(arg, ast.Starred) for arg in call.args):
        return None
    try:
        check_arity(declared, given, place)
    except SchemaError as error:
        return error
    return None

"""Targets: the bundle that a text on the command line names.

A target is the name of an installed bundle, `MODULE:NAME`, a Python file with an optional `:NAME`, or a project folder.
"""

from __future__ import annotations

import importlib.util
import re
import sys
import tomllib
from collections.abc import Iterator, Mapping
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from dsc.components.assembly import made, module_error, named_part
from dsc.components.hooks import contained
from knowledge_base.errors import InputError, Place, UnknownNameError
from knowledge_base.tracebacks import user_place
from knowledge_base.user_objects import shown
from planning.robot.bundles import GROUP, Bundle, installed

ROBOT = "robot"
"""The name that a Python file gives to its bundle, and the name of the file in a project without entry points."""
_FILE = re.compile(r"(?P<file>.+\.py)(?::(?P<name>\w+))?")
_FORMS = "the name of an installed bundle, MODULE:NAME, a Python file (robot.py or robot.py:NAME), or a project folder"


def bundle_at(target: str) -> Bundle:
    """Return the bundle that a target names; the module of the target is executed.

    Raises:
        UnknownNameError: there is no such bundle, module, file or name.
        InputError: the module raises an error, or the name leads to another kind of object.
    """
    return _as_bundle(value_at(target), target)


def value_at(target: str) -> object:
    """Return the value that a target names, e.g. components; a function is called. Errors as for `bundle_at`."""
    path = Path(target)
    if path.is_dir():
        return _of_folder(path)
    if file := _FILE.fullmatch(target):
        return _of_file(Path(file["file"]), file["name"])
    if ":" in target:
        return made(named_part(target), target)
    found = installed()
    if target not in found and target not in found.errors:
        raise UnknownNameError(f"there is no robot '{target}'; a robot is {_FORMS}", found=target, valid=found)
    return found.require(target)


def _as_bundle(found: object, target: str) -> Bundle:
    if not isinstance(found, Bundle):
        raise InputError(f"'{target}' leads to {shown(found)}, not to a Bundle, e.g. Bundle.in_folder(...)")
    return found


def full_target(target: str) -> str:
    """Return the target in a form that is valid in every present folder."""
    file = _FILE.fullmatch(target)
    if file is not None:
        return str(Path(file["file"]).resolve()) + (f":{file['name']}" if file["name"] else "")
    return str(Path(target).resolve()) if Path(target).is_dir() else target


def _of_folder(folder: Path) -> object:
    points = entry_points_of(folder)
    for inside in (folder / "src", folder):
        if inside.is_dir() and str(inside.resolve()) not in sys.path:
            sys.path.insert(0, str(inside.resolve()))
    bundles = {name: _as_bundle(made(named_part(value), value), value) for name, value in points.items()}
    runnable = [one for one in bundles.values() if one.main is not None or one.goal is not None]
    if len(runnable) == 1 or len(bundles) == 1:
        return (runnable or [*bundles.values()])[0]
    if bundles:
        message = f"the project has {len(bundles)} bundles; name one as MODULE:NAME"
        raise InputError(message, place=Place(str(folder)), valid=points.values())
    if (folder / f"{ROBOT}.py").is_file():
        return _of_file(folder / f"{ROBOT}.py", None)
    message = f"the folder has neither an entry point '{GROUP}' in its pyproject.toml nor a {ROBOT}.py"
    raise InputError(message, place=Place(str(folder)))


def entry_points_of(folder: Path) -> Mapping[str, str]:
    """Return the entry points `GROUP` of the folder's `pyproject.toml`; the project need not be installed."""
    file = folder / "pyproject.toml"
    if not file.is_file():
        return {}
    try:
        points = tomllib.loads(file.read_text("utf-8")).get("project", {}).get("entry-points", {}).get(GROUP, {})
    except (ValueError, AttributeError) as error:
        raise InputError(f"this is not a pyproject.toml: {error}", place=Place(str(file))) from None
    if not isinstance(points, dict) or not all(isinstance(value, str) for value in points.values()):
        raise InputError(f"the entry points '{GROUP}' are names with MODULE:NAME", place=Place(str(file)))
    return points


def _of_file(file: Path, name: str | None) -> object:
    module = _execute(file)
    if name is None:
        name = _only_bundle(module, file)
    if not hasattr(module, name):
        raise UnknownNameError(f"there is no '{name}' in {file}", found=name, valid=_public(module))
    return made(getattr(module, name), f"{file}:{name}")


def _execute(file: Path) -> ModuleType:
    if not file.is_file():
        raise InputError("there is no such file", place=Place(str(file)), found=str(file))
    name, above = file.resolve().stem, file.resolve().parent
    while (above / "__init__.py").is_file() and above.name.isidentifier():
        name, above = f"{above.name}.{name}", above.parent
    folder = str(above)
    if folder not in sys.path:
        sys.path.insert(0, folder)
    try:
        with contained():
            known = sys.modules.get(name)
            if known is not None and getattr(known, "__file__", None) == str(file.resolve()):
                return known
            if known is None and all(part.isidentifier() for part in name.split(".")):
                return import_module(name)
            return _load(file.resolve().stem, file)
    except InputError as error:
        if error.place is not None:
            raise
        raise InputError(f"{file} cannot be executed: {error}", place=user_place(error)) from error
    except Exception as error:  # a user's module may raise any error
        raise module_error(error, f"{file} cannot be executed") from error


def _load(name: str, file: Path) -> ModuleType:
    """Execute a file whose module name is taken or not an identifier."""
    spec = importlib.util.spec_from_file_location(f"_target_{name}", file)
    assert spec is not None and spec.loader is not None  # noqa: S101, PT018  the file ends in .py
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def _only_bundle(module: ModuleType, file: Path) -> str:
    if hasattr(module, ROBOT):
        return ROBOT
    named = {name: value for name, value in vars(module).items() if isinstance(value, Bundle)}
    if len(named) == 1:
        return next(iter(named))
    has = f"has {len(named)} bundles" if named else "has no bundle"
    message = f"the file {has}; name one as {file.name}:NAME, or call it `{ROBOT}`"
    raise InputError(message, place=Place(str(file)), valid=named or _public(module))


def _public(module: ModuleType) -> Iterator[str]:
    names: dict[str, Any] = vars(module)
    return (name for name in names if not name.startswith("_"))

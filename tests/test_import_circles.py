"""Modules import each other without circles; imports for types only, and imports inside functions, count."""

import ast
import graphlib
from collections.abc import Iterator
from collections.abc import Set as AbstractSet
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
ROOMS = ("knowledge_base", "dsc", "planning", "domains")


def imports_of_product() -> dict[str, set[str]]:
    """Each module with the modules of the product that it imports."""
    files = {_name(file): file for room in ROOMS for file in (ROOT / room).rglob("*.py")}
    return {name: set(_imported(file, files.keys())) - {name} for name, file in files.items()}


def _name(file: Path) -> str:
    return ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def _imported(file: Path, known: AbstractSet[str]) -> Iterator[str]:
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in known)
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            inside = {f"{node.module}.{alias.name}" for alias in node.names}
            yield from inside & known
            if node.module in known and not inside <= known:
                yield node.module


def circles(imports: dict[str, set[str]]) -> list[set[str]]:
    """The strongly connected components of more than one module."""
    reached = {name: _reached(name, imports) for name in imports}
    found: list[set[str]] = []
    for name in sorted(imports):
        if name in reached[name] and not any(name in circle for circle in found):
            found.append({other for other in reached[name] if name in reached[other]})
    return found


def _reached(start: str, imports: dict[str, set[str]]) -> set[str]:
    """All modules that one imports, directly or through others."""
    found: set[str] = set()
    left = [*imports[start]]
    while left:
        if (name := left.pop()) not in found:
            found.add(name)
            left += imports[name]
    return found


def test_modules_import_each_other_without_circles():
    assert circles(imports_of_product()) == []


def test_rooms_import_each_other_without_circles():
    """The import contracts leave out imports for types only."""
    rooms: dict[str, set[str]] = {}
    for name, others in imports_of_product().items():
        if name.count("."):
            room = _room(name)
            rooms.setdefault(room, set()).update(_room(other) for other in others if other.count("."))
    for room, others in rooms.items():
        others.discard(room)
    graphlib.TopologicalSorter(rooms).prepare()


def _room(module: str) -> str:
    return ".".join(module.split(".")[:2])


def test_a_circle_of_types_only_is_found():
    imports = {"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": {"a"}}
    assert circles(imports) == [{"b", "c"}]

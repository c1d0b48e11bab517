"""Measures of the code's structure, compared with the limits in `house.toml`: sizes, imports, names, circles, calls.

`python tests/house.py` prints each measure with its limit and ends with status 1 if one is exceeded; `make check` runs it.
A limit may only shrink. `--names` prints the names that count, so that they can be replaced.
"""

from __future__ import annotations

import argparse
import ast
import io
import json
import re
import statistics
import tokenize
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from pathlib import Path

from prose import WORDS

from knowledge_base.origin import parse_program

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ("knowledge_base", "dsc", "planning", "domains")
LIMITS = Path(__file__).with_name("house.toml")
CALLS = ROOT / "benchmarks" / "calls.json"

_BANNED = re.compile("|".join(rf"\b(?:{pattern})\b" for pattern in WORDS))
_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")
_PARTICIPLE = re.compile(
    r"_?(?:[a-z]+ed|given|taken|made|found|said|told|held|known|shown|drawn|written|begun|kept|left|sent)"
)
_CLAUSE = re.compile(r"test_(?:what|who|whom|whose|whoever|whatever|how|where|that)_")


def modules(*folders: str) -> list[Path]:
    """Return the modules in folders of the project, without the project template."""
    found = chain.from_iterable(sorted((ROOT / folder).rglob("*.py")) for folder in folders)
    return [file for file in found if "project_template" not in file.parts]


def code_lines(source: str) -> set[int]:
    """Return the numbers of the lines that have code: no comments, docstrings and blank lines."""
    strings = {
        line
        for node in ast.walk(parse_program(source))
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        for line in range(node.lineno, (node.end_lineno or node.lineno) + 1)
    }
    ignored = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}
    tokens = (one for one in tokenize.generate_tokens(io.StringIO(source).readline) if one.type not in ignored)
    return {line for one in tokens for line in range(one.start[0], one.end[0] + 1)} - strings


def imports(tree: ast.AST) -> list[ast.Import | ast.ImportFrom]:
    """Return the import statements, those inside functions included."""
    return [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]


def imported(file: Path, known: set[str]) -> set[str]:
    """Return the modules among `known` that a file imports, relative imports included."""
    found: set[str] = set()
    for node in imports(parse_program(file.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names} & known
            continue
        package = module_name(file).split(".") if file.name == "__init__.py" else module_name(file).split(".")[:-1]
        base = (
            ".".join([*package[: len(package) - node.level + 1], *filter(None, [node.module])])
            if node.level
            else node.module
        )
        inside = {f"{base}.{alias.name}" for alias in node.names}
        found |= inside & known or {str(base)} & known
    return found - {module_name(file)}


def module_name(file: Path) -> str:
    """Return the dotted name of a module."""
    return ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def room(module: str) -> str:
    """Return the room of a module: the folder inside its package, or the module itself."""
    return ".".join(module.split(".")[:2])


def arrows(package: str) -> set[tuple[str, str]]:
    """Return the imports between the rooms of a package; its public interface is not a room."""
    files = {module_name(file): file for file in modules(package)}
    found = {(room(name), room(other)) for name, file in files.items() for other in imported(file, {*files})}
    return {(one, other) for one, other in found if package not in (one, other) and one != other}


def circles(files: Iterable[Path]) -> list[list[str]]:
    """Return the groups of modules that import each other, directly or indirectly."""
    named = {module_name(file): file for file in files}
    below = {name: imported(file, {*named}) for name, file in named.items()}
    reached = {name: _reached(name, below) for name in below}
    groups = {
        frozenset(other for other in reached[name] if name in reached[other]) for name in below if name in reached[name]
    }
    return [sorted(group) for group in groups]


def _reached(name: str, below: dict[str, set[str]]) -> set[str]:
    found: set[str] = set()
    agenda = [*below[name]]
    while agenda:
        if (one := agenda.pop()) not in found:
            found.add(one)
            agenda += below[one]
    return found


def defined_names(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Yield line and name of each class, function, parameter, variable and attribute that a module defines."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            yield node.lineno, node.name
        elif isinstance(node, ast.arg):
            yield node.lineno, node.arg
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.lineno, node.id
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            yield node.lineno, node.attr


def is_banned(name: str) -> bool:
    """Return whether a name contains a word that the prose check bans."""
    return _BANNED.search(" ".join(_WORD.findall(name)).lower()) is not None


def banned_names(files: Iterable[Path]) -> dict[str, str]:
    """Return the different banned names, each with the place of its first definition."""
    return {name: place for name, place in _named(files) if is_banned(name)}


def participles(files: Iterable[Path]) -> list[str]:
    """Return the functions whose whole name is a participle, instead of a verb with an object."""
    trees = (parse_program(file.read_text("utf-8")) for file in files)
    functions = (
        node for tree in trees for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    )
    return [node.name for node in functions if _PARTICIPLE.fullmatch(node.name)]


def clause_names() -> list[str]:
    """Return the tests whose name begins with a clause instead of a subject."""
    trees = (parse_program(file.read_text("utf-8")) for file in modules("tests"))
    return [name for tree in trees for _, name in defined_names(tree) if _CLAUSE.match(name)]


def _named(files: Iterable[Path]) -> Iterator[tuple[str, str]]:
    seen: set[str] = set()
    for file in files:
        for line, name in defined_names(parse_program(file.read_text("utf-8"))):
            if name not in seen:
                seen.add(name)
                yield name, f"{file.relative_to(ROOT)}:{line}"


def measures() -> dict[str, float]:
    """Return all measures by name."""
    product = modules(*SOURCES)
    sources = [file.read_text("utf-8") for file in product]
    code = [code_lines(source) for source in sources]
    per_file = [sorted(set(_modules_of(parse_program(source)))) for source in sources]
    import_lines = sum(
        len(
            {line for node in imports(parse_program(source)) for line in range(node.lineno, (node.end_lineno or 0) + 1)}
        )
        for source in sources
    )
    lines = sum(map(len, code))
    rooms = {room(module_name(file)) for file in modules("planning")} - {"planning"}
    template = ROOT / "planning" / "project_template"
    return {
        "modules": len(product),
        "code lines": lines,
        "import lines, %": round(100 * import_lines / lines, 1),
        "imported modules a file, p90": statistics.quantiles(map(len, per_file), n=10)[-1],
        "longest module, lines": max(source.count("\n") for source in sources),
        "modules of 300 lines and more": sum(source.count("\n") >= 300 for source in sources),
        "banned names": len(banned_names(product)),
        "functions named by a participle": len(participles(product)),
        "tests named by a clause": len(clause_names()),
        "circles": len(circles(product)) + len(circles(sorted(template.rglob("*.py")))),
        "rooms of planning": len(rooms),
        "arrows of planning": len(arrows("planning")),
        **{f"calls: {flow}": calls for flow, calls in json.loads(CALLS.read_text("utf-8")).items()},
    }


def _modules_of(tree: ast.AST) -> Iterator[str]:
    for node in imports(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        else:
            yield str(node.module)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the measures with their limits; return 1 if a measure exceeds its limit."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument(
        "--names", action="store_true", help="print the names that count as banned, participle or clause"
    )
    if parser.parse_args(arguments).names:
        product = modules(*SOURCES)
        for name, place in banned_names(product).items():
            print(f"{place}: banned: {name}")
        print(
            *(f"participle: {name}" for name in participles(product)),
            *(f"clause: {name}" for name in clause_names()),
            sep="\n",
        )
        return 0
    limits = tomllib.loads(LIMITS.read_text("utf-8"))["limits"]
    found = measures()
    exceeded = [name for name, value in found.items() if name in limits and value > limits[name]]
    for name, value in found.items():
        mark = "  EXCEEDED" if name in exceeded else ""
        print(f"{name:<44}{value:>10g}{limits.get(name, ''):>10}{mark}")
    return int(bool(exceeded))


if __name__ == "__main__":
    raise SystemExit(main())

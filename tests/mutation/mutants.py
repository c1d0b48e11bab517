"""Mutants of a room, as mutmut makes them: names, places and changes."""

from __future__ import annotations

import ast
import difflib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from mutmut.mutation.data import LineSpan
from mutmut.mutation.file_mutation import mutate_file_contents
from mutmut.utils.format_utils import (
    get_mutant_name,
    mangled_name_from_mutant_name,
    orig_function_and_class_names_from_key,
)
from rooms import ROOT


@dataclass(frozen=True)
class Mutant:
    """One change of one function.

    Attributes:
        name: mutmut's own.
        path: module file, relative to the repository.
        function: module, class and function, joined by dots.
        line: first changed line in the repository's file.
        change: removed lines after `- `, then added lines after `+ `, without indentation.
        key, digest: the mutated function for mutmut, and its content; a verdict holds for this content.
    """

    name: str
    path: str
    function: str
    line: int
    change: str
    key: str
    digest: str


def mutants_of(path: str, folder: Path) -> Iterator[Mutant]:
    """Return the mutants of a module, in the workspace `folder`, which is the working directory."""
    mutated = mutate_file_contents(path, (folder / path).read_text())
    lines = mutated.code.splitlines()
    starts = dict(_starts((ROOT / path).read_text()))
    module = path.removesuffix(".py").replace("/", ".")
    for name in mutated.mutant_names:
        original = mangled_name_from_mutant_name(name)
        function, owner = orig_function_and_class_names_from_key(name)
        qualified = f"{owner}.{function}" if owner else function
        before = _body(lines, mutated.line_span_by_function_name[f"{original}__mutmut_orig"])
        after = _body(lines, mutated.line_span_by_function_name[name])
        before[0], after[0] = (text.replace(made, function) for text, made in
                               ((before[0], f"{original}__mutmut_orig"), (after[0], name)))  # fmt: skip
        offset, change = _difference(before, after)
        yield Mutant(
            name=get_mutant_name(Path(path), name),
            path=path,
            function=f"{module}.{qualified}",
            line=starts[qualified] + offset,
            change=change,
            key=original,
            digest=mutated.hash_by_function_name.get(original, ""),
        )


def _body(lines: list[str], span: LineSpan) -> list[str]:
    """Return the function's lines from its `def` on."""
    own = lines[span.start - 1 : span.end]
    first = next(at for at, line in enumerate(own) if line.lstrip().startswith(("def ", "async def ")))
    return own[first:]


def _difference(before: list[str], after: list[str]) -> tuple[int, str]:
    """Return the offset of the first change, and the changed lines."""
    blocks = [
        code
        for code in difflib.SequenceMatcher(None, before, after, autojunk=False).get_opcodes()
        if code[0] != "equal"
    ]
    gone = [f"- {line.strip()}" for _, start, end, _, _ in blocks for line in before[start:end]]
    come = [f"+ {line.strip()}" for _, _, _, start, end in blocks for line in after[start:end]]
    return blocks[0][1], "\n".join([*gone, *come])


def _starts(text: str) -> Iterator[tuple[str, int]]:
    """Yield each function and method with the line of its `def`."""
    for node in ast.parse(text).body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield node.name, node.lineno
        elif isinstance(node, ast.ClassDef):
            for inner in node.body:
                if isinstance(inner, ast.FunctionDef | ast.AsyncFunctionDef):
                    yield f"{node.name}.{inner.name}", inner.lineno

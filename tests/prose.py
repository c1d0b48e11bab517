"""Checks the prose of pages, docstrings, comments and error messages.

`python tests/prose.py` checks every room that is not in `PENDING`, as `make check` does. With paths it checks these
files and folders, pending or not. `--list` counts the findings of each room. The rules are in CONTRIBUTING.md.
"""

from __future__ import annotations

import argparse
import ast
import inspect
import io
import re
import tokenize
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
PAGES = ("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md", "docs/**/*.md")
SOURCES = ("knowledge_base", "dsc", "planning", "domains", "benchmarks")
KEY = ROOT / "docs" / "sources.md"
"""The key of paper rows such as (S0.4)."""
MOST_WORDS = 25
MOST_WORDS_WITH_REASON = 32
"""The limit for a sentence of Python source with a colon or semicolon: claim and reason belong together there."""
RULES = ("length", "subject", "word", "row")

WORDS = {
    "affairs?": "task",
    "all that": "every",
    "all the same": "still",
    "anew|once more": "again",
    "again and again": "repeatedly",
    "any ?more": "no longer",
    "(?:any|every|some)(?:body|one)|nobody|no one": "the role: caller, component, reader",
    "(?:as|so) far as": "if, or the limit by name",
    "ask(?:s|ed)? after": "query the status of",
    "at once": "immediately, or together",
    "at rest": "idle, or stopped",
    "at work": "active, or running",
    "be had": "available",
    "(?:become|becomes|became|come|comes|came) of": "result",
    "beside": "next to, or with",
    "br(?:eak|eaks|eaking|oken|oke) off": "interrupt",
    "br(?:ing|ings|inging|ought) about": "cause",
    "carr(?:y|ies|ied|ying) out": "execute",
    "for ever": "without end",
    "(?:and|by|for|from|of|or|to|with) who|whom|whoever": "the role: caller, component, reader",
    "(?:give|gives|given|gave|giving) up": "abandon",
    "(?:go|goes|going|gone|went) on": "continue",
    "(?:hand|hands|handed|handing) (?:on|over|back)": "pass, or return",
    "hears?|heard": "receive",
    "hence|lest|thereby|therein|thereof|wherein": "two sentences",
    "hold(?:s)? against|held against": "compare with",
    "in a circle": "cycle",
    "in force": "active, or effective",
    "in the place of|takes? the place of": "replace",
    "(?:is|are) (?:that|those) of": "equal",
    "(?<!there )(?:is|are|was|were) no(?= [a-z])(?! longer| more| such)": "is not a",
    "(?:is|are|was|were|be) not there": "missing",
    "(?:is|are|was|were|be|been|being) said|(?:said|says?) of": "declare, state, or report",
    "(?:is|are|was|were|be|been|being) told": "receive, or assert",
    "judge[sd]?|judging": "validate",
    "keepers?": "supervisor",
    "(?:leave|leaves|left|leaving) out": "omit",
    "look(?:s|ed)? back": "inspect",
    "mend(?:s|ed|ing)?": "repair",
    "not known": "unknown",
    "now and then": "periodically",
    "of (?:its|their|our|your|one's|his|her) own": "own, or separate",
    "ours": "of this project",
    "posed|posing": "construct the problem",
    "put(?:s|ting)? in order|things in order": "clean up",
    "rests? (?:on|upon)": "depend on",
    "rosters?": "registry",
    "rungs?": "escalation step",
    "shall": "must",
    "side by side": "in parallel, or concurrently",
    "so (?:many|much)": "the number by name",
    "standstill": "deadlock",
    "(?:stand|stands|stood)(?! for| still)": "be, or appear",
    "stays? as (?:it|they)": "stay unchanged",
    "still to come|yet to come": "pending",
    "swallow(?:s|ed|ing)?": "ignore",
    "taken? up|takes up|taking up|took up": "resume",
    "the like": "similar",
    "thought": "expected, or computed",
    "under way": "running, or in progress",
    "what of": "two sentences",
    "whatever|whichever|wherever": "any, or every",
    "works? out|worked out": "compute",
    "worth": "value",
}
"""Private or archaic words (patterns), and the words to use instead."""

PENDING: set[str] = set()
"""Rooms that are not rewritten yet: pages, and folders without the folders inside. The list only shrinks."""


class Finding(NamedTuple):
    """A sentence that breaks a rule, and how."""

    file: Path
    line: int
    rule: str
    how: str
    text: str

    def __str__(self) -> str:
        """One line; the file is relative to the checkout."""
        return f"{self.file.relative_to(ROOT)}:{self.line}: {self.rule}: {self.how}: {self.text[:60]}"


_BLOCK = re.compile(r"^ *```.*?^ *```[^\n]*$|^ *\|[^\n]*$", re.MULTILINE | re.DOTALL)
_CODE = re.compile(r"(`+)(?:[^\n]|\n(?! *\n))+?\1|https?://\S+")
_PART = re.compile(
    r"^ *(?:[-*>]|\d+\.|#{1,6}) |^ *(?:Args|Attributes|Raises|Returns|Yields):$|^ {4}[\w*, .…]+: |\n(?= *\n)",
    re.MULTILINE,
)
"""The beginning of a list item, heading, docstring section or its entry, or the end of a paragraph."""
_END = re.compile(r"\f|(?<!e\.g)(?<!i\.e)(?<! vs)[.!?][\"')\]*]*(?:\s+|$)")
_LINK = re.compile(r"!?\[([^\]]*)\]\([^)]*\)")
_WORD = re.compile(r"[A-Za-z0-9][\w'.,/+-]*")
_SUBJECT = re.compile(
    r"(?:^|; )[(\"'*]*(?:(?:and|but) )?(?:(?:what(?:ever)?|who(?:m|se|ever)?|how)\b|where\b(?!.*,))", re.IGNORECASE
)
_PRIVATE = {re.compile(rf"\b(?:{pattern})\b", re.IGNORECASE): instead for pattern, instead in WORDS.items()}
_DIRECTIVE = re.compile(r"# *(?:noqa(?:: [A-Z0-9, ]+)?|type: \S+|fmt: \w+|-- .*|!.*)")
_ROW = re.compile(r"\bS[0-4]\.\d+\b")


def sentences(text: str, first: int = 1) -> Iterator[tuple[int, str]]:
    """Line and text of each sentence in Markdown or a docstring, without code; `first` is the line of its beginning."""
    text = _BLOCK.sub(lambda block: "\f" + "\n" * block[0].count("\n"), text)
    text = _CODE.sub(lambda code: "…" + "\n" * code[0].count("\n"), text)
    text = _PART.sub(lambda part: "\n\f" if part[0] == "\n" else "\f", text)
    start = 0
    for end in chain((match.end() for match in _END.finditer(text)), [len(text)]):
        part = text[start:end].strip("\f")
        blank = len(part) - len(part.lstrip())
        if part.strip():
            yield first + text[:start].count("\n") + part[:blank].count("\n"), " ".join(part.split())
        start = end


def of_python(source: str) -> Iterator[tuple[int, str]]:
    """Sentences of docstrings, comments and error messages."""
    tree = ast.parse(source)
    for line, text in chain(_docstrings(tree), _messages(tree), _comments(source)):
        yield from sentences(text, line)


def _docstrings(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Docstrings, those of attributes included."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            yield node.lineno, inspect.cleandoc(node.value.value)


def _messages(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Text that `raise` passes to an error, directly or in a variable."""
    raised = [node.exc for node in ast.walk(tree) if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call)]
    names = {node.id for call in raised for node in ast.walk(call) if isinstance(node, ast.Name)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign) and any(isinstance(one, ast.Name) and one.id in names for one in node.targets):
            yield from _literals(node.value)
    yield from chain.from_iterable(map(_literals, raised))


def _literals(node: ast.AST) -> Iterator[tuple[int, str]]:
    if isinstance(node, ast.JoinedStr):
        yield node.lineno, "".join(str(part.value) if isinstance(part, ast.Constant) else "…" for part in node.values)
    elif isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.lineno, node.value
    else:
        yield from chain.from_iterable(_literals(child) for child in ast.iter_child_nodes(node))


def _comments(source: str) -> Iterator[tuple[int, str]]:
    """Comments; lines of comment that follow each other are one."""
    block: list[str] = []
    begun = 0
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            alone = not token.line[: token.start[1]].strip()
            if block and not (alone and token.start[0] == begun + len(block)):
                yield begun, "\n".join(block)
                block = []
            begun = begun if block else token.start[0]
            block.append(_DIRECTIVE.sub("", token.string).lstrip("# "))
    yield begun, "\n".join(block)


def broken_rules(text: str, *, source: bool = False) -> Iterator[tuple[str, str]]:
    """The rules that a sentence of a page, or of Python source, breaks, and how."""
    words = len(_WORD.findall(_LINK.sub("", text)))
    if words > (MOST_WORDS_WITH_REASON if source and re.search("[:;]", text) else MOST_WORDS):
        yield "length", f"{words} words"
    text = _LINK.sub(r"\1", text)
    if _SUBJECT.search(text) and not text.rstrip("\"')*").endswith("?"):
        yield "subject", "begin with a noun"
    for pattern, instead in _PRIVATE.items():
        for match in pattern.finditer(text):
            yield "word", f"'{match[0]}' (use {instead})"


def key() -> set[str]:
    """The paper rows that `docs/sources.md` has a line for."""
    return set(re.findall(rf"^\| ({_ROW.pattern}) \|", KEY.read_text(), re.MULTILINE))


def cited(path: Path) -> Iterator[tuple[int, str]]:
    """Lines of a file that cite a paper row, and the row."""
    for number, line in enumerate(path.read_text().splitlines(), 1):
        for row in _ROW.findall(line):
            yield number, row


def prose() -> list[Path]:
    """All files with prose."""
    pages = chain.from_iterable(sorted(ROOT.glob(pattern)) for pattern in PAGES)
    return [*pages, *chain.from_iterable(sorted((ROOT / source).rglob("*.py")) for source in SOURCES)]


def citing() -> list[Path]:
    """All files that may cite a paper row."""
    return [*prose(), *sorted((ROOT / "tests").rglob("*.py"))]


def room(path: Path) -> str:
    """The folder of a module; a page is a room by itself."""
    return (path.parent if path.suffix == ".py" else path).relative_to(ROOT).as_posix()


def findings(path: Path) -> list[Finding]:
    """Sentences of a file that break a rule, by line."""
    source = path.read_text()
    is_source = path.suffix == ".py"
    found = of_python(source) if is_source else sentences(source)
    broken = ((line, text, rule) for line, text in found for rule in broken_rules(text, source=is_source))
    return sorted(Finding(path, line, *rule, text) for line, text, rule in broken)


def unkeyed(paths: Iterable[Path]) -> Iterator[Finding]:
    """Citations of paper rows that the key has no line for."""
    rows = key()
    for path in paths:
        for line, row in cited(path):
            if row not in rows:
                yield Finding(path, line, "row", f"no line in {KEY.relative_to(ROOT)}", row)


def _counts(found: Iterable[Finding]) -> Iterator[str]:
    counts = Counter((room(one.file), one.rule) for one in found)
    rooms = [*dict.fromkeys(name for name, _ in counts)]
    yield f"{'room':40}" + "".join(f"{rule:>8}" for rule in RULES)
    for name in rooms:
        pending = "  pending" if name in PENDING else ""
        yield f"{name:40}" + "".join(f"{counts[name, rule]:8}" for rule in RULES) + pending
    yield f"{'all':40}" + "".join(f"{sum(counts[name, rule] for name in rooms):8}" for rule in RULES)


def main(arguments: Sequence[str] | None = None) -> int:
    """The command; returns its exit status."""
    parser = argparse.ArgumentParser(description="Check the prose of pages, docstrings, comments and error messages.")
    parser.add_argument("--list", action="store_true", help="count the findings of each room")
    parser.add_argument("paths", nargs="*", type=Path, help="files and folders to check, pending or not")
    given = parser.parse_args(arguments)
    chosen = {path.resolve() for path in given.paths} or {ROOT}
    paths = [path for path in prose() if chosen & {path, *path.parents}]
    if not paths:
        parser.error("the paths hold no prose that is checked")
    checked = paths if given.paths or given.list else [path for path in paths if room(path) not in PENDING]
    found = [*chain.from_iterable(map(findings, checked)), *unkeyed(paths if given.paths else citing())]
    for line in _counts(found) if given.list else map(str, found):
        print(line)
    return int(bool(found) and not given.list)


if __name__ == "__main__":
    raise SystemExit(main())

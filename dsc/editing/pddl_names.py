"""Names in PDDL texts, also in half-written ones: one pass over the words, with the groups around each."""

from __future__ import annotations

import re
from collections.abc import Iterator

from dsc.editing.names import NameKind, Occurrence
from knowledge_base.language.syntax.expression import KEYWORDS

_TOKEN = re.compile(r"""(?P<skip>;[^\n]*|"[^"]*")|(?P<open>\()|(?P<close>\))|(?P<word>[^\s()";]+)""")
_NAMES = {":types": "type", ":constants": "object", ":objects": "object"}
_DECLARES = frozenset({":predicates", ":functions"})
_ACTIONS = frozenset({":action", ":durative-action"})


def pddl_names(text: str) -> Iterator[Occurrence]:
    """Yield the names in the text of a PDDL domain or problem."""
    heads: list[str | None] = []
    action, before, asked = "", "", ""
    for match in _TOKEN.finditer(text):
        begin, end = match.span()
        if match["open"]:
            heads.append(None)
        elif match["close"]:
            heads[-1:] = []
        elif match["word"]:
            word = match["word"]
            head = bool(heads) and heads[-1] is None
            if head:
                heads[-1] = word.lower()
            section = next((one for one in heads if one and one.startswith(":")), "")
            asked = word if word.startswith(":") else asked
            if before.lower() in _ACTIONS:
                action = word
                yield Occurrence("action", word, begin, end, defines=True, about=_line(text, begin))
            elif word.startswith("?"):
                if section in _ACTIONS:
                    yield Occurrence("variable", word[1:], begin + 1, end, asked == ":parameters", f"action {action}")
            elif word[0].isalpha() and word.lower() not in KEYWORDS and heads[1:2] != ["domain"]:
                kind = _kind(section, before, head=head)
                defines = before != "-" and (section in _NAMES or (section in _DECLARES and head))
                if kind is not None and "define" in heads[:1] and len(heads) > 1:
                    yield Occurrence(kind, word, begin, end, defines, about=_group(text, begin) if defines else "")
            before = word


def _kind(section: str, before: str, *, head: bool) -> NameKind | None:
    if before == "-":
        return "type"
    if section in _NAMES:
        return "type" if _NAMES[section] == "type" else "object"
    if section in {"", ":requirements", ":domain"}:
        return None
    return "relation" if head else "object"


def _group(text: str, begin: int) -> str:
    """Return the declaration around a name, without line breaks."""
    start = text.rfind("(", 0, begin)
    end = text.find(")", begin)
    return " ".join(text[start : end + 1].split()) if text[start + 1 : begin].strip() == "" and end > 0 else ""


def _line(text: str, begin: int) -> str:
    """Return the name of an action with its parameters."""
    found = re.compile(r"(\S+)\s*:parameters\s*\(([^()]*)\)").match(text, begin)
    return text[begin:].split(maxsplit=1)[0] if found is None else f"({found[1]} {' '.join(found[2].split())})"

"""The place of a cursor in YAML that may be half-written: keys around it, by indentation and open brackets."""

from __future__ import annotations

import re
from dataclasses import dataclass

_LINE = re.compile(r"""(?P<lead>[ ]*(?:-[ ]+)*)(?:(?P<key>[\w.\-?]+|"[^"]*"|'[^']*'):(?=\s|$))?(?P<rest>.*)""")
_WORD = re.compile(r"[\w?.:\-]*$")
_FLOW = re.compile(
    r"""(?P<quote>"[^"]*"?|'[^']*'?)|(?P<open>[{\[])|(?P<close>[}\]])|(?P<key>[\w.\-?]+):(?=\s|$)|(?P<comma>,)|[^\s,{}\[\]"']+|\s"""
)


@dataclass(frozen=True, slots=True)
class Cursor:
    """The surroundings of a cursor.

    Attributes:
        path: the keys around the cursor; a position in a list is 0.
        prefix: the part of a word before the cursor.
        value: the text of the value before the cursor; `None` where a key is written.
    """

    path: tuple[str | int, ...]
    prefix: str
    value: str | None

    @property
    def in_expression(self) -> bool:
        """Whether a condition, effect or term is written."""
        return self.prefix.startswith("?") or (self.value or "").lstrip(" '\"").startswith("(")


def cursor_at(text: str, offset: int) -> Cursor:
    """Return the surroundings of an offset in a YAML text."""
    stack: list[tuple[int, str | int]] = []
    flow = ""
    lines = text[:offset].split("\n")
    for number, line in enumerate(lines):
        last = number == len(lines) - 1
        if flow:
            flow += "\n" + line
        elif not last and (not line.strip() or line.lstrip().startswith("#")):
            continue
        else:
            flow = _enter(line, stack)
        if not last and _depth(flow) <= 0:
            flow = ""
    prefix = _WORD.search(lines[-1])
    word = "" if prefix is None else prefix[0]
    around = tuple(key for _, key in stack)
    if _depth(flow) > 0:
        inside, key, value = _flow_path(flow)
        return Cursor((*around, *inside, *([key] if key is not None else [])), word, value)
    match = _LINE.fullmatch(lines[-1])
    if match is not None and match["key"]:
        return Cursor(around, word, match["rest"])
    if match is not None and "-" in match["lead"]:
        return Cursor(around, word, match["rest"])
    return Cursor(around, word, None)


def _enter(line: str, stack: list[tuple[int, str | int]]) -> str:
    """Push the key of a line in place of deeper ones; return the rest of the line."""
    match = _LINE.fullmatch(line)
    if match is None:
        return ""
    lead = match["lead"]
    indent = len(lead) - len(lead.lstrip(" "))
    while stack and stack[-1][0] >= indent and not (stack[-1][1] != 0 and lead.strip() and stack[-1][0] == indent):
        stack.pop()
    for at, character in enumerate(lead):
        if character == "-":
            stack.append((at, 0))
    if match["key"]:
        stack.append((len(lead), match["key"].strip("\"'")))
    return match["rest"]


def _depth(flow: str) -> int:
    opened = closed = 0
    for match in _FLOW.finditer(flow):
        opened += match["open"] is not None
        closed += match["close"] is not None
    return opened - closed


def _flow_path(flow: str) -> tuple[list[str | int], str | None, str | None]:
    """Return the keys inside the brackets of a value, the last key, and the value after it."""
    frames: list[tuple[str, str | None, int]] = []
    for match in _FLOW.finditer(flow):
        if match["open"]:
            frames.append((match["open"], None, match.end()))
        elif match["close"] and frames:
            frames.pop()
        elif frames and match["key"] and frames[-1][0] == "{":
            frames[-1] = ("{", match["key"], match.end())
        elif frames and match["comma"]:
            frames[-1] = (frames[-1][0], None, match.end())
    path: list[str | int] = [0 if bracket == "[" else str(key) for bracket, key, _ in frames[:-1]]
    bracket, key, begin = frames[-1]
    if bracket == "[":
        return [*path, 0], None, flow[begin:]
    return path, key, None if key is None else flow[begin:]

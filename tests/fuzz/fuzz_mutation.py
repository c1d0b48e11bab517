"""Mutations of inputs, each drawn from a `Random`: bytes, words, brackets, lines, values of JSON, rows of a database."""

from __future__ import annotations

import json
import re
import sqlite3
from collections.abc import Callable, Sequence
from pathlib import Path
from random import Random
from typing import Any

MOST_BYTES = 400_000
"""Bytes of a mutated input; above every limit of a reader, and cheap to make."""
NUMBERS = (
    "0", "-0", "-1", "1e308", "1e999", "-1e999", "1e-400", "nan", "inf", "0x10", "1_000", "007", "1.", ".5", "1e",
    "4294967296", "9223372036854775808", "9" * 400, "9" * 5000, "0." + "0" * 400 + "1", "true", "null",
)  # fmt: skip
NAMES = (
    "", " ", "?", "?x", "?event.x", "a" * 300, "a" * 20_000, "é", "Ⅷ", "日本", "\u202eabc", "a b", "A", "__proto__",
    "constructor", "__class__", "{}", "%s", "${x}", "../x", "a/b", "-", "--", "\n", "\t", "\x00", "\x1b[31m", "\ufeff",
)  # fmt: skip
DEPTHS = (2, 30, 200, 1500, 12_000)
VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 1.5, 2**31, 2**63, 10**400, 1e308, float("nan"), float("inf"), "", "x", "?x", "__proto__",
    "\ud800", "\x00", "a" * 5000, [], {}, [[]], [None], {"": None}, {"x": {}}, [1, "a", None], "(", "(and)", "1",
)  # fmt: skip
_WORD = re.compile(rb"[^\s()\[\]{}<>,:;\"'=]+")
_NUMBER = re.compile(rb"-?\d+(?:\.\d+)?")
_TAG = re.compile(rb"<[^<>]*>")
_OPENING, _CLOSING = b"([{", b")]}"

Mutation = Callable[[bytes, Random, Sequence[bytes], Sequence[bytes]], bytes]
"""Is given the input, the source of chance, all inputs of the same form, and the tokens of the form."""


def mutated(data: bytes, random: Random, others: Sequence[bytes], tokens: Sequence[bytes], form: str = "text") -> bytes:
    """The input after one to five mutations that suit its form: `text`, `json`, `lines` (of JSON) or `database`."""
    kinds = {"json": (*TEXT, *JSON * 3), "lines": (*TEXT, *LINES * 2), "database": BYTES}.get(form, TEXT)
    for _ in range(random.choice((1, 1, 1, 2, 3, 5))):
        data = random.choice(kinds)(data, random, others, tokens)[:MOST_BYTES]
    return data


def _place(data: bytes, random: Random) -> int:
    return random.randrange(len(data) + 1)


def _span(data: bytes, random: Random, longest: int = 200) -> tuple[int, int]:
    start = _place(data, random)
    return start, min(len(data), start + random.randint(1, longest))


def flip(data: bytes, random: Random, others: Sequence[bytes], tokens: Sequence[bytes]) -> bytes:
    """Another byte in some places."""
    changed = bytearray(data)
    for _ in range(random.choice((1, 1, 2, 8)) if data else 0):
        changed[random.randrange(len(changed))] = random.choice((random.randrange(256), random.randrange(32, 127)))
    return bytes(changed)


def lose(data: bytes, random: Random, others: Sequence[bytes], tokens: Sequence[bytes]) -> bytes:
    """A part is missing."""
    start, end = _span(data, random)
    return data[:start] + data[end:]


def cut(data: bytes, random: Random, others: Sequence[bytes], tokens: Sequence[bytes]) -> bytes:
    """The end is missing, or the beginning."""
    at = _place(data, random)
    return data[:at] if random.random() < 0.8 else data[at:]


def double(data: bytes, random: Random, others: Sequence[bytes], tokens: Sequence[bytes]) -> bytes:
    """A part stands there twice, or very often."""
    start, end = _span(data, random)
    times = random.choice((1, 1, 1, 3, 50, 2000))
    return data[:end] + data[start:end] * min(times, MOST_BYTES // max(1, end - start)) + data[end:]


def move(data: bytes, random: Random, others: Sequence[bytes], tokens: Sequence[bytes]) -> bytes:
    """A part stands elsewhere."""
    start, end = _span(data, random)
    rest = data[:start] + data[end:]
    at = _place(rest, random)
    return rest[:at] + data[start:end] + rest[at:]


def splice(data: bytes, random: Random, others: Sequence[bytes], tokens: Sequence[bytes]) -> bytes:
    """A part of another input stands in the place of a part."""
    other = random.choice(others)
    start, end = _span(data, random)
    first, last = _span(other, random, 500)
    return data[:start] + other[first:last] + data[random.choice((start, end)) :]


def insert(data: bytes, random: Random, others: Sequence[bytes], tokens: Sequence[bytes]) -> bytes:
    """A token is added."""
    at = _place(data, random)
    return data[:at] + _token(random, tokens) + data[at:]


def reword(data: bytes, random: Random, others: Sequence[bytes], tokens: Sequence[bytes]) -> bytes:
    """Another token, name or word in the place of a word."""
    words = list(_WORD.finditer(data))
    if not words:
        return insert(data, random, others, tokens)
    word = random.choice(words)
    new = random.choice((_token(random, tokens), random.choice(words).group(), random.choice(NAMES).encode()))
    return data[: word.start()] + new + data[word.end() :]


def renumber(data: bytes, random: Random, others: Sequence[bytes], tokens: Sequence[bytes]) -> bytes:
    """An odd number in the place of a number, or of a word."""
    found = list(_NUMBER.finditer(data)) or list(_WORD.finditer(data))
    if not found:
        return data + random.choice(NUMBERS).encode()
    one = random.choice(found)
    return data[: one.start()] + random.choice(NUMBERS).encode() + data[one.end() :]


def regroup(data: bytes, random: Random, others: Sequence[bytes], tokens: Sequence[bytes]) -> bytes:
    """A group in brackets, or between two tags, is lost, doubled, moved or nested."""
    groups = _groups(data)
    if not groups:
        return lose(data, random, others, tokens)
    start, end = random.choice(groups)
    group = data[start:end]
    match random.randrange(5):
        case 0:
            return data[:start] + data[end:]
        case 1:
            return data[:end] + b" " + group + data[end:]
        case 2:
            first, last = random.choice(groups)
            return data[:first] + group + data[last:]
        case 3:
            depth = random.choice(DEPTHS)
            before, after = random.choice((
                (b"(not ", b")"), (b"(and ", b")"), (b"[", b"]"), (b"{a: ", b"}"), (b'{"a": ', b"}"), (b"(", b")"), (b"(forall (?x) ", b")"),
                (b"(+ 1 ", b")"), (b"<state>", b"</state>"), (b"!(", b")"), (b"(when (a) ", b")"),
            ))  # fmt: skip
            return data[:start] + before * depth + group + after * depth + data[end:]
        case _:
            inside = group[1:-1]
            return data[:start] + inside + data[end:]


def reline(data: bytes, random: Random, others: Sequence[bytes], tokens: Sequence[bytes]) -> bytes:
    """A line is lost, doubled, moved or indented."""
    lines = data.split(b"\n")
    at, other = random.randrange(len(lines)), random.randrange(len(lines))
    match random.randrange(5):
        case 0:
            del lines[at]
        case 1:
            lines.insert(other, lines[at])
        case 2:
            lines[at], lines[other] = lines[other], lines[at]
        case 3:
            lines[at] = random.choice((b"  ", b"\t", b"- ", b"? ", b"    " * 200)) + lines[at]
        case _:
            lines[at] = lines[at].lstrip()
    return b"\n".join(lines)


def recode(data: bytes, random: Random, others: Sequence[bytes], tokens: Sequence[bytes]) -> bytes:
    """Another encoding, line end or mark at the beginning."""
    text = data.decode("utf-8", "surrogateescape")
    at = _place(data, random)
    sign = random.choice((b"\x00", b"\xff", b"\xed\xa0\x80", b"\xc0\x80", b"\x85", b"\x1b"))
    line_end = random.choice((b"\r\n", b"\r", "\u2028".encode(), b"\x0c"))
    return random.choice((
        text.encode("utf-16", "surrogatepass"),
        text.encode("utf-32", "surrogatepass"),
        text.encode("latin-1", "replace"),
        text.upper().encode("utf-8", "surrogateescape"),
        b"\xef\xbb\xbf" + data,
        data.replace(b"\n", line_end),
        data[:at] + sign + data[at:],
    ))  # fmt: skip


def revalue(data: bytes, random: Random, others: Sequence[bytes], tokens: Sequence[bytes]) -> bytes:
    """One value of a JSON text is another, missing, double, or nested; text that is no JSON is left alone."""
    try:
        form = json.loads(data)
    except (ValueError, RecursionError):
        return data
    holder: dict[str, Any] = {"": form}
    places = list(_places(holder))
    inside, key = random.choice(places)
    match random.randrange(6):
        case 0 | 1:
            inside[key] = random.choice(VALUES)
        case 2:
            del inside[key]
        case 3:
            other, other_key = random.choice(places)
            value = json.loads(json.dumps(other[other_key]))
            inside[key] = value
        case 4:
            if isinstance(inside, list):
                inside.insert(key, json.loads(json.dumps(inside[key])))
            else:
                inside[random.choice([str(k) for _, k in places] + list(NAMES[:8]))] = inside[key]
        case _:
            text = json.dumps(holder.get(""))
            depth = random.choice(DEPTHS)
            before, after = random.choice((("[", "]"), ('{"a": ', "}")))
            return text.replace(json.dumps(inside[key]), before * depth + after * depth, 1).encode()
    return json.dumps(holder.get("")).encode()


def reline_json(data: bytes, random: Random, others: Sequence[bytes], tokens: Sequence[bytes]) -> bytes:
    """`revalue` for one line of many."""
    lines = data.split(b"\n")
    at = random.randrange(len(lines))
    lines[at] = revalue(lines[at], random, others, tokens)
    return b"\n".join(lines)


def reset(file: Path, random: Random) -> None:
    """Another value in one column of one row of a database; what SQLite refuses is left as it was."""
    connection = sqlite3.connect(file, isolation_level=None)
    try:
        tables = [
            name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name")
        ]
        table = random.choice(tables)
        columns = [row[1] for row in connection.execute(f"PRAGMA table_info({table})")]
        rows = connection.execute(f"SELECT * FROM {table} LIMIT 50").fetchall()  # noqa: S608  names of the file's own schema
        if not rows:
            return
        row, at = random.choice(rows), random.randrange(len(columns))
        value: Any = random.choice((None, 0, -1, 2**62, 1.5, "", "x", "[]", "{}", "null", b"\xff", "NaN", row[at]))
        if isinstance(row[at], str) and random.random() < 0.6:
            text = revalue(row[at].encode(), random, (), ())
            value = random.choice((text, flip(row[at].encode(), random, (), ()))).decode("utf-8", "replace")
        match random.randrange(6):
            case 0:
                connection.execute(f"DELETE FROM {table} WHERE {columns[0]} IS ?", (row[0],))  # noqa: S608
            case 1:
                connection.execute(f"DROP TABLE {table}")
            case _:
                connection.execute(f"UPDATE {table} SET {columns[at]} = ? WHERE {columns[0]} IS ?", (value, row[0]))  # noqa: S608
    except (sqlite3.Error, UnicodeEncodeError):
        pass
    finally:
        connection.close()


BYTES: tuple[Mutation, ...] = (flip, flip, lose, cut, double, move, splice)
TEXT: tuple[Mutation, ...] = (
    *BYTES[1:],
    insert,
    insert,
    reword,
    reword,
    reword,
    renumber,
    regroup,
    regroup,
    reline,
    recode,
)
JSON: tuple[Mutation, ...] = (revalue, revalue, revalue)
LINES: tuple[Mutation, ...] = (reline_json, reline_json, reline)


def _token(random: Random, tokens: Sequence[bytes]) -> bytes:
    if tokens and random.random() < 0.7:
        return random.choice(tokens)
    return random.choice((*NAMES, *NUMBERS)).encode()


def _groups(data: bytes) -> list[tuple[int, int]]:
    """Spans of what stands in brackets, or from one tag to another."""
    found, open_at = [], []
    for at, sign in enumerate(data):
        if sign in _OPENING:
            open_at.append(at)
        elif sign in _CLOSING and open_at:
            found.append((open_at.pop(), at + 1))
    tags = [tag.span() for tag in _TAG.finditer(data)]
    found += tags
    found += [(one[0], other[1]) for one, other in zip(tags, tags[1:] + tags[-1:], strict=True)]
    return sorted(found)


def _places(form: Any) -> list[tuple[Any, Any]]:
    """Each value of a form by what holds it; without recursion, since forms can be nested deeply."""
    found, todo = [], [form]
    while todo:
        holder = todo.pop()
        for key in holder if isinstance(holder, dict) else range(len(holder)):
            found.append((holder, key))
            if isinstance(holder[key], dict | list):
                todo.append(holder[key])
    return found

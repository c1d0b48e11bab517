"""Types and values of data in the words of messages, and the answer to a text that is not a type."""

from __future__ import annotations

import re

from knowledge_base.errors import InputError
from knowledge_base.facts import GEOMETRY, MOST_NUMBERS
from knowledge_base.spelling import TRUTH_VALUES, is_plain_name, text_inside, value_text
from knowledge_base.user_objects import shown

_LIKE_PYTHON = re.compile(r"(list|map|dict|optional)[\[(<](.*)[\])>]", re.IGNORECASE)


def in_words(text: str) -> str:
    """Return a type, given as text, with its article, for messages."""
    if text in _SAID:
        return _SAID[text]
    if is_plain_name(text):
        return f"the name of an object of type {text}"
    return f"{'an' if text[0] in 'aeiou' else 'a'} {text}"


_SAID = {
    "text": "text", "symbol": "a name", "condition": "a condition", "plot": "a plot", "boolean": "a truth value",
    "number": "a finite number", "integer": "an integer", GEOMETRY: f"a geometry, 1 to {MOST_NUMBERS} finite numbers",
}  # fmt: skip


def brief(value: object) -> str:
    """Return the text of a value, with at most 80 characters."""
    text = shown(value)
    return text if len(text) <= _LONGEST_SHOWN else f"{text[: _LONGEST_SHOWN - 1]}…"


_LONGEST_SHOWN = 80


_QUOTED = r'"(?:[^"\\]|\\.)*"'
_BLANKS = re.compile(rf"({_QUOTED})|\s+", re.DOTALL)
_CHOICE = re.compile(rf'(?:{_QUOTED}|[^"|])+', re.DOTALL)


def collapse_blanks(text: str) -> str:
    """Return the text of a type with one blank between two words; quoted values are unchanged."""
    return _BLANKS.sub(lambda found: found[1] or " ", text).strip()


def choice_text(value: str | float) -> str:
    """Return a value as a choice writes it: a text that could be read as something else has quotes."""
    return value_text(value, quoted=isinstance(value, str) and ("|" in value or value == "optional"))


def choice_values(text: str) -> tuple[str | float, ...]:
    """Return the values of a choice; raise `InputError` for a quote without its end."""
    words = [word.strip() for word in _CHOICE.findall(text)]
    if '"' in re.sub(_QUOTED, "", text):
        raise InputError(f"'{text}' is not a type: a quote has no end", found=text)
    return tuple(_choice_value(word) for word in words if word)


def _choice_value(word: str) -> str | float:
    """Return the value that `choice_text` writes as this word."""
    if word in TRUTH_VALUES:
        return TRUTH_VALUES[word]
    for read in (int, float):
        try:
            return read(word)
        except ValueError:
            continue
    return text_inside(word) if word[:1] == '"' else word


def bound_text(bound: float) -> str:
    """Return a bound as the shortest text that is read as an equal number."""
    short = f"{bound:g}"
    return short if float(short) == bound else repr(bound)


def not_a_type(text: str) -> InputError:
    """Return the error for a text that is not a type, with the form that is nearest."""
    python = _LIKE_PYTHON.fullmatch(text)
    if python is not None:
        outer, inside = python[1].lower(), python[2].rpartition(",")[2].strip()
        better = f"optional {inside}" if outer == "optional" else f"{outer.replace('dict', 'map')} of {inside}"
    elif text.endswith("?"):  # the sign of other languages
        better = f"optional {text[:-1]}"
    elif text.partition(" ")[0] in {"list", "map"}:
        better = f"{text.partition(' ')[0]} of {text.rpartition(' ')[2]}"
    else:
        forms = "a name, `list of item`, `map of number`, `optional text`, `left | right` or `number from 0 to 5 in m`"
        return InputError(f"'{text}' is not a type; a type is {forms}", found=text)
    return InputError(f"'{text}' is not a type; write `{better}`", found=text)

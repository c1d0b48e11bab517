"""Widths of texts, and shortening of texts to a width, without access to a font.

The widths are measured in DejaVu Sans, the widest of the usual sans-serif fonts, so that others fit as well.
"""

from __future__ import annotations

from unicodedata import east_asian_width

from dsc.drawing.layout import TextStyle

FONT_SIZES = {
    TextStyle.TITLE: 16.0,
    TextStyle.ABOUT: 12.0,
    TextStyle.NAME: 13.0,
    TextStyle.DETAIL: 11.5,
    TextStyle.LABEL: 11.5,
    TextStyle.RULE: 11.5,
}
LINE_HEIGHT = 15.0
"""From one baseline of a small text to the next."""
BOLD = frozenset({TextStyle.TITLE, TextStyle.NAME})
_BOLDER = 1.12

_EM = {
    character: width
    for width, characters in {
        0.29: "ijlIJ' ",
        0.35: ",./:;\\|f-",
        0.41: "()[]t!r",
        0.51: '"*_`sz',
        0.56: "?cLFk",
        0.61: "vxyPTYaoe",
        0.64: "ESbdghnpqu$0123456789{}",
        0.70: "KAVBRXZC",
        0.79: "UHNDG&OQ",
        0.85: "w#+<=>^~M",
        1.0: "%mW@",
    }.items()
    for character in characters
}
ELLIPSIS = "…"


def text_width(text: str, style: TextStyle) -> float:
    """Return an upper bound of a text's width."""
    ems = sum(_EM.get(character) or _unknown(character) for character in text)
    return ems * FONT_SIZES[style] * (_BOLDER if style in BOLD else 1.0)


def _unknown(character: str) -> float:
    return 1.05 if east_asian_width(character) in "FWA" else 0.85


def shorten(text: str, style: TextStyle, width: float) -> str:
    """Return the text, shortened with an ellipsis if it does not fit."""
    if text_width(text, style) <= width:
        return text
    low, high = 0, len(text)
    while low < high:
        middle = (low + high + 1) // 2
        if text_width(text[:middle] + ELLIPSIS, style) <= width:
            low = middle
        else:
            high = middle - 1
    return text[:low].rstrip() + ELLIPSIS


def pack(words: list[str], style: TextStyle, width: float) -> list[str]:
    """Return the words on the necessary number of lines; shorten a word that is too long for a line."""
    lines: list[str] = []
    for word in words:
        if lines and text_width(f"{lines[-1]} {word}", style) <= width:
            lines[-1] += f" {word}"
        else:
            lines.append(shorten(word, style, width))
    return lines

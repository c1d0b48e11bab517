"""Formatting: only white space changes, data and comments stay, and a second formatting changes nothing."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsc.editing.formatting import format_edits
from dsc.editing.surgery import patch
from dsc.text.yaml import load_document

ROOT = Path(__file__).parents[3]
FILES = [file for folder in ("domains", "planning") for file in sorted((ROOT / folder).rglob("plots/*.yaml"))]


def formatted(text):
    return patch(text, format_edits(text))


@given(st.sampled_from(FILES), st.lists(st.tuples(st.integers(0, 200), st.sampled_from(["  ", "\n", "\n \n"]))))
def test_blanks_in_shipped_plots(file, blanks):
    lines = file.read_text("utf-8").split("\n")
    for number, blank in blanks:
        lines[number % len(lines)] += blank
    text = "\n".join(lines)
    result = formatted(text)
    assert load_document(result).data == load_document(text).data
    assert [one.strip() for one in result.split("\n") if one.strip()] == [
        one.strip() for one in text.split("\n") if one.strip()
    ]
    assert formatted(result) == result


@pytest.mark.parametrize(
    ("text", "result"),
    [
        ("plot: a  \n\n\n\n# why \nstates:\n  s: {final: true}", "plot: a\n\n# why\nstates:\n  s: {final: true}\n"),
        ("a: |\n  x  \n\n\n  y\n\n\nb: 1 \n\n\n", "a: |\n  x  \n\n\n  y\n\n\nb: 1\n"),
        ("a: 'x  \n\n\n  y'\nb: {c: 1, \n\n\n  d: 2}\n", "a: 'x  \n\n\n  y'\nb: {c: 1,\n\n  d: 2}\n"),
        ("a: 1 \r\n\r\n\r\nb: 2", "a: 1\r\n\r\nb: 2\r\n"),
        ("a: |+\n  x\n\n\n", "a: |+\n  x\n\n\n"),
        ("a: [1  \n", "a: [1  \n"),
        ("", ""),
    ],
)
def test_the_white_space_of_a_text(text, result):
    assert formatted(text) == result
    assert formatted(result) == result

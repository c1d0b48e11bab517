"""A text that is read in pieces has the data, places and spans of the whole text, or is read as a whole."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsc.text.incremental import IncrementalReader
from dsc.text.yaml import Spans, load_document
from knowledge_base.errors import InputError

ROOT = Path(__file__).parents[3]
TEXTS = [
    file.read_text("utf-8")
    for folder in ("domains", "planning", "tests/support/delivery_project", "tests/support/cell", "docs")
    for file in sorted((ROOT / folder).rglob("*.yaml"))
]
LINES = ("  a: |", "   b", "about: 'x", "  go: {on: {done: over}}", "#", "---", "?", "\tx", "  - 1", "states:", "", "...", "  '", "x: >-", " y")  # fmt: skip


def read_whole(text):
    spans = Spans()
    try:
        document = load_document(text, "x.yaml", spans)
    except InputError as error:
        return str(error)
    return document.data, dict(document.places), spans.keys, spans.values


def read_in_pieces(reader, text):
    try:
        document, spans = reader.load(text, "x.yaml")
    except InputError as error:
        return str(error)
    return document.data, dict(document.places), spans.keys, spans.values


@pytest.mark.parametrize("number", range(len(TEXTS)))
def test_each_shipped_file_is_read_alike(number):
    text = TEXTS[number]
    assert read_in_pieces(IncrementalReader(), text) == read_whole(text)


def test_most_shipped_plots_are_read_in_pieces():
    plots = [text for text in TEXTS if "\nstates:\n" in text]
    assert sum(IncrementalReader()._join(text, None) is not None for text in plots) > 0.9 * len(plots)


@given(
    st.sampled_from(TEXTS), st.lists(st.tuples(st.integers(0, 60), st.sampled_from(LINES), st.booleans()), max_size=4)
)
def test_edited_lines_are_read_alike(text, edits):
    reader = IncrementalReader()
    lines = text.split("\n")
    for number, line, replace in edits:
        at = number % len(lines)
        lines[at : at + replace] = [line]
        edited = "\n".join(lines)
        assert read_in_pieces(reader, edited) == read_whole(edited)


@given(st.sampled_from(TEXTS), st.data())
def test_edited_characters_are_read_alike(text, data):
    at = data.draw(st.integers(0, len(text)))
    edited = (
        text[:at]
        + data.draw(st.sampled_from(["'", '"', "{", "}", ":", "\n", "#", "|", "🚪", " ", "&a ", "-", "\u2028"]))
        + text[at + data.draw(st.integers(0, 1)) :]
    )
    assert read_in_pieces(IncrementalReader(), edited) == read_whole(edited)


def test_an_edit_reads_only_its_piece():
    reader = IncrementalReader()
    states = "".join(f"  s{n}: {{on: {{done: s{n + 1}}}}}\n" for n in range(50))
    text = f"plot: long\nstates:\n{states}  s50: {{final: true}}\n"
    reader.load(text)
    before = set(reader._known)
    reader.load(text.replace("s7: {on: {done: s8}}", "s7: {on: {done: s9}}"))
    assert set(reader._known) - before == {"  s7: {on: {done: s9}}\n"}

"""Plots that lead nowhere, asked for in other forms: refused with the place, whatever is missing."""

from __future__ import annotations

import pytest

from dsc.scxml.writer import to_scxml
from dsc.text.plot_files import parse_plot
from dsc.text.text_diagrams import to_mermaid, to_plantuml
from knowledge_base.errors import UnknownNameError

BROKEN = {
    "a transition": ("states:\n  a: {on: {go: nowhere}}\n  b: {final: true}\n", 3),
    "a timeout": ("states:\n  a: {after: {seconds: 1, to: nowhere}}\n  b: {final: true}\n", 3),
    "the beginning": ("initial: nowhere\nstates:\n  a: {on: {go: b}}\n  b: {final: true}\n", 2),
    "a beginning inside": (
        "states:\n  a:\n    initial: nowhere\n    states: {c: {final: true}}\n    on: {done: b}\n  b: {final: true}\n", 4,
    ),
    "a region": (
        "states:\n  a:\n    regions:\n      r: {initial: nowhere, states: {c: {final: true}}}\n    on: {done: b}\n  b: {final: true}\n", 5,
    ),
    "a choice": ("states:\n  a: {choice: [{when: (= 1 1), to: nowhere}, b]}\n  b: {final: true}\n", 3),
    "a history": (
        "dialect: scxml\nstates:\n  a:\n    states: {h: {history: deep, to: nowhere}, c: {}}\n  b: {final: true}\n", 5,
    ),
}  # fmt: skip


@pytest.mark.parametrize("form", [to_mermaid, to_plantuml, to_scxml], ids=lambda form: form.__name__)
@pytest.mark.parametrize("what", BROKEN)
def test_a_plot_that_leads_nowhere_has_no_other_form(what: str, form) -> None:
    text, line = BROKEN[what]
    plot = parse_plot(f"plot: p\n{text}", "p.yaml")
    with pytest.raises(UnknownNameError, match=rf"^p\.yaml:{line}:\d+: there is no state 'nowhere'"):
        form(plot)

"""Changes of a library: copies are independent, and the tables of all other plots are kept."""

from __future__ import annotations

import pytest
from dsc_charts import plot

from dsc.dynamic.library import Library
from knowledge_base.errors import InputError

OLD = plot("{plot: part, states: {a: {final: true}}}")
NEW = plot("{plot: part, states: {b: {final: true}}}")
USER = plot("{plot: user, states: {s: {use: part, on: {done: e}}, e: {final: true}}}")
RULED = plot("""
plot: ruled
states: {s: {use: part, on: {done: e}}, e: {final: true}}
rules: [{on: lost, do: {then: retry, limit: 2}}, {on: lost, do: {then: e}}]
""")
LOST = plot("{plot: part, emits: {lost: }, states: {b: {final: true, emit: lost}}}")


@pytest.mark.parametrize("compiled", [False, True])
def test_a_change_of_a_copy_leaves_the_library_unchanged(compiled):
    library = Library([OLD, USER])
    if compiled:
        library.compiled("part")
    other = library.copy()
    other.change({"part": NEW})
    assert other.compiled("part").plot == NEW
    assert library.compiled("part").plot == OLD
    library.add(plot("{plot: more, states: {s: }}"))
    assert "more" not in other
    other.change({"part": None})
    assert "part" in library
    with pytest.raises(InputError, match="there is no plot 'part'"):
        other.compiled("part")


def test_only_tables_whose_expansion_differs_are_new():
    library = Library([OLD, USER, RULED])
    user, ruled = library.compiled("user"), library.compiled("ruled")
    library.change({"part": NEW})
    assert library.compiled("user") is user
    assert library.compiled("ruled") is ruled
    library.change({"part": LOST})
    assert library.compiled("user") is user
    assert "lost" in library.compiled("ruled").nodes[1].edges
    assert "lost" not in ruled.nodes[1].edges

"""A text that a program contains has places in the program's file."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from textwrap import dedent, indent
from typing import Any

import pytest

from dsc import parse_plot
from dsc.deployment.model import parse_deployment
from dsc.monitoring.profile import parse_monitoring
from dsc.scxml.reader import parse_scxml
from dsc.text.experience import parse_experience
from dsc.text.incremental import IncrementalReader
from dsc.text.profiles import parse_profile
from dsc.text.yaml import load_document
from dsc.trees.reading.reader import parse_trees
from knowledge_base import Schema
from knowledge_base.errors import InputError
from planning import PlanningDomain

TWICE = """
plot: twice
wrong: 1
"""
BEGUN = """(define (domane d)
  (:predicates (p)))"""
DOMAIN = """(define (domain d)
  (:predicates (p))
  (:action a :parameters (?x - thingy) :effect (p)))
"""


def line_of(text: str) -> int:
    """Return the number of the only line of this file that contains the text, apart from assertions about it."""
    lines = Path(__file__).read_text().splitlines()
    (found,) = (number for number, line in enumerate(lines, 1) if text in line.partition("line_of(")[0])
    return found


def place_of(read, text: str) -> tuple[str | None, int | None, int | None]:
    with pytest.raises(InputError) as raised:
        read(text)
    place = raised.value.place
    assert place is not None
    return place.source, place.line, place.column


def test_a_mistake_in_a_plot_has_its_line_in_the_program():
    found = place_of(
        parse_plot,
        """
        plot: p
        statess: {a: {final: true}}
        """,
    )
    assert found == (__file__, line_of("statess: {a: {final: true}}"), 9)


def test_a_text_without_its_indentation_has_the_columns_of_the_program():
    found = place_of(
        parse_plot,
        dedent("""\
            plot: p
            states: {a: {finally: true}}
        """),
    )
    assert found == (__file__, line_of("states: {a: {finally: true}}"), 26)


def test_a_text_that_begins_in_the_line_of_its_quotes_has_the_columns_of_the_program():
    assert place_of(parse_plot, "plot: [in one line]") == (__file__, line_of('"plot: [in one line]"'), 34)
    assert place_of(PlanningDomain.parse, BEGUN) == (__file__, line_of("BEGUN ="), 20)


def test_a_text_in_a_constant_has_the_line_of_the_constant():
    assert place_of(parse_plot, TWICE)[1] == line_of("wrong: 1")
    assert place_of(PlanningDomain.parse, DOMAIN)[:2] == (__file__, line_of("?x - thingy"))


def test_of_two_equal_texts_the_nearest_is_meant():
    with pytest.raises(InputError) as first:
        parse_plot("plot: [p, q]")
    with pytest.raises(InputError) as second:
        parse_plot("plot: [p, q]")
    lines = [getattr(one.value.place, "line", 0) for one in (first, second)]
    assert lines == [lines[0], lines[0] + 2]


@pytest.mark.parametrize(
    "read",
    [parse_profile, parse_monitoring, parse_deployment, parse_experience, parse_scxml, parse_trees, Schema.parse],
    ids=lambda one: one.__qualname__,
)
def test_every_reader_of_a_text_tells_its_line_in_the_program(read):
    source, line, _ = place_of(read, "<(: no reader takes this")
    assert (source, line) == (__file__, line_of('"<(: no reader takes this"'))


@pytest.mark.parametrize(
    "text", ["plot: {}".format("[x, y]"), "\n".join(["plot: p", "initial: 1"]), f"plot: [{TWICE[1:5]}]"]
)
def test_a_text_that_the_program_does_not_contain_has_its_own_lines(text):
    assert place_of(parse_plot, text)[0] is None


def test_a_text_with_a_name_has_this_name():
    named = partial(parse_plot, source="mine.yaml")
    assert place_of(named, "plot: [p]")[:2] == ("mine.yaml", 1)


def test_a_computed_text_that_the_program_contains_by_chance_has_its_own_lines():
    parts = ["plot", "[p]"]  # "plot: [p]" is a literal below, and part of other texts
    assert place_of(parse_plot, ": ".join(parts))[0] == __file__
    assert place_of(parse_plot, parts[0])[1] == line_of('parts = ["plot"')
    assert place_of(parse_plot, "".join(["pl", "ot: [p"]))[0] is None
    assert place_of(parse_plot, "\n".join(["plot: p", "states: {}"]))[0] is None


def test_a_program_that_has_changed_is_read_again(tmp_path, monkeypatch):
    file = tmp_path / "changed_program.py"
    monkeypatch.syspath_prepend(tmp_path)
    for line in (1, 3):
        file.write_text("\n" * (line - 1) + 'READ = lambda parse: parse("plot: [changed]")\n')
        names: dict[str, Any] = {}
        exec(compile(file.read_text(), str(file), "exec"), names)  # noqa: S102
        with pytest.raises(InputError) as raised:
            names["READ"](parse_plot)
        assert raised.value.place is not None
        assert (raised.value.place.source, raised.value.place.line) == (str(file), line)


def test_a_text_of_one_line_within_longer_quotes_has_its_line():
    found = place_of(
        parse_plot,
        """
        {plot: [alone]}
        """,
    )
    assert found == (__file__, line_of("{plot: [alone]}"), 10)


def test_the_last_lines_of_a_program_are_searched_too(tmp_path):
    file = tmp_path / "short_program.py"
    file.write_text('read("""plot: p\nstates: {}""")\nx = "plot: p"')
    with pytest.raises(InputError) as raised:
        exec(compile(file.read_text(), str(file), "exec"), {"read": parse_plot})  # noqa: S102
    assert raised.value.place is not None
    assert (raised.value.place.source, raised.value.place.line) == (str(file), 2)


SHORT = """
plot: p
states: x
"""
LONG = """
plot: p
states: x
initial: a
"""


def test_a_text_with_escapes_has_the_line_of_its_literal():
    assert place_of(parse_plot, "plot: escapes\nstate: {}") == (__file__, line_of('"plot: escapes'), None)
    joined = "plot: joined\nstat: {}"
    assert place_of(parse_plot, joined) == (__file__, line_of("joined = "), None)


def test_a_text_that_begins_another_text_has_its_own_line():
    assert place_of(parse_plot, SHORT)[1] == line_of("SHORT =") + 2
    assert place_of(parse_plot, LONG)[1] == line_of("LONG =") + 2


def test_a_comment_and_a_part_of_a_text_are_no_literals():
    # a comment about "plot: [commented]"
    assert place_of(parse_plot, "".join(["plot: ", "[commented]"]))[0] is None
    assert place_of(parse_plot, "".join(["o", "s"]))[0] is None


def test_the_standard_library_is_no_program():
    with ThreadPoolExecutor(1) as pool, pytest.raises(InputError) as raised:
        pool.submit(parse_plot, "".join(["se", "lf"])).result()
    assert raised.value.place is not None
    assert raised.value.place.source is None


def test_a_text_that_is_indented_by_the_program_has_columns_from_1():
    text = indent("plot: p\nstates: {a: {final: true}\n", "    ")
    source, line, column = place_of(parse_plot, text)
    assert source in {None, __file__}
    assert (line or 0) > 0
    assert column is None or column > 0


def test_the_pieces_of_an_incremental_reader_have_the_places_of_its_file():
    document, _ = IncrementalReader().load(TWICE, "p.yaml")
    assert {place.source for place in document.places.values()} == {"p.yaml"}
    assert document.places == load_document(TWICE, "p.yaml").places

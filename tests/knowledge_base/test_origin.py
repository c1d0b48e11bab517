"""A text that a program contains has places in the program's file."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from textwrap import dedent

import pytest

from dsc import parse_plot
from dsc.deployment.model import parse_deployment
from dsc.monitoring.profile import parse_monitoring
from dsc.scxml.reader import parse_scxml
from dsc.text.experience import parse_experience
from dsc.text.profiles import parse_profile
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
    "text", ["plot: p\nstate: {}", "plot: {}".format("[x, y]"), "\n".join(["plot: p", "initial: 1"])]
)
def test_a_text_that_the_program_does_not_contain_has_its_own_lines(text):
    assert place_of(parse_plot, text)[0] is None


def test_a_text_with_a_name_has_this_name():
    named = partial(parse_plot, source="mine.yaml")
    assert place_of(named, "plot: [p]")[:2] == ("mine.yaml", 1)

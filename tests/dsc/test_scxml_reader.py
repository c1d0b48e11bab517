"""SCXML in: what is read, and that what cannot be said is named with its place."""

from __future__ import annotations

import pytest
from dsc_charts import Run

from dsc.text.files import MAX_BYTES
from dsc.text.plots import parse_plot, plot_to_yaml
from dsc.text.scxml.document import MAX_DEPTH
from dsc.text.scxml.ecmascript import condition, term
from dsc.text.scxml.errors import NotExpressibleError
from dsc.text.scxml.reader import parse_scxml
from knowledge_base.errors import InputError
from knowledge_base.language.printer import to_text


def scxml(body, attributes=""):
    return parse_scxml(f'<scxml xmlns="http://www.w3.org/2005/07/scxml" version="1.0" {attributes}>{body}</scxml>', "c.scxml")


FULL = """
<datamodel><data id="Count" expr="0"/></datamodel>
<parallel id="p">
  <history id="h" type="deep"><transition target="a2"/></history>
  <state id="a" initial="a1">
    <state id="a1"><onexit><log label="bye" expr="'count ' + Count"/></onexit><transition event="go" target="a2"/></state>
    <state id="a2"/>
  </state>
  <state id="b"><transition event="x y.*" cond="Count &gt;= 0 &amp;&amp; In('a2')" type="internal"><assign location="Count" expr="Count + 1"/></transition></state>
  <transition event="out" target="end"/>
</parallel>
<state id="end"><transition event="back" target="h"/></state>
"""


def test_a_chart_is_read_and_runs():
    run = Run(scxml(FULL))
    run.start()
    assert run.active == ["p", "a", "a1", "b"]
    for event in ("go", "out", "back"):
        run.send(event)
    assert run.active == ["p", "a", "a2", "b"]


def test_an_imported_chart_survives_yaml():
    plot = scxml(FULL)
    assert parse_plot(plot_to_yaml(plot)) == plot


def test_descriptors_keep_document_order_across_keys():
    body = """<datamodel><data id="x" expr="1"/></datamodel>
    <state id="s"><transition event="a" target="t" cond="x === 2"/><transition event="*" target="u"/><transition event="a" target="t"/></state>
    <state id="t"/><state id="u"/>"""
    run = Run(scxml(body))
    run.start()
    run.send("a")
    assert run.active == ["u"]


@pytest.mark.parametrize(
    ("text", "read"),
    [
        ("x === 1", "(= ?x 1)"),
        ("!(x < 2) || In('A b')", '(or (not (< ?x 2)) (in-state "A b"))'),
        ("x !== 'it\\'s'", '(!= ?x "it\'s")'),
        ("x * 2 - -1 > _event.data.Size", "(> (- (* ?x 2) -1) ?event.size)"),
        ("Math.pow(x, 3) == 8", "(= (* ?x ?x ?x) 8)"),
        ("true", "(and)"),
    ],
)
def test_conditions_are_translated(text, read):
    assert to_text(condition(text, {"x": "x"})) == read


@pytest.mark.parametrize("text", ["f(x)", "x ? 1 : 2", "{a: 1}", "[1]", "'a' + x", "x +", "x y", "(x", "_sessionid", "x.y", "(" * 200])
def test_what_terms_cannot_say_is_named(text):
    with pytest.raises(NotExpressibleError):
        term(text, {"x": "x"})


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("<state id='a'>\n<invoke/></state>", "c.scxml:2:1: invoke: has no counterpart"),
        ("<state id='a'><onentry><script>x()</script></onentry></state>", "script: has no counterpart"),
        ("<state id='a'><onentry><send event='e' target='http://x'/></onentry></state>", "send/@target"),
        ("<state id='a' initial='b c'><state id='b'/><state id='c'/></state>", "only one state"),
        ("<state id='a'><x:y xmlns:x='other'/></state>", "y: has no counterpart"),
        ("<state id='a'><transition event='go after' target='a'/></state>", "transition/@event: 'after'"),
        ("<state id='a'><transition event='every' target='a'/></state>", "transition/@event: 'every'"),
        ("<state id='a'><transition event='at_least' target='a'/></state>", "transition/@event: 'at_least'"),
    ],
)
def test_elements_without_counterpart_are_named(body, message):
    with pytest.raises(NotExpressibleError, match=message):
        scxml(body)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("<stat id='a'/>", "did you mean 'state'"),
        ("<state id='a'><transition evnt='e'/></state>", "did you mean 'event'"),
        ("<state id='a'><onentry><assign location='xx' expr='1'/></onentry></state>", "there is no data 'xx'"),
        ("<state id='a'><onentry><raise/></onentry></state>", "needs the attribute 'event'"),
        ("<state id='a'/><state id='a'/>", "two states are named 'a'"),
        ("<state id='a/b'/>", "no name for a state"),
        ("<state id='a'><history id='h'/></state>", "needs states beside"),
        ("<state id='a'><history id='h'/><state id='b'/></state>", "exactly one <transition>"),
        ("<state id='a'><onentry><send event='e' delay='soon'/></onentry></state>", "is no delay"),
        ("", "at least one"),
    ],
)
def test_mistakes_are_said_with_file_and_line(body, message):
    with pytest.raises(InputError, match=message) as caught:
        scxml(body)
    assert str(caught.value).startswith("c.scxml:1")


@pytest.mark.parametrize(
    "text",
    [
        "<scxml>",
        "",
        "<chart/>",
        '<!DOCTYPE scxml [<!ENTITY a "b">]><scxml/>',
        "<scxml>" + "<state>" * (MAX_DEPTH + 1),
        "<scxml>" + " " * MAX_BYTES + "</scxml>",
    ],
)
def test_documents_that_are_none_or_too_much_are_refused(text):
    with pytest.raises(InputError):
        parse_scxml(text)

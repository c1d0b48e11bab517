"""SCXML in: what is read, and that what cannot be said is named with its place."""

from __future__ import annotations

import re

import pytest
from dsc_charts import Run

from dsc.dynamic.library import Library
from dsc.errors import NotExpressibleError
from dsc.scxml.document import MAX_DEPTH
from dsc.scxml.ecmascript import condition, term, tokens
from dsc.scxml.reader import parse_scxml
from dsc.scxml.writer import to_scxml
from dsc.testing import DryRun
from dsc.text.plot_files import parse_plot, plot_to_yaml
from dsc.text.yaml import MAX_BYTES
from dsc.validation import validate_plot
from knowledge_base.errors import InputError
from knowledge_base.language.syntax.text import to_text


def scxml(body, attributes=""):
    return parse_scxml(
        f'<scxml xmlns="http://www.w3.org/2005/07/scxml" version="1.0" {attributes}>{body}</scxml>', "c.scxml"
    )


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


@pytest.mark.parametrize(
    "text", ["f(x)", "x ? 1 : 2", "{a: 1}", "[1]", "'a' + x", "x +", "x y", "(x", "_sessionid", "x.y", "(" * 200]
)
def test_an_expression_without_a_term_is_refused(text):
    with pytest.raises(NotExpressibleError):
        term(text, {"x": "x"})


def outcome(data, content, ways):
    """The state that a chart ends in: `content` stands in the onentry of the first state, `ways` follow it."""
    body = f"""<datamodel>{data}</datamodel>
    <state id="s"><onentry>{content}</onentry>{ways}<transition event="*" target="fail"/></state>
    <final id="pass"/><final id="fail"/>"""
    run = DryRun([scxml(body)], "c")
    run.advance(1)
    return run.steps[-1].microsteps[-2].entered if run.finished else "waits"


CONVERTED = [
    ('<data id="n" expr="3"/>', "n", True),
    ('<data id="n" expr="0"/>', "n", False),
    ('<data id="n" expr="0"/>', "!n", True),
    ('<data id="t" expr="\'\'"/>', "t", False),
    ('<data id="t" expr="\'false\'"/>', "t", True),
    ('<data id="b" expr="false"/>', "b || !b", True),
    ("", "'foo'", True),
    ("", "0", False),
    ('<data id="n" expr="1"/>', "n - 1", False),
    ('<data id="n" expr="1"/>', "n == 1 && n != 2", True),
    ('<data id="n" expr="1"/>', "n === '1'", False),
    ("<data id='t'>1 + 1</data>", "t == '1 + 1'", True),
    ("<data id='t'> 12 </data>", "t == 12", True),
    ("<data id='t'>a\n  b</data>", "t == 'a b'", True),
    ('<data id="t" expr="\'a\\tb\\q\'"/>', "t == 'a\\tbq'", True),
    ("<data id='u'/>", "u", False),
    ("<data id='u'/>", "u == undefined", True),
    ('<data id="n" expr="1"/>', "n === undefined", False),
    ("<data id='u'/>", "u === 1", False),
    ("<data id='u'/>", "u !== 1", True),
]


@pytest.mark.parametrize(("data", "cond", "holds"), CONVERTED)
def test_conditions_mean_what_they_mean_in_ecmascript(data, cond, holds):
    text = cond.replace("&", "&amp;")
    ways = f'<transition cond="{text}" target="pass"/><transition target="fail"/>'
    assert outcome(data, "", ways) == ("pass" if holds else "fail",)


SENT = [
    ('<send event="e"><content>123</content></send>', "_event.data == 123"),
    ('<send event="e"><content>this  is\n text </content></send>', "_event.data == 'this is text'"),
    ('<send event="e"><content>"json"</content></send>', "_event.data == 'json'"),
    ('<send event="e"><content expr="1 + 1"/></send>', "_event.data == 2"),
    (
        '<send event="e"><content>{"productName": "bar", "n": 1}</content></send>',
        "_event.data.productName == 'bar' && _event.data.n &lt; 2",
    ),
    ('<send event="e"><param name="aB" expr="true"/></send>', "_event.data.aB"),
    ('<send event="e" namelist="X"/>', "_event.data.X == 7"),
]


@pytest.mark.parametrize(("send", "cond"), SENT)
def test_events_carry_what_they_carry_in_scxml(send, cond):
    text = cond.replace("&&", "&amp;&amp;")
    ways = f'<transition event="e" cond="{text}" target="pass"/>'
    assert outcome('<data id="X" expr="7"/>', send, ways) == ("pass",)


def cond(text, data=""):
    return f"<datamodel>{data}</datamodel><state id='s'><transition cond=\"{text}\" target='s'/></state>"


def sent(send, read):
    return f"<state id='s'><onentry>{send}</onentry><transition event='e' cond=\"{read}\" target='s'/></state>"


REFUSED = [
    (cond("x == 1", "<data id='x' expr=\"'1'\"/>"), "'==' may convert"),
    (cond("x == true", "<data id='x' expr='1'/>"), "'==' may convert"),
    (cond("x &lt; 1", "<data id='x' expr=\"'1'\"/>"), "need not be a number"),
    (cond("x &lt; 1", "<data id='x'/>"), "need not be a number"),
    (cond("x === 1 / x", "<data id='x' expr='1'/>"), "only a number other than 0 divides"),
    (cond("--x === 1", "<data id='x' expr='1'/>"), "'--'"),
    (cond("x === 010", "<data id='x' expr='1'/>"), "octal"),
    (cond("x === '\\101'", "<data id='x' expr='1'/>"), "has no counterpart"),
    (cond("x === '\\u{41}'", "<data id='x' expr='1'/>"), "has no counterpart"),
    (cond("x === '\\ud83d'", "<data id='x' expr='1'/>"), "half a character"),
    (cond("true", "<data id='x' expr='y + 1'/><data id='y' expr='1'/>"), "has none yet"),
    (cond("true", "<data id='x' expr='x'/>"), "has none yet"),
    (cond("true", "<data id='x'>[1]</data>"), "an array"),
    (cond("x === 'undefined'", "<data id='x'/>"), "stands for no value"),
    (cond("true", "<data id='x'>undefined</data>"), "'undefined'"),
    (sent("<send event='e'><content>[1]</content></send>", "_event.data === 1"), "an array"),
    (
        sent("<send event='e'><content>{'a': {}}</content></send>".replace("'a'", '"a"'), "_event.data.a === 1"),
        "an array",
    ),
    (
        sent("<send event='e'><param name='aB' expr='1'/></send>", "_event.data.ab === 1"),
        "is undefined for the event 'e'",
    ),
    (
        sent("<send event='e'><param name='a' expr='1'/><param name='A' expr='2'/></send>", "_event.data.a === 1"),
        "two are named 'a'",
    ),
    (sent("<send event='e'><param name='a' expr='1'/></send>", "_event.data === 1"), "is undefined for the event 'e'"),
    (sent("<send event='e'/>", "_event.data === 1"), "is undefined for the event 'e'"),
    (
        sent(
            "<send event='e'><param name='a' expr='1'/></send><send event='e.f'><param name='a' expr=\"'1'\"/></send>",
            "_event.data.a == 1",
        ),
        "may convert",
    ),
    (sent("<raise event='f'/>", "_event.data === 1"), "not sent with <content>"),
    (sent("<raise event='f'/>", "_event.data.a &lt; 1 &amp;&amp; _event.data.a == 'x'"), None),
    (sent("<raise event='f'/>", "_event.data.a === 1 &amp;&amp; _event.data.A === 1"), "spelt 'a' elsewhere"),
    (sent("<send event='e' target='#_internal' delay='1s'/>", "true"), "send/@delay"),
]


@pytest.mark.parametrize(("body", "message"), REFUSED)
def test_inexpressible_ecmascript_is_refused_with_its_reason_and_place(body, message):
    with pytest.raises(NotExpressibleError, match=message and re.escape(message)) as caught:
        scxml(body)
    assert str(caught.value).startswith("c.scxml:1")


def test_attributes_of_events_from_outside_are_declared_with_the_types_that_the_chart_needs():
    body = """<datamodel><data id="n" expr="0"/></datamodel><state id="s">
      <transition event="e" cond="_event.data.level &gt; 3 &amp;&amp; _event.data.who == 'me'"><assign location="n" expr="_event.data.Count"/></transition>
      <transition event="f" cond="_event.data.x !== 1"/></state>"""
    read = scxml(body)
    assert read.receives == {"e": {"level": "number", "who": "text", "count": "number"}, "f": {"x": "number"}}
    assert validate_plot(read, Library([read])) == []


def test_data_that_get_a_value_before_they_can_be_read_need_none_at_first():
    entered = (
        "<state id='s'><onentry><assign location='x' expr='1'/><assign location='x' expr='x + 1'/></onentry></state>"
    )
    left = "<state id='s'><transition event='e' target='t'><assign location='x' expr='1'/></transition></state><state id='t'><transition cond='x &lt; 2'/></state>"
    data = "<datamodel><data id='x'/></datamodel>"
    assert scxml(data + entered).variables["x"].type == "number"
    assert scxml(data + left).variables["x"].type == "number"
    for body in (
        entered.replace("'1'", "'x'"),
        left.replace("target", "cond='x &lt; 1' target"),
        left.replace("</transition>", "</transition><transition event='f' target='t'/>"),
    ):
        with pytest.raises(NotExpressibleError, match="undefined"):
            scxml(data + body)


def test_several_onentry_are_blocks_of_their_own():
    body = """<datamodel><data id="x" expr="1"/></datamodel><state id="s">
      <onentry><log expr="1"/></onentry><onentry><log expr="2"/></onentry><onentry/>
      <onexit><log expr="3"/></onexit></state>"""
    state = scxml(body).state("s")
    assert [len(block.block) for block in state.entry] == [1, 1]
    assert [type(action).__name__ for action in state.exit] == ["Log"]
    assert to_scxml(scxml(body)).count("<onentry>") == 2
    assert parse_scxml(to_scxml(scxml(body))).state("s") == state


@pytest.mark.parametrize(
    ("expr", "shown"),
    [
        ("n + 1 + 'a'", "3a"),
        ("'a' + n + 1", "a21"),
        ("n / 2", "1"),
        ("n / 4", "0.5"),
        ("b", "true"),
        ("t + n", "t2"),
        ("u", "undefined"),
    ],
)
def test_a_log_shows_what_ecmascript_shows(expr, shown):
    data = '<data id="n" expr="2"/><data id="b" expr="true"/><data id="t" expr="\'t\'"/><data id="u"/>'
    body = f'<datamodel>{data}</datamodel><state id="s"><onentry><log expr="{expr}"/></onentry></state>'
    [note] = DryRun([scxml(body)], "c").steps[0].output
    assert note.text == shown


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("<state id='a'>\n<invoke/></state>", "c.scxml:2:1: invoke: has no counterpart"),
        ("<state id='a'><onentry><script>x()</script></onentry></state>", "script: has no counterpart"),
        ("<state id='a'><onentry><send event='e' target='http://x'/></onentry></state>", "send/@target"),
        ("<state id='a' initial='b c'><state id='b'/><state id='c'/></state>", "only one state"),
        ("<state id='a'><x:y xmlns:x='other'/></state>", "y: has no counterpart"),
        ("<parallel id='a'><parallel id='b'/><state id='c'/></parallel>", "parallel: without states"),
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
        ("<state id='a/b'/>", "not a name for a state"),
        ("<state id='a'><history id='h'/></state>", "needs sibling states"),
        ("<state id='a'><history id='h'/><state id='b'/></state>", "exactly one <transition>"),
        ("<state id='a'><onentry><send event='e' delay='soon'/></onentry></state>", "is not a delay"),
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


@pytest.mark.parametrize(
    ("literal", "text"),
    [("\\u0041", "A"), ("\\x41", "A"), ("\\ud83d\\ude00", "\U0001f600"), ("a\\\\u0041", "a\\u0041"), ("\\v\\'", "\v'")],
)
def test_escapes_are_read_as_ecmascript_reads_them(literal, text):
    (word, _) = tokens(f"'{literal}'", None)
    assert (word.kind, word.text) == ("text", text)

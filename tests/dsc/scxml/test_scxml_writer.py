"""SCXML out, the other text forms, and the commands for them."""

from __future__ import annotations

from pathlib import Path

import pytest
from dsc_charts import plot
from typer.testing import CliRunner

from dsc.cli.plots import app
from dsc.errors import NotExpressibleError
from dsc.scxml.reader import parse_scxml
from dsc.scxml.writer import to_scxml
from dsc.text.text_diagrams import to_mermaid, to_plantuml
from knowledge_base.errors import InputError
from knowledge_base.language.syntax.text import to_text

SHIPPED = sorted((Path(__file__).parents[3] / "domains" / "clean_up_table" / "plots").glob("*.yaml"))

CHART = """<scxml xmlns="http://www.w3.org/2005/07/scxml" version="1.0" name="c">
<datamodel><data id="x" expr="0"/></datamodel>
<parallel id="p">
  <history id="h" type="deep"><transition target="a2"><log expr="'back ' + x"/></transition></history>
  <state id="a" initial="a1">
    <state id="a1"><transition event="go *" cond="!(x &lt; 1) || In('b')" target="a2" type="internal"/></state>
    <state id="a2"><onentry><if cond="x === 1"><raise event="e"/><elseif cond="x === 2"/><send event="f" delay="10ms"/><else/><send event="g"><param name="n" expr="x * 2"/></send></if></onentry></state>
  </state>
  <state id="b"/>
</parallel>
<final id="end"/>
</scxml>"""


def test_a_chart_that_was_read_can_be_written_and_read_again():
    written = to_scxml(parse_scxml(CHART))
    assert to_scxml(parse_scxml(written)) == written
    assert "'back ' + x" not in written
    assert '"back " + x' in written.replace("&quot;", '"')


def test_send_and_cancel_by_id_are_read_and_written():
    text = """<scxml xmlns="http://www.w3.org/2005/07/scxml" version="1.0" name="c">
    <datamodel><data id="made" expr="'none'"/></datamodel>
    <state id="a"><onentry>
      <send event="e" delay="1s" id="one"/><send event="f" delay="2s" idlocation="made"/>
      <cancel sendid="one"/><cancel sendidexpr="made"/>
    </onentry></state></scxml>"""
    read = parse_scxml(text)
    kinds = [(type(action).__name__, getattr(action, "into", None)) for action in read.state("a").entry]
    assert kinds == [("Emit", None), ("Emit", "made"), ("Withdraw", None), ("Withdraw", None)]
    assert parse_scxml(to_scxml(read)).state("a") == read.state("a")


def test_a_plain_dsc_plot_can_be_written():
    text = """
    plot: p
    receives: {go: {}}
    states:
      a:
        states: {a1: {on: {go: a2}}, a2: {final: true}}
        on: {done: b}
      b: {final: true}
    """
    assert 'event="done.state.a" target="b"' in to_scxml(plot(text))


@pytest.mark.parametrize(
    "state",
    [
        "{entry: {trigger: arm.grasp}}",
        "{use: other}",
        "{dynamic: [other]}",
        "{after: {seconds: 1, to: end}}",
        "{on: {go: {to: end, tell: (seen)}}}",
        "{on: {go: {to: end, when: (seen)}}}",
        "{on: {done: end}}",
        "{on: {go: {assign: {x: 1, y: ?x}}}}",
    ],
)
def test_a_state_that_scxml_cannot_express_is_refused(state):
    with pytest.raises(NotExpressibleError):
        to_scxml(plot(f"plot: p\nvariables: {{x: number, y: number}}\nstates: {{a: {state}, end: {{final: true}}}}"))


@pytest.mark.parametrize(
    ("element", "keys"),
    [
        ("outputs", "outputs: {x: {type: number, initial: 0}}\nstates: {a: {on: {go: b}}, b: {final: true}}"),
        ("on_break", "states: {a: {on_break: {switch: arm, to: up}, on: {go: b}}, b: {final: true}}"),
        ("every", "states: {a: {every: {seconds: 1}, on: {go: b}}, b: {final: true}}"),
        ("at_least", "states: {a: {at_least: 1, on: {go: b}}, b: {final: true}}"),
        ("pass", "states: {a: {on: {go: {to: b, pass: {x: 1}}}}, b: {final: true}}"),
        (
            "clear",
            "dialect: scxml\nstates: {a: {on: {go: {to: b, clear: b}}}, b: {states: {h: {history: deep, to: c}, c: {}}}}",
        ),
    ],
)
def test_an_element_without_scxml_counterpart_is_named_as_in_the_plot(element, keys):
    with pytest.raises(NotExpressibleError) as caught:
        to_scxml(plot(f"plot: p\n{keys}\n"))
    assert caught.value.element == element


CONNECTORS = """
    plot: p
    receives: {go: {kind: text}}
    variables: {x: {type: number, initial: 0}}
    states:
      first: {choice: [{when: (< ?x 3), to: a, assign: {x: (+ ?x 1)}}, b]}
      a: {on: {go: which}}
      which: {select: ?event.kind, cases: {cup: {to: a, when: (> ?x 1)}, 2: b}, else: first}
      b: {final: true}
"""


def test_connectors_are_passed_through_as_states_that_wait_for_nothing():
    written = to_scxml(plot(CONNECTORS))
    read = parse_scxml(written)
    assert read.initial == "first"
    assert [(one.target, len(one.effect)) for one in read.states["first"].always] == [("a", 1), ("b", 0)]
    assert [one.target for one in read.states["which"].always] == ["a", "b", "first"]
    guard = read.states["which"].always[0].guard
    assert guard is not None
    assert to_text(guard) == '(and (= ?event.kind "cup") (> ?x 1))'
    assert to_scxml(read) == written


def test_text_diagrams_show_connectors_and_times():
    made = plot(
        CONNECTORS.replace(
            "a: {on:", "a: {at_least: 2, every: {seconds: 0.5, to: b}, on_break: {switch: arm, to: up}, on:"
        )
    )
    for text in (to_mermaid(made), to_plantuml(made)):
        assert "state s1 <<choice>>" in text
        assert "state s3 <<choice>>" in text
        assert "s1 --> s4 : [else]" in text
        assert "s3 --> s2 : [(and (= ?event.kind cup) (> ?x 1))]" in text
        assert "s2 --> s4 : every 0.5 s" in text
        assert "s2 : at least 2 s" in text
        assert "s2 : break / arm → up" in text


@pytest.mark.parametrize("file", SHIPPED, ids=lambda file: file.stem)
@pytest.mark.parametrize("form", ["mermaid", "plantuml", "svg"])
def test_shipped_plots_are_exported(file, form):
    result = CliRunner().invoke(app, ["export", str(file), "--to", form])
    assert result.exit_code == 0
    assert file.stem in result.output or form == "mermaid"


def test_text_diagrams_show_states_edges_and_regions():
    read = parse_scxml(CHART)
    mermaid, plantuml = to_mermaid(read), to_plantuml(read)
    assert mermaid.startswith("stateDiagram-v2\n")
    assert plantuml.endswith("@enduml\n")
    for text in (mermaid, plantuml):
        assert 'state "h (H*)" as' in text
        assert "\n    --\n" in text
        assert "[*] --> s1" in text


def test_a_chart_goes_to_yaml_and_back_by_command(tmp_path):
    source, yaml, back = (tmp_path / name for name in ("c.scxml", "c.yaml", "back.scxml"))
    source.write_text(CHART)
    assert CliRunner().invoke(app, ["import", str(source), "--out", str(yaml)]).exit_code == 0
    assert CliRunner().invoke(app, ["check", str(yaml)]).exit_code == 0
    assert CliRunner().invoke(app, ["export", str(yaml), "--to", "scxml", "--out", str(back)]).exit_code == 0
    assert back.read_text() == to_scxml(parse_scxml(CHART))


def test_an_unknown_form_is_an_error_with_the_nearest(tmp_path):
    file = tmp_path / "p.yaml"
    file.write_text("plot: p\nstates: {a: {final: true}}\n")
    result = CliRunner().invoke(app, ["export", str(file), "--to", "mermade"])
    assert isinstance(result.exception, InputError)
    assert "did you mean 'mermaid'" in str(result.exception)

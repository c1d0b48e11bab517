"""What a notebook shows of a value: its picture as SVG, or a table as HTML."""

from xml.etree import ElementTree as ET

from dsc import RunEnd, parse_plot
from dsc.engine.situation import Decision, Verdict
from knowledge_base import Delta, KnowledgeBase, Schema, fact
from planning import Plan, PlanStep, Timing
from planning.model.plan import PlanFound

SCHEMA = Schema.parse("(define (domain d) (:types cup) (:predicates (dirty ?c - cup)))")


def cells(html):
    return [cell.text or "" for cell in ET.fromstring(html).iter("td")]  # noqa: S314  our own text


def world():
    kb = KnowledgeBase(SCHEMA)
    kb.apply(Delta(nodes={"cup1": "cup", "cup2": "cup"}, added=(fact("dirty", "cup1"),)), "test")
    return kb


def test_a_plot_and_a_world_are_pictures():
    plot = parse_plot("{plot: p, states: {waiting: {after: {seconds: 1, to: over}}, over: {final: true}}}")
    kb = world()
    for shown, name in ((plot, "waiting"), (kb, "cup1"), (kb.at(version=1), "cup1")):
        picture = ET.fromstring(shown._repr_svg_())  # noqa: S314
        assert picture.tag == "{http://www.w3.org/2000/svg}svg"
        assert name in [text.text for text in picture.iter("{http://www.w3.org/2000/svg}text")]


def test_the_end_of_a_run_is_a_table_of_its_outputs():
    html = RunEnd(finished=True, outputs={"where": "shelf"})._repr_html_()
    assert cells(html) == ["where", "shelf"]
    assert [heading in html for heading in ("reached", "output", "value")] == [True] * 3


def test_a_plan_is_a_table_of_its_steps():
    steps = (PlanStep("take", ("a<b",)), PlanStep("put"))
    assert cells(Plan(steps)._repr_html_()) == ["1", "(take a<b)", "2", "(put)"]
    assert cells(PlanFound(Plan(steps), "pyperplan", 0.5, 0.1)._repr_html_()) == ["1", "(take a<b)", "2", "(put)"]
    timed = Plan(steps, (Timing(0, 2.5), Timing(2.5, 1)))
    assert cells(timed._repr_html_()) == ["1", "(take a<b)", "0 s", "2.5 s", "2", "(put)", "2.5 s", "1 s"]
    assert "2 steps, 3.5 s" in timed._repr_html_()


def test_a_decision_is_a_table_of_its_candidates():
    verdicts = (Verdict("near", fits=False, reason="(near cup1) is false"), Verdict("far", fits=True, reason="true"))
    html = Decision("far", verdicts=verdicts, version=3)._repr_html_()
    assert cells(html) == ["✕", "near", "(near cup1) is false", "✓", "far", "true"]
    assert "chosen: far (version 3)" in html
    assert "no candidate fits" in Decision(None)._repr_html_()


def test_an_explanation_is_its_tree():
    why = world().explain("(forall (?c - cup) (dirty ?c))")
    assert ET.fromstring(why._repr_html_()).text == "\n".join(why.lines())  # noqa: S314
    assert "(dirty cup2)" in why._repr_html_()


def test_the_end_of_a_run_has_its_reason_and_outputs():
    html = RunEnd(finished=True, outputs={"found": "cup1"})._repr_html_()
    assert cells(html) == ["found", "cup1"]
    assert "reached: the plot reached its end" in html

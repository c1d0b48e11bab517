"""What functions are worth, as charts see it: a geometry is a list there, since charts hold plain JSON."""

import json

from dsc.dynamic.knowledge_situation import KnowledgeSituation
from dsc.dynamic.library import Library
from dsc.testing.fixtures import world
from knowledge_base.language.syntax.text import parse_effect, parse_term

ROOM = """(define (domain room) (:types thing)
  (:functions (pose ?t ?frame - thing) - geometry (label ?t - thing) - text))"""
FACTS = '(= (pose cup map) (geometry 0.4 0.1)) (= (label cup) "red")'


def test_a_chart_reads_and_tells_content():
    situation = KnowledgeSituation(world(ROOM, "cup map - thing", FACTS), Library([]))
    pose = situation.value(parse_term("(pose ?t map)"), {"t": "cup"})
    assert pose == [0.4, 0.1] == json.loads(json.dumps(pose))
    assert situation.value(parse_term("(label ?t)"), {"t": "cup"}) == "red"
    situation.tell(
        parse_effect("(and (assign (pose cup map) (geometry 1 2)) (assign (label cup) ?found))"), {"found": "blue"}
    )
    assert situation.value(parse_term("(pose cup map)"), {}) == [1, 2]
    assert situation.value(parse_term("(label cup)"), {}) == "blue"


def test_an_unknown_geometry_has_no_value():
    situation = KnowledgeSituation(world(ROOM, "cup map - thing"), Library([]))
    assert situation.value(parse_term("(pose cup map)"), {}) is None

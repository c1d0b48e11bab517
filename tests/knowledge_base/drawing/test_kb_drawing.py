"""Pictures of worlds: everything asked for is there, nothing covers another card, the same world looks the same."""

from __future__ import annotations

from itertools import combinations
from xml.etree import ElementTree as ET

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from knowledge_base import Delta, KnowledgeBase, Schema, UnknownNameError, fact
from knowledge_base.drawing import MOST_DRAWN, draw
from knowledge_base.drawing.picture import picture_of
from knowledge_base.drawing.rendering import arranged

SCHEMA = Schema.parse(
    """(define (domain d) (:types cup place - object)
  (:predicates (on ?c ?p - object) (clean ?c - object) (gives ?a ?b ?c - object) (label ?c - object ?t - text))
  (:functions (weight ?c - object) (far ?a ?b - object) (time)))"""
)
NAMES = [f"c{i}" for i in range(8)]


def world(*facts, **numbers) -> KnowledgeBase:
    kb = KnowledgeBase(SCHEMA)
    kb.apply(Delta(nodes=dict.fromkeys(NAMES, "cup") | {"table": "place"}, added=facts), "me")
    return kb


def texts(svg: str) -> list[str]:
    root = ET.fromstring(svg)  # noqa: S314  our own
    return [node.text or "" for node in root.iter("{http://www.w3.org/2000/svg}text")]


def test_facts_about_one_object_appear_on_its_card_and_about_two_on_an_arrow() -> None:
    kb = world(fact("on", "c0", "table"), fact("clean", "c0"), fact("label", "c0", "Red <cup>"))
    kb.apply(Delta(values={fact("weight", "c0"): 0.25, fact("far", "c0", "table"): 3}), "me")
    shown = texts(draw(kb, "c0"))
    assert shown == ["c0", "cup", "clean", 'label "Red <cup>"', "weight = 0.25", "table", "place", "on, far = 3"]


def test_a_fact_about_three_things_is_a_card_that_leads_to_each() -> None:
    picture = picture_of(world(fact("gives", "c0", "c1", "table")), "c1", 1, 10)
    assert [card.title for card in picture.cards] == ["c1", "c0", "table", "gives"]
    assert [(link.target, link.labels[0].text) for link in picture.links] == [("c0", "1"), ("c1", "2"), ("table", "3")]


def test_hops_say_how_far_the_neighbourhood_goes() -> None:
    kb = world(*(fact("on", f"c{i}", f"c{i + 1}") for i in range(7)))
    assert [[card.title for card in picture_of(kb, "c3", hops, 99).cards] for hops in (0, 1, 2)] == [
        ["c3"],
        ["c3", "c2", "c4"],
        ["c3", "c2", "c4", "c1", "c5"],
    ]


def test_a_picture_says_how_many_things_it_leaves_out() -> None:
    kb = KnowledgeBase(SCHEMA)
    kb.apply(Delta(nodes={f"c{i}": "cup" for i in range(MOST_DRAWN + 12)}), "me")
    assert "12 more things are not drawn" in texts(draw(kb))


def test_an_unknown_thing_names_the_nearest() -> None:
    with pytest.raises(UnknownNameError, match="there is no object 'tabel'; did you mean 'table'"):
        draw(world(), "tabel")


def test_an_empty_world_is_an_empty_picture() -> None:
    assert texts(draw(KnowledgeBase(SCHEMA))) == []


@settings(derandomize=True, deadline=None, max_examples=40)
@given(st.sets(st.tuples(st.sampled_from(NAMES), st.sampled_from(NAMES)), max_size=20))
def test_no_card_covers_another_and_all_are_inside(pairs) -> None:
    kb = world(*(fact("on", *pair) for pair in sorted(pairs)))
    picture = arranged(picture_of(kb, None, 1, 99))
    for one, other in combinations(picture.cards.values(), 2):
        apart_across = abs(one.x - other.x) >= (one.width + other.width) / 2
        apart_down = abs(one.y - other.y) >= (one.height + other.height) / 2
        assert apart_across or apart_down, (one, other)
    left = min(one.x - one.width / 2 for one in picture.cards.values())
    right = max(one.x + one.width / 2 for one in picture.cards.values())
    top = min(one.y - one.height / 2 for one in picture.cards.values())
    bottom = max(one.y + one.height / 2 for one in picture.cards.values())
    assert min(left, top, picture.width - right, picture.height - bottom) >= -0.1
    assert draw(kb) == draw(kb)


KINDS = [
    "(define (domain perception) (:predicates (sees ?a ?b - object)))",
    "(define (domain dialogue) (:predicates (ask ?a ?b - object) (busy ?a - object) (tells ?a ?b ?c - object)))",
]


def colours(svg: str) -> dict[str, str]:
    """Return the colours of coloured texts."""
    root = ET.fromstring(svg)  # noqa: S314  our own
    return {one.text or "": one.get("fill", "") for one in root.iter("{http://www.w3.org/2000/svg}tspan")}


def test_facts_have_the_colours_of_their_kinds_also_from_a_store(tmp_path) -> None:
    schema = Schema.parse(KINDS[0]).merged(Schema.parse(KINDS[1]))
    facts = "(sees c0 c1) (ask c0 c1) (busy c0) (tells c0 c1 c2)"
    with KnowledgeBase.open(schema, tmp_path / "w.kb") as kb:
        kb.apply(Delta(nodes={"c0": "object", "c1": "object", "c2": "object"}), "me")
        kb.apply(facts, author="me")
        drawn = colours(draw(kb))
    assert drawn["ask"] == drawn["busy"] == drawn["dialogue"] != drawn["sees"] == drawn["perception"]
    with KnowledgeBase.open(None, tmp_path / "w.kb") as kb:
        assert colours(draw(kb)) == drawn


def test_facts_of_one_kind_have_no_colour() -> None:
    assert colours(draw(world(fact("on", "c0", "table")))) == {}

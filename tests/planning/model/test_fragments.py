"""Domains that come in pieces: what they make together, and what they must not contradict each other in."""

from __future__ import annotations

from typing import Annotated

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsc import Component, Outcome, SkillCall, primitive_plot, skill
from knowledge_base import Delta, InputError, KnowledgeBase, Schema, SchemaError, SchemaMismatchError, fact
from planning import PlanningDomain, Robot
from planning.robot.bundles import shipped_by

WORLD = """(define (domain kitchen) (:types item place)
  (:predicates (at ?i - item ?p - place)) (:constants home - place))"""
ARM = """(define (domain arm) (:types cup - item)
  (:predicates (holding ?i - item) (at ?i - item ?p - place))
  (:action grasp :parameters (?i - item ?p - place) :precondition (and (at ?i ?p) (clean ?i))
    :effect (and (holding ?i) (not (at ?i ?p)))))"""
DISHWASHER = """(define (domain dishwasher) (:predicates (clean ?i - item))
  (:action wash :parameters (?i - item) :effect (clean ?i)))"""


@pytest.fixture
def files(tmp_path):
    """Writes texts into files `a.pddl`, `b.pddl`, ... and gives their paths."""

    def write(*texts):
        paths = [tmp_path / f"{name}.pddl" for name, _ in zip("abcdef", texts, strict=False)]
        for path, text in zip(paths, texts, strict=True):
            path.write_text(text)
        return paths

    return write


def content(domain):
    """All that a domain says, without the order in which it says it."""
    schema = domain.schema
    return (
        dict(schema.types),
        dict(schema.constants),
        {name: [p.types for p in s.parameters] for name, s in schema.predicates.items()},
        {name: [p.types for p in s.parameters] for name, s in schema.functions.items()},
        dict(domain.actions),
        set(domain.axioms),
    )


def test_pieces_make_one_domain(files):
    domain = PlanningDomain.from_pddl(*files(WORLD, ARM, DISHWASHER))
    assert domain.name == "kitchen"
    assert list(domain.actions) == ["grasp", "wash"]
    assert domain.schema.ancestors("cup") == ("cup", "item", "object")


def test_pieces_keep_what_functions_are_worth():
    labels = PlanningDomain.parse("(define (domain d) (:types item) (:functions (label ?i - item) - text))")
    domain = PlanningDomain.from_fragments([labels, "(define (domain e) (:types place))"])
    assert domain.schema.functions["label"].result == "text"


def test_alone_a_piece_lacks_what_the_others_declare():
    with pytest.raises(InputError, match="'place'"):
        PlanningDomain.parse(ARM)


def test_a_name_in_no_piece_is_told_with_all_files(files):
    with pytest.raises(InputError, match=r"b\.pddl:3:\d+: there is no predicate 'clean' in .*a\.pddl, .*b\.pddl"):
        PlanningDomain.from_pddl(*files(WORLD, ARM))
    with pytest.raises(InputError, match=r"a\.pddl:.*'item' in .*a\.pddl, .*b\.pddl"):
        PlanningDomain.from_pddl(*files(DISHWASHER, "(define (domain none))"))


CONFLICTS = [
    ("(:types cup - place)", "(:types cup - item)", "cup - place", "cup - item"),
    ("(:types cup)", "(:types cup - item)", "cup - object", "cup - item"),
    ("(:types cup - item)", "(:types cup)", "cup - item", "cup - object"),
    ("(:constants home)", "(:constants home - place)", "home - object", "home - place"),
    ("(:constants home - item)", "(:constants home - place)", "home - item", "home - place"),
    ("(:predicates (at ?i - item))", "(:predicates (at ?i ?p - item))", "(at ?i - item)", "(at ?i - item ?p - item)"),
    ("(:functions (f))", "(:functions (f ?x))", "(f)", "(f ?x - object)"),
    ("(:action a)", "(:action a :parameters (?i - item))", "the parameters () instead", "of (?i - item)"),
    ("(:action a :effect (p))", "(:action a :effect (not (p)))", "the effect (p) instead", "of (not (p))"),
    (
        "(:durative-action a :duration (= ?duration 3))",
        "(:durative-action a :duration (= ?duration 4))",
        "the duration from 3 to 3",
        "from 4 to 4",
    ),
    (
        "(:durative-action a :duration () :condition (over all (p)))",
        "(:durative-action a :duration () :condition (at start (p)))",
        "the precondition (and)",
        "(p)",
    ),
]


@pytest.mark.parametrize(("first", "second", "before", "here"), CONFLICTS, ids=[c[0][:25] for c in CONFLICTS])
def test_a_conflict_names_both_places_and_what_differs(files, first, second, before, here):
    common = "(define (domain d) (:types item place) (:predicates (p)))"
    with pytest.raises(SchemaError) as caught:
        PlanningDomain.from_pddl(*files(f"(define (domain a)\n\n{first})", f"(define (domain b)\n{second})", common))
    said = str(caught.value)
    assert caught.value.place.source.endswith("b.pddl")
    assert caught.value.place.line == 2
    assert "a.pddl:3:" in said
    assert said.index(before) < said.index(here)


def test_a_fragment_may_declare_more_about_a_type_that_another_only_uses():
    use = "(define (domain use) (:types cup - item) (:predicates (clean ?i - item)))"
    for pieces in ([use, "(define (domain b) (:types item - thing thing))"], [use, use]):
        assert PlanningDomain.from_fragments(pieces).schema.is_a("cup", "item")


def test_one_piece_may_say_object_and_then_more():
    wild = "(define (domain wild) (:types cup item - object cup - item))"
    assert PlanningDomain.from_fragments([wild, wild]).schema.ancestors("cup") == ("cup", "item", "object")


def test_a_predicate_of_one_piece_and_a_function_of_another(files):
    with pytest.raises(SchemaError, match=r"b\.pddl:1.*'f' has the name of a predicate \(at .*a\.pddl:1"):
        PlanningDomain.from_pddl(
            *files("(define (domain a) (:predicates (f)))", "(define (domain b) (:functions (f)))")
        )


def test_a_derived_predicate_of_one_piece_is_not_changed_by_another(files):
    derived = "(define (domain a) (:predicates (p) (q)) (:derived (p) (q)))"
    with pytest.raises(SchemaError, match=r"b\.pddl:1.*derived \(at .*a\.pddl:1"):
        PlanningDomain.from_pddl(*files(derived, "(define (domain b) (:action a :effect (p)))"))


def test_the_notes_of_all_pieces_are_kept(files):
    domain = PlanningDomain.from_pddl(
        *files("(define (domain a) (:requirements :fancy))", "(define (domain b) (:types x - y))")
    )
    assert ["a.pddl:1:" in domain.notes[0], "b.pddl:1:" in domain.notes[1], len(domain.notes)] == [True, True, 2]


def test_a_fragment_can_be_a_domain_a_text_or_a_file(files):
    whole = PlanningDomain.from_fragments([WORLD, ARM, DISHWASHER])
    again = PlanningDomain.from_fragments([PlanningDomain.parse(WORLD), files(DISHWASHER)[0], ARM])
    assert content(again) == content(whole)


def test_a_domain_is_what_its_text_says(clean_up):
    assert content(PlanningDomain.from_text(clean_up.to_text())) == content(clean_up)


PARTS = [
    "(:types item place vehicle - object)",
    "(:types cup can - item)",
    "(:constants home - place)",
    "(:predicates (at ?i - item ?p - place) (held ?i - item))",
    "(:predicates (clean ?c - cup) (shiny ?c - cup))",
    "(:functions (weight ?i - item) (total-cost))",
    "(:derived (shiny ?c) (clean ?c))",
    "(:action take :parameters (?i - item) :precondition (at ?i home) :effect (and (held ?i) (not (at ?i home))))",
    "(:durative-action wash :parameters (?c - cup) :duration (= ?duration (weight ?c)) :effect (at end (clean ?c)))",
]


@settings(derandomize=True, deadline=None, max_examples=60)
@given(
    st.lists(st.sets(st.integers(0, 3), min_size=1), min_size=len(PARTS), max_size=len(PARTS)),
    st.permutations(range(4)),
)
def test_a_domain_is_independent_of_the_division_and_order_of_its_fragments(owners, order):
    def piece(number):
        own = [part for part, fragments in zip(PARTS, owners, strict=True) if number in fragments]
        return f"(define (domain d) {' '.join(merged_sections(own))})"

    assert content(PlanningDomain.from_fragments([piece(number) for number in order])) == content(
        PlanningDomain.parse(f"(define (domain d) {' '.join(merged_sections(PARTS))})")
    )


def merged_sections(parts):
    """A file has each section of declarations once."""
    sections: dict[str, list[str]] = {}
    for part in parts:
        keyword, rest = part[1:-1].split(" ", 1)
        once = keyword in (":types", ":predicates")
        sections.setdefault(keyword if once else part, [keyword]).append(rest)
    return [f"({' '.join(words)})" for words in sections.values()]


Item = Annotated[str, "item"]


class Grasped(Outcome): ...


class Gripper(Component):
    domain = """(define (domain gripper) (:predicates (holding ?i - item))
      (:action grasp :parameters (?item - item) :precondition (near ?item) :effect (holding ?item)))"""

    @skill
    async def grasp(self, call: SkillCall, item: Item) -> Grasped:
        return Grasped(observed=Delta(added=(fact("holding", item),)))


class Spare(Gripper):
    """Another gripper of the same make."""


ROOM = "(define (domain room) (:types item) (:predicates (near ?i - item)))"


def test_an_executive_plans_with_what_its_components_bring():
    gripper = Gripper()
    plots = [primitive_plot(gripper.skills()["grasp"], done="grasped", implements="grasp")]
    with Robot(PlanningDomain.parse(ROOM), plots, [gripper, Spare(), Component("camera")], clock="simulated") as robot:
        robot.knowledge.apply(Delta(nodes={"cup": "item"}, added=(fact("near", "cup"),)), author="test")
        assert robot.achieve("(holding cup)").finished
        assert robot.knowledge.ask("(holding cup)")


def test_a_mistake_in_what_a_component_brings_is_named_with_its_class():
    with pytest.raises(
        InputError, match=r"Gripper\.domain:2:\d+: there is no predicate 'near' in room, Gripper\.domain"
    ):
        Robot("(define (domain room) (:types item)\n)", [], [Gripper()], clock="simulated")


def test_a_component_may_bring_a_file(files):
    (path,) = files(DISHWASHER)

    class Dishwasher(Component):
        domain = path

    assert [text.name for text in shipped_by([Dishwasher(), Dishwasher("second")])] == ["dishwasher"]


def test_a_world_model_that_lacks_what_a_component_brings_is_refused():
    with pytest.raises(SchemaMismatchError, match="the predicate 'holding' is missing"):
        Robot(ROOM, [], [Gripper()], knowledge=KnowledgeBase(Schema.parse(ROOM)), clock="simulated")


def test_a_domain_has_at_least_one_fragment():
    with pytest.raises(InputError, match="at least one"):
        PlanningDomain.from_fragments([])

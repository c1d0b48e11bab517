"""What programs hand to a knowledge base and should not: one line of error, and nothing changed."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kb_strategies import SCHEMA, THINGS
from kb_worlds import PROPERTY, Ticks, everything

from knowledge_base import Delta, Fact, InputError, KnowledgeBase, SchemaError, StoreError, UnknownNameError, fact

QUESTIONS = ["ask", "query", "explain", "explain_query", "install", "watch"]


@pytest.fixture
def kb() -> KnowledgeBase:
    kb = KnowledgeBase(SCHEMA, Ticks())
    kb.apply(Delta(nodes=THINGS, added=(fact("heavy", "cup1"),)), author="test")
    return kb


def one_line(error: pytest.ExceptionInfo[InputError]) -> str:
    said = str(error.value)
    assert said.isprintable()
    return said


# --- parameters


@pytest.mark.parametrize("question", QUESTIONS)
def test_a_parameter_that_the_question_does_not_have_is_named_with_the_nearest(kb, question):
    with pytest.raises(UnknownNameError, match=r"did you mean '[?]item'"):
        getattr(kb, question)("(heavy ?item)", {"item": "cup1", "itm": "cup1"})
    with kb.transaction(author="test") as tx, pytest.raises(UnknownNameError, match=r"did you mean '[?]item'"):
        tx.query("(heavy ?item)", {"itm": "cup1"})


@pytest.mark.parametrize("text", ["(heavy ?Item)", "(heavy ?item)"])
@pytest.mark.parametrize("name", ["Item", "item", "ITEM"])
def test_parameters_are_found_however_they_are_written(kb, text, name):
    for _ in range(2):
        assert [kb.ask(text, {name: one}) for one in ("cup1", "cup2")] == [True, False]
        assert kb.query(text, {name: "cup1"}) == [{}]
        assert str(kb.explain(text, {name: "cup2"})) == "(heavy cup2) is false"
        assert "heavy" in str(kb.explain_query(text, {name: "cup2"}))
        assert kb.install(text, {name: "cup1"}).truth
    with kb.transaction(author="test") as tx:
        assert [tx.ask(text, {name: one}) for one in ("cup1", "cup2")] == [True, False]


def test_a_variable_of_a_quantifier_is_no_parameter(kb):
    with pytest.raises(UnknownNameError, match=r"no free variable '[?]i'"):
        kb.ask("(exists (?i - item) (heavy ?i))", {"i": "cup2"})


def test_a_variable_is_given_one_value(kb):
    with pytest.raises(InputError, match=r"'[?]item' is given two values"):
        kb.ask("(heavy ?item)", {"item": "cup1", "Item": "cup2"})


@pytest.mark.parametrize("question", QUESTIONS)
@pytest.mark.parametrize("params", [5, "item", ["item"], {"item": None}, {"item": ["cup1"]}, {5: "cup1"}])
def test_parameters_are_a_mapping_of_names_to_values(kb, question, params):
    before = everything(kb)
    with pytest.raises(InputError) as error:
        getattr(kb, question)("(heavy ?item)", params)
    assert "mapping" in one_line(error) or "name" in one_line(error)
    assert everything(kb) == before


@pytest.mark.parametrize("question", QUESTIONS)
def test_a_geometry_is_no_parameter(kb, question):
    with pytest.raises(SchemaError, match=r"'[?]item' cannot be a geometry"):
        getattr(kb, question)("(heavy ?item)", {"item": (1.0, 2.0)})


# --- conditions


@pytest.mark.parametrize("question", QUESTIONS)
@pytest.mark.parametrize("text", [5, True, b"(heavy cup1)", ["(heavy cup1)"], object, fact("heavy", "cup1")])
@pytest.mark.parametrize("params", [None, {"item": "cup1"}])
def test_a_condition_is_text(kb, question, text, params):
    with pytest.raises(InputError, match="a condition is text such as") as error:
        getattr(kb, question)(text, params)
    one_line(error)


def test_the_error_for_a_fact_passed_to_ask_shows_it_as_text(kb):
    with pytest.raises(InputError, match=r"write it as text: \(heavy cup1\)"):
        kb.ask(fact("heavy", "cup1"))


# --- changes and how they are made


@pytest.mark.parametrize(
    "delta",
    [
        None,
        fact("heavy", "cup2"),
        Delta(added=[fact("heavy", "cup2")]),  # type: ignore[arg-type]
        Delta(added=fact("heavy", "cup2")),  # type: ignore[arg-type]
        Delta(removed=("heavy",)),  # type: ignore[arg-type]
        Delta(replaced=(None,)),  # type: ignore[arg-type]
        Delta(nodes=["cup9"]),  # type: ignore[arg-type]
        Delta(values=[("weight", 2)]),  # type: ignore[arg-type]
        Delta(values={"weight": 2}),  # type: ignore[dict-item]
        Delta(removed_nodes="cup2"),  # type: ignore[arg-type]
        Delta(added=(fact(5, "cup2"),)),  # type: ignore[arg-type]
        Delta(added=(Fact("heavy", ["cup2"]),)),  # type: ignore[arg-type]
    ],
)
def test_a_change_is_a_delta_of_facts(kb, delta):
    before = everything(kb)
    with pytest.raises(InputError) as error:
        kb.apply(delta, author="test")
    one_line(error)
    with kb.transaction(author="test") as tx, pytest.raises(InputError):
        tx.apply(delta)
    assert everything(kb) == before


@pytest.mark.parametrize(
    "how", [{"author": 5}, {"author": None}, {"author": "a", "key": 5}, {"author": "a", "key": b"k"}]
)
def test_authors_and_keys_are_text(kb, how):
    with pytest.raises(InputError, match="is text, not"):
        kb.apply(Delta(added=(fact("quiet"),)), **how)
    with pytest.raises(InputError, match="is text, not"):
        kb.transaction(**how).__enter__()
    assert not kb.ask("(quiet)")


@pytest.mark.parametrize("limit", [0, 1.5, "5", None, True])
def test_a_watch_keeps_a_whole_number_of_changes(kb, limit):
    with pytest.raises(InputError, match="at least one change"):
        kb.watch(limit=limit)


@pytest.mark.parametrize("how", [{"hold_s": "1"}, {"hold_s": None}, {"hold_s": True}, {"fire": 5}, {"fire": ["edge"]}])
def test_a_condition_fires_on_terms_that_are_known(kb, how):
    with pytest.raises(InputError):
        kb.install("(quiet)", **how)


@pytest.mark.parametrize(
    ("schema", "path", "durability", "means"),
    [
        (SCHEMA, "world.kb", "disk", "there is no durability 'disk'"),
        (SCHEMA, "world.kb", 5, "there is no durability 5"),
        (SCHEMA, None, "disk", "there is no durability 'disk'"),
        ("(define)", "world.kb", None, "a schema is a Schema"),
        ("(define)", None, None, "a schema is a Schema"),
        (SCHEMA, 5, None, "a store's path is text"),
        (SCHEMA, b"world.kb", None, "a store's path is text"),
        (SCHEMA, "", None, "a store's path is text"),
        (SCHEMA, "a\0b", None, "a store's path is text"),
    ],
)
def test_a_store_that_cannot_be_opened_leaves_no_file(tmp_path, monkeypatch, schema, path, durability, means):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=means):
        KnowledgeBase.open(schema, path, durability)
    assert list(tmp_path.iterdir()) == []


def test_links_that_lead_to_each_other_are_no_store(tmp_path):
    (tmp_path / "loop.kb").symlink_to("loop.kb")
    with pytest.raises(StoreError):
        KnowledgeBase.open(SCHEMA, tmp_path / "loop.kb")


def test_a_replacement_of_everything_is_refused(kb):
    with (
        kb.transaction(author="test") as tx,
        pytest.raises(SchemaError, match="would replace all other facts of 'heavy'"),
    ):
        tx.replace("heavy", "cup2")
    assert kb.ask("(heavy cup1)")


# --- what cannot be computed

BAD = ["(> (/ 1 0) 1)", "(> (* 1e308 1e308) 1)", "(= (- (* 1e308 10) 1) 0)"]


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize("text", ["{}", "(not {})", "(and {} (heavy cup1))", "(or (quiet) {})", "(imply {} (quiet))"])
def test_an_incomputable_part_that_decides_a_condition_is_an_error(kb, bad, text):
    for question in ("ask", "query", "explain"):
        with pytest.raises(InputError, match="cannot be computed"):
            getattr(kb, question)(text.format(bad))
    condition = kb.install(text.format(bad))
    assert (condition.truth, "cannot be computed" in str(condition.error)) == (False, True)


HEAVY = "(> (/ 2 (weight ?i)) 1)"
SOME = (
    f"(exists (?i - item) {HEAVY})",
    f"(forall (?i - item) {HEAVY})",
    f"(exists (?i - item) (and (on ?i shelf) {HEAVY}))",
    f"(forall (?i - item) (imply (on ?i shelf) {HEAVY}))",
    f"(exists (?i - item ?p - place) (and (on ?i ?p) {HEAVY} (near ?p home)))",
    f"(exists (?i - item) (and (or (heavy ?i) (on ?i shelf)) {HEAVY}))",
)
"""`cup1` and `cup2` weigh 1 and 4 below; what weighs nothing cannot be computed."""


def parts() -> st.SearchStrategy[str]:
    leaf = st.sampled_from(["(quiet)", "(heavy cup1)", *BAD[:2], *SOME])
    several = lambda part: st.lists(part, max_size=3).map(" ".join)  # noqa: E731
    return st.recursive(
        leaf,
        lambda part: st.one_of(
            several(part).map("(and {})".format),
            several(part).map("(or {})".format),
            part.map("(not {})".format),
            st.tuples(part, part).map(lambda both: f"(imply {both[0]} {both[1]})"),
        ),
        max_leaves=8,
    )


def outcome(ask) -> bool | None:
    try:
        return bool(ask())
    except InputError:
        return None


def world(order, weights) -> KnowledgeBase:
    kb = KnowledgeBase(SCHEMA)
    items = {name: THINGS[name] for name in order}
    said = [fact("heavy", "cup1"), fact("near", "shelf", "home"), *(fact("on", name, "shelf") for name in order)]
    kb.apply(Delta({**items, "shelf": "place"}, added=tuple(said)), author="test")
    kb.apply(Delta(values={fact("weight", name): weight for name, weight in weights.items()}), author="test")
    return kb


ORDERS = st.permutations(("cup1", "cup2", "can1"))
WEIGHTS = st.dictionaries(st.sampled_from(("cup1", "cup2", "can1")), st.sampled_from((1, 4)))


@PROPERTY
@given(ORDERS, WEIGHTS)
def test_one_thing_decides_although_another_cannot_be_computed(order, weights):
    kb = world(order, weights)
    light = [2 / weights[name] > 1 if name in weights else None for name in order]
    some = True if True in light else (None if None in light else False)
    every = False if False in light else (None if None in light else True)
    for text, truth in zip(SOME, [some, every, some, every, some, some], strict=True):
        assert outcome(lambda: kb.ask(text)) is truth, text  # noqa: B023


@PROPERTY
@given(parts(), ORDERS, WEIGHTS)
def test_all_questions_agree_on_what_can_be_computed(text, order, weights):
    kb = world(order, weights)
    truth = outcome(lambda: kb.ask(text))
    assert outcome(lambda: kb.query(text)) is truth
    assert outcome(lambda: kb.explain(text).truth) is truth
    condition = kb.install(text)
    assert (condition.truth, condition.error is None) == (truth is True, truth is not None)


# --- contradictions

ON = fact("on", "cup1", "table")


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("added", Delta(removed=(fact("heavy", "cup1"), ON), added=(ON,))),
        ("replaced", Delta(removed=(fact("heavy", "cup1"), ON), replaced=(ON,))),
    ],
)
def test_a_change_that_makes_one_fact_false_and_true_is_refused_with_both_places(kb, name, change):
    before = everything(kb)
    with pytest.raises(InputError) as error:
        kb.apply(change, author="test")
    assert f"(on cup1 table) is removed[1] and {name}[0]" in one_line(error)
    assert everything(kb) == before

"""Relations whose rows a running program provides: queries, quantifiers, installed conditions, mistakes."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

import knowledge_base.language.checking.relations as registry
from knowledge_base import Delta, KnowledgeBase, Schema, UnknownNameError, fact
from knowledge_base.errors import InputError, SchemaError

SCHEMA = Schema.parse("(define (domain d) (:types cup) (:predicates (clean ?c - cup)))", "d")


@pytest.fixture(autouse=True, scope="module")
def declared() -> Iterator[None]:
    registry.declare_relations({"test:on": "lamp", "test:level": "lamp level"})
    yield
    for name in ("test:on", "test:level"):
        del registry._declared[name]


def room(*lamps: str) -> tuple[KnowledgeBase, dict[str, float]]:
    """A knowledge base with a cup, and the levels of lamps that it reads."""
    kb = KnowledgeBase(SCHEMA)
    kb.apply(Delta(nodes={"red": "cup"}, added=(fact("clean", "red"),)), author="test")
    levels = dict.fromkeys(lamps, 1.0)
    kb.provide({"test:on": lambda: [(one,) for one in levels], "test:level": lambda: list(levels.items())})
    return kb, levels


@pytest.mark.parametrize(
    ("condition", "expected"),
    [
        ("(test:on left)", True),
        ('(test:on "left")', True),
        ("(test:on middle)", False),
        ("(exists (?lamp) (test:on ?lamp))", True),
        ('(exists (?lamp) (and (test:on ?lamp) (!= ?lamp "left")))', True),
        ("(exists (?lamp ?level) (and (test:level ?lamp ?level) (> ?level 2)))", False),
        ("(forall (?lamp) (imply (test:on ?lamp) (exists (?level) (test:level ?lamp ?level))))", True),
        ('(forall (?lamp) (imply (test:on ?lamp) (= ?lamp "left")))', False),
        ("(exists (?lamp - cup) (test:on ?lamp))", False),
        ("(exists (?cup) (and (clean ?cup) (not (test:on ?cup))))", True),
        ("(exists (?lamp) (or (test:on ?lamp) (test:level ?lamp 5)))", True),
    ],
)
def test_conditions_read_rows(condition, expected):
    kb, _ = room("left", "right")
    assert kb.ask(condition) is expected
    assert kb.explain(condition).truth is expected
    assert kb.install(condition).truth is expected


def test_queries_list_rows():
    kb, _ = room("left", "right")
    assert kb.query("(test:on ?lamp)") == [{"lamp": "left"}, {"lamp": "right"}]
    assert kb.query("(test:level ?lamp 1)") == [{"lamp": "left"}, {"lamp": "right"}]


_LAMPS = ("a", "b", "c")
_CONDITIONS = (
    "(test:on a)", "(exists (?x) (test:on ?x))", '(exists (?x) (and (test:on ?x) (!= ?x "a")))',
    "(forall (?x) (imply (test:on ?x) (test:level ?x 2)))", "(not (test:level b 2))",
    "(exists (?x ?v) (and (test:level ?x ?v) (> ?v 1) (clean red)))",
)  # fmt: skip


@given(st.lists(st.dictionaries(st.sampled_from(_LAMPS), st.integers(1, 3)), max_size=6))
def test_installed_conditions_follow_changed_rows(worlds):
    kb, levels = room()
    installed = {text: kb.install(text) for text in _CONDITIONS}
    for world in worlds:
        levels.clear()
        levels.update(world)
        kb.renew_relations()
        assert {text: one.truth for text, one in installed.items()} == {text: kb.ask(text) for text in _CONDITIONS}


def test_rows_are_no_part_of_the_world():
    kb, _ = room("left")
    assert kb.ask("(test:on left)")
    assert KnowledgeBase.from_json(kb.to_json()).query("(test:on ?lamp)") == []
    assert "test:" not in kb.to_json()


def test_an_ended_provision_leaves_no_rows():
    kb, _ = room("left")
    end = kb.provide({"test:on": lambda: [("extra",)]})
    fired = kb.install("(test:on extra)")
    assert fired.truth
    end()
    assert not fired.truth
    assert kb.query("(test:on ?lamp)") == [{"lamp": "left"}]


@pytest.mark.parametrize(
    ("write", "said"),
    [
        (lambda kb: kb.apply(Delta(added=(fact("test:on", "left"),)), author="test"), "read-only"),
        (lambda kb: kb.query("(test:onn ?lamp)"), "did you mean 'test:on'"),
        (lambda kb: kb.query("(test:on ?lamp ?other)"), r"takes 1 argument, as in \(test:on \?lamp\); found 2"),
    ],
)
def test_mistakes_are_refused(write, said):
    kb, _ = room("left")
    with pytest.raises((SchemaError, UnknownNameError, InputError), match=said):
        write(kb)


def test_a_relation_where_no_program_has_declared_any(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "_declared", {})
    with pytest.raises(SchemaError, match="'dsc:active' is a relation of a running program"):
        KnowledgeBase(Schema()).query("(dsc:active ?s)")

"""Names of things: each is refused when it is told, or written as PDDL and read back as the same."""

from __future__ import annotations

import json
from typing import Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from knowledge_base import Delta, KnowledgeBase, Schema, fact
from knowledge_base.cli import app
from knowledge_base.errors import InputError
from knowledge_base.language.syntax.effect import EFFECT_KEYWORDS
from knowledge_base.language.syntax.expression import COMPUTING, KEYWORDS
from knowledge_base.pddl import read_problem
from knowledge_base.spelling import LONGEST_NAME, is_name, nearest_name

DOMAIN = """(define (domain d) (:types cup) (:predicates (clean ?c - cup) (said ?c - cup ?t - text))
  (:functions (label ?c - cup) - text))"""
SCHEMA = Schema.parse(DOMAIN)
ODD = [
    *KEYWORDS, *COMPUTING, *EFFECT_KEYWORDS, "object", "either", "define", "cup", "clean", "label", "text", "number",
    "at", "preference", "#t", "total-time", "true", "false", "-", "-x", "a-", "--", "?x", "x?y", ":x", "x:y", ";", "a;b",
    "1", "1a", "+1", "1e5", ".5", "1.", "inf", "nan", "Cup1", "red cup", "a\tb", "a\nb", "a\x00", "\x7f", "\x85", "(",
    ")", "a(b", '"', "'", "|", "\\", "a\\n", "\udc80", "\ud800", "ü", "İ", "ß", "ẞ", "\u2028", "\xa0", "\u200b", "\ufeff",
    "", " ", "x" * LONGEST_NAME, "x" * (LONGEST_NAME + 1),
]  # fmt: skip


def agrees(name: str) -> None:
    """Told through the API, the name is refused, or comes back out of a PDDL file in every place."""
    kb = KnowledgeBase(SCHEMA)
    said = Delta(
        nodes={name: "cup"}, added=(fact("clean", name), fact("said", name, name)), values={fact("label", name): name}
    )
    try:
        kb.apply(said, author="test")
    except InputError:
        assert not is_name(name)
        assert kb.version == 0
        return
    assert is_name(name)
    text = kb.to_pddl("d", name).encode().decode()  # as a file has it
    read = read_problem(text.replace("\r\n", "\n").replace("\r", "\n"), SCHEMA)
    assert (read.name, read.delta()) == (name, said)
    assert kb.ask(f"(clean {name})")


@given(st.text(st.characters(exclude_categories=()), max_size=6) | st.text('aA1-?:;#t. \r\n"()\\', max_size=4))
def test_every_name_is_refused_or_read_back(name: str) -> None:
    agrees(name)


@pytest.mark.parametrize("name", ODD, ids=ascii)
def test_odd_names_are_refused_or_read_back(name: str) -> None:
    agrees(name)


SURROGATES: tuple[Literal["Cs"]] = ("Cs",)


@given(
    st.text(st.characters(exclude_categories=SURROGATES), min_size=1, max_size=8)
    | st.text('a\r\n\\"n', min_size=1, max_size=6)
)
def test_every_text_is_read_back(text: str) -> None:
    kb = KnowledgeBase(SCHEMA)
    said = Delta(nodes={"red": "cup"}, added=(fact("said", "red", text),), values={fact("label", "red"): text})
    kb.apply(said, author="test")
    written = kb.to_pddl("d", "p").replace("\r\n", "\n").replace("\r", "\n")  # as files are opened
    assert read_problem(written, SCHEMA).delta() == said


@pytest.mark.parametrize("part", ["added", "values"])
def test_text_that_no_file_can_hold_is_refused(part: str) -> None:
    kb = KnowledgeBase(SCHEMA)
    half = (
        {"added": (fact("said", "red", "\udc80"),)}
        if part == "added"
        else {"values": {fact("label", "red"): "ü\ud800"}}
    )
    with pytest.raises(InputError, match=r"text that can be written to a file, not '(\\xfc)?\\ud"):
        kb.apply(Delta(nodes={"red": "cup"}, **half), author="test")
    assert kb.version == 0


@given(st.text())
def test_the_name_that_is_suggested_is_one(text: str) -> None:
    meant = nearest_name(text)
    assert meant is None or is_name(meant)


BAD = "Red Cup"
SAYS = r"'Red Cup' cannot be the name of a thing: a name has 1 to 255 printable characters .*; did you mean 'red-cup'\?"


def test_each_door_refuses_what_pddl_cannot_say(tmp_path) -> None:
    kb = KnowledgeBase(SCHEMA)
    with pytest.raises(InputError, match=SAYS), kb.transaction(author="test") as tx:
        tx.add_node(BAD, "cup")
    kb.apply(Delta(nodes={"red": "cup"}), author="test")
    form = json.loads(kb.to_json())
    form["nodes"] = {BAD: "cup"}
    (tmp_path / "w.json").write_text(json.dumps(form))
    with pytest.raises(InputError, match=SAYS):
        KnowledgeBase.from_json(tmp_path / "w.json")
    with KnowledgeBase.open(SCHEMA, tmp_path / "s.kb"):
        pass
    refused = CliRunner().invoke(app, ["tell", str(tmp_path / "s.kb"), f'(cup "{BAD}")']).exception
    assert isinstance(refused, InputError)
    assert "did you mean 'red-cup'?" in str(refused)
    assert kb.nodes() == {"red": "cup"}


def test_a_store_that_has_such_a_name_goes_on(tmp_path, monkeypatch) -> None:
    with monkeypatch.context() as older, KnowledgeBase.open(SCHEMA, tmp_path / "s.kb") as kb:
        older.setattr("knowledge_base.world.overlay.is_name", lambda _: True)
        kb.apply(Delta(nodes={BAD: "cup"}), author="old")
    with KnowledgeBase.open(None, tmp_path / "s.kb") as kb:
        kb.apply(Delta(nodes={BAD: "cup"}, added=(fact("clean", BAD),)), author="new")
        assert kb.ask(f'(clean "{BAD}")')
        with pytest.raises(InputError, match="'Red Cup' cannot be a name in PDDL"):
            kb.to_pddl("d")
        assert BAD in kb.to_json()
        with kb.transaction(author="new") as tx:
            tx.remove_node(BAD)
        assert kb.to_pddl("d")


@pytest.mark.parametrize("name", ["Is Clean", "and", "?p", "=", "a(b"])
def test_a_declared_name_that_pddl_cannot_say_is_not_written(name: str) -> None:
    clean = SCHEMA.predicates["clean"]
    kb = KnowledgeBase(Schema(types={"cup": None}, predicates={name: type(clean)(name, clean.parameters)}))
    kb.apply(Delta(nodes={"red": "cup"}, added=(fact(name, "red"),)), author="test")
    with pytest.raises(InputError, match="cannot be a name in PDDL"):
        kb.to_pddl("d")

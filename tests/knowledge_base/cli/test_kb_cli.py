"""`dsc kb` on problems, worlds in JSON and scenarios, and what importing it costs."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from knowledge_base.cli import app
from knowledge_base.cli.console import print_json, print_json_list, print_table
from knowledge_base.errors import InputError

DOMAIN = """(define (domain d) (:types cup place)
  (:predicates (on ?c - cup ?p - place)) (:functions (cost)))"""
PROBLEM = """(define (problem two-cups) (:domain d) (:objects a b - cup table - place)
  (:init (on a table) (on b table) (= (cost) 3)) (:goal (not (on a table))))"""


@pytest.fixture
def problem(tmp_path) -> str:
    (tmp_path / "domain.pddl").write_text(DOMAIN, encoding="utf-8")
    (tmp_path / "problem.pddl").write_text(PROBLEM, encoding="utf-8")
    return str(tmp_path / "problem.pddl")


def run(*args: str) -> str:
    result = CliRunner().invoke(app, list(args), catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.output


def test_answers_are_a_table(problem) -> None:
    lines = run("query", problem, "(on ?cup ?where)").splitlines()
    assert ["?cup" in lines[1], "a" in lines[3], "b" in lines[4]] == [True, True, True]


def test_a_closed_question_is_answered_yes_or_no(problem) -> None:
    assert run("query", problem, "(< (cost) 3)") == "no\n"
    assert run("query", problem, "(exists (?c - cup) (on ?c table))") == "yes\n"


def test_answers_as_json(problem) -> None:
    assert json.loads(run("query", "--json", problem, "(on ?c table)")) == {
        "variables": ["c"],
        "holds": True,
        "answers": [{"c": "a"}, {"c": "b"}],
    }


def test_show(problem, tmp_path) -> None:
    assert "(on a table)" in run("show", problem)
    (tmp_path / "other.pddl").write_text(DOMAIN, encoding="utf-8")
    shown = json.loads(run("show", problem, "--json", "--domain", str(tmp_path / "other.pddl")))
    assert shown == {
        "problem": "two-cups",
        "domain": "d",
        "objects": {"a": "cup", "b": "cup", "table": "place"},
        "facts": ["(on a table)", "(on b table)"],
        "values": {"(cost)": 3},
        "goal": "(not (on a table))",
    }


@pytest.mark.parametrize(
    ("file", "expression", "message"),
    [
        ("problem.pddl", "(onn ?x table)", "EXPR:1:1: there is no predicate 'onn'; did you mean 'on'"),
        ("problm.pddl", "(on ?x table)", "did you mean 'problem.pddl'"),
        ("domain.pddl", "(on ?x table)", "this defines a 'domain'"),
    ],
)
def test_mistakes_are_input_errors(problem, tmp_path, file: str, expression: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        run("query", str(tmp_path / file), expression)
    assert message in str(caught.value)


def test_without_a_domain_beside_it_the_option_is_named(tmp_path) -> None:
    (tmp_path / "problem.pddl").write_text(PROBLEM, encoding="utf-8")
    with pytest.raises(InputError, match="--domain"):
        run("show", str(tmp_path / "problem.pddl"))
    with pytest.raises(InputError, match=r"no file .*problm\.pddl'; did you mean 'problem\.pddl'"):
        run("show", str(tmp_path / "problm.pddl"))


def test_importing_the_package_and_the_command_loads_nothing_heavy() -> None:
    heavy = "{'networkx', 'pydantic', 'unified_planning', 'rich'} & set(sys.modules)"
    code = f"import sys, knowledge_base, knowledge_base.cli; print({heavy})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


def test_public_names_are_there_when_asked_for() -> None:
    import knowledge_base

    assert "KnowledgeBase" in dir(knowledge_base)
    assert {getattr(knowledge_base, name) is not None for name in knowledge_base.__all__} == {True}  # type: ignore[attr-defined]
    with pytest.raises(AttributeError, match="no attribute 'Knowledge'"):
        _ = knowledge_base.Knowledge  # type: ignore[attr-defined]


ENDLESS = "(and (cup ?a) (cup ?b) (cup ?c) (cup ?d) (cup ?e) (cup ?f) (cup ?g) (cup ?h) (cup ?i) (cup ?j) (cup ?k))"


def test_answers_are_limited(problem) -> None:
    said = json.loads(run("query", problem, ENDLESS, "--limit", "3", "--json"))
    assert len(said["answers"]) == 3
    assert run("query", problem, "(on ?cup ?where)", "--limit", "1").count("table") == 1


def test_a_question_is_given_up_after_some_seconds(problem) -> None:
    for command in ("query", "ask"):
        text = f"(exists (?x) {ENDLESS} )".replace("(?x)", "(?a ?b ?c ?d ?e ?f ?g ?h ?i ?j ?k ?l ?m ?n ?o)")
        text = text.replace("(cup ?k)", "(cup ?k) (not (= ?k ?k))")
        result = CliRunner().invoke(app, [command, problem, text, "--seconds", "0"])
        assert isinstance(result.exception, InputError)
        assert "the query takes longer than 0 s" in str(result.exception)


@pytest.mark.parametrize("items", [[], [1], [{"a": "x\ny", "b": [1, {"c": None}]}, [], "z"]])
def test_a_list_is_printed_item_by_item_as_if_at_once(items, capsys) -> None:
    for said in (None, {"n": 1, "names": ["a"]}):
        print_json_list(iter(items), said, "items")
        streamed = capsys.readouterr().out
        print_json(items if said is None else {**said, "items": items})
        assert streamed == capsys.readouterr().out


def test_a_long_table_is_printed_in_parts(monkeypatch, capsys) -> None:
    monkeypatch.setattr("knowledge_base.cli.console.MOST_ROWS", 2)
    print_table(["number"], ([number] for number in range(5)))
    assert capsys.readouterr().out.count("number") == 3
    print_table(["number"], [])
    assert capsys.readouterr().out.count("number") == 1

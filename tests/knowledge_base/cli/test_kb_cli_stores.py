"""`dsc kb` on a store's file: made, told, asked, looked back on, taken elsewhere."""

from __future__ import annotations

import json
import sqlite3
import threading
from datetime import datetime
from xml.etree import ElementTree as ET

import pytest
from typer.testing import CliRunner, Result

from knowledge_base import InputError, KnowledgeBase, StoreError
from knowledge_base.cli import app

DOMAIN = """(define (domain kitchen) (:types cup surface - object) (:constants table - surface)
  (:predicates (on ?c - cup ?s - surface) (clean ?c - cup)) (:functions (weight ?c - cup)))"""


@pytest.fixture
def store(tmp_path) -> str:
    (tmp_path / "domain.pddl").write_text(DOMAIN, encoding="utf-8")
    run("new", str(tmp_path / "my.kb"), "--domain", str(tmp_path / "domain.pddl"))
    run("tell", str(tmp_path / "my.kb"), "(cup mug)", "(on mug table)", "(= (weight mug) 0.25)", "--author", "eyes")
    return str(tmp_path / "my.kb")


def invoke(*args: str) -> Result:
    return CliRunner().invoke(app, list(args), catch_exceptions=False)


def run(*args: str) -> str:
    result = invoke(*args)
    assert result.exit_code == 0, result.output
    return result.output


def test_a_new_store_says_what_may_be_said_and_takes_no_files_place(tmp_path) -> None:
    (tmp_path / "domain.pddl").write_text(DOMAIN, encoding="utf-8")
    made = run("new", str(tmp_path / "a.kb"), "--domain", str(tmp_path / "domain.pddl"))
    assert "3 types, 2 predicates, 1 functions, 1 constants" in made
    with pytest.raises(StoreError, match="is there already"):
        run("new", str(tmp_path / "a.kb"), "--domain", str(tmp_path / "domain.pddl"))


def test_query_and_show_return_the_stored_facts_and_values(store) -> None:
    assert json.loads(run("query", store, "(on ?c ?where)", "--json"))["answers"] == [{"c": "mug", "where": "table"}]
    assert json.loads(run("query", store, "(on ?c ?where)", "--json", "-p", "where=table"))["answers"] == [{"c": "mug"}]
    assert json.loads(run("show", store, "--json")) == {
        "version": 1,
        "objects": {"table": "surface", "mug": "cup"},
        "facts": ["(on mug table)"],
        "values": {"(weight mug)": 0.25},
    }


def test_a_question_answers_with_its_exit_status_and_says_why(store) -> None:
    yes, no = invoke("ask", store, "(on mug ?t)", "-p", "t=table"), invoke("ask", store, "(clean mug)", "--why")
    assert (yes.exit_code, yes.output) == (0, "yes\n")
    assert (no.exit_code, no.output) == (1, "no\nfalse  (clean mug)\n")
    why = json.loads(invoke("ask", store, "(and (on mug table) (clean mug))", "--json").output)
    assert (why["holds"], why["why"]["decider"], [p["truth"] for p in why["why"]["children"]]) == (
        False,
        1,
        [True, False],
    )


def test_telling_prints_what_became_different(store) -> None:
    assert run("tell", store, "(clean mug)", "(on mug table)") == "+ (clean mug)\nversion 2\n"
    assert run("tell", store, "(clean mug)") == "nothing new\nversion 2\n"
    assert run("retract", store, "(clean mug)", "(cup mug)") == (
        "- mug and all about it\n- (on mug table)\n- (clean mug)\nversion 3\n"
    )


def test_a_mistake_in_one_fact_changes_nothing(store) -> None:
    with pytest.raises(InputError, match="FACT 2:1:5: there is no object 'mog'"):
        run("tell", store, "(clean mug)", "(on mog table)")
    assert json.loads(run("show", store, "--json"))["version"] == 1


def test_an_expected_version_and_a_key_guard_against_saying_it_twice(store) -> None:
    with pytest.raises(InputError, match="version 7 is expected, but the world is at version 1"):
        run("tell", store, "(clean mug)", "--expect", "7")
    first = json.loads(run("tell", store, "(= (weight mug) 1)", "--key", "w1", "--json"))
    again = json.loads(run("tell", store, "(= (weight mug) 1)", "--key", "w1", "--json"))
    assert (first.pop("again"), again.pop("again")) == (False, True)
    assert first == again
    assert first["values"] == {"(weight mug)": 1}


def test_the_history_says_who_changed_what(store) -> None:
    run("tell", store, "(clean mug)", "--author", "hands")
    changes = json.loads(run("history", store, "--json"))
    assert [(c["version"], c["author"], c["added"]) for c in changes] == [
        (1, "eyes", ["(on mug table)"]),
        (2, "hands", ["(clean mug)"]),
    ]
    assert [c["version"] for c in json.loads(run("history", store, "(clean ?c)", "--json"))] == [2]
    assert [c["version"] for c in json.loads(run("history", store, "--until", "1", "--json"))] == [1]
    shown = run("history", store)
    assert "+ (clean mug)" in shown
    assert "eyes" in shown


def test_the_history_of_a_compacted_store_begins_where_it_is_kept(store) -> None:
    run("tell", store, "(clean mug)")
    with KnowledgeBase.open(None, store) as kb:
        kb.compact(keep_since=1)
    assert [c["version"] for c in json.loads(run("history", store, "--json"))] == [2]


def test_the_past_is_shown_and_asked(store) -> None:
    run("retract", store, "(on mug table)")
    assert json.loads(run("at", store, "1", "(on ?c table)", "--json"))["holds"]
    assert json.loads(run("at", store, "2", "--json"))["facts"] == []
    time = json.loads(run("history", store, "--json"))[0]["time"]
    iso = datetime.fromtimestamp(time).isoformat()
    assert json.loads(run("at", store, iso, "--json"))["version"] in (0, 1)  # isoformat cuts at microseconds
    with pytest.raises(InputError, match="a moment is a version such as 12"):
        run("at", store, "yesterday")
    with pytest.raises(InputError, match="version 9 is in the future"):
        run("at", store, "9")


def test_everything_about_a_thing(store) -> None:
    assert json.loads(run("show", store, "mug", "--json"))["facts"] == ["(on mug table)"]
    with pytest.raises(InputError, match="there is no object 'mugg'; did you mean 'mug'"):
        run("show", store, "mugg")


def test_a_world_goes_out_and_comes_in_again(store, tmp_path) -> None:
    for name in ("world.json", "problem.pddl"):
        assert run("export", store, "--to", str(tmp_path / name)) == f"wrote {tmp_path / name}\n"
        other = str(tmp_path / f"{name}.kb")
        run("new", other, "--domain", str(tmp_path / "domain.pddl"))
        run("import", other, str(tmp_path / name))
        assert json.loads(run("show", other, "--json")) == json.loads(run("show", store, "--json"))
    assert KnowledgeBase.from_json(run("export", store)).ask("(on mug table)")


def test_an_import_that_does_not_fit_changes_nothing(store, tmp_path) -> None:
    other = tmp_path / "other.json"
    other.write_text(run("export", store).replace('"cup"', '"cap"'), encoding="utf-8")
    with pytest.raises(InputError):
        run("import", store, str(other))
    assert json.loads(run("show", store, "--json"))["version"] == 1


def test_a_drawing_is_svg(store, tmp_path) -> None:
    run("draw", store, "mug", "--to", str(tmp_path / "mug.svg"))
    svg = ET.parse(tmp_path / "mug.svg")  # noqa: S314  our own
    assert svg.getroot().tag == "{http://www.w3.org/2000/svg}svg"
    assert run("draw", store).startswith("<svg")


@pytest.mark.parametrize("command", [("tell", "(clean mug)"), ("history",), ("at", "1"), ("import", "x.json")])
def test_a_missing_store_is_reported_and_not_created(tmp_path, command: tuple[str, ...]) -> None:
    (tmp_path / "my.kb").write_bytes(b"")
    verb, *rest = command
    with pytest.raises(InputError):
        run(verb, str(tmp_path / "mine.kb"), *rest)
    assert [path.name for path in tmp_path.iterdir()] == ["my.kb"]


def test_a_scenario_is_what_the_robot_knows_at_its_start(tmp_path) -> None:
    import planning.cli.command  # noqa: F401  brings its kind of source along

    scenario = tmp_path / "two.yaml"
    scenario.write_text("table: {cups: 2}\nrobot_at: sink\n", encoding="utf-8")
    assert json.loads(run("query", str(scenario), "(robot-at ?p)", "--json"))["answers"] == [{"p": "sink"}]
    scenario.write_text("says: [follow me]\n", encoding="utf-8")
    assert json.loads(run("query", str(scenario), "(robot-at ?p)", "--json"))["answers"] == [{"p": "hall"}]
    scenario.write_text("table: {cups: many}\n", encoding="utf-8")
    with pytest.raises(
        InputError, match=r"ROBOT@two\.yaml \(butler: .*; clean-up-table: .*two\.yaml:1:9: a whole number"
    ):
        run("query", str(scenario), "(robot-at ?p)")


def test_parameters_are_written_with_an_equals_sign(store) -> None:
    with pytest.raises(InputError, match="a parameter is written x=VALUE, not 'where'"):
        run("query", store, "(on ?c ?where)", "-p", "where")


def test_watching_prints_what_others_commit(store) -> None:
    """Another process (here a thread of ours) writes; the command ends after two changes that it was asked for."""
    waiting = threading.Event()

    def write() -> None:
        with KnowledgeBase.open(None, store) as kb:
            waiting.wait(timeout=60)
            while not done.wait(timeout=0.05):  # until the command has seen two of them
                with kb.transaction("eyes") as world:
                    world.tell("clean", "mug")
                with kb.transaction("eyes") as world:
                    world.retract("clean", "mug")

    done, writer = threading.Event(), threading.Thread(target=write)
    writer.start()
    waiting.set()
    try:
        printed = run("watch", store, "(clean ?c)", "--count", "2", "--seconds", "120", "--json").splitlines()
    finally:
        done.set()
        writer.join()
    told = [json.loads(line) for line in printed]
    assert [change["author"] for change in told] == ["eyes", "eyes"]
    assert told[1]["version"] == told[0]["version"] + 1
    assert run("watch", store, "--seconds", "0") == ""


def test_content_is_told_and_shown_as_the_language_writes_it(tmp_path) -> None:
    (tmp_path / "domain.pddl").write_text(
        "(define (domain d) (:types cup) (:functions (label ?c - cup) - text (pose ?c - cup) - geometry))",
        encoding="utf-8",
    )
    store = str(tmp_path / "c.kb")
    run("new", store, "--domain", str(tmp_path / "domain.pddl"))
    told = run("tell", store, "(cup c)", '(= (label c) "Red one")', "(= (pose c) (geometry 0.5 1))")
    assert told == '+ (cup c)\n= (label c) "Red one"\n= (pose c) (geometry 0.5 1)\nversion 1\n'
    assert json.loads(run("show", store, "--json"))["values"] == {"(label c)": "Red one", "(pose c)": [0.5, 1.0]}
    assert '"Red one"' in run("show", store)


def test_nothing_is_written_in_the_place_of_a_store(store, tmp_path) -> None:
    for command in (("export", store), ("draw", store)):
        with pytest.raises(InputError, match=f"--to: cannot write '{store}': the command needs"):
            run(*command, "--to", store)
    assert json.loads(run("show", store, "--json"))["version"] == 1


@pytest.mark.parametrize("command", [("history",), ("at", "0"), ("watch", "--seconds", "0")])
def test_only_a_store_has_a_past(tmp_path, command: tuple[str, ...]) -> None:
    (tmp_path / "domain.pddl").write_text(DOMAIN, encoding="utf-8")
    (tmp_path / "problem.pddl").write_text("(define (problem p) (:domain kitchen))", encoding="utf-8")
    verb, *rest = command
    with pytest.raises(StoreError):
        run(verb, str(tmp_path / "problem.pddl"), *rest)


def test_a_version_of_many_digits_is_no_moment(store) -> None:
    with pytest.raises(InputError, match="a moment is a version such as 12"):
        run("at", store, "9" * 5000)


def test_a_key_that_was_used_says_so(store) -> None:
    run("tell", store, "(cup red)", "--key", "k")
    assert (
        run("tell", store, "(cup blue)", "--key", "k") == "the key 'k' was used already, for version 2: nothing new\n"
    )


def test_the_option_explain_shows_the_lookup_steps_of_a_query(store) -> None:
    assert "(on ?c table)" in run("query", store, "(on ?c table)", "--explain")
    assert json.loads(run("query", store, "(on ?c table)", "--explain", "--json"))["steps"]


def test_names_of_older_stores_are_printed_so_that_they_do_nothing_to_a_terminal(store, monkeypatch) -> None:
    monkeypatch.setattr("knowledge_base.world.overlay.is_name", lambda _: True)
    run("tell", store, '(cup "Red one")', '(on "Red one" table)', '(cup "\x1b[31m")')
    (said,) = [fact for fact in json.loads(run("show", store, "--json"))["facts"] if "Red" in fact]
    assert run("retract", store, said).startswith('- (on "Red one" table)')
    assert "\x1b" not in run("show", store) + run("history", store)


def test_a_store_without_its_first_world_is_damaged(store) -> None:
    with sqlite3.connect(store) as connection:
        connection.execute("DELETE FROM snapshots")
    connection.close()
    with pytest.raises(StoreError, match="the store is damaged"):
        run("show", store)


def test_a_store_is_made_with_functional_predicates(tmp_path) -> None:
    (tmp_path / "domain.pddl").write_text(DOMAIN, encoding="utf-8")
    path = str(tmp_path / "f.kb")
    run("new", path, "--domain", str(tmp_path / "domain.pddl"), "--functional", "on")
    run("tell", path, "(cup mug)", "(surface shelf)", "(on mug table)")
    with pytest.raises(InputError, match="'on' is functional"):
        run("tell", path, "(on mug shelf)")
    with pytest.raises(InputError, match="'onn'"):
        run("new", str(tmp_path / "g.kb"), "--domain", str(tmp_path / "domain.pddl"), "--functional", "onn")
    assert not (tmp_path / "g.kb").exists()


def test_the_past_of_a_store_is_forgotten_when_that_is_wanted(store) -> None:
    for weight in range(1, 200):
        run_quietly(store, weight)
    said = json.loads(run("compact", store, "--keep", "150", "--json"))
    assert (said["oldest"], said["version"]) == (150, 200)
    assert next(change["version"] for change in json.loads(run("history", store, "--json"))) == 151
    with pytest.raises(InputError, match="version 149"):
        run("at", store, "149", "(clean mug)")
    assert run("compact", store).startswith("versions 200 to 200 are kept: ")
    assert json.loads(run("history", store, "--json")) == []
    assert json.loads(run("ask", store, "(= (weight mug) 199)", "--json"))["holds"]


def run_quietly(store: str, weight: int) -> None:
    with KnowledgeBase.open(None, store) as kb, kb.transaction("scales") as tx:
        tx.set("weight", "mug", weight)

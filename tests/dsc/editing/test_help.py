"""The answers to questions about positions, without a server."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dsc.editing.completion import complete
from dsc.editing.cursor import cursor_at
from dsc.editing.navigation import definitions, hover, references, symbols
from dsc.editing.project_facts import ComponentFacts, ProjectFacts
from dsc.editing.renaming import rename_at
from dsc.editing.surgery.text_edits import patch
from dsc.editing.view import View
from dsc.editing.workspace import Workspace, text_of
from dsc.skills import SkillSignature
from dsc.text.plot_files import parse_plot
from knowledge_base.errors import InputError

ROOT = Path("/project")
FACTS = ProjectFacts(
    skills=(SkillSignature("arm", "grasp", {"item": "item"}, {}, {"grasped": {}, "slipped": {}}),),
    about={"arm.grasp": "Close the hand around an item."},
    components={"arm": ComponentFacts({"speed": "number, from 0"})},
    scenario={"properties": {"says": {"type": "array"}, "slow": {"type": "boolean"}}, "type": "object"},
)
DOMAIN = """; 🚪 a domain
(define (domain d)
  (:types item room)
  (:predicates (in ?i - item ?r - room) (held ?i - item))
  (:action take :parameters (?item - item ?room - room)
    :precondition (in ?item ?room) :effect (held ?item)))
"""
TAKE = """plot: take
about: 🚪 takes an item
implements: take
parameters: {item: item, room: room}
emits: {lost: {}}
when: (in ?item ?room)
states:
  go:
    entry: {trigger: arm.grasp, with: {item: ?item}}
    on: {grasped: over, slipped: {to: gone, emit: lost}}
  over: {final: true}
  gone: {final: true}
"""
MAIN = """plot: main
states:
  work:
    initial: first
    states:
      first: {use: take, with: {item: cup}, on: {done: second, lost: second}}
      second: {final: true}
    on: {done: over}
  over: {final: true}
"""
FILES = {ROOT / "d.pddl": DOMAIN, ROOT / "plots/take.yaml": TAKE, ROOT / "plots/main.yaml": MAIN}


def view(file: str, text: str | None = None, before: str | None = None) -> View:
    """The view of a file; `before` is an earlier text of it."""
    space = Workspace()
    texts = {one: own if text is None or one != ROOT / file else text for one, own in FILES.items()}
    if text is not None:
        texts[ROOT / file] = text
    if before is not None:
        space.page(ROOT / file, before)
    pages = space.pages(ROOT, texts)
    return View(next(one for one in pages if one.file == ROOT / file), tuple(pages), FACTS, ROOT)


def labels(file: str, marked: str, before: str | None = None) -> set[str]:
    """The proposals at the mark `|` of a text."""
    return {one.label for one in complete(view(file, marked.replace("|", "", 1), before), marked.index("|"))}


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("grasped: over", "grasped: |", {"over", "gone", "go"}),
        ("{to: gone,", "{to: go|", {"over", "gone"}),
        ("trigger: arm.grasp", "trigger: ar|", {"arm.grasp"}),
        ("{grasped: over", "{|", {"grasped", "slipped", "done", "timed_out"}),
        ("{item: ?item}}", "{item: ?|", {"?item", "?room"}),
        ("when: (in ?item ?room)", "when: (|", {"in", "held", "item"}),
        ("  over: {final: true}", "  over: {|", {"final", "on", "entry"}),
        ("emits: {lost", "em|\nemits: {lost", {"emits", "when", "states"}),
        ("implements: take", "implements: |", {"take"}),
        ("parameters: {item: item", "parameters: {item: |", {"item", "room"}),
        ("final: true", "final: |", {"true", "false"}),
    ],
)  # fmt: skip
def test_a_half_written_plot_is_completed_from_its_last_good_text(old, new, expected):
    assert old in TAKE
    assert expected <= labels("plots/take.yaml", TAKE.replace(old, new, 1), TAKE)


def test_a_used_plot_gives_its_parameters_and_outcomes():
    file = "plots/main.yaml"
    assert labels(file, MAIN.replace("{item: cup}", "{|}")) == {"item", "room"}
    assert {"lost", "done"} <= labels(file, MAIN.replace("lost: second", "|"), MAIN)
    assert {"take", "main"} <= labels(file, MAIN.replace("use: take", "use: |"), MAIN)


def test_pddl_is_completed_by_place():
    assert labels("d.pddl", DOMAIN.replace("(held ?item)", "(|")) >= {"in", "held", "and", "not"}
    assert labels("d.pddl", DOMAIN.replace("(held ?item)", "(held ?|")) == {"?item", "?room"}
    assert labels("d.pddl", DOMAIN.replace("?r - room", "?r - |")) == {"item", "room", "object"}


def test_profiles_and_scenarios_are_completed():
    profile = "profile: fast\ncomponents:\n  arm: {|}\nplots:\n  take: {}\n"
    assert labels("profiles/fast.yaml", profile) == {"speed"}
    assert labels("profiles/fast.yaml", profile.replace("|", "").replace("take: {}", "take: {|}")) == {"item", "room"}
    devices = profile.replace("|", "").replace("plots:", "devices:")
    assert labels("profiles/fast.yaml", devices.replace("take: {}", "take: {|}")) == {"item", "room"}
    assert labels("profiles/fast.yaml", devices.replace("take: {}", "|")) == {"take", "main"}
    assert {"components", "devices", "plots", "wiring"} <= labels("profiles/fast.yaml", "profile: fast\n|")
    assert labels("scenarios/one.yaml", "s|") == {"says", "slow"}
    assert labels("scenarios/one.yaml", "slow: |") == {"true", "false"}


def parts(file: str, part: str, inside: int = 0) -> tuple[View, int]:
    found = view(file)
    return found, found.page.text.index(part) + inside


def test_hover_tells_skills_plots_relations_and_keys():
    assert "Close the hand" in hover(*parts("plots/take.yaml", "arm.grasp", 2))
    assert "`arm.grasp(item: item)`" in hover(*parts("plots/take.yaml", "arm.grasp", 2))
    assert "takes an item" in hover(*parts("plots/main.yaml", "use: take", 6))
    assert "(in ?i - item ?r - room)" in hover(*parts("plots/take.yaml", "(in", 1))
    assert "`emit`" in hover(*parts("plots/take.yaml", "emit:", 1))
    assert hover(*parts("plots/take.yaml", "true}", 1)) == ""


def found_texts(ranges) -> list[tuple[str, str]]:
    return [(one.file.name, FILES[one.file][one.begin : one.end]) for one in ranges]


def test_definitions_and_references_are_found_across_files():
    (place,) = definitions(*parts("plots/main.yaml", "use: take", 6))
    assert found_texts([place]) == [("take.yaml", "take")]
    (state,) = definitions(*parts("plots/take.yaml", "to: gone", 5))
    assert TAKE[state.begin :].startswith("gone: {final")
    found = references(*parts("plots/take.yaml", "(in", 1))
    assert found_texts(found) == [("d.pddl", "in"), ("d.pddl", "in"), ("take.yaml", "in")]


def changed(rename) -> dict[Path, str]:
    return {file: patch(text, rename.edits.get(file, ())) for file, text in FILES.items()}


def test_a_parameter_is_renamed_in_its_plot_its_action_and_its_callers():
    texts = changed(rename_at(*parts("plots/take.yaml", "?item", 2), "thing"))
    assert "parameters: {thing: item, room: room}" in texts[ROOT / "plots/take.yaml"]
    assert "when: (in ?thing ?room)" in texts[ROOT / "plots/take.yaml"]
    assert "with: {item: ?thing}" in texts[ROOT / "plots/take.yaml"]  # that is a parameter of the skill
    assert "with: {thing: cup}" in texts[ROOT / "plots/main.yaml"]
    assert "(?thing - item ?room - room)" in texts[ROOT / "d.pddl"]
    assert "(held ?thing)" in texts[ROOT / "d.pddl"]
    assert "(held ?i - item)" in texts[ROOT / "d.pddl"]


STATES = [
    (file, name)
    for file in ("plots/take.yaml", "plots/main.yaml")
    for name, _, _ in parse_plot(FILES[ROOT / file]).walk()
]


@given(st.sampled_from(STATES), st.from_regex(r"[a-z][a-z0-9_]{0,8}_x", fullmatch=True))
def test_a_renamed_state_makes_the_same_plot_with_another_name(pick, new):
    file, old = pick
    own = view(file)
    begin = next(one.begin for one in own.page.names if one.kind == "state" and one.name == old and one.defines)
    text = changed(rename_at(own, begin, new))[ROOT / file]
    back = view(file, text)
    begin = next(one.begin for one in back.page.names if one.name == new and one.defines)
    assert patch(text, rename_at(back, begin, old).edits[ROOT / file]) == FILES[ROOT / file]


@pytest.mark.parametrize(
    ("part", "new", "said"),
    [
        ("over: {", "gone", "already"),
        ("over: {", "9x", "is not a name"),
        ("arm.grasp", "arm.take", "Python code names it"),
        ("true}", "false", "no name at the cursor"),
    ],
)
def test_a_rename_that_would_break_something_is_refused(part, new, said):
    with pytest.raises(InputError, match=said):
        rename_at(*parts("plots/take.yaml", part), new)


def test_nothing_is_renamed_while_a_file_is_half_written():
    own = view("plots/main.yaml", MAIN + "  x: {", MAIN)
    other = View(next(one for one in own.pages if one.plot == "take"), own.pages, FACTS, ROOT)
    with pytest.raises(InputError, match=r"main\.yaml"):
        rename_at(other, TAKE.index("over: {"), "end")


def test_the_outline_of_a_plot_is_the_tree_of_its_states():
    def tree(found):
        return {one.name: tree(one.inside) for one in found}

    assert tree(symbols(view("plots/main.yaml").page)) == {"work": {"first": {}, "second": {}}, "over": {}}
    assert [one.name for one in symbols(view("d.pddl").page)] == ["item", "room", "in", "held", "take"]


@given(st.text(alphabet="ab: {}[]-'\"\n?(,#", max_size=60), st.data())
def test_a_cursor_has_surroundings_in_any_text(text, data):
    offset = data.draw(st.integers(0, len(text)))
    found = cursor_at(text, offset)
    assert text[:offset].endswith(found.prefix)


@pytest.mark.parametrize("at", range(0, len(TAKE), 7))
def test_a_text_that_ends_anywhere_is_completed_without_an_error(at):
    complete(view("plots/take.yaml", TAKE[:at], TAKE), at)


def test_an_emptied_text_replaces_the_text_on_disk(tmp_path):
    file = tmp_path / "a.yaml"
    file.write_text("plot: a", "utf-8")
    assert text_of(file, {file: ""}) == ""
    assert text_of(file, {}) == "plot: a"

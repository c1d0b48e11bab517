"""The check of prose finds each broken rule where it stands; rooms on the list of pending ones still need it."""

from __future__ import annotations

from pathlib import Path

import prose
import pytest
from prose import MOST_WORDS, PENDING, WORDS, broken_rules, of_python, sentences

LONG = "word " * (MOST_WORDS + 1)


def rules(text: str) -> list[str]:
    return [rule for rule, _ in broken_rules(text)]


def on_page(text: str) -> list[str]:
    return [rule for _, sentence in sentences(text) for rule in rules(sentence)]


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A checkout with one page, one module and a key of one row."""
    for folder in ("docs", "dsc/model"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "docs" / "sources.md").write_text(f"| row |\n| --- |\n| S0.{1} | a chart |\n")
    (tmp_path / "README.md").write_text("# A title\n\nThe store starts anew.\n")
    (tmp_path / "dsc" / "model" / "plot.py").write_text(f'"""A plot (S0.{1}).\n\nNobody\nwaits (S0.{99}).\n"""\n')
    monkeypatch.setattr(prose, "ROOT", tmp_path)
    monkeypatch.setattr(prose, "KEY", tmp_path / "docs" / "sources.md")
    monkeypatch.setattr(prose, "PENDING", {"dsc/model"})
    return tmp_path


# -- the rules -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("text", [
    "What is needed and has crashed is started.",
    "Whoever asks gets an answer.",
    "and how a plan ends",
    "(Whose turn it is, a lock decides.)",
    "Where it stops is unknown.",
    "The component stops; what is missing is named.",
])  # fmt: skip
def test_a_sentence_begins_with_no_subject_clause(text: str) -> None:
    assert "subject" in rules(text)


@pytest.mark.parametrize("text", [
    "What does an event cost?",
    "Where no candidate fits, the planner runs.",
    "However long a search takes, it ends.",
    "The page shows what a plan costs.",
])  # fmt: skip
def test_questions_and_other_clauses_are_no_subject_clauses(text: str) -> None:
    assert "subject" not in rules(text)


@pytest.mark.parametrize(("text", "found"), [
    ("It starts ANEW.", "ANEW"),
    ("the run was broken\noff", "broken off"),
    ("a number that is no index", "is no"),
    ("Facts that nobody told", "nobody"),
])  # fmt: skip
def test_a_private_word_is_found_with_the_word_to_use(text: str, found: str) -> None:
    ((_, sentence),) = sentences(text)
    assert [how.partition(" (use ")[0] for rule, how in broken_rules(sentence) if rule == "word"] == [f"'{found}'"]


@pytest.mark.parametrize("text", ["there is no plan", "it is no longer active", "a time stands still", "renewed"])
def test_words_that_only_look_private_are_left_alone(text: str) -> None:
    assert rules(text) == []


@pytest.mark.parametrize("instead", WORDS.values())
def test_the_words_to_use_pass_the_check(instead: str) -> None:
    assert rules(instead) == []


def test_a_sentence_has_a_bound_of_words() -> None:
    assert rules("word " * MOST_WORDS) == []
    assert rules(LONG) == ["length"]
    assert [rule for rule, _ in broken_rules(f"claim: {LONG}", source=True)] == []
    assert [rule for rule, _ in broken_rules(LONG, source=True)] == ["length"]
    assert [rule for rule, _ in broken_rules(f"claim: {LONG} {'word ' * 9}", source=True)] == ["length"]


@pytest.mark.parametrize("text", [
    f"Run `{LONG}` first.",
    f"Read [{LONG}](docs/x.md) first.",
    f"| {LONG} |",
    f"Before:\n\n```console\n{LONG}\n```\n\nafter.",
    f"- {LONG[:60]}\n- {LONG[:60]}\n- {LONG[:60]}",
    f"# {LONG[:60]}\n{LONG[:60]}\n\n{LONG[:60]}",
    f"{LONG[:60]}. {LONG[:60]}! (E.g. {LONG[:40]}.)",
    "Make the plot.\n\nArgs:\n    one: " + LONG[:60] + "\n    two, three: " + LONG[:60] + "\n\nReturns:\n    " + LONG[:60],
])  # fmt: skip
def test_code_links_tables_and_other_items_do_not_count(text: str) -> None:
    assert on_page(text) == []


def test_an_item_that_goes_over_lines_is_one_sentence() -> None:
    assert on_page(f"- {LONG[:90]}\n  {LONG[:90]}\n") == ["length"]
    assert on_page(f"Make it.\n\nArgs:\n    one: {LONG[:90]}\n        {LONG[:90]}\n") == ["length"]


def test_a_short_form_does_not_end_a_sentence() -> None:
    assert [text for _, text in sentences("Use a planner, e.g. pyperplan. Then run.")] == [
        "Use a planner, e.g. pyperplan.", "Then run."]  # fmt: skip


# -- where prose is --------------------------------------------------------------------------------------

MODULE = '''"""A module.

Its second
paragraph."""

LIMIT = 3  # noqa: X100  a reason
"""An attribute."""
# First line of a comment,
# and its second line.


def f(name, other):  # fmt: skip
    """Do it: `code`."""
    text = f"no {name}"
    shown = "not a message"
    if other:
        raise KeyError(text, shown.upper())
    raise ValueError(f"a {name} b" + "and more")
'''


def test_docstrings_comments_and_messages_of_python_are_read() -> None:
    assert sorted(of_python(MODULE)) == [
        (1, "A module."), (3, "Its second paragraph."),
        (6, "a reason"), (7, "An attribute."), (8, "First line of a comment, and its second line."),
        (13, "Do it: …."), (14, "no …"), (15, "not a message"), (18, "a … b"), (18, "and more"),
    ]  # fmt: skip


def test_a_sentence_is_found_at_its_line_behind_tables_and_code() -> None:
    page = "# Title\n\n| a |\n| b |\n\n```\ncode\n```\n\nOne `code\nspan`. Two\nthree.\n\n- four\n"
    assert [*sentences(page)] == [(1, "Title"), (10, "One … ."), (11, "Two three."), (14, "four")]


# -- the command -----------------------------------------------------------------------------------------


def test_a_pending_room_is_not_checked_but_its_citations_are(
    checkout: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert prose.main([]) == 1
    assert capsys.readouterr().out.splitlines() == [
        "README.md:3: word: 'anew' (use again): The store starts anew.",
        f"dsc/model/plot.py:4: row: no line in docs/sources.md: S0.{99}",
    ]


def test_a_path_is_checked_pending_or_not(checkout: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert prose.main([str(checkout / "dsc")]) == 1
    assert capsys.readouterr().out.splitlines() == [
        f"dsc/model/plot.py:3: word: 'Nobody' (use the role: caller, component, reader): Nobody waits (S0.{99}).",
        f"dsc/model/plot.py:4: row: no line in docs/sources.md: S0.{99}",
    ]
    assert prose.main([str(checkout / "docs")]) == 0
    assert capsys.readouterr().out == ""


def test_the_list_counts_findings_by_room(checkout: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert prose.main(["--list"]) == 0
    assert [line.split() for line in capsys.readouterr().out.splitlines()] == [
        ["room", "length", "subject", "word", "row"],
        ["README.md", "0", "0", "1", "0"],
        ["dsc/model", "0", "0", "1", "1", "pending"],
        ["all", "0", "0", "2", "1"],
    ]


def test_a_path_without_prose_is_refused(checkout: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as refused:
        prose.main([str(checkout / "missing")])
    assert refused.value.code == 2
    assert "hold no prose" in capsys.readouterr().err


# -- the project -----------------------------------------------------------------------------------------


def test_the_project_passes(capsys: pytest.CaptureFixture[str]) -> None:
    assert prose.main([]) == 0, capsys.readouterr().out


def test_the_check_keeps_its_own_rules() -> None:
    assert prose.findings(Path(prose.__file__)) == []


@pytest.mark.parametrize("name", sorted(PENDING))
def test_a_pending_room_exists_and_still_breaks_a_rule(name: str) -> None:
    """Take a room off the list as soon as it passes."""
    inside = [path for path in prose.prose() if prose.room(path) == name]
    assert any(prose.findings(path) for path in inside), f"remove {name!r} from PENDING"

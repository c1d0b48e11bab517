"""Comments that ignore findings, the selection of codes, and findings as SARIF."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from dsc.cli.findings import lines as listed
from dsc.cli.plots import app
from dsc.codes import CODES
from dsc.errors import Finding
from knowledge_base.errors import InputError, Place, UnknownNameError

PLOT = """plot: p
states:
  a: {on: {done: ovre}}%s
  b: {on: {done: over}}
  over: {final: true}
"""


def check(folder: Path, text: str, *options: str) -> Result:
    file = folder / "p.yaml"
    file.write_text(text)
    return CliRunner().invoke(app, ["check", str(file), *options])


def lines(folder: Path, text: str, *options: str) -> list[str]:
    return check(folder, text, *options).output.replace(f"{folder / 'p.yaml'}:", "").splitlines()


def test_a_line_ends_with_its_code(tmp_path):
    (line,) = lines(tmp_path, PLOT % "")
    assert line == "3:12: there is no state 'ovre'; did you mean 'over'? [target]"


@pytest.mark.parametrize(
    "before", ["  # dsc: ignore[target] it comes with the next version", "# dsc:ignore[ reachable ,target ] later"]
)
def test_a_comment_on_the_line_ignores_its_codes(tmp_path, before):
    found = lines(tmp_path, PLOT % before)
    assert not [line for line in found if "[target]" in line]


def test_a_comment_on_a_line_of_its_own_is_about_the_next_line(tmp_path):
    text = PLOT.replace("  a:", "  # dsc: ignore[target] later\n  a:") % ""
    assert not [line for line in lines(tmp_path, text) if "[target]" in line]
    text = PLOT.replace("  b:", "  # dsc: ignore[target] later\n  b:") % ""
    assert [line for line in lines(tmp_path, text) if "[target]" in line]


@pytest.mark.parametrize(
    ("comment", "said"),
    [
        ("# dsc: ignore[target]", "the comment has no reason"),
        ("# dsc: ignore[] because", "the comment has no code"),
        ("# dsc: ignore[traget] because", "there is no code 'traget'; did you mean 'target'?"),
        ("# dsc: ignore[goal] because", "the comment ignores no finding (remove it) [ignore, warning]"),
    ],
)
def test_a_wrong_comment_ignores_nothing_and_is_a_finding(tmp_path, comment, said):
    found = lines(tmp_path, PLOT % f"  {comment}")
    assert any(said in line for line in found)
    assert any(line.endswith("[target]") for line in found)


def test_only_selected_codes_are_printed(tmp_path):
    text = PLOT.replace("over: {final: true}", "over: {final: true}\n  left: {final: true}") % ""
    assert [line.rpartition(" ")[2] for line in lines(tmp_path, text, "--select", "target")] == ["[target]"]
    assert check(tmp_path, text, "--select", "goal").exit_code == 0
    error = check(tmp_path, text, "--select", "taget").exception
    assert isinstance(error, UnknownNameError)
    assert "--select: there is no code 'taget'; did you mean 'target'?" in str(error)


def test_findings_as_sarif(tmp_path):
    (run,) = json.loads(check(tmp_path, PLOT % "", "--sarif").output)["runs"]
    assert run["tool"]["driver"]["rules"] == [{"id": "target", "shortDescription": {"text": CODES["target"]}}]
    assert run["results"] == [
        {
            "ruleId": "target",
            "level": "error",
            "message": {"text": "there is no state 'ovre'; did you mean 'over'?"},
            "locations": [
                {
                    "physicalLocation": {
                        "artifactLocation": {"uri": (tmp_path / "p.yaml").as_posix()},
                        "region": {"startLine": 3, "startColumn": 12},
                    }
                }
            ],
        }
    ]


def test_a_warning_at_several_places_is_one_line_with_their_number():
    def warning(line, text="no engine can plan with numbers"):
        return ("p.yaml", Finding(InputError(text, place=Place("p.yaml", line, 1)), "engine", level="warning"))

    found = [warning(3), warning(5), warning(7, "another"), warning(9)]
    assert listed(found) == [
        "p.yaml:3:1: no engine can plan with numbers [engine, warning] (3 times)",
        "p.yaml:7:1: another [engine, warning]",
    ]

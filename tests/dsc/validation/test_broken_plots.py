"""Files with one fault each, given to the command: one clear line with file and line, never a traceback.

What is wrong with a file of `broken/` stands in its first line, as `LINE: part of the message`; for files that can have
no such line it stands in `BYTES`. Files that are too large or too deep to be kept are made here.
"""

from __future__ import annotations

import builtins
import re
import subprocess
import sys
from pathlib import Path

import pytest
from dsc_bombs import BOMBS, FINAL, HEAD

from dsc.text.yaml import MAX_BYTES
from dsc.validation.library import MAX_FINDINGS
from planning.cli.command import main

BROKEN = Path(__file__).parents[2] / "support" / "broken"
HELPERS = {"grasp.yaml", "wait.yaml"}
"""Plots that broken ones use."""
BYTES = {
    "empty.yaml": (1, "found nothing"),
    "empty.scxml": (1, "no element found"),
    "only_blanks.yaml": (1, "found nothing"),
    "byte_order_mark_alone.yaml": (1, "found nothing"),
    "byte_order_mark_inside.yaml": (2, "did you mean 'states'?"),
    "latin_1.yaml": (2, "the file is not UTF-8: it cannot have the byte 0xfc here"),
    "latin_1.scxml": (2, "the file is not UTF-8: it cannot have the byte 0xfc here"),
    "utf_16.yaml": (1, "the file is not UTF-8"),
    "utf_16.scxml": (1, "the file is not UTF-8"),
    "nul.yaml": (2, "the character U+0000 is not allowed in a text"),
    "nul.scxml": (2, "not well-formed"),
    "control_character.yaml": (2, "the character U+001B is not allowed in a text"),
    "picture.yaml": (1, "the file is not UTF-8"),
    "yaml_1_1.yaml": (2, "only YAML 1.2"),
    "version_too_long.yaml": (1, "the version is too long"),
    "tag_directive.yaml": (2, "only YAML 1.2 without tags"),
    "crlf_and_a_fault.yaml": (3, "did you mean 'final'?"),
}
EXPECTED = re.compile(r"(?:# |<!-- )(\d+): (.+?)(?: -->)?")
EXCEPTIONS = re.compile(
    r"\b(Traceback|"
    + "|".join(n for n, c in vars(builtins).items() if isinstance(c, type) and issubclass(c, BaseException))
    + r")\b"
)
LONGEST = 700
"""Characters of a line of output besides the name of the file."""


@pytest.fixture
def dsc(monkeypatch, capsys):
    def call(*words):
        monkeypatch.setattr(sys, "argv", ["dsc", *map(str, words)])
        with pytest.raises(SystemExit) as stopped:
            main()
        shown = capsys.readouterr()
        return stopped.value.code or 0, shown.out + shown.err

    return call


@pytest.fixture
def complaints(dsc):
    """What the command says about a broken file, a line each."""

    def call(file):
        status, output = dsc("plot", "import" if file.suffix == ".scxml" else "check", file)
        lines = [line.removeprefix("dsc: ") for line in output.splitlines()]
        assert status == 2
        assert 0 < len(lines) <= MAX_FINDINGS
        assert not EXCEPTIONS.search(output.replace(str(file), ""))
        assert all(line.startswith(f"{file}:") and len(line) < LONGEST + len(str(file)) for line in lines)
        return lines

    return call


def kept():
    return [
        file for file in sorted(BROKEN.rglob("*")) if file.suffix in {".yaml", ".scxml"} and file.name not in HELPERS
    ]


def expected(file):
    if file.name in BYTES:
        return BYTES[file.name]
    found = EXPECTED.fullmatch(file.read_text().splitlines()[0])
    assert found is not None
    return int(found[1]), found[2]


@pytest.mark.parametrize("file", kept(), ids=lambda file: str(file.relative_to(BROKEN)))
def test_a_broken_file_gets_a_clear_line_with_its_place(complaints, file):
    line, message = expected(file)
    assert len(message) > 3
    first = complaints(file)[0]
    assert first.startswith(f"{file}:{line}:")
    assert message in first


def test_there_are_many():
    assert len(kept()) > 250
    assert set(BYTES) == {file.name for file in (BROKEN / "bytes").iterdir()}


@pytest.mark.parametrize("name", sorted(HELPERS))
def test_the_plots_that_broken_ones_use_are_right(dsc, name):
    assert dsc("plot", "check", BROKEN / "library" / name)[0] == 0


def test_charts_are_checked_as_well_as_imported(dsc):
    for file in sorted((BROKEN / "scxml").glob("*.scxml")):
        line, message = expected(file)
        status, output = dsc("plot", "check", file)
        assert status == 2
        assert f"{file}:{line}:" in output
        assert message in output


def test_no_file_is_read_that_a_document_names(complaints):
    for name in ("external_entity", "parameter_entity"):
        assert "this must not be read" not in "".join(complaints(BROKEN / "scxml" / f"{name}.scxml"))


def test_all_files_at_once_are_all_complained_about(dsc):
    files = [file for file in kept() if file.suffix == ".yaml"]
    status, output = dsc("plot", "check", *files)
    assert status == 2
    assert all(str(file) in output for file in files)


@pytest.mark.parametrize(
    "name", ["yaml/target_unknown.yaml", "bytes/latin_1.yaml", "bytes/empty.yaml", "scxml/doctype.scxml"]
)
def test_the_installed_command_says_the_same(complaints, name):
    file = BROKEN / name
    words = ["plot", "import" if file.suffix == ".scxml" else "check", str(file)]
    command: list[str | Path] = [Path(sys.executable).with_name("dsc"), *words]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 2
    assert (result.stdout + result.stderr).removeprefix("dsc: ").splitlines() == complaints(file)


# -- too many, too deep, too long ----------------------------------------------------------------------------


@pytest.mark.parametrize("name", BOMBS)
def test_bombs_are_refused_where_they_go_too_far(complaints, tmp_path, name):
    text, line, message = BOMBS[name]
    assert len(text) <= MAX_BYTES, "the limit for bytes has a test of its own"
    file = tmp_path / name
    file.write_text(text)
    first = complaints(file)[0]
    assert message in first
    assert first.startswith(f"{file}:{line}:")


@pytest.mark.parametrize(
    ("name", "size"),
    [
        ("scalar.yaml", 100_000_000),
        ("line.yaml", 10_000_000),
        ("chart.scxml", 10_000_000),
        ("bit_more.yaml", MAX_BYTES + 1),
    ],
)
def test_huge_files_are_refused_by_their_size(complaints, tmp_path, name, size):
    file = tmp_path / name
    with file.open("wb") as stream:
        stream.write(b"plot: a")
        stream.truncate(size)  # sparse: nothing is written, and nothing may be read
    (line,) = complaints(file)
    code = "" if name.endswith(".scxml") else " [readable]"  # another command reads SCXML
    assert line == f"{file}: the text has {size} bytes; at most {MAX_BYTES} are read{code}"


def test_many_states_are_refused_by_their_size(complaints, tmp_path):
    file = tmp_path / "states.yaml"
    file.write_text(HEAD + "".join(f"  s{n}: {{}}\n" for n in range(200_000)))
    (line,) = complaints(file)
    assert f"{file.stat().st_size} bytes; at most {MAX_BYTES}" in line


def test_a_file_that_never_ends_is_left_at_the_limit(complaints):
    assert complaints(Path("/dev/zero")) == [
        f"/dev/zero: the text has {MAX_BYTES + 1} bytes; at most {MAX_BYTES} are read [readable]"
    ]


def test_a_path_that_is_not_a_readable_file_is_reported(dsc, tmp_path):
    assert dsc("plot", "check", tmp_path) == (2, f"{tmp_path}: cannot read the file: Is a directory [readable]\n")
    assert dsc("plot", "check", tmp_path / "no.yaml")[0] == 2
    assert dsc("plot", "check", tmp_path / ("a" * 300)) == (
        2,
        f"{tmp_path / ('a' * 300)}: cannot read the file: File name too long [readable]\n",
    )


def test_neighbours_that_are_too_large_do_not_matter(dsc, tmp_path):
    (tmp_path / "p.yaml").write_text("plot: p\nstates:\n  a: {use: q, on: {done: over}}\n" + FINAL)
    (tmp_path / "q.yaml").write_text("plot: q\nstates:\n  a: {after: {seconds: 1, to: over}}\n" + FINAL)
    with (tmp_path / "huge.yaml").open("wb") as stream:
        stream.truncate(100_000_000)
    assert dsc("plot", "check", tmp_path / "p.yaml")[0] == 0


def test_a_plot_of_a_thousand_states_is_not_too_large(dsc, tmp_path):
    states = (
        f"  s{n}: {{entry: {{trigger: arm.move, with: {{to: table}}}}, on: {{moved: s{(n + 1) % 1000}, failed: over}}}}\n"
        for n in range(1000)
    )
    (tmp_path / "p.yaml").write_text(HEAD + "".join(states) + FINAL)
    assert dsc("plot", "check", tmp_path / "p.yaml")[0] == 0

"""Every example runs and prints what its last lines say; a new example is covered the day it appears."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
import tutorial
from typer.testing import CliRunner

from planning.cli.command import app

FOLDER = Path(__file__).parent.parent / "examples"
MARK = "# Expected output:\n"
PARTS = {FOLDER / "service.py", *FOLDER.glob("strangers/*_maker.py")}  # the service has a test of its own
EXAMPLES = sorted({*FOLDER.rglob("*.py")} - PARTS)


def expected(source: str) -> str:
    block = source.split(MARK, 1)[1]
    return "".join(line.removeprefix("#").removeprefix(" ") for line in block.splitlines(keepends=True))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_prints_its_expected_output(example):
    done = subprocess.run([sys.executable, str(example)], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert [line.rstrip() for line in done.stdout.splitlines()] == [
        line.rstrip() for line in expected(example.read_text()).splitlines()
    ]


def test_the_bundles_of_strangers_know_no_other_bundle():
    for maker in FOLDER.glob("strangers/*_maker.py"):
        assert not re.search("(laser|map|power)_maker", maker.read_text()), maker


def test_the_run_of_the_strangers_prints_its_outputs():
    folder = FOLDER / "strangers"
    words = ["run", str(folder / "robot.py"), "--profile", str(folder / "backwards.yaml"), "--quiet"]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    assert "outputs: metres 2.0, hours 1.5" in result.output


def test_the_deployment_of_the_strangers_has_no_mistake():
    result = CliRunner().invoke(app, ["deployment", "check", str(FOLDER / "strangers" / "lab.yaml")])
    assert result.exit_code == 0, result.output


def test_there_are_examples():
    assert len(EXAMPLES) >= 4


def test_the_tutorial_page_has_the_present_programs():
    assert tutorial.PAGE.read_text("utf-8") == tutorial.page(), "run python tests/tutorial.py"


def test_the_steps_are_numbered_without_a_gap():
    assert [file.stem.partition("_")[0] for file in tutorial.STEPS] == [f"step{n}" for n in range(1, 10)]

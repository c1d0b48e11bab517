"""`dsc new`: the project runs, passes its test, its types and its checks as it is made."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

DSC = Path(sys.executable).with_name("dsc")


def dsc(*words, cwd, status=0):
    done = subprocess.run([DSC, *words], capture_output=True, text=True, check=False, cwd=cwd)
    assert done.returncode == status, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    folder = tmp_path_factory.mktemp("made")
    said = dsc("new", "night-porter", cwd=folder)
    assert "next:  cd night-porter" in said
    return folder / "night-porter"


def test_a_new_project_runs_and_has_no_findings(project):
    assert "no mistakes found" in dsc("check", "--strict", cwd=project)
    report = json.loads(dsc("run", ".", "--json", cwd=project).splitlines()[-1])
    assert (report["robot"], report["goal_reached"], report["judge"]) == ("night_porter", True, "world")
    assert "retry" in dsc("run", ".", "--seed", "3", "--faults", "0.5", cwd=project)
    slow = json.loads(dsc("run", ".", "--profile", "careful", "--json", cwd=project).splitlines()[-1])
    assert slow["simulated_s"] > report["simulated_s"]


def test_its_test_passes(project):
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:asyncio"],
        capture_output=True,
        text=True,
        check=False,
        cwd=project,
    )
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
    assert "7 passed" in done.stdout


def test_its_types_are_strict(project):
    command = [sys.executable, "-m", "mypy", "--strict", "-p", "night_porter", "--cache-dir", project / ".mypy_cache"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=project)
    assert done.returncode == 0, done.stdout


def test_nothing_of_the_template_is_left_and_an_editor_finds_the_schemas(project):
    texts = {file: file.read_text() for file in project.rglob("*") if file.is_file() and "cache" not in str(file)}
    assert [str(file) for file, text in texts.items() if "my_robot" in text + str(file)] == []
    settings = json.loads((project / ".vscode" / "settings.json").read_text())["yaml.schemas"]
    assert all((project / schema).is_file() for schema in settings)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("2fast", "begins with a letter"),
        ("class", "begins with a letter"),
        ("json", "'json' is the name of an installed module"),
        ("a b", "begins with a letter"),
    ],
)
def test_a_name_that_no_package_can_have_is_refused(name, said, tmp_path):
    assert said in dsc("new", name, cwd=tmp_path, status=2)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_with_content_is_left_as_it_is(tmp_path):
    (tmp_path / "porter").mkdir()
    (tmp_path / "porter" / "thesis.txt").write_text("years of work")
    assert "porter: there is something here" in dsc("new", "porter", cwd=tmp_path, status=2)
    assert [file.name for file in (tmp_path / "porter").iterdir()] == ["thesis.txt"]

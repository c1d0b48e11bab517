"""The process that examines a project, and the search for the project around a file."""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path

import pytest

from dsc.editing.projects import Examiner, Project
from knowledge_base.errors import InputError
from planning.robot.project_search import project_around

ROOT = Path(__file__).parents[3]
EXAMINE = [sys.executable, "-m", "planning.cli.examination"]


def examined(project: Project, texts: dict[Path, str]):
    return asyncio.run(Examiner(EXAMINE).examine(project, texts))


def test_an_examination_reads_unsaved_texts_and_returns_findings_and_facts(project):
    home = project_around(project / "porter" / "plots" / "drive.yaml")
    assert home == Project(project, project / "pyproject.toml", str(project))
    domain = project / "porter" / "domain.pddl"
    unsaved = domain.read_text().replace("(empty))", "(empty) (asleep))", 1)
    found = examined(home, {domain: unsaved})
    assert found.findings == ()
    facts = found.facts
    skill = facts.skill("base.drive")
    assert skill is not None
    assert skill.parameters == {"start": "room", "to": "room"}
    assert skill.place.partition(":")[0].endswith("skills.py")
    assert facts.schema is not None
    assert "asleep" in facts.schema.predicates
    assert facts.objects is not None
    assert "room" in facts.objects.values()
    assert Path(facts.plots["drive"]) == project / "porter" / "plots" / "drive.yaml"
    broken = examined(home, {domain: "(define (domain"})
    assert [Path(one.file).name for one in broken.findings] == ["domain.pddl"]


def test_code_that_prints_does_not_disturb_the_answer(project):
    module = project / "porter" / "robot.py"
    module.write_text("import os\nprint('hello')\nos.system('echo there')\n" + module.read_text())
    assert examined(Project(project, project / "pyproject.toml", str(project)), {}).findings == ()


def test_a_command_that_fails_or_never_ends_is_an_error(tmp_path):
    project = Project(tmp_path, tmp_path / "robot.py", str(tmp_path))
    with pytest.raises(InputError, match="failed: no good"):
        asyncio.run(Examiner([sys.executable, "-c", "raise SystemExit('no good')"]).examine(project, {}))
    with pytest.raises(InputError, match=r"longer than 0\.2 s"):
        asyncio.run(Examiner([sys.executable, "-c", "while True: pass"], 0.2).examine(project, {}))


def test_the_bundle_around_a_file_is_checked_in_a_project_of_several():
    found = project_around(ROOT / "domains" / "butler" / "plots" / "give.yaml")
    assert found is not None
    assert (found.root, found.target) == (ROOT, "domains.butler.bringup:bundle")
    assert project_around(Path("/nowhere/at_all.yaml")) is None


def test_a_source_that_is_no_file_has_its_findings_at_the_main_file(tmp_path):
    project = Project(tmp_path, tmp_path / "robot.py", str(tmp_path))
    (tmp_path / "a.yaml").write_text("")
    assert project.home(str(tmp_path)) == str(tmp_path / "robot.py")
    assert project.home("a.yaml") == str(tmp_path / "a.yaml")

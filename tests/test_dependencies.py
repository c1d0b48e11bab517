"""The page of dependencies names each with bound and licence; what is GPL is never imported by the program."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from dependencies import PAGE, TITLES, WHY, Requirement, licence, requirements

ROOT = Path(__file__).parents[1]
ROWS = [
    tuple(cell.strip() for cell in line.split("|")[1:-1])
    for line in PAGE.read_text().splitlines()
    if line.startswith("| ")
]


def test_the_page_lists_all_that_the_project_names_and_nothing_else():
    """With `python tests/dependencies.py --write` it does."""
    listed = [(package, bound) for package, bound, *_ in ROWS if package not in {"package", "---"}]
    assert sorted(listed) == sorted((one.package, one.bound or "any") for one in requirements())
    assert {one.package for one in requirements()} == set(WHY)
    assert {one.group for one in requirements()} <= set(TITLES)


def test_each_has_a_licence_a_reason_and_a_way_it_is_met():
    assert [row for row in ROWS if len(row) != 5 or not all(row)] == []
    assert licence("pyperplan").startswith("GPL-3.0")


@pytest.mark.parametrize("one", [one for one in requirements() if one.group == "core"], ids=lambda one: one.package)
def test_the_core_has_a_lower_bound(one: Requirement):
    assert one.bound


def test_a_program_that_plans_does_not_import_pyperplan():
    """It runs in the worker's process alone."""
    program = (
        "import sys\n"
        "from domains.clean_up_table.bringup import deploy\n"
        "from domains.clean_up_table.scenario import Scenario\n"
        "with deploy(Scenario.parse('table: {cups: 1}')) as table:\n"
        "    assert table.report().goal_reached\n"
        "assert not [name for name in sys.modules if name.partition('.')[0] == 'pyperplan']\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


def test_the_page_is_built_from_a_lock_that_names_no_registry():
    lock = json.loads((ROOT / "frontend" / "package-lock.json").read_text(encoding="utf-8"))
    declared = json.loads((ROOT / "frontend" / "package.json").read_text(encoding="utf-8"))
    assert lock["packages"][""]["dependencies"] == declared["dependencies"]
    assert lock["packages"][""]["devDependencies"] == declared["devDependencies"]
    assert all("integrity" in package for place, package in lock["packages"].items() if place)
    assert "://" not in json.dumps(lock)

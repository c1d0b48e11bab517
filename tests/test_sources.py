"""The page of sources has every row of the five papers; what it promises exists."""

import re
import shlex
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import typer.main

from planning.cli.command import app

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
NOT_YET = "not yet"
ROWS = {"S0": range(1, 21), "S1": range(1, 23), "S2": [*range(1, 24), 25], "S3": range(1, 9), "S4": range(1, 19)}
"""The numbers of the rows of each paper."""


class Row(NamedTuple):
    """A line of the page."""

    name: str
    idea: str
    section: str
    where: str
    command: str


def rows():
    lines = re.findall(r"^\| (S\d\.\d+ \|.*) \|$", (DOCS / "sources.md").read_text(), flags=re.MULTILINE)
    return [Row(*(cell.strip() for cell in line.split(" |"))) for line in lines]


def headings(page: Path):
    found = re.findall(r"^#+ (.+)$", page.read_text(), flags=re.MULTILINE)
    return {re.sub(r"\s+", "-", re.sub(r"[^\w\s-]", "", heading).strip().lower()) for heading in found}


def test_every_row_of_the_papers_has_a_line():
    assert [row.name for row in rows()] == [f"{paper}.{number}" for paper in ROWS for number in ROWS[paper]]
    assert len(rows()) == 92


@pytest.mark.parametrize("row", rows(), ids=lambda row: row.name)
def test_a_row_leads_to_a_section_or_is_not_there_yet(row: Row):
    links = re.findall(r"\]\(([\w.-]+\.md)#?([\w-]*)\)", row.where)
    assert row.where == NOT_YET or links or "`dsc " in row.where
    for page, anchor in links:
        assert not anchor or anchor in headings(DOCS / page), f"{page}#{anchor}"


@pytest.mark.parametrize("row", [row for row in rows() if row.command], ids=lambda row: row.name)
def test_the_command_of_a_row_is_one_of_dsc(row: Row, monkeypatch):
    monkeypatch.chdir(ROOT)
    program, *words = shlex.split(row.command.strip("`"))
    assert program == "dsc"
    context: Any = typer.main.get_command(app).make_context("dsc", words)
    while hasattr(context.command, "resolve_command"):  # the group reads its options only; each command its own
        name, command, rest = context.command.resolve_command(context, context._protected_args + context.args)
        context = command.make_context(name, rest, parent=context)


def test_no_code_cites_a_row_that_is_not_there_yet():
    missing = {row.name for row in rows() if row.where == NOT_YET}
    for package in ("dsc", "planning", "knowledge_base", "domains"):
        for path in (ROOT / package).rglob("*.py"):
            assert not missing & set(re.findall(r"\bS\d\.\d+\b", path.read_text())), path

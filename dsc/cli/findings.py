"""Output of findings: lines for people, JSON for programs, and SARIF for services that annotate changes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from dsc.codes import CODES
from dsc.errors import Finding
from knowledge_base.cli.console import print_json
from knowledge_base.errors import UnknownNameError

Found = Sequence[tuple[Path | str, Finding]]
"""Findings, each with the checked file or target."""
Form = Literal["text", "json", "sarif"]
JSON = Annotated[bool, typer.Option("--json", help="Print a JSON list of findings.")]
SARIF = Annotated[bool, typer.Option("--sarif", help="Print the findings as SARIF 2.1.0, e.g. for code hosts.")]
SELECT = Annotated[str | None, typer.Option("--select", metavar="CODE,...", help="Only the findings with these codes.")]
STRICT = Annotated[bool, typer.Option("--strict", help="Warnings count, too.")]


def report(every: Found, nothing: str, *, json: bool, sarif: bool, selection: str | None, strict: bool) -> bool:
    """Print the selected findings as the options of a command state; return whether one of them counts as a mistake.

    Raises:
        UnknownNameError: there is no code of the selection.
    """
    found = _with_codes(every, selection)
    _print(found, "sarif" if sarif else "json" if json else "text", nothing)
    return any(strict or finding.level == "error" for _, finding in found)


def _with_codes(found: Found, selection: str | None) -> Found:
    """Return the findings with one of the codes in a selection, e.g. `known-object,goal`; without it, all."""
    codes = [] if selection is None else [code.strip() for code in selection.split(",")]
    for code in codes:
        if code not in CODES:
            raise UnknownNameError(f"--select: there is no code '{code}'", found=code, valid=CODES)
    return [(file, one) for file, one in found if not codes or one.code in codes]


def _print(found: Found, form: Form, nothing: str) -> None:
    """Print findings; without findings, text for people is `nothing`."""
    if form == "json":
        print_json([as_data(file, finding) for file, finding in found])
    elif form == "sarif":
        print_json(_sarif(found))
    else:
        for line in lines(found):
            typer.echo(line)
        if not found:
            typer.echo(nothing)


def lines(found: Found) -> list[str]:
    """Return a line for each finding; a warning that several places of a file share is one line with their number."""
    shared: dict[tuple[str, ...], int] = {}
    texts: dict[tuple[str, ...], str] = {}
    for number, (file, finding) in enumerate(found):
        is_error, where = finding.level == "error", finding.place or file
        source = finding.place.source if finding.place else file
        key = (str(number),) if is_error else (str(source), finding.code, finding.text)
        level = "" if is_error else f", {finding.level}"
        texts.setdefault(key, f"{where}: {finding.text} [{finding.code}{level}]")
        shared[key] = shared.get(key, 0) + 1
    return [f"{text} ({shared[key]} times)" if shared[key] > 1 else text for key, text in texts.items()]


def as_data(file: Path | str, finding: Finding) -> dict[str, Any]:
    """Return a finding as JSON data, as `--json` prints it; `file` is the checked file or target."""
    error, place = finding.error, finding.place
    return {
        "file": (place.source if place else None) or str(file),
        "line": place.line if place else None,
        "column": place.column if place else None,
        "message": error.message,
        "found": error.found,
        "nearest": error.nearest,
        "code": finding.code,
        "fix": finding.fix or None,
        "level": finding.level,
    }


def _sarif(found: Found) -> dict[str, Any]:
    """Return findings in the Static Analysis Results Interchange Format 2.1.0 of OASIS."""
    codes = dict.fromkeys(finding.code for _, finding in found)
    rules = [{"id": code, "shortDescription": {"text": CODES.get(code, code)}} for code in codes]
    return {
        "$schema": "https://json.schemastore.org/sarif-2.1.0.json",
        "version": "2.1.0",
        "runs": [
            {
                "tool": {"driver": {"name": "dsc", "rules": rules}},
                "results": [_result(file, finding) for file, finding in found],
            }
        ],
    }


def _result(file: Path | str, finding: Finding) -> dict[str, Any]:
    place = finding.place
    source = Path((place.source if place else None) or str(file))
    physical: dict[str, Any] = {"artifactLocation": {"uri": source.as_posix()}}
    if place is not None and place.line:
        physical["region"] = {"startLine": place.line} | ({"startColumn": place.column} if place.column else {})
    return {
        "ruleId": finding.code,
        "level": finding.level,
        "message": {"text": finding.text},
        "locations": [{"physicalLocation": physical}],
    }

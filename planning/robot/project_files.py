"""Checks of the files of a project that no robot uses, and the kinds of files."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path

from dsc.dynamic.library import Library
from dsc.errors import Finding
from dsc.model.plot import ActionPlot
from dsc.monitoring.profile import load_monitoring
from dsc.text.plot_files import load_plot
from dsc.text.profiles import load_profile
from dsc.validation import review_plot, validate_plot
from knowledge_base.errors import InputError, Place, collecting, tolerated
from knowledge_base.pddl import read_problem
from knowledge_base.pddl.domain_text import read_domain
from knowledge_base.pddl.unsaved_texts import readable_text
from knowledge_base.world.schema import Schema
from planning.model.domain import PlanningDomain
from planning.robot.soundness import IMPLEMENTED

READABLE = "readable"
"""The code of findings about files and parts that cannot be read."""
NAMES_PLOT = re.compile(r"^plot:\s*[\"']?([\w.-]+)", re.MULTILINE)
_KNOWN_PLOT = "known-plot"
_WORD = re.compile(r"[\w-]+")
_IMPLEMENTS = re.compile(r"^implements:\s*[\"']?([\w.-]+)", re.MULTILINE)
_DEFINES_PROBLEM = re.compile(r"\(\s*define\s*\(\s*problem\b", re.IGNORECASE)
_DEFINES_DOMAIN = re.compile(r"\(\s*define\s*\(\s*domain\b", re.IGNORECASE)
YAML = frozenset({".yaml", ".yml"})


def is_deployment(file: Path) -> bool:
    """Return whether a file is a deployment model."""
    return _has_key(file, "deployment")


def is_profile(file: Path) -> bool:
    """Return whether a file is a settings profile; a deployment model may name one."""
    return _has_key(file, "profile") and not is_deployment(file)


def plot_name(file: Path, text: str) -> str | None:
    """Return the name of the plot in a file with this text; `None` for any other file."""
    found = NAMES_PLOT.search(text) if file.suffix in YAML else None
    return None if found is None else found[1]


def is_monitoring(file: Path) -> bool:
    """Return whether a file is a monitoring profile."""
    return _has_key(file, "monitor")


def _has_key(file: Path, key: str) -> bool:
    """Return whether a file is YAML whose outermost mapping has a key."""
    return file.suffix in YAML and re.search(rf"^{key}:", readable_text(file), re.MULTILINE) is not None


def without_consequences(findings: Iterable[Finding], broken: Iterable[Path]) -> list[Finding]:
    """Return the findings without those about plots, actions and outcomes that are in files with errors."""
    texts = [readable_text(file) for file in broken]
    plots = {name for text in texts for name in NAMES_PLOT.findall(text)}
    actions = {name for text in texts for name in _IMPLEMENTS.findall(text)}
    missing = {(_KNOWN_PLOT, name) for name in plots} | {(IMPLEMENTED, name) for name in actions}
    words = {word for text in texts for word in _WORD.findall(text)}
    events = {("rule-event", word) for word in words} | {("known-event", word) for word in words}
    return [one for one in findings if (one.code, one.error.found) not in missing | events]


def check_files(files: Iterable[Path]) -> list[Finding]:
    """Return the findings about files without a robot: their form, and the agreement of plots with their domain."""
    files = list(files)
    texts = {file: readable_text(file) for file in files}
    found: list[Finding] = []
    with collecting() as errors:
        for file in files:
            with tolerated():
                _read(file, texts[file])
    found += [Finding(error, READABLE) for error in errors]
    plots = [file for file in files if plot_name(file, texts[file]) is not None]
    return found + _validate(plots)


def _read(file: Path, text: str) -> None:
    """Raise `InputError` for a file that is not Python, or is a domain with an error."""
    if file.suffix == ".py":
        try:
            compile(text, str(file), "exec")
        except (SyntaxError, ValueError) as error:
            line = getattr(error, "lineno", None)
            raise InputError(str(getattr(error, "msg", error)), place=Place(str(file), line)) from None
    elif file.suffix == ".pddl" and _DEFINES_DOMAIN.search(text):
        PlanningDomain.from_pddl(file)
    elif is_profile(file):
        load_profile(file)
    elif is_monitoring(file):
        load_monitoring(file)


def _validate(files: Iterable[Path]) -> list[Finding]:
    """Return the findings about plot files; each plot may use the other plots of its folder."""
    found: list[Finding] = []
    folders: dict[Path, list[Path]] = {}
    for file in files:
        folders.setdefault(file.parent, []).append(file)
    for folder, own in folders.items():
        library, broken, plots = Library(), list[Path](), list[ActionPlot]()
        for file in sorted(folder.glob("*.yaml")):
            try:
                plot = load_plot(file)
                library.add(plot)
            except InputError as error:
                broken.append(file)
                found += [Finding(error, READABLE)] if file in own else []
            else:
                plots += [plot] if file in own else []
        schema = _schema(folder)
        objects = None if schema is None else _declared_near(folder, schema)
        for plot in plots:
            findings = validate_plot(plot, library, schema, objects=objects, thorough=True)
            findings = findings or review_plot(plot, library)
            found += without_consequences(findings, broken)
    return found


def _schema(folder: Path) -> Schema | None:
    """Return the schema of `domain.pddl` in a folder or the folder above; `None` without a readable one."""
    for place in (folder / "domain.pddl", folder.parent / "domain.pddl"):
        if place.is_file():
            try:
                return Schema.from_text(read_domain(place))
            except InputError:  # reported as a finding about this file
                return None
    return None


def objects_in(file: Path, schema: Schema) -> Mapping[str, str]:
    """Return the objects of a problem for the schema with their types; empty for another file."""
    if file.suffix == ".pddl" and _DEFINES_PROBLEM.search(readable_text(file)):
        with suppress(InputError):  # it is a problem for another domain, or has an error
            return read_problem(file, schema).objects
    return {}


def _declared_near(folder: Path, schema: Schema) -> dict[str, str] | None:
    """Return the objects of the problems in a folder or the folder above; `None` without a problem."""
    files = [*folder.glob("*.pddl"), *folder.parent.glob("*.pddl")]
    return {name: kind for file in files for name, kind in objects_in(file, schema).items()} or None

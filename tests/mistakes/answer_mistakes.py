"""Answers of the command to planted mistakes of users, each in a fresh copy of a new project.

`python answer_mistakes.py` compares the answers with the corpus; `--write` also writes the table of the documentation.
A mistake is found by `dsc check`, at the start of the command (status 2), or in the run (status 1 or 3, never 0).
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

HERE = Path(__file__).parent
TABLE = HERE.parents[1] / "docs" / "mistakes.md"
DSC = Path(sys.executable).with_name("dsc")
PATIENCE = 25
"""Real seconds of one command; later, it counts as one that never ends."""
MOMENTS = {
    "check": "by `dsc check`",
    "start": "at the start",
    "run": "in the run",
    "named": "in the run, status 0",
    "works": "works",
    "endless": "in the run, which does not end",
    "never": "not found",
}
"""Moments of the first answer; a mistake that was mended for the user `works`."""
KINDS = {"python": "Python", "yaml": "Plots and profiles", "pddl": "PDDL", "command": "Commands"}
_NOISE = re.compile(r"^(INFO|\s+File|Traceback|\s+\d+\.\d s)|^\.?: no mistakes found")


@dataclass(frozen=True)
class Answer:
    """The first answer to a mistake: its moment, the exit status, and the lines that matter."""

    moment: str
    status: int | None
    said: str


def answered(mistake: dict[str, Any], project: Path) -> Answer:
    """Return the first answer to a mistake in a copy of a correct project."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "porter"
        shutil.copytree(project, copy)
        plant(mistake, copy)
        if mistake["kind"] != "command":
            status, said = run(f"{DSC} check .", copy)
            if status != 0:
                return Answer("check", status, said)
        status, said = run(mistake.get("command", "dsc run ."), copy)
        moment = {0: "never", 2: "start", None: "never"}.get(status, "run")
        return Answer(moment, status, said)


def plant(mistake: dict[str, Any], project: Path) -> None:
    """Make the mistake in a project."""
    if "file" in mistake:
        file = project / mistake["file"]
        text = file.read_text()
        assert text.count(mistake["old"]) == 1, mistake["id"]
        file.write_text(text.replace(mistake["old"], mistake["new"]))
    for name, text in mistake.get("files", {}).items():
        (project / name).write_text(text)


def run(command: str, folder: Path) -> tuple[int | None, str]:
    """Return the exit status of a command, `None` without an end, and its output with paths inside the project."""
    environment = {**os.environ, "PATH": f"{DSC.parent}{os.pathsep}{os.environ['PATH']}", "COLUMNS": "400"}
    words = shlex.split(command)
    try:
        done = subprocess.run(
            words, cwd=folder, env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True,
            timeout=PATIENCE, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired as error:
        return None, _inside(((error.stderr or b"") + (error.stdout or b"")).decode(), folder)
    return done.returncode, _inside(done.stderr + done.stdout, folder)


def _inside(output: str, folder: Path) -> str:
    lines = [line.strip() for line in output.replace(f"{folder.resolve()}/", "").splitlines()]
    return "\n".join(line for line in lines if line and not _NOISE.match(line))


def corpus() -> list[dict[str, Any]]:
    """Return the mistakes."""
    loaded: list[dict[str, Any]] = YAML(typ="safe").load(HERE / "corpus.yaml")
    return loaded


def answers(mistakes: list[dict[str, Any]]) -> list[Answer]:
    """Return the answers to all mistakes, in order."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([DSC, "new", "porter"], cwd=folder, check=True, capture_output=True)
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            return list(pool.map(lambda one: answered(one, Path(folder) / "porter"), mistakes))


def problem(mistake: dict[str, Any], answer: Answer) -> str | None:
    """Return the difference between an answer and the expected one; `None` without a difference."""
    wanted = mistake["answer"]
    if answer.moment != {"named": "never", "works": "never", "endless": "never"}.get(
        wanted["moment"], wanted["moment"]
    ):
        return f"found {MOMENTS[answer.moment]}, not {MOMENTS[wanted['moment']]}: {answer.said[-400:]}"
    return None if wanted["said"] in answer.said else f"does not say {wanted['said']!r}: {answer.said[-600:]}"


def table(mistakes: list[dict[str, Any]]) -> str:
    """Return the page of the documentation."""
    count = Counter(one["answer"]["moment"] for one in mistakes)
    outside = [one for one in mistakes if one["origin"] == "outside"]
    first = sum(one.get("first_pass", False) for one in outside)
    parts = [
        "# Mistakes and answers",
        "",
        f"`make mistakes` plants {len(mistakes)} mistakes, each in a fresh project of `dsc new`. It compares the answers of the command",
        f"with this table. `dsc check` finds {count['check']} of them, the start of the command finds {count['start']}, and the run finds",
        f"{count['run']}. The run names {count['named'] + count['endless']} others and continues. The last {count['never']} are not found, and {count['works']} have no effect.",
        "",
        f"Programmers who did not know the checks planted {len(outside)} of the mistakes, and rated the first answers strictly:",
        f"{first} were good. The other answers were then improved.",
    ]
    for kind, title in KINDS.items():
        parts += ["", f"## {title}", "", "| mistake | found | answer |", "| --- | --- | --- |"]
        for one in mistakes:
            if one["kind"] == kind:
                said = one["answer"]["said"].replace("|", "\\|")
                parts.append(
                    f"| {one['what']} | {MOMENTS[one['answer']['moment']]} | {f'`` {said} ``' if said else ''} |"
                )
    return "\n".join(parts) + "\n"


def say(line: str) -> None:
    """Write a line to standard output."""
    sys.stdout.write(f"{line}\n")


def main(words: list[str]) -> int:
    """Compare the answers; return the exit status."""
    mistakes = corpus()
    problems = 0
    for mistake, answer in zip(mistakes, answers(mistakes), strict=True):
        said = problem(mistake, answer)
        if said is not None:
            problems += 1
            say(f"{mistake['id']}: {said}")
    page = table(mistakes)
    if "--write" in words:
        TABLE.write_text(page)
    elif TABLE.read_text() != page:
        problems += 1
        say("docs/mistakes.md is not up to date: python tests/mistakes/answer_mistakes.py --write")
    say(f"{len(mistakes)} mistakes, {problems} other answers than expected")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""Robot projects that an editor works on, and the process that examines them."""

from __future__ import annotations

import asyncio
import json
import os
import signal
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from dsc.editing.diagnostics import FileFinding
from dsc.editing.project_facts import ProjectFacts
from knowledge_base.errors import InputError

PATIENCE_S = 120.0
"""Maximum time of an examination, in seconds; user code may not end."""


@dataclass(frozen=True, slots=True)
class Project:
    """A robot project.

    Attributes:
        root: the folder of the project.
        main: the file that makes the folder a project; it has the findings that no other file has.
        target: the target of `dsc check`.
    """

    root: Path
    main: Path
    target: str

    def home(self, source: str) -> str:
        """Return the file that has the findings about a source: the source if it is a file, else `main`."""
        path = Path(os.path.normpath(self.root / source))
        return str(path if path.is_file() else self.main)


@dataclass(frozen=True, slots=True)
class Examined:
    """The result of an examination: the findings about all files of a project, and its facts."""

    findings: tuple[FileFinding, ...] = ()
    facts: ProjectFacts = field(default_factory=ProjectFacts)


class Examiner:
    """A command that examines projects, each in a new process, so that it reads the present Python code.

    Args:
        command: the command, to which the target of the project is added. It reads unsaved texts and writes JSON, as
            `planning.cli.examination` does.
        seconds: time limit of an examination.
    """

    def __init__(self, command: Sequence[str], seconds: float = PATIENCE_S) -> None:
        self._command = tuple(command)
        self._seconds = seconds

    async def examine(self, project: Project, texts: Mapping[Path, str]) -> Examined:
        """Return the findings and facts of a project; a cancelled call ends the process.

        Args:
            project: the project.
            texts: the unsaved texts by file.

        Raises:
            InputError: the process failed, or exceeded the time limit.
        """
        process = await asyncio.create_subprocess_exec(
            *self._command, project.target, cwd=project.root, start_new_session=True,
            stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE,
        )  # fmt: skip
        given = json.dumps({str(file): text for file, text in texts.items()}).encode()
        try:
            async with asyncio.timeout(self._seconds):
                out, problem = await process.communicate(given)
        except TimeoutError:
            raise InputError(f"the check of the project took longer than {self._seconds:g} s") from None
        finally:
            if process.returncode is None:
                with suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)
                await process.wait()
        if process.returncode:
            raise InputError(f"the check of the project failed: {_last_line(problem)}")
        form = json.loads(out)
        findings = tuple(FileFinding.read(one, project.root) for one in form["findings"])
        return Examined(findings, ProjectFacts.read(form["facts"]))


def _last_line(text: bytes) -> str:
    lines = text.decode("utf-8", "replace").strip().splitlines()
    return lines[-1] if lines else "no reason was written"

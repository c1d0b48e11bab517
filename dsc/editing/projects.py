"""Robot projects that an editor works on, and the process that examines them."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from dsc.editing.diagnostics import FileFinding
from dsc.editing.project_command import ProjectCommand
from dsc.editing.project_facts import ProjectFacts

PATIENCE_S = 120.0
"""Maximum time of an examination, in seconds."""


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
        command: the command, see `dsc.editing.project_command`.
        seconds: time limit of an examination.
    """

    def __init__(self, command: Sequence[str], seconds: float = PATIENCE_S) -> None:
        self._command = ProjectCommand(command, seconds, "the check of the project")

    async def examine(self, project: Project, texts: Mapping[Path, str]) -> Examined:
        """Return the findings and facts of a project; a cancelled call ends the process.

        Args:
            project: the project.
            texts: the unsaved texts by file.

        Raises:
            InputError: the process failed, or exceeded the time limit.
        """
        form = await self._command.run(project.root, texts, project.target)
        findings = tuple(FileFinding.read(one, project.root) for one in form["findings"])
        return Examined(findings, ProjectFacts.read(form["facts"]))

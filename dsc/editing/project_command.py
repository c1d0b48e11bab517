"""Commands that execute the code of a robot project, each in a new process."""

from __future__ import annotations

import asyncio
import json
import os
import signal
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from knowledge_base.errors import InputError


class ProjectCommand:
    """A command that reads unsaved texts and writes JSON, as `planning.cli.examination` does.

    Args:
        command: the command without its arguments.
        seconds: time limit of a process; user code may not end.
        work: the work of the command, for messages.
    """

    def __init__(self, command: Sequence[str], seconds: float, work: str) -> None:
        self._command = tuple(command)
        self._seconds = seconds
        self._work = work

    async def run(self, folder: Path, texts: Mapping[Path, str], *arguments: str) -> Any:
        """Return the JSON data that the command writes; a cancelled call ends the process.

        Args:
            folder: the working folder.
            texts: the unsaved texts by file.
            arguments: the arguments of the command.

        Raises:
            InputError: the process failed, or exceeded the time limit.
        """
        process = await asyncio.create_subprocess_exec(
            *self._command, *arguments, cwd=folder, start_new_session=True,
            stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE,
        )  # fmt: skip
        given = json.dumps({str(file): text for file, text in texts.items()}).encode()
        try:
            async with asyncio.timeout(self._seconds):
                out, problem = await process.communicate(given)
        except TimeoutError:
            raise InputError(f"{self._work} took longer than {self._seconds:g} s") from None
        finally:
            if process.returncode is None:
                with suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)
                await process.wait()
        if process.returncode:
            raise InputError(f"{self._work} failed: {_last_line(problem)}")
        return json.loads(out)


def _last_line(text: bytes) -> str:
    lines = text.decode("utf-8", "replace").strip().splitlines()
    return lines[-1] if lines else "no reason was written"

"""Verdicts on mutants: mutmut finds and keeps them in the workspace, so an interrupted run goes on where it stopped."""

from __future__ import annotations

import hashlib
import os
import signal
import subprocess
import sys
from collections.abc import Iterable
from contextlib import suppress
from enum import StrEnum
from pathlib import Path

from mutants import Mutant
from mutmut.mutation.data import SourceFileMutationData
from mutmut.stats import status_by_exit_code
from rooms import ROOT, Room


class Verdict(StrEnum):
    """What the tests say of a mutant. One that no test reaches survives."""

    KILLED = "killed"
    TIMEOUT = "timeout"
    SURVIVED = "survived"


VERDICTS = {
    "killed": Verdict.KILLED,
    "timeout": Verdict.TIMEOUT,
    "segfault": Verdict.TIMEOUT,  # killed by the limit on processor time
    "survived": Verdict.SURVIVED,
    "no tests": Verdict.SURVIVED,
}


def verdicts(mutants: Iterable[Mutant]) -> dict[str, tuple[Verdict, float]]:
    """Return the verdict on each tested mutant, and the seconds that it took, by name."""
    kept: dict[str, SourceFileMutationData] = {}
    found = {}
    for mutant in mutants:
        if mutant.path not in kept:
            kept[mutant.path] = SourceFileMutationData(path=mutant.path)
            kept[mutant.path].load()
        data = kept[mutant.path]
        if data.hash_by_function_name.get(mutant.key) != mutant.digest:
            continue
        verdict = VERDICTS.get(status_by_exit_code[data.exit_code_by_key.get(mutant.name)])
        if verdict is not None:
            found[mutant.name] = verdict, data.durations_by_key.get(mutant.name, 0.0)
    return found


def forget_survivors(room: Room) -> None:
    """Forget who survived, and which test reaches what, if the tests have changed since."""
    digest = hashlib.sha256(b"".join((ROOT / test).read_bytes() for test in room.tests)).hexdigest()
    last = Path("tests.sha256")
    if last.exists() and last.read_text() == digest:
        return
    Path("mutants/mutmut-stats.json").unlink(missing_ok=True)
    for module in room.modules:
        data = SourceFileMutationData(path=module)
        data.load()
        for name, code in data.exit_code_by_key.items():
            if VERDICTS.get(status_by_exit_code[code]) is Verdict.SURVIVED:
                data.exit_code_by_key[name] = None
        if data.exit_code_by_key:
            data.save()
    last.write_text(digest)


def run_mutmut(mutants: Iterable[Mutant], jobs: int) -> None:
    """Let mutmut test these mutants; on a terminal it shows how far it is.

    Raises:
        SystemExit: the tests fail without any mutant.
    """
    command = [str(Path(sys.executable).with_name("mutmut")), "run", "--max-children", str(jobs)]
    log = Path("mutmut.log").absolute()
    with log.open("w") as file:
        shown = None if sys.stdout.isatty() else file
        names = [mutant.name for mutant in mutants]
        # In a group of its own: what a mutant has started may outlive its test.
        with subprocess.Popen([*command, *names], stdout=shown, stderr=shown, process_group=0) as running:
            try:
                code = running.wait()
            finally:
                with suppress(ProcessLookupError):
                    os.killpg(running.pid, signal.SIGKILL)
    if code:
        raise SystemExit(f"mutmut ended with {code}; it wrote to {'the terminal' if shown is None else log}")

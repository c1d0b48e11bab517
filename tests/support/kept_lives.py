"""One life of a kept run of the clean-up table, in a process that is there to be killed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from domains.clean_up_table.bringup import bundle, deploy
from domains.clean_up_table.scenario import Scenario
from dsc.runs.archive import archive, has_run
from planning import resume

SCENARIO = "table: {cups: 2, cans: 1, crisp_cans: [small]}"


def live(store: str, seed: int, faults: float, say) -> None:
    """Begin the run, or go on with it; say the number of each record that is made, and at last that it is over."""
    path = Path(store)
    with (
        resume(bundle(), path) if has_run(path) else deploy(Scenario.parse(SCENARIO), seed, faults, store=path) as table
    ):
        table.report(prepare=lambda run: run.trace.listen(lambda record: say.send(record.seq)))
    say.send("end")


def told(path: Path) -> tuple[Any, ...]:
    """What is in the store of each macrostep; the records are left out, of which a new life makes some anew."""
    with archive(path) as runs:
        run = runs.run()
        return run.ended, [replace(step, records=()) for step in runs.steps(run.number)]

"""A cell whose arm one program hosts, and whose robot another program runs: `dsc host cell.py:arm`, `dsc run cell.py`.

The world is a file of JSON lines, one for each movement that began or ended, so that it survives its program.
"""

from __future__ import annotations

import fcntl
import json
import os
from pathlib import Path
from typing import Any

from dsc import Component, Outcome, SkillCall, SkillError, load_plot, skill
from knowledge_base import Delta, fact
from planning import Bundle

HERE = Path(__file__).parent
BOXES = tuple(f"box{n}" for n in range(1, 6))


class Moved(Outcome): ...


class Seen(Outcome): ...


class World:
    """The boxes on the table, by the lines of a file; it refuses a host that was replaced."""

    def __init__(self, file: Path) -> None:
        self._file = file

    def lines(self) -> list[dict[str, Any]]:
        return [json.loads(line) for line in self._file.read_text().splitlines()] if self._file.exists() else []

    def moved(self) -> set[str]:
        return {one["box"] for one in self.lines() if one["what"] == "moved"}

    def write(self, call: SkillCall, what: str, box: str = "") -> bool:
        """Write a line, unless the action has it already; return whether the line is new."""
        with self._file.open("a+") as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            file.seek(0)
            known = [json.loads(line) for line in file]
            if any(one["fence"] > call.fence for one in known):
                raise SkillError("a later host has taken over the arm")
            if any((one["what"], one["key"]) == (what, call.key) for one in known):
                return False
            file.write(json.dumps({"what": what, "box": box, "key": call.key, "fence": call.fence}) + "\n")
            return True


class Arm(Component):
    name = "arm"

    def __init__(self) -> None:
        super().__init__()
        self.world = World(Path(os.environ["CELL_WORLD"]))

    @skill(after_crash="same_id")
    async def move(self, call: SkillCall, box: str) -> Moved:
        await call.clock.sleep(0.05)
        self.world.write(call, "moved", box)
        return Moved(observed=Delta(added=(fact("on-table", box),)))

    @skill(after_crash="repeat")
    async def look(self, call: SkillCall) -> Seen:
        self.world.write(call, "looked")
        return Seen(observed=Delta(added=tuple(fact("on-table", box) for box in self.world.moved())))


arm = Bundle("arm", components=lambda: [Arm()])

boss = Bundle(
    "boss",
    remote=("tidier",),
    plots=(load_plot(HERE / "boss" / "order.yaml"),),
    main="order",
    goal="(forall (?b - box) (on-table ?b))",
)

robot = Bundle.in_folder(
    HERE,
    name="cell",
    remote=("arm",),
    main="tidy",
    goal="(forall (?b - box) (on-table ?b))",
    knowledge=Delta(nodes=dict.fromkeys(BOXES, "box")),
)

"""The conversation in the lift: simulated persons, and floors in their answers."""

from __future__ import annotations

import re
from typing import Annotated

from domains.dialogue.channels import Script
from domains.elevator.floors import FLOORS
from domains.elevator.lift import NAMES
from domains.elevator.ride import Ride
from dsc.calls import SkillCall
from dsc.conversions import conversion


@conversion
def floor_in(words: str) -> Annotated[str, "symbol"]:
    """Return the floor in an answer, e.g. `we are on the third floor`; `none` if there is none."""
    lower = words.lower()
    for number, (name, floor) in enumerate(FLOORS.items()):
        if any(word in lower for word in floor.words) or re.search(rf"\b(floor\s*)?{number}\b", lower):
            return name
    return "none"


class Riders(Script):
    """The persons in the lift; a mishap lets a person give no answer, or a wrong one."""

    def __init__(self, ride: Ride) -> None:
        super().__init__(lambda _to, _topic: None)
        self._ride = ride

    async def receive(self, call: SkillCall, to: str, topic: str) -> str | None:  # noqa: ARG002
        """Return the answer of a person after three seconds."""
        await call.clock.sleep(3.0)
        now = call.clock.now()
        stop = self._ride.lift.last_stop(now)
        if stop is None or to not in self._ride.persons(now):
            return None
        mishap = self._ride.mishap(call.action_id, "no answer", "wrong floor")
        if mishap == "no answer":
            return None
        number = NAMES.index(stop.floor)
        return f"We are on floor {(number + 1) % len(FLOORS) if mishap else number}."

"""The butler as a bundle: a simulated flat, spoken commands, and two ways to approach a place (S0.13)."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

from domains.butler.components import Base, Butler
from domains.butler.flat import DOORS, FURNITURE, HOME, ROOMS, Flat, spots
from domains.butler.scenario import Scenario
from domains.butler.speech import Fetch, Speech, command, from_list, from_prompt
from domains.fetch_skills.bringup import NAME as FETCH_SKILLS
from domains.fetch_skills.hand import Hand
from domains.fetch_skills.platform import Mapper, PathPlanner
from dsc.components.component import Component
from dsc.sequencer.run_end import RunEnd
from knowledge_base.facts import Delta, fact
from knowledge_base.store import KnowledgeBase
from planning.robot.bundles import Bundle
from planning.robot.simulation import Left, Setup, Simulation

FOLDER = Path(str(files("domains.butler")))
NAME = "butler"


class ButlerFlat(Simulation):
    """The simulated flat with the robot.

    Attributes:
        flat: the true state.
        said: the sentences that the robot has spoken.
    """

    reads_scenarios = True
    scenario_form = Scenario
    turning = 0.0
    """Seconds of a turn on the spot."""

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self.scenario = Scenario.of(setup.scenario, FOLDER / "scenarios" / "evening.yaml")
        self.flat = Flat()
        self.flat.closed = {doors for doors in DOORS if "-".join(doors) in self.scenario.closed}
        self.said: list[str] = []

    def components(self) -> Iterable[Component]:
        """Return the components of the butler."""
        says = self.scenario.says
        speech = Speech(from_prompt(sys.stdin) if says == "prompt" else from_list(says), self.said.append)
        butler = Butler(self.flat, self.fault, self.turning)
        return [speech, Mapper(), PathPlanner(butler), Base(butler, self.flat, self.fault), Hand(butler)]

    def knowledge(self) -> Delta:
        """Return the places with their coordinates (S4.14), and the items as they were last seen."""
        values = {fact("position", name): at for name, at in spots().items()}
        nodes = {**dict.fromkeys(ROOMS, "room"), **dict.fromkeys(FURNITURE, "furniture")}
        nodes |= dict.fromkeys(self.flat.items, "item")
        items = tuple([fact("item-at", item, place) for item, place in self.flat.items.items()])
        return Delta(nodes, added=(fact("robot-at", HOME), *items), values=values)

    def scene(self) -> list[dict[str, Any]]:
        """Return the flat for the page."""
        return self.flat.scene()

    def left(self) -> list[Left]:
        """Return the items that were asked for, and that the person does not have."""
        asked = [command(words) for words in self.scenario.says if self.scenario.says != "prompt"]
        items = [str(one.attributes["what"]) for one in asked if isinstance(one, Fetch)]
        return [Left(one, self.flat.items.get(one, "")) for one in items if self.flat.items.get(one) != "person"]

    def reason(self, left: Left, knowledge: KnowledgeBase, end: RunEnd) -> str:
        """Return the last sentence of the robot."""
        del left, knowledge, end
        return f"it said: {self.said[-1]}" if self.said else ""

    def own_report(self, knowledge: KnowledgeBase, end: RunEnd) -> Mapping[str, Any]:
        """Return the sentences of the robot, and what the person has."""
        del knowledge, end
        return {"said": self.said, "person_has": [item for item, at in self.flat.items.items() if at == "person"]}

    def headline(self, own: Mapping[str, Any], *, reached: bool) -> str:
        """Return what the robot has said."""
        del reached
        return f"The butler said: {'; '.join(own['said']) or 'nothing'}"


class ButlerOnTracks(ButlerFlat):
    """The same flat with a robot on tracks, which turns on the spot before each line."""

    turning = 4.0


def bundle() -> Bundle:
    """Return the bundle; `serve` is its main plot."""
    return Bundle.in_folder(
        FOLDER,
        name=NAME,
        about="obey spoken commands in a flat: go to a room or an object, follow, fetch",
        needs=(FETCH_SKILLS,),
        main="serve",
        simulation=ButlerFlat,
        robots={"on_wheels": ButlerFlat, "on_tracks": ButlerOnTracks},
    )

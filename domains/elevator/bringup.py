"""The elevator challenge as a bundle: a mission tree, goals for each phase, and a dialogue by arcs (S4.11)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from domains.attention.bringup import NAME as ATTENTION
from domains.attention.gaze import Attention
from domains.dialogue.bringup import NAME as DIALOGUE
from domains.dialogue.channels import Console
from domains.dialogue.speech import Dialogue
from domains.elevator.base import Base
from domains.elevator.floors import FLOORS
from domains.elevator.lift import LIFT, PERSONS, Lift, scene
from domains.elevator.mission import Mission
from domains.elevator.perception import Door, Head, People
from domains.elevator.ride import Ride
from domains.elevator.scenario import Scenario
from domains.elevator.talk import Riders, floor_in
from dsc.components.component import Component
from dsc.sequencer.run_end import RunEnd
from knowledge_base.facts import Delta, fact
from knowledge_base.store import KnowledgeBase
from planning.robot.bundles import Bundle
from planning.robot.simulation import Left, Setup, Simulation

FOLDER = Path(str(files("domains.elevator")))
NAME = "elevator"


class ElevatorRide(Simulation):
    """A house with a lift, persons, and the robot.

    Attributes:
        scenario: the floors and the persons.
        ride: the true state.
        riders: the simulated persons.
    """

    reads_scenarios = True
    scenario_form = Scenario
    lasts = True

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self.scenario = Scenario.of(setup.scenario)
        self.ride = Ride(Lift(self.seed, self.scenario.persons), self.scenario.start, self.fault)
        self.riders = Riders(self.ride)
        self._mission = Mission()
        self._dialogue = Dialogue(Console() if self.scenario.answers == "console" else self.riders)
        if setup.resumes and setup.store is not None:
            self.ride.resume(_file(setup.store))

    def begin(self) -> None:
        """Write the state next to the store."""
        if self.setup.store is not None:
            self.ride.keep(_file(self.setup.store))

    def components(self) -> Iterable[Component]:
        """Return the components of the robot."""
        senses = [Door(self.ride), People(self.ride), Attention(Head(self.ride))]
        return [*senses, self._dialogue, Base(self.ride), self._mission]

    def knowledge(self) -> Delta:
        """Return the persons, the floors with their places, the floor of the robot, and its destination."""
        assigned = fact("assigned", "robot", self.scenario.destination)
        nodes = {**dict.fromkeys(FLOORS, "floor"), **dict.fromkeys(PERSONS, "person")}
        values = {fact("position", name): floor.place for name, floor in FLOORS.items()}
        return Delta(nodes, added=(fact("arrived", self.scenario.start), assigned), values=values)

    def scene(self) -> list[dict[str, Any]]:
        """Return the house for the page."""
        return scene(self.ride.lift, self.ride.place, self.ride.second)

    def left(self) -> Sequence[Left]:
        """Return the robot, unless it is at its destination."""
        return [] if self.ride.place == self.scenario.destination else [Left("robot", self.ride.place)]

    def reason(self, left: Left, knowledge: KnowledgeBase, end: RunEnd) -> str:
        """Return the reason of the last goal that was not reached."""
        del left, knowledge, end
        return self._mission.reasons[-1] if self._mission.reasons else ""

    def own_report(self, knowledge: KnowledgeBase, end: RunEnd) -> Mapping[str, Any]:
        """Return the destination, the place of the robot, and the number of its questions."""
        del knowledge, end
        destination = self.scenario.destination
        return {"destination": destination, "place": self.ride.place, "questions": self._dialogue.questions}

    def headline(self, own: Mapping[str, Any], *, reached: bool) -> str:
        """Return where the robot is."""
        where = "in the lift" if own["place"] == LIFT else f"on {own['place']}"
        wrong = "" if reached else f" and not on {own['destination']}"
        return f"The robot is {where}{wrong}, after {own['questions']} questions"


def _file(store: Path) -> Path:
    return store.with_name(f"{store.name}.ride")


def bundle() -> Bundle:
    """Return the bundle; `take_elevator` is its main plot."""
    return Bundle.in_folder(
        FOLDER,
        name=NAME,
        about="take the elevator: a mission tree, goals for each phase, questions to persons",
        needs=(DIALOGUE, ATTENTION),
        main="take_elevator",
        simulation=ElevatorRide,
        failures=("did_not_arrive",),
        conversions=(floor_in,),
    )

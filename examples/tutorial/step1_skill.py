"""Step 1, a skill: a coroutine of a component, which ends with an outcome and with what it observed."""

from typing import NewType

from dsc import Component, Outcome, SkillCall, primitive_plot, skill
from knowledge_base import Delta, fact
from planning import Robot

DOMAIN = """(define (domain house) (:types room)
  (:predicates (robot-in ?r - room)))"""


Room = NewType("Room", str)


class Arrived(Outcome): ...


class Base(Component):
    """The wheels of the robot."""

    name = "base"

    @skill
    async def drive(self, call: SkillCall, start: Room, to: Room) -> Arrived:
        await call.clock.sleep(10.0)  # simulated seconds: the run does not wait for them
        print(f"{call.clock.now():4.0f} s  in the {to}")
        return Arrived(observed=Delta(removed=(fact("robot-in", start),), added=(fact("robot-in", to),)))


def main() -> None:
    base = Base()
    drive = primitive_plot(base.skills()["drive"], done="arrived")  # the smallest plot around one skill
    with Robot(DOMAIN, [drive], [base], clock="simulated") as robot:
        robot.knowledge.apply(Delta(nodes={"hall": "room", "office": "room"}, added=(fact("robot-in", "hall"),)), "map")
        end = robot.run("drive", {"start": "hall", "to": "office"})
        print("finished:", end.finished, "| known:", *robot.knowledge.query("(robot-in ?room)"))


if __name__ == "__main__":
    main()

# Expected output:
#   10 s  in the office
# finished: True | known: {'room': 'office'}

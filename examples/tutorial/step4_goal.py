"""Step 4, a goal: a planner finds actions for what no candidate covers; plots implement these actions."""

from step1_skill import Base
from step2_plot import Gripper

from dsc import Record, primitive_plot
from knowledge_base import Delta, fact
from planning import Robot

DOMAIN = """(define (domain house) (:types room parcel)
  (:predicates (robot-in ?r - room) (lies-in ?p - parcel ?r - room) (carries ?p - parcel) (connected ?a ?b - room))
  (:action drive
    :parameters (?start ?to - room)
    :precondition (and (robot-in ?start) (connected ?start ?to))
    :effect (and (not (robot-in ?start)) (robot-in ?to)))
  (:action pick-up
    :parameters (?parcel - parcel ?room - room)
    :precondition (and (robot-in ?room) (lies-in ?parcel ?room))
    :effect (and (not (lies-in ?parcel ?room)) (carries ?parcel))))"""

KNOWN = Delta(
    nodes={"hall": "room", "stairs": "room", "office": "room", "letter": "parcel"},
    added=(
        fact("robot-in", "hall"), fact("connected", "hall", "stairs"), fact("connected", "stairs", "office"),
        fact("connected", "office", "stairs"), fact("connected", "stairs", "hall"), fact("lies-in", "letter", "office"),
    ),
)  # fmt: skip


def show(record: Record) -> None:
    if record.type == "plan.found":
        print("plan:", *record.data["steps"])


def main() -> None:
    base, gripper = Base(), Gripper("letter")
    plots = [
        primitive_plot(base.skills()["drive"], done="arrived", implements="drive"),
        primitive_plot(gripper.skills()["pick_up"], done="picked_up", implements="pick-up"),
    ]
    with Robot(DOMAIN, plots, [base, gripper], clock="simulated") as robot:
        robot.listen(show)
        robot.knowledge.apply(KNOWN, "map")
        end = robot.achieve("(and (carries letter) (robot-in hall))")
        print("reached:", end.reached)


if __name__ == "__main__":
    main()

# Expected output:
# plan: (drive hall stairs) (drive stairs office) (pick-up letter office) (drive office stairs) (drive stairs hall)
#   10 s  in the stairs
#   20 s  in the office
#   23 s  holds the letter
#   33 s  in the stairs
#   43 s  in the hall
# reached: True

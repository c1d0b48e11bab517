"""A robot of your own: two planning actions in PDDL, two skills in Python, a goal, and a plan that reaches it.

`dsc run examples/own_domain.py` runs it, too.
"""

from typing import NewType

from dsc import Component, Outcome, SkillCall, primitive_plot, skill
from knowledge_base import Delta, fact
from planning import Bundle, PlanningDomain, deploy

WATERING = PlanningDomain.parse("""
(define (domain watering)
  (:requirements :strips :typing)
  (:types room plant)
  (:predicates (robot-in ?r - room) (stands-in ?p - plant ?r - room) (watered ?p - plant))
  (:action go
    :parameters (?from ?to - room)
    :precondition (robot-in ?from)
    :effect (and (not (robot-in ?from)) (robot-in ?to)))
  (:action water
    :parameters (?plant - plant ?room - room)
    :precondition (and (robot-in ?room) (stands-in ?plant ?room))
    :effect (watered ?plant)))
""")


Room = NewType("Room", str)
Plant = NewType("Plant", str)


class Arrived(Outcome): ...


class Watered(Outcome): ...


class Gardener(Component):
    name = "gardener"

    @skill
    async def go(self, call: SkillCall, to: Room) -> Arrived:
        await call.clock.sleep(20.0)  # simulated seconds: the run does not wait for them
        print(f"{call.clock.now():5.1f} s  in the {to}")
        return Arrived()

    @skill
    async def water(self, call: SkillCall, plant: Plant) -> Watered:
        await call.clock.sleep(5.0)
        print(f"{call.clock.now():5.1f} s  watered the {plant}")
        # What a skill observes is told to the knowledge base together with its outcome.
        return Watered(observed=Delta(added=(fact("watered", plant),)))


SKILLS = Gardener().skills()

robot = Bundle(
    "gardener",
    plots=(
        # `go` observes nothing by itself, so its effects are assumed once it has arrived.
        primitive_plot(SKILLS["go"], done="arrived", implements="go", effects="assumed"),
        primitive_plot(SKILLS["water"], done="watered", implements="water"),
    ),
    components=lambda: [Gardener()],
    domain=WATERING,
    knowledge=Delta(
        nodes={"kitchen": "room", "balcony": "room", "basil": "plant", "rose": "plant"},
        added=(
            fact("robot-in", "kitchen"),
            fact("stands-in", "basil", "kitchen"),
            fact("stands-in", "rose", "balcony"),
        ),
    ),
    goal="(forall (?p - plant) (watered ?p))",
)


def main() -> None:
    with deploy(robot, clock="simulated") as deployed:
        report = deployed.report()
        print(report.lines()[0])


if __name__ == "__main__":
    main()

# Expected output:
#   5.1 s  watered the basil
#  25.1 s  in the balcony
#  30.1 s  watered the rose
# Goal reached (judge: knowledge), 30 s of simulated time.

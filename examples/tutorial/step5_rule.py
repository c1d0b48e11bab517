"""Step 5, a rule: a foreseen failure is answered in one place, for designed plots and for steps of plans alike."""

from step1_skill import Arrived, Room
from step2_plot import Gripper
from step4_goal import DOMAIN, KNOWN

from dsc import Component, Outcome, SkillCall, parse_plot, primitive_plot, skill
from knowledge_base import Delta, fact
from planning import Robot

BRING = parse_plot("""
plot: bring
emits: {undelivered: {}}
states:
  bring:
    goal: (and (carries letter) (robot-in hall))
    on: {done: delivered, no_plan: failed, gave_up: failed}
  delivered: {final: true}
  failed: {final: true, emit: undelivered}
rules:
  - on: door_closed
    do: {use: knock, then: retry, limit: 3}    # at most three times for each step, then the robot plans again
""")
KNOCK = parse_plot("""
plot: knock
states:
  wait: {entry: {trigger: base.knock}, on: {knocked: over}}
  over: {final: true}
""")


class DoorClosed(Outcome): ...


class Knocked(Outcome): ...


class Doors(Component):
    """Wheels in a house whose doors are closed now and then."""

    name = "base"

    def __init__(self, closed: int) -> None:
        super().__init__()
        self.closed = closed

    @skill
    async def drive(self, call: SkillCall, start: Room, to: Room) -> Arrived | DoorClosed:
        await call.clock.sleep(10.0)
        if self.closed:
            self.closed -= 1
            print(f"{call.clock.now():4.0f} s  the door to the {to} is closed")
            return DoorClosed()
        print(f"{call.clock.now():4.0f} s  in the {to}")
        return Arrived(observed=Delta(removed=(fact("robot-in", start),), added=(fact("robot-in", to),)))

    @skill
    async def knock(self, call: SkillCall) -> Knocked:
        await call.clock.sleep(2.0)
        print(f"{call.clock.now():4.0f} s  knocked")
        return Knocked()


def main() -> None:
    base, gripper = Doors(closed=2), Gripper("letter")
    plots = [
        BRING,
        KNOCK,
        primitive_plot(base.skills()["drive"], done="arrived", implements="drive"),
        primitive_plot(gripper.skills()["pick_up"], done="picked_up", implements="pick-up"),
    ]
    with Robot(DOMAIN, plots, [base, gripper], clock="simulated") as robot:
        robot.knowledge.apply(KNOWN, "map")
        print(robot.run("bring").reason)


if __name__ == "__main__":
    main()

# Expected output:
#   10 s  the door to the stairs is closed
#   12 s  knocked
#   22 s  the door to the stairs is closed
#   24 s  knocked
#   34 s  in the stairs
#   44 s  in the office
#   47 s  holds the letter
#   57 s  in the stairs
#   67 s  in the hall
# the plot reached its end

"""A dynamic state with two designed candidates and a planner behind them, in Python and the same in YAML."""

from typing import NewType

from dsc import ActionPlot, Component, Outcome, Record, SkillCall, parse_plot, primitive_plot, skill
from knowledge_base import Delta, fact
from planning import PlanningDomain, Robot

DOMAIN = PlanningDomain.parse("""
(define (domain delivery)
  (:types room)
  (:predicates (robot-in ?r - room) (connected ?a ?b - room) (visible ?r - room) (lift-ready))
  (:action move
    :parameters (?from ?to - room)
    :precondition (and (robot-in ?from) (connected ?from ?to))
    :effect (and (not (robot-in ?from)) (robot-in ?to))))
""")

# In Python. Each candidate carries its own condition; the dynamic state only names them.
in_python = ActionPlot.model_validate(
    {
        "plot": "visit",
        "parameters": {"room": "room"},
        "states": {
            "approach": {
                "dynamic": ["go_straight", "take_the_lift"],
                "with": {"to": "?room"},
                "goal": "(robot-in ?room)",
                "on": {"done": "there", "no_plan": "lost", "gave_up": "lost"},
            },
            "there": {"final": True},
            "lost": {"final": True},
        },
    }
)

# The same in YAML, as people usually write it.
in_yaml = parse_plot("""
plot: visit
parameters: {room: room}
states:
  approach:
    dynamic: [go_straight, take_the_lift]
    with: {to: ?room}
    goal: (robot-in ?room)
    on: {done: there, no_plan: lost, gave_up: lost}
  there: {final: true}
  lost: {final: true}
""")


Room = NewType("Room", str)


class Arrived(Outcome): ...


class Base(Component):
    name = "base"
    room = Room("hall")

    @skill
    async def drive(self, call: SkillCall, to: Room) -> Arrived:
        await call.clock.sleep(10.0)
        here, self.room = self.room, to
        return Arrived(observed=Delta(removed=(fact("robot-in", here),), added=(fact("robot-in", to),)))


def show(record: Record) -> None:
    if record.type == "decision" and record.data["state"] == "approach":
        verdicts = [f"{one['plot']}: {one['reason']}" for one in record.data["candidates"]]
        print(f"chose {record.data['chosen']}  ({'; '.join(verdicts)})" if verdicts else "nothing to do")
    elif record.type == "plan.found":
        print("  planned", *record.data["steps"])


def main() -> None:
    print("the same plot:", in_python.to_form() == in_yaml.to_form())
    base = Base()
    drive = base.skills()["drive"]
    plots = [
        in_yaml,
        primitive_plot(drive, name="go_straight", done="arrived", when="(visible ?to)"),
        primitive_plot(drive, name="take_the_lift", done="arrived", when="(lift-ready)"),
        primitive_plot(drive, name="move", done="arrived", implements="move"),
    ]
    with Robot(DOMAIN, plots, [base], clock="simulated") as robot:
        robot.listen(show)
        with robot.knowledge.transaction(author="map") as world:
            for room in ("hall", "office", "lab", "archive"):
                world.add_node(room, "room")
            world.tell("robot-in", "hall")
            world.tell("visible", "office")
            for pair in (("office", "lab"), ("lab", "archive")):
                world.tell("connected", *pair)
        robot.run("visit", {"room": "office"})
        robot.run("visit", {"room": "archive"})


if __name__ == "__main__":
    main()

# Expected output:
# the same plot: True
# chose go_straight  (go_straight: (visible office) is true; take_the_lift: (lift-ready) is false)
# chose achieve  (go_straight: (visible archive) is false; take_the_lift: (lift-ready) is false)
#   planned (move office lab) (move lab archive)

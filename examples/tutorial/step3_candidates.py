"""Step 3, candidates: a dynamic state chooses the first plot whose condition is true in the knowledge base."""

from step1_skill import Base

from dsc import Record, parse_plot, primitive_plot
from knowledge_base import Delta, fact
from planning import Robot

DOMAIN = """(define (domain house) (:types room)
  (:predicates (robot-in ?r - room) (door-open ?r - room) (lift-works)))"""

VISIT = parse_plot("""
plot: visit
parameters: {start: room, to: room}
emits: {no_way: {}}
states:
  approach:
    dynamic: [through_the_door, by_lift]       # tried in this order
    with: {start: ?start, to: ?to}
    on: {done: there, no_candidate: {to: outside, emit: no_way}}
  there: {final: true}
  outside: {final: true}
""")


def show(record: Record) -> None:
    if record.type == "decision":
        tried = ", ".join(f"{one['plot']}: {one['reason']}" for one in record.data["candidates"])
        print(f"{record.data['chosen']} ({tried})")


def main() -> None:
    base = Base()
    drive = base.skills()["drive"]
    plots = [
        VISIT,
        primitive_plot(drive, name="through_the_door", done="arrived", when="(door-open ?to)"),
        primitive_plot(drive, name="by_lift", done="arrived", when="(lift-works)"),
    ]
    with Robot(DOMAIN, plots, [base], clock="simulated") as robot:
        robot.listen(show)
        rooms = {"hall": "room", "office": "room", "lab": "room"}
        robot.knowledge.apply(Delta(nodes=rooms, added=(fact("robot-in", "hall"), fact("door-open", "office"))), "map")
        robot.run("visit", {"start": "hall", "to": "office"})
        robot.knowledge.apply(Delta(added=(fact("lift-works"),)), "janitor")
        robot.run("visit", {"start": "office", "to": "lab"})


if __name__ == "__main__":
    main()

# Expected output:
# through_the_door (through_the_door: (door-open office) is true, by_lift: (lift-works) is false)
#   10 s  in the office
# by_lift (through_the_door: (door-open lab) is false, by_lift: (lift-works) is true)
#   10 s  in the lab

"""Step 2, a plot: a state chart in YAML, which uses skills and other plots and names what can go wrong."""

from typing import NewType

from step1_skill import Base, Room

from dsc import Component, Outcome, SkillCall, parse_plot, primitive_plot, skill
from knowledge_base import Delta, fact
from planning import Robot

DOMAIN = """(define (domain house) (:types room parcel)
  (:predicates (robot-in ?r - room) (lies-in ?p - parcel ?r - room) (carries ?p - parcel)))"""

FETCH = parse_plot("""
plot: fetch
parameters: {parcel: parcel, from: room, to: room}
emits: {missing: {parcel: parcel}}             # how the plot may end besides `done`
states:
  go:
    use: drive
    with: {start: ?from, to: ?to}
    on: {done: grasp}
  grasp:
    entry: {trigger: gripper.pick_up, with: {parcel: ?parcel, room: ?to}, within: 20}
    on: {picked_up: held, nothing_there: {to: lost, emit: missing, with: {parcel: ?parcel}}}
  held: {final: true}
  lost: {final: true}
""")


Parcel = NewType("Parcel", str)


class PickedUp(Outcome): ...


class NothingThere(Outcome): ...


class Gripper(Component):
    """The hand of the robot; it feels whether it holds something."""

    name = "gripper"

    def __init__(self, *shelf: str) -> None:
        super().__init__()
        self.shelf = {*shelf}

    @skill
    async def pick_up(self, call: SkillCall, parcel: Parcel, room: Room) -> PickedUp | NothingThere:
        await call.clock.sleep(3.0)
        if parcel not in self.shelf:
            return NothingThere(observed=Delta(removed=(fact("lies-in", parcel, room),)))
        self.shelf.remove(parcel)
        print(f"{call.clock.now():4.0f} s  holds the {parcel}")
        return PickedUp(observed=Delta(removed=(fact("lies-in", parcel, room),), added=(fact("carries", parcel),)))


KNOWN = Delta(
    nodes={"hall": "room", "office": "room", "letter": "parcel", "book": "parcel"},
    added=(fact("robot-in", "hall"), fact("lies-in", "letter", "office"), fact("lies-in", "book", "hall")),
)


def main() -> None:
    base = Base()
    drive = primitive_plot(base.skills()["drive"], done="arrived")
    with Robot(DOMAIN, [FETCH, drive], [base, Gripper("letter")], clock="simulated") as robot:
        robot.knowledge.apply(KNOWN, "map")
        for parcel, start, to in (("letter", "hall", "office"), ("book", "office", "hall")):
            end = robot.run("fetch", {"parcel": parcel, "from": start, "to": to})
            print(parcel, "->", end.reason)


if __name__ == "__main__":
    main()

# Expected output:
#   10 s  in the office
#   13 s  holds the letter
# letter -> the plot reached its end
#   10 s  in the hall
# book -> the plot ended with 'missing'

"""Step 9, a look: a camera returns a list of records, the plot reads its parts, and a function of Python chooses."""

from dataclasses import dataclass

from step1_skill import Room
from step2_plot import KNOWN, Gripper, Parcel

from dsc import Component, Outcome, SkillCall, conversion, parse_plot, skill
from knowledge_base import Delta, fact
from planning import Robot

DOMAIN = """(define (domain house) (:types room parcel)
  (:predicates (robot-in ?r - room) (lies-in ?p - parcel ?r - room) (carries ?p - parcel) (seen ?p - parcel)))"""


@dataclass
class Sighting:
    """A record; plots read its fields, as in `?event.parcels.0.sure`."""

    parcel: Parcel
    grams: float
    sure: float = 1.0


class Seen(Outcome):
    parcels: list[Sighting]


class Camera(Component):
    """The eye of the robot."""

    name = "camera"

    @skill
    async def look(self, call: SkillCall, room: Room) -> Seen:
        await call.clock.sleep(1.0)
        seen = [Sighting(Parcel("letter"), grams=20, sure=0.9), Sighting(Parcel("book"), grams=700, sure=0.4)]
        return Seen(parcels=seen, observed=Delta(added=tuple(fact("lies-in", one.parcel, room) for one in seen)))


@conversion
def lightest(sightings: list[Sighting]) -> Parcel:
    """Terms of plots call this function; it must be pure."""
    return min(sightings, key=lambda one: one.grams).parcel


CLEAR = parse_plot("""
plot: clear
parameters: {room: room, least: {type: number from 0 to 1, default: 0.5}}
outputs: {fetched: {type: list of parcel, initial: []}}
emits: {nothing_seen: }
variables: {found: {type: list of sighting, initial: []}}
states:
  look:
    entry: {trigger: camera.look, with: {room: ?room}}
    on:
      seen:
        - to: grasp
          when: (exists (?s - ?event.parcels) (> ?s.sure ?least))    # goes through the list
          tell: (forall (?s - ?event.parcels) (seen ?s.parcel))
          assign: {found: ?event.parcels}
        - {to: nothing, emit: nothing_seen}
  grasp:
    entry: {trigger: gripper.pick_up, with: {parcel: (lightest ?found), room: ?room}}
    on: {picked_up: {to: over, assign: {fetched: [(lightest ?found)]}}, nothing_there: over}
  over: {final: true}
  nothing: {final: true}
""")


def main() -> None:
    components = [Camera(), Gripper("letter")]
    with Robot(DOMAIN, [CLEAR], components, clock="simulated", conversions=[lightest]) as robot:
        robot.knowledge.apply(KNOWN, "map")
        end = robot.run("clear", {"room": "office"})
        print(end.outputs, "| seen:", sorted(str(one["p"]) for one in robot.knowledge.query("(seen ?p)")))


if __name__ == "__main__":
    main()

# Expected output:
#    4 s  holds the letter
# {'fetched': ['letter']} | seen: ['book', 'letter']

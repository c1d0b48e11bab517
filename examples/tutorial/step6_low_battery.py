"""Step 6, an event: a low battery interrupts every activity, and the robot continues afterwards."""

from step1_skill import Base

from dsc import Component, Event, Outcome, Sequencer, SkillCall, parse_plot, primitive_plot, skill
from knowledge_base import Delta, fact
from planning import Robot

DOMAIN = """(define (domain house) (:types room)
  (:predicates (robot-in ?r - room)))"""

PATROL = parse_plot("""
plot: patrol
receives: {low_battery: {level: number}}
states:
  there: {use: drive, with: {start: hall, to: office}, on: {done: back}}
  back: {use: drive, with: {start: office, to: hall}, on: {done: over}}
  over: {final: true}
handlers:
  - on: low_battery
    when: (< ?event.level 20)
    interrupt: true                            # the state is left, and entered again afterwards
    do: {use: charge}
""")
CHARGE = parse_plot("""
plot: charge
states:
  plug_in: {entry: {trigger: battery.charge}, on: {charged: full}}
  full: {final: true}
""")


class Charged(Outcome): ...


class Battery(Component):
    """The battery, which is charged where the robot stands."""

    name = "battery"

    @skill
    async def charge(self, call: SkillCall) -> Charged:
        await call.clock.sleep(30.0)
        print(f"{call.clock.now():4.0f} s  charged")
        return Charged()


def main() -> None:
    base = Base()
    plots = [PATROL, CHARGE, primitive_plot(base.skills()["drive"], done="arrived")]
    with Robot(DOMAIN, plots, [base, Battery()], clock="simulated") as robot:
        robot.knowledge.apply(Delta(nodes={"hall": "room", "office": "room"}, added=(fact("robot-in", "hall"),)), "map")

        def battery_falls(sequencer: Sequencer) -> None:
            sequencer.post(Event("low_battery", {"level": 60}), after=2)
            sequencer.post(Event("low_battery", {"level": 15}), after=14)

        print(robot.run("patrol", prepare=battery_falls).reason)


if __name__ == "__main__":
    main()

# Expected output:
#   10 s  in the office
#   44 s  charged
#   54 s  in the hall
# the plot reached its end

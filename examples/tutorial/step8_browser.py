"""Step 8, a robot: a bundle names all parts together, and `dsc run step8_browser.py --view` shows it in the browser."""

from step2_plot import Gripper
from step4_goal import DOMAIN, KNOWN
from step5_rule import BRING, KNOCK, Doors

from dsc import primitive_plot
from planning import Bundle, PlanningDomain, deploy

robot = Bundle(
    "porter",
    about="bring the letter",
    plots=(
        BRING,
        KNOCK,
        primitive_plot(Doors(0).skills()["drive"], done="arrived", implements="drive"),
        primitive_plot(Gripper().skills()["pick_up"], done="picked_up", implements="pick-up"),
    ),
    components=lambda: [Doors(closed=1), Gripper("letter")],
    domain=PlanningDomain.parse(DOMAIN),
    knowledge=KNOWN,
    main="bring",
    goal="(and (carries letter) (robot-in hall))",  # what the report checks
)


def main() -> None:
    with deploy(robot, clock="simulated") as deployed:
        print("\n".join(deployed.report().lines()))


if __name__ == "__main__":
    main()

# Expected output:
#   10 s  the door to the stairs is closed
#   12 s  knocked
#   22 s  in the stairs
#   32 s  in the office
#   35 s  holds the letter
#   45 s  in the stairs
#   55 s  in the hall
# Goal reached (judge: knowledge), 55 s of simulated time.
#   plans 1, replans 0
#   skill failures: door_closed 1
#   rules used: door_closed: knock, retry 1
#   candidates chosen: drive 5, pick_up 1

"""The clean-up table driven from Python: a scenario of one's own, faults, and a listener that counts grasps."""

from domains.clean_up_table import Scenario, deploy
from dsc import Record


class Grasps:
    """A listener is any callable that takes records."""

    def __init__(self) -> None:
        self.tried = 0

    def __call__(self, record: Record) -> None:
        if record.type == "action" and record.data.get("skill") == "arm.pick_up":
            self.tried += 1
        if record.type == "plan.found":
            print(f"plan with {len(record.data['steps'])} steps")


def main() -> None:
    grasps = Grasps()
    scenario = Scenario.parse("""
table: {cups: 3, cans: 2, crisp_cans: [large]}
""")
    table = deploy(scenario, seed=6, faults=0.1, listener=grasps)
    with table:
        report = table.report()
    print("goal reached:", report.goal_reached, "in", report.own["trips"], "trips")
    print("grasps tried:", grasps.tried)


if __name__ == "__main__":
    main()

# Expected output:
# plan with 15 steps
# plan with 4 steps
# goal reached: True in 3 trips
# grasps tried: 7

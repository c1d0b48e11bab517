"""Two robots clear two tables at the same time: one plan, carried out side by side where nobody has to wait."""

from pathlib import Path
from typing import NewType

from dsc import ActionPlot, Component, Outcome, Record, SkillCall, skill, uniform
from knowledge_base import Delta, Fact, fact
from planning import Planner, Robot

DOMAIN = Path(__file__).with_suffix(".pddl")
ROBOTS = ("anna", "bert")
GOAL = "(and (forall (?i - item) (disposed ?i)) (forall (?b - bin) (closed ?b)))"


Place = NewType("Place", str)
Item = NewType("Item", str)
Table = NewType("Table", str)
Bin = NewType("Bin", str)


class Acted(Outcome): ...


class Arm(Component):
    """One robot; `seed` decides how long each of its actions takes."""

    def __init__(self, name: str, seed: int = 0) -> None:
        super().__init__(name)
        self.seed = seed

    async def act(self, call: SkillCall, seconds: float, removed: list[Fact], added: list[Fact]) -> Acted:
        """Take about `seconds`; what is different then is what the robot observes."""
        await call.clock.sleep(seconds * (0.75 + 0.5 * uniform(self.seed, call.action_id, "duration")))
        return Acted(observed=Delta(removed=tuple(removed), added=tuple(added)))

    @skill
    async def drive(self, call: SkillCall, start: Place, to: Place) -> Acted:
        return await self.act(call, 8.0, [fact("robot-at", self.name, start)], [fact("robot-at", self.name, to)])

    @skill
    async def pick_up(self, call: SkillCall, item: Item, table: Table) -> Acted:
        gone = [fact("hand-free", self.name), fact("lies-at", item, table)]
        return await self.act(call, 4.0, gone, [fact("holding", self.name, item)])

    @skill
    async def throw_away(self, call: SkillCall, item: Item) -> Acted:
        come = [fact("hand-free", self.name), fact("disposed", item)]
        return await self.act(call, 3.0, [fact("holding", self.name, item)], come)

    @skill
    async def open_lid(self, call: SkillCall, bin: Bin) -> Acted:  # noqa: A002
        return await self.act(call, 2.0, [fact("closed", bin)], [fact("open", bin)])

    @skill
    async def close_lid(self, call: SkillCall, bin: Bin) -> Acted:  # noqa: A002
        return await self.act(call, 2.0, [fact("open", bin)], [fact("closed", bin)])


def plots(robot: str) -> list[ActionPlot]:
    """What one robot can do for a plan; the plan's steps say whether it is to do it."""
    actions = {
        "drive": {"start": "place", "to": "place"},
        "pick-up": {"item": "item", "table": "table"},
        "throw-away": {"item": "item"},
        "open-lid": {"bin": "bin"},
        "close-lid": {"bin": "bin"},
    }
    return [
        ActionPlot.model_validate(
            {
                "plot": f"{robot}_{action}",
                "implements": action,
                "when": f"(= ?robot {robot})",
                "parameters": {"robot": "robot", **types},
                "states": {
                    "act": {
                        "entry": {
                            "trigger": f"{robot}.{action.replace('-', '_')}",
                            "with": {name: f"?{name}" for name in types},
                        },
                        "on": {"acted": "over"},
                    },
                    "over": {"final": True},
                },
            }
        )
        for action, types in actions.items()
    ]


def team(items: dict[str, int], *, parallel: bool = True, seed: int = 0, planner: Planner | None = None) -> Robot:
    """Both robots at the bin; `items` says how many things lie on each robot's table."""
    every_plot = [plot for robot in ROBOTS for plot in plots(robot)]
    robots = [Arm(name, seed) for name in ROBOTS]
    executive = Robot(DOMAIN, every_plot, robots, planner=planner, parallel=parallel, clock="simulated")
    with executive.knowledge.transaction(author="map") as world:
        world.add_node("bin", "bin")
        world.tell("closed", "bin")
        for robot, count in items.items():
            table = f"{robot}s-table"
            world.add_node(robot, "robot")
            world.add_node(table, "table")
            world.tell("robot-at", robot, "bin")
            world.tell("hand-free", robot)
            for place in ("bin", table):
                world.tell("reaches", robot, place)
            for number in range(1, count + 1):
                world.add_node(f"{robot}s-cup{number}", "item")
                world.tell("lies-at", f"{robot}s-cup{number}", table)
    return executive


def makespan(items: dict[str, int], *, parallel: bool) -> float:
    """How long the plan takes, in simulated seconds; says so as well."""
    records: list[Record] = []
    with team(items, parallel=parallel) as robots:
        robots.listen(records.append)
        end = robots.achieve(GOAL)
        done = robots.knowledge.ask(GOAL)
    (found,) = [record for record in records if record.type == "plan.found"]
    (plot,) = [record.data["plot"] for record in records if record.type == "plot" and record.data["name"] == "plan_1"]
    flows = len(plot["states"]["work"]["regions"]) if "work" in plot["states"] else 1
    seconds = records[-1].t - found.t
    how = f"{len(found.data['steps'])} steps in {flows} region{'s' if flows > 1 else ''}"
    print(f"{how}: {seconds:.0f} s, finished: {end.finished}, both tables clear and the lid closed: {done}")
    return seconds


def main() -> None:
    items = {"anna": 4, "bert": 4}
    one_by_one = makespan(items, parallel=False)
    together = makespan(items, parallel=True)
    print(f"together they take {together / one_by_one:.2f} of the time")


if __name__ == "__main__":
    main()

# Expected output:
# 34 steps in 1 region: 188 s, finished: True, both tables clear and the lid closed: True
# 34 steps in 2 regions: 94 s, finished: True, both tables clear and the lid closed: True
# together they take 0.50 of the time

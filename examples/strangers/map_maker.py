"""A bundle by a maker of maps, who knows no laser and no battery: a component, and a plot that uses it."""

from dsc import ALWAYS, Component, Demand, Outcome, QueryClient, SkillCall, Stream, TimedTask, parse_plot, skill
from planning import Bundle


class Surveyed(Outcome):
    metres: float
    hours: float


class Cartographer(Component):
    name = "cartographer"
    modes = ("mapping",)
    needs = {"mapping": ("scan",)}
    demands = {
        ALWAYS: Demand(resources={"memory": 200}),
        "mapping": Demand(resources={"memory": 700}, tasks={"fuse": TimedTask(period=0.2, worst_case=0.05)}),
    }
    scan = Stream({"metres": "number"})
    energy = QueryClient({"watts": "number"}, answer={"hours": "number"})

    @skill
    async def survey(self, call: SkillCall) -> Surveyed:
        left = await self.energy.ask(watts=60.0, within=1)
        return Surveyed(metres=(await self.scan.next(within=1))["metres"], hours=left["hours"])


SURVEY = """
plot: survey
outputs: {metres: number, hours: number}
states:
  map:
    entry: [{switch: cartographer, to: mapping}, {trigger: cartographer.survey}]
    on: {surveyed: {to: over, assign: {metres: ?event.metres, hours: ?event.hours}}}
  over: {final: true}
"""
bundle = Bundle("maps", plots=(parse_plot(SURVEY),), components=lambda: [Cartographer()])

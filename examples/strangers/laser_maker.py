"""A bundle by a maker of lasers, who knows no map and no battery."""

from dsc import ALWAYS, Component, Demand, Push, TimedTask
from planning import Bundle


class RangeFinder(Component):
    """A laser; this simulated one always measures the same distance."""

    period = 0.05
    demands = {ALWAYS: Demand(hardware=("laser",), tasks={"step": TimedTask(period=0.05, worst_case=0.008)})}
    echo = Push({"metres": "number", "quality": "number"})

    def __init__(self, name: str, metres: float) -> None:
        super().__init__(name)
        self._metres = metres

    async def step(self) -> None:
        self.echo.put(metres=self._metres, quality=0.9)


bundle = Bundle("range-finders", components=lambda: [RangeFinder("front", 1.0), RangeFinder("rear", 2.0)])

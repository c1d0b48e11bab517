"""A bundle by a maker of batteries, who knows no robot."""

from dsc import Component, Outcome, query
from planning import Bundle


class Remaining(Outcome):
    hours: float


class Accumulator(Component):
    name = "accumulator"

    @query
    async def remaining(self, watts: float, reserve: float = 0.0) -> Remaining:
        return Remaining(hours=90.0 / watts - reserve)


bundle = Bundle("power", components=lambda: [Accumulator()])

"""The condition handler of a run: charts watch conditions over several components and the knowledge (S2.4, S2.18).

The handler of ArmarX distributes the parts of a condition to the sources, and fires an event when the whole becomes
true (Box 1 of the paper): `trigger: conditions.watch_truth`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dsc.calls import SkillCall
from dsc.components.component import Component
from dsc.components.value_conditions import WATCH_OUTCOMES, WATCH_TYPES
from dsc.outcomes import Outcome
from dsc.sensing.watched_condition import WatchedCondition, Work
from dsc.skills import Declared, SkillBody
from knowledge_base.store import KnowledgeBase

_OUTCOMES = {event: {"values": "map of any", "parts": "map of any"} for event in WATCH_OUTCOMES}


async def _watch(handler: Any, _: SkillBody, call: SkillCall[Any], arguments: Mapping[str, Any]) -> Outcome:
    condition: WatchedCondition = handler.condition(call, arguments)
    return await condition.watch()


class ConditionHandler(Component):
    """The component of each run that watches conditions for charts.

    Args:
        components: the components of the run by name.
        work: keeps a component active while it is a source.
        knowledge: the knowledge base.
    """

    name = "conditions"
    concurrent = True

    def __init__(self, components: Mapping[str, Component], work: Work, knowledge: KnowledgeBase) -> None:
        super().__init__()
        self._sources = components, work, knowledge

    @Declared(WATCH_TYPES, _OUTCOMES, _watch, own=1, pattern="event", after_crash="repeat")
    def watch_truth(
        self, condition: str, values: Mapping[str, Any] | None = None, hysteresis: float = 0.0, hold: float = 0.0
    ) -> None:
        """Report each change of a condition's truth as `became_true` or `became_false`, see `WatchedCondition`.

        The first of them reports the truth at the beginning, as soon as the known parts decide it.
        """

    def condition(self, call: SkillCall[Any], arguments: Mapping[str, Any]) -> WatchedCondition:
        """Return the condition of an execution of `watch_truth`."""
        given = {"values": {}, "hysteresis": 0.0, "hold": 0.0, **arguments}
        condition, values = given["condition"], given["values"]
        return WatchedCondition(call, condition, values, given["hysteresis"], given["hold"], *self._sources)

"""The table's own part of the report: the true state of the items, with reasons from the robot's knowledge."""

from __future__ import annotations

from dsc.sequencer.run_end import RunEnd
from knowledge_base.store import KnowledgeBase
from planning.robot.report import reason_of_end

STOPPED = "stopped"
"""The event that the plot emits if the operator stops the run."""


def reason_for(item: str, knowledge: KnowledgeBase, end: RunEnd) -> str:
    """Return the reason why an item is left, from the robot's knowledge."""
    about = {"item": item}
    if knowledge.type_of(item) is None:
        return "it was never seen"
    if not knowledge.ask("(graspable ?item)", about):
        return f"it cannot be grasped, {knowledge.value('failures', (item,)):g} tries in a row failed"
    blocked = knowledge.query("(and (goes-to ?item ?place) (not (passable ?place)))", about)
    if blocked:
        return f"no path to the {blocked[0]['place']}"
    if knowledge.ask("(missing ?item)", about):
        return "it was seen, and not found again"
    carriers = knowledge.query("(inside ?item ?carrier)", about)
    if carriers:
        carrier = str(carriers[0]["carrier"])
        return f"it is in {carrier}: {reason_for(carrier, knowledge, end)}"
    return _why_it_ended(end)


def _why_it_ended(end: RunEnd) -> str:
    if any(event.name == STOPPED for event in end.emitted):
        return "the operator stopped the run"
    return reason_of_end(end)

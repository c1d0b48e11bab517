"""The hand of any robot: it takes items, puts them down, and gives them to persons (S2.15)."""

from __future__ import annotations

from domains.fetch_skills.drivers import HandDriver
from dsc.calls import SkillCall
from dsc.components.component import Component
from dsc.outcomes import Outcome
from dsc.skills import skill
from knowledge_base.facts import Delta, fact
from knowledge_base.language.checking.inputs import require_methods


class Taken(Outcome):
    """The item is in the hand."""


class NotTaken(Outcome):
    """The item is where it was."""

    reason: str


class Released(Outcome):
    """The hand has released the item."""


class NotReleased(Outcome):
    """The item is still in the hand."""

    reason: str


class Hand(Component):
    """A hand that holds one item.

    Args:
        driver: moves the fingers, or a suction cup.
    """

    name = "hand"

    def __init__(self, driver: HandDriver) -> None:
        super().__init__()
        self._driver = require_methods(driver, HandDriver)

    @skill
    async def take(self, call: SkillCall, item: str, place: str) -> Taken | NotTaken:
        """Take an item from a place."""
        reason = await self._driver.grasp(call, item)
        if reason is not None:
            return NotTaken(reason=reason)
        return Taken(observed=Delta(added=(fact("holding", item),), removed=(fact("item-at", item, place),)))

    @skill
    async def put(self, call: SkillCall, item: str, place: str) -> Released | NotReleased:
        """Put the held item down at a place."""
        return await self._release(call, item, place)

    @skill
    async def give(self, call: SkillCall, item: str) -> Released | NotReleased:
        """Give the held item to a person."""
        return await self._release(call, item, None)

    async def _release(self, call: SkillCall, item: str, place: str | None) -> Released | NotReleased:
        reason = await self._driver.release(call, item, place)
        if reason is not None:
            return NotReleased(reason=reason)
        added = () if place is None else (fact("item-at", item, place),)
        return Released(observed=Delta(added=added, removed=(fact("holding", item),)))

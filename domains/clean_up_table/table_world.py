"""The simulated world of clean-up-table, with one method ("verb") for each skill of the robot.

Every verb receives the id of the action that it executes. For a repeated id it returns the first result and changes
nothing, so that a run can be resumed after a crash. A physically impossible call returns `not_possible` or `gone`. No
verb raises an error, and no result contradicts the world.
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Concatenate, ParamSpec, TypeVar

from domains.clean_up_table.items import DESTINATIONS, PLACES, SURFACES
from domains.clean_up_table.observations import Result, not_possible
from domains.clean_up_table.robot_body import RobotBody
from domains.clean_up_table.world_faults import ITEM_SLIPPED, NOTHING_FOUND

if TYPE_CHECKING:
    from collections.abc import Callable

_Arguments = ParamSpec("_Arguments")
_World = TypeVar("_World", bound="TableWorld")


def _verb(
    body: Callable[Concatenate[_World, str, _Arguments], Result],
) -> Callable[Concatenate[_World, str, _Arguments], Result]:
    """Decorate a verb so that each action id is executed once; a repeated id returns the first result."""

    @functools.wraps(body)
    def once(world: _World, action_id: str, /, *args: _Arguments.args, **named: _Arguments.kwargs) -> Result:
        world.catch_up()
        if action_id not in world.done:
            world.executed(action_id, body(world, action_id, *args, **named))
        return world.done[action_id]

    return once


class TableWorld(RobotBody):
    """The world on which the robot's skills act, with one method for each skill."""

    @_verb
    def drive(self, action_id: str, to: str) -> Result:
        """Drive to a place; return `arrived`, `no_path`, or `slipped` if the held item fell on the floor."""
        if to not in PLACES:
            return not_possible(f"there is no place '{to}'")
        if to in self.faults.unreachable:
            return self._no_path(to)
        if to != self.robot_at:
            self.departure = action_id, self.robot_at
        draw = self.faults.draw(action_id, self._drive_faults(to))
        if draw is None:
            return self._arrive(to)
        held = self.items.held
        if held and draw.kind == ITEM_SLIPPED:
            return self._slip(draw, action_id, held, to)
        return self._block(draw, action_id, to)

    @_verb
    def pick_up(self, action_id: str, item: str, surface: str) -> Result:
        """Grasp an item that lies on a surface; return `picked_up`, `grasp_failed`, `no_ik` or `gone`."""
        refusal = self._not_at(surface, SURFACES) or self._hand_full()
        if refusal:
            return refusal
        draw = self._meddle(action_id, self._grasp_faults(item, self._absent(item, surface)))
        return self._absent(item, surface) or self._grasp(
            draw, action_id, item, Result("picked_up", {"item": item, "surface": surface})
        )

    @_verb
    def put_down(self, action_id: str, item: str, surface: str) -> Result:
        """Put the held item on a surface; return `put_down`."""
        refusal = self._not_at(surface, SURFACES) or self._not_held(item)
        if refusal:
            return refusal
        self._meddle(action_id, {})
        self.items.move(self.items[item], surface)
        return Result("put_down", {"item": item, "surface": surface})

    @_verb
    def stack(self, action_id: str, item: str, carrier: str, surface: str) -> Result:
        """Put the held item into a carrier on a surface; return `stacked`, `stack_fell` or `gone`."""
        refusal = (
            self._not_at(surface, SURFACES)
            or self._not_held(item)
            or self._absent(carrier, surface)
            or self._no_room(item, carrier)
        )
        if refusal:
            return refusal
        draw = self._meddle(action_id, self._stack_faults(carrier), keep=carrier)
        if draw:
            return self._fall(draw, action_id, item, carrier, surface)
        return self._stack(item, carrier, surface)

    @_verb
    def take_out(self, action_id: str, item: str, carrier: str, surface: str) -> Result:
        """Grasp an item that is directly in a carrier; return `taken_out`, `grasp_failed`, `no_ik` or `gone`."""
        refusal = self._not_at(surface, SURFACES) or self._hand_full()
        if refusal:
            return refusal
        draw = self._meddle(action_id, self._grasp_faults(item, self._not_inside(item, carrier, surface)))
        attributes = {"item": item, "carrier": carrier, "surface": surface}
        result = self._not_inside(item, carrier, surface) or self._grasp(
            draw, action_id, item, Result("taken_out", attributes, apart=((item, carrier),))
        )
        return self._with_room(result, carrier) if result.outcome == "taken_out" else result

    @_verb
    def look_into(self, action_id: str, carrier: str, surface: str) -> Result:
        """Inspect a carrier, which closes one unit of its free room; return `looked` or `gone`."""
        refusal = self._not_at(surface, SURFACES) or self._absent(carrier, surface)
        if refusal:
            return refusal
        self._meddle(action_id, {}, keep=carrier)
        looked = self.items[carrier]
        looked.closed = min(looked.closed + 1, self.items.free_room(looked))
        return self._with_room(Result("looked", {"carrier": carrier, "surface": surface}), carrier)

    @_verb
    def throw_away(self, action_id: str, item: str, destination: str) -> Result:
        """Throw the held item, with all items in it, into its destination; return `thrown_away`."""
        refusal = self._not_at(destination, DESTINATIONS) or self._not_held(item)
        if refusal:
            return refusal
        thrown = self.items[item]
        if thrown.destination != destination:
            return not_possible(f"a {thrown.kind} does not go to the {destination}")
        self._meddle(action_id, {})
        stack = self.items.stack(thrown)
        sightings = tuple(self._sighting(each) for each in stack)
        apart = tuple((each.name, each.where) for each in stack[1:])
        for each in stack:
            each.where = destination
        self.trips += 1
        return Result("thrown_away", {"item": item, "destination": destination}, sightings, apart)

    @_verb
    def recognise(self, action_id: str, surface: str) -> Result:
        """Recognise the visible items on a surface; return `recognised` with these items, or `nothing_found`."""
        refusal = self._not_at(surface, SURFACES)
        if refusal:
            return refusal
        visible = self._visible(surface)
        bare = [item for item in visible if not self.items.contents(item)]
        possible = {NOTHING_FOUND: bool(bare)} if visible and self.faults.may_fail("look", surface) else {}
        draw = self.faults.draw(action_id, possible)
        if draw:
            return self._overlook(draw, action_id, surface, bare)
        self.faults.passed("look", surface)
        return self._see(surface, visible)

    @_verb
    def say(self, _action_id: str, text: str) -> Result:
        """Speak a text to the operator; return `said`."""
        self.said.append(text)
        return Result("said", {"text": text})

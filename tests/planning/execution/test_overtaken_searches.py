"""In a world that changes faster than plans are made, the last executable plan begins after three searches."""

from __future__ import annotations

import pytest

from dsc import Component, Outcome, SkillCall, primitive_plot, skill
from dsc.trace import Record
from knowledge_base import Delta, fact
from planning import Robot

DOMAIN = """
(define (domain washing)
  (:types item)
  (:predicates (clean ?i - item))
  (:action wash :parameters (?i - item) :precondition (not (clean ?i)) :effect (clean ?i)))
"""


class Washed(Outcome): ...


class Arm(Component):
    name = "arm"

    def __init__(self):
        super().__init__()
        self.log = []

    @skill
    async def wash(self, call: SkillCall, i: str) -> Washed:
        self.log.append((call.clock.now(), i))
        await call.clock.sleep(2)
        return Washed(observed=Delta(added=(fact("clean", i),)))


@pytest.mark.parametrize("every", [0.02, 0.05])
def test_a_robot_begins_although_things_come_and_go_all_the_time(every):
    arm, records = Arm(), list[Record]()
    plots = [primitive_plot(arm.skills()["wash"], done="washed", implements="wash")]

    def prepare(sequencer):
        for number in range(400):
            came, gone = every * (number + 1), every * (number + 2)
            sequencer.change(Delta(nodes={f"n{number}": "item"}), "camera", after=came)
            sequencer.change(Delta(removed_nodes=(f"n{number}",)), "camera", after=gone)

    with Robot(DOMAIN, plots, [arm], clock="simulated") as robot:
        robot.knowledge.apply(Delta(nodes={"a": "item", "b": "item"}), "test")
        robot.listen(records.append)
        end = robot.achieve("(forall (?i - item) (clean ?i))", prepare=prepare)
    assert end.reached
    assert [item for _, item in arm.log] == ["a", "b"]
    assert arm.log[0][0] < 1
    (overtaken, *_) = [one.data for one in records if one.type == "plan.overtaken"]
    assert overtaken["searches"] == 3

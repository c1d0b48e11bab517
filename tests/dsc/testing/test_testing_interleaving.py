"""What comes at one moment comes in an order of the seed, and what comes from one place in its own."""

from __future__ import annotations

import itertools
from typing import Any

import pytest
from dsc_charts import plot
from dsc_runs import SCHEMA

from dsc import Component, Library, Outcome, Sequencer, SkillCall, skill
from dsc.events import Event
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.testing import Interleaving
from knowledge_base import Delta, KnowledgeBase
from knowledge_base.facts import Fact

TWO = """
plot: two
receives: {stop: }
states:
  both:
    regions:
      left:
        states:
          work: {entry: {trigger: left.work}, on: {said: {}, did: rest}}
          rest: {final: true}
      right:
        states:
          help: {entry: {trigger: right.work}, on: {said: {}, did: done_}}
          done_: {final: true}
    after: {seconds: 2, to: late}
    on: {done: over, stop: late}
  late: {after: {seconds: 1, to: over}}
  over: {final: true}
"""


class Did(Outcome): ...


class Said(Outcome): ...


class Side(Component):
    @skill
    async def work(self, call: SkillCall[Said]) -> Did:
        await call.clock.sleep(2)
        call.report(Said())
        return Did()


def heard(interleaving):
    """Who was heard in which order, as far as anybody listened."""
    order: list[Any] = []

    async def main():
        clock = LoopClock()
        knowledge = KnowledgeBase(SCHEMA)
        sequencer = Sequencer(Library([plot(TWO)]), knowledge, [Side("left"), Side("right")], clock)
        if interleaving is not None:
            interleaving.attach(sequencer)
        sequencer.trace.listen(order.append)
        sequencer.post(Event("stop"), after=2)
        sequencer.change(Delta(added=(Fact("p"),)), "somebody", after=2)
        end = await sequencer.run("two")
        return end.finished, clock.now()

    assert run_simulated(main())[0]
    return tuple(
        one.data["author"] if one.type == "knowledge" else f"{one.data['source']} {one.data['name']}"
        for one in order
        if one.type in {"event", "knowledge"} and one.t == 2
    )


def test_without_it_the_order_is_that_in_which_it_was_asked_for():
    assert heard(None) == heard(None)


def test_a_seed_is_an_order():
    orders = [heard(Interleaving(seed)) for seed in range(40)]
    assert orders == [heard(Interleaving(seed)) for seed in range(40)]
    assert len(set(orders)) > 10


@pytest.mark.parametrize(
    ("one", "other"),
    [*itertools.permutations(["left.work said", "right.work said", "timer after", "outside stop", "somebody"], 2)],
)
def test_inputs_from_two_places_come_in_either_order(one, other):
    for seed in range(60):
        order = heard(Interleaving(seed))
        if one in order and other in order and order.index(one) < order.index(other):
            return
    pytest.fail(f"{one} never came before {other}")


def test_inputs_from_one_place_keep_their_order():
    for seed in range(60):
        order = [one for one in heard(Interleaving(seed)) if one.startswith("left")]
        assert order == ["left.work said", "left.work did"][: len(order)]


def test_it_says_how_often_it_made_a_difference():
    interleaving = Interleaving(3)
    assert interleaving.turned == 0
    heard(interleaving)
    assert interleaving.turned > 0

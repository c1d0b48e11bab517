"""Seeded faults around components and sequencers: each happens as it says, to whom it is drawn for, and to no one else."""

from __future__ import annotations

import pytest
from dsc_charts import plot
from dsc_runs import SCHEMA

from dsc import Component, Library, Outcome, Sequencer, event, skill
from dsc.events import Event
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.testing import Fault, Faults, trail
from knowledge_base import Delta, InputError, KnowledgeBase
from knowledge_base.facts import Fact, fact

GO = """
plot: go
states:
  work:
    entry: {trigger: robot.work, within: 60}
    on: {did: done_, skill_error: failed, timed_out: late}
  done_: {final: true}
  failed: {final: true}
  late: {final: true}
"""
WATCH = """
plot: watch
variables: {n: {type: number, initial: 0}}
states:
  watching:
    entry: [{trigger: robot.beat}, {trigger: robot.work, with: {times: 8}}]
    on: {beat: {assign: {n: "(+ ?n 1)"}}, did: waiting}
    every: {seconds: 100, to: over}
  waiting: {after: {seconds: 50, to: over}}
  over: {final: true}
"""


class Did(Outcome): ...


class Beat(Outcome):
    n: float


class Robot(Component):
    name = "robot"

    def __init__(self):
        super().__init__()
        self.done = []
        self.heard = []

    @skill
    async def work(self, call, times=1) -> Did:
        for n in range(times):
            await call.clock.sleep(2)
            self.done.append(call.action_id)
            self.update("beat", float(n))
        return Did(observed=Delta(added=(Fact("p"),)))

    @event
    def beat(self, n: float) -> Beat | None:
        return Beat(n=n) if n % 2 else None


def run(faults, text=GO, changes=None, interrupts=None):
    """How it ended, at which second, the last state that was entered, the robot, what is known, each step with its time."""
    robot, kb, seen = faults.inject(Robot()), KnowledgeBase(SCHEMA), []

    async def main():
        clock = LoopClock()
        sequencer = Sequencer(Library([plot(text)]), kb, [robot], clock)
        sequencer.listen(lambda step: seen.append((clock.now(), step)))
        if changes is not None:
            faults.meddle(sequencer, lambda: changes)
        if interrupts is not None:
            faults.interrupt(sequencer, interrupts, 1.0)
        end = await sequencer.run(plot(text).name)
        return end, clock.now(), trail([step for _, step in seen])[-1]

    return *run_simulated(main()), robot, kb, seen


@pytest.mark.parametrize(
    ("fault", "last", "seconds", "times"),
    [
        (Fault.SKILL_FAILS, "failed", 0, 0),
        (Fault.SKILL_HANGS, "late", 60, 0),
        (Fault.COMPONENT_DIES, "failed", 0, 0),
        (Fault.ANSWER_LOST, "late", 60, 1),
        (Fault.ANSWER_TWICE, "done_", 2, 1),
    ],
)
def test_a_skill_ends_as_the_fault_says(fault, last, seconds, times):
    faults = Faults(1, 1.0, {fault})
    end, at, entered, robot, kb, _ = run(faults)
    assert end.finished
    assert (entered, at, len(robot.done)) == (last, seconds, times)
    assert kb.ask("(p)") == (last == "done_")
    assert list(faults.counts()) == [fault]


def test_an_answer_comes_late_and_within_its_time():
    ends = [run(Faults(seed, 1.0, {Fault.ANSWER_LATE})) for seed in range(5)]
    assert all(end[2] == "done_" and 2 < end[1] < 7 for end in ends)
    assert len({end[1] for end in ends}) == 5


def test_a_component_that_died_is_back_after_a_while():
    text = GO.replace("skill_error: failed", "skill_error: again") + "  again: {after: {seconds: 30, to: work}}\n"
    seed = next(s for s in range(99) if _falls(s, "a2.0") and not _falls(s, "a3.0") and not _falls(s, "a4.0"))
    faults = Faults(seed, 0.5, {Fault.COMPONENT_DIES})
    end, at, entered, *_ = run(faults, text)
    assert (end.problem, entered, at) == (None, "done_", 32)
    assert len(faults.fired) == 1


def _falls(seed, action_id):
    return Faults(seed, 0.5, {Fault.COMPONENT_DIES}).draw(action_id, [Fault.COMPONENT_DIES])


@pytest.mark.parametrize(("kinds", "beats"), [((), 4), ((Fault.EVENT_TWICE,), 8), ((Fault.EVENT_LATE,), 4)])
def test_events_come_twice_or_late_and_are_never_lost(kinds, beats):
    text = WATCH.replace("did: waiting", "did: {}")
    *_, seen = run(Faults(3, 1.0, kinds), text)
    heard = [(at, step) for at, step in seen if step.event is not None and step.event.name == "beat"]
    assert len(heard) == beats
    numbers = [step.event.attributes["n"] for _, step in heard]
    assert sorted(set(numbers)) == [1, 3, 5, 7]
    if Fault.EVENT_LATE in kinds:
        assert all(0 < at - 2 * (n + 1) <= 5 for (at, _), n in zip(heard, numbers, strict=True))


def test_events_that_are_late_may_overtake_each_other():
    orders = set()
    for seed in range(10):
        *_, seen = run(Faults(seed, 1.0, {Fault.EVENT_LATE}), WATCH.replace("did: waiting", "did: {}"))
        orders.add(tuple(s.event.attributes["n"] for _, s in seen if s.event is not None and s.event.name == "beat"))
    assert len(orders) > 1


def test_somebody_changes_the_knowledge_while_an_action_is_under_way():
    faults = Faults(2, 1.0, {Fault.KNOWLEDGE_CHANGED})
    *_, kb, _ = run(faults, GO.replace("did: done_", "did: {}"), [Delta(added=(fact("q"),))])
    assert kb.ask("(q)")
    (change,) = [change for change in kb.changes(0) if change.author == "somebody"]
    assert change.delta.added == (fact("q"),)


def test_somebody_interrupts_while_an_action_is_under_way():
    text = GO.replace("plot: go", "plot: go\nreceives: {stop: }").replace("did: done_,", "did: {}, stop: failed,")
    text = text.replace("within: 60}", "within: 60}\n    after: {seconds: 50, to: late}")
    ends = [run(Faults(seed, 1.0, {Fault.INTERRUPTED}), text, interrupts=Event("stop")) for seed in range(50)]
    assert {entered for _, _, entered, *_ in ends} == {"failed"}
    seconds = [at for _, at, *_ in ends]
    assert all(0 < at <= 5 for at in seconds)
    assert 15 < seconds.count(2) < 35  # just when the action ends


def test_an_interruption_is_as_rare_as_is_said():
    faults = Faults(1, 0.5, {Fault.INTERRUPTED})
    drawn = [faults.draw(f"a{n}", [Fault.INTERRUPTED], 0.2) for n in range(1000)]
    assert 60 < sum(one is not None for one in drawn) < 140


def test_an_answer_that_is_late_is_given_at_once_when_the_action_is_cancelled():
    text = GO.replace("plot: go", "plot: go\nreceives: {stop: }").replace("did: done_,", "did: {}, stop: waiting,")
    text += "  waiting: {after: {seconds: 50, to: failed}}\n"
    known = set()
    for seed in range(60):
        faults = Faults(seed, 1.0, {Fault.INTERRUPTED, Fault.ANSWER_LATE})
        *_, robot, kb, seen = run(faults, text, interrupts=Event("stop"))
        assert kb.ask("(p)") == bool(robot.done)  # what was done is known, though nobody waits for it
        known.add((bool(robot.done), next(step.event.name for _, step in seen if step.event)))
    assert known >= {(False, "stop"), (True, "stop"), (True, "did")}


def test_faults_depend_on_seed_and_action_alone():
    ids = [f"a{n}.0" for n in range(400)]

    def drawn(seed, order):
        faults = Faults(seed, 0.3)
        for one in order:
            faults.draw(one, list(Fault))
        return faults.fired

    assert drawn(1, ids) == drawn(1, reversed(ids)) == drawn(1, ids * 2)
    assert drawn(1, ids) != drawn(2, ids)
    assert 80 < len(drawn(1, ids)) < 160
    assert Fault.ANSWER_LOST not in drawn(1, ids).values()  # has to be asked for
    assert len(set(drawn(1, ids).values())) == len(Fault) - 1


def test_a_chance_is_between_0_and_1():
    with pytest.raises(InputError, match=r"between 0 and 1, not 1\.5"):
        Faults(1, 1.5)


def test_nothing_hits_a_component_without_faults():
    end, at, entered, robot, *_ = run(Faults(1, 0.0))
    assert (end.finished, at, entered, len(robot.done)) == (True, 2, "done_", 1)

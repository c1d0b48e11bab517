"""A message is in the store from its own commit on: scheduled ones before they arrive, answers each apart."""

from __future__ import annotations

import asyncio
from itertools import pairwise
from pathlib import Path
from typing import Any

from dsc_crashes import Robot, Run, copied

from dsc.events import Event
from dsc.runs.archive import archive
from dsc.sequencer.sequencer import Sequencer
from knowledge_base.facts import Delta, Fact

WAITS = """
    plot: p
    receives: {first: , second: }
    states:
      a: {on: {first: b}}
      b: {on: {second: e}}
      e: {final: true}
"""
BOTH = """
    plot: p
    states:
      a:
        regions:
          x: {states: {w: {entry: {trigger: robot.work, with: {seconds: 2}}, on: {did: f}}, f: }}
          y: {states: {v: {entry: {trigger: other.work, with: {seconds: 2}}, on: {did: g}}, g: }}
        after: {seconds: 10, to: e}
      e: {final: true}
"""


def at(second: float, what: Any) -> None:
    """Call `what` at that second of the run."""
    asyncio.get_running_loop().call_later(second, what)


def copying(folder: Path, name: str) -> Any:
    """Return a function that leaves a copy of the run as `kill -9` would leave it."""
    return lambda: copied(folder, folder.parent / name)


def test_a_message_scheduled_while_the_run_waits_survives_a_crash_before_the_next_macrostep(tmp_path: Path) -> None:
    alive = tmp_path / "alive"
    alive.mkdir()

    def prepare(sequencer: Sequencer) -> None:
        sequencer.post(Event("second"), after=30)
        at(1, lambda: sequencer.post(Event("first"), after=10))
        at(2, copying(alive, "copy"))

    Run(alive, [WAITS], prepare=prepare)
    run = Run(tmp_path / "copy", [WAITS], resume=True)
    assert (run.end.finished, [step.time for step in run.steps]) == (True, [0, 11, 30])


def test_messages_scheduled_before_and_after_a_resume_are_told_apart(tmp_path: Path) -> None:
    """The later life schedules an earlier message; its arrival must not remove the one of the life before."""
    alive = tmp_path / "alive"
    alive.mkdir()

    def first(sequencer: Sequencer) -> None:
        at(1, lambda: sequencer.post(Event("second"), after=10))
        at(2, copying(alive, "second"))
        sequencer.post(Event("first"), after=20)  # ends this life, whose copy goes on

    def second(sequencer: Sequencer) -> None:
        at(3, lambda: sequencer.post(Event("first"), after=2))
        at(8, copying(tmp_path / "second", "third"))

    text = WAITS.replace("second: e", "second: e, first: e")
    Run(alive, [text], prepare=first)
    Run(tmp_path / "second", [text], resume=True, prepare=second)
    run = Run(tmp_path / "third", [text], resume=True)
    assert [step.time for step in run.steps] == [0, 5, 11]


def test_grouped_macrosteps_have_consecutive_versions_of_the_knowledge(tmp_path: Path) -> None:
    def prepare(sequencer: Sequencer) -> None:
        for n in range(4):
            sequencer.change(Delta(added=(Fact("p"),)) if n % 2 == 0 else Delta(removed=(Fact("p"),)), "me", after=1)
        sequencer.post(Event("first"), after=2)
        sequencer.post(Event("second"), after=3)

    run = Run(tmp_path, [WAITS], prepare=prepare)
    versions = [(step.before, step.version) for step in run.steps]
    assert [version for _, version in versions][1:5] == [1, 2, 3, 4]
    assert all(one[1] == other[0] for one, other in pairwise(versions))


class Other(Robot):
    name = "other"


def test_each_answer_of_a_component_has_a_commit_of_its_own_and_settles_its_skill(tmp_path: Path) -> None:
    forgotten: list[str] = []
    working: list[Any] = []
    commits: list[float] = []

    class Forgets(Robot):
        async def forget(self, action_id: str) -> None:
            forgotten.append(action_id)

    robot = Forgets()

    def prepare(sequencer: Sequencer) -> None:
        sequencer.dispatcher.deploy(Other())
        sequencer.post(Event("noise"), after=2)
        assert sequencer.store is not None
        sequencer.store.writing.listen(
            lambda boundary: commits.append(sequencer.clock.now()) if boundary == "after commit" else None
        )
        at(5, lambda: working.append(sequencer.diagnose()["working"]))

    run = Run(tmp_path, [BOTH.replace("plot: p", "plot: p\n    receives: {noise: }")], robot=robot, prepare=prepare)
    assert run.end.finished
    assert working == [[]]
    assert len(forgotten) == 1
    answers = [step for step in run.steps if "action" in step.message]
    assert len(answers) == 2
    assert commits.count(2.0) >= 2


def test_the_causes_of_cancelled_skills_do_not_accumulate_in_the_store(tmp_path: Path) -> None:
    text = """
        plot: p
        variables: {n: {type: number, initial: 0}}
        states:
          a: {entry: [{trigger: robot.work, with: {seconds: 9}}], after: {seconds: 0.5, to: b}}
          b: {entry: {assign: {n: (+ ?n 1)}}, always: [{to: a, when: (< ?n 1500)}, {to: e}]}
          e: {final: true}
    """
    causes: list[int] = []

    def prepare(sequencer: Sequencer) -> None:
        at(740, lambda: causes.append(len(sequencer._reactor.caused_by)))

    Run(tmp_path, [text], prepare=prepare)
    with archive(tmp_path / "run.kb") as runs:
        assert runs.run().ended
    assert causes[0] <= 1_001


def test_an_answer_after_a_restart_is_caused_by_the_start_of_its_skill(tmp_path: Path) -> None:
    alive = tmp_path / "alive"
    alive.mkdir()
    text = """
        plot: p
        states:
          a: {entry: {trigger: robot.work, with: {seconds: 20}}, on: {did: e}}
          e: {final: true}
    """
    whole = Run(alive, [text], prepare=lambda _: at(2, copying(alive, "copy")))
    resumed = Run(tmp_path / "copy", [text], resume=True)
    (start,) = [one.seq for one in whole.records if one.type == "action" and one.data["action"] == "start"]
    for run in (whole, resumed):
        assert [one.cause for one in run.records if one.type == "event" and one.data["name"] == "did"] == [start]

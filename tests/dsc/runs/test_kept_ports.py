"""Everything that leaves a chart outlives a crash: messages, modes, parameters, events that were activated, queries."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest
from dsc_charts import plot
from dsc_crashes import Crashes, Robot, Run, copied
from dsc_runs import SCHEMA

from dsc.blocking import BlockingCall
from dsc.components.behaviour_trees import action, sequence, tree_skill
from dsc.components.ports import event, query, takes
from dsc.dynamic.library import Library
from dsc.events import Event
from dsc.outcomes import Outcome
from dsc.sequencer.plot_skill import PlotComponent
from dsc.skills import skill
from knowledge_base.facts import Delta, Fact
from knowledge_base.store import KnowledgeBase


class Low(Outcome):
    level: float


class Count(Outcome):
    n: float


class Seen(Outcome): ...


class Did(Outcome): ...


class Failed(Outcome): ...


class Station(Robot):
    """A robot with all ports; what it was told it remembers, as one that never died would."""

    modes = ("careful", "fast")

    def __init__(self, done=(), crash=lambda: None):
        super().__init__(done, crash)
        self.abandoned = []

    def remember(self):
        return [list(one) for one in self.told]

    def recall(self, memory):
        self.told = [tuple(one) for one in memory]

    async def start(self):
        self.told.append(("life", "started"))

    async def stop(self):
        self.told.append(("life", "stopped"))

    async def abandon(self, action_id, skill_name, arguments):
        self.abandoned.append(skill_name)

    @takes
    async def note(self, text):
        self.told.append(("note", text))

    @takes
    async def slow_note(self, text):
        await asyncio.sleep(3)
        self.told.append(("note", text))

    @event
    def low(self, level: float, below: float = 20.0) -> Low | None:
        return Low(level=level) if level < below else None

    @query
    async def count(self) -> Count:
        return Count(n=7)

    @skill(after_crash="same_id")
    async def sees_nonsense(self, call) -> Seen:
        call.report(Seen(observed=Delta(added=(Fact("nonsense"),))))
        await call.clock.sleep(50)
        return Seen()

    @skill(blocking="thread", after_crash="repeat")
    def block(self, call: BlockingCall) -> Did:
        call.sleep(0.001)
        return Did()

    @tree_skill(success=Did, failure=Failed, after_crash="repeat")
    def climb(self, call):
        async def nap():
            await call.clock.sleep(1)
            return Outcome("rested")

        return sequence(action("one", nap, ends={"rested"}), action("two", nap, ends={"rested"}))


def crashes(tmp_path, chart, prepare=None):
    return Crashes(tmp_path, chart, prepare=prepare, make=Station)


def notes(told):
    return [text for kind, text in told if kind == "note"]


MESSAGES = """
    plot: p
    states:
      a:
        entry: [{send: robot.note, with: {text: one}}, {send: robot.slow_note, with: {text: two}}, {send: robot.note, with: {text: three}}]
        after: {seconds: 1, to: b}
      b: {entry: [{send: robot.note, with: {text: four}}], after: {seconds: 1, to: c}}
      c: {after: {seconds: 2, to: d}}
      d: {entry: [{trigger: robot.work}], on: {did: e}}
      e: {final: true}
"""


def test_a_message_that_was_not_taken_is_sent_again_in_order(tmp_path):
    whole = crashes(tmp_path, MESSAGES)
    assert notes(whole.whole.robot.told) == ["one", "two", "three", "four"]
    for what, run in whole.resumed():
        told = notes(run.robot.told)
        assert list(dict.fromkeys(told)) == ["one", "two", "three", "four"], what
        assert (run.end, run.robot.done) == (whole.whole.end, whole.whole.robot.done), what


def test_a_message_that_was_taken_is_not_sent_again(tmp_path):
    whole = crashes(tmp_path, MESSAGES)
    _, last = list(whole.resumed())[-1]
    assert notes(last.robot.told) == ["one", "two", "three", "four"]


HURRY = """
    plot: p
    receives: {go: {}}
    states:
      a: {on: {go: b}}
      b: {entry: [{set: robot.speed, to: 1}], on: {go: c}}
      c: {entry: [{set: robot.speed, to: 2}], on: {go: d}}
      d: {entry: [{set: robot.speed, to: 3}], on: {go: f}}
      f: {entry: [{trigger: robot.work}], on: {did: e}}
      e: {final: true}
"""


def test_no_parameter_is_passed_over_that_a_component_has_not_taken(tmp_path):
    """Several macrosteps may be over before a component comes to its turn."""

    def prepare(sequencer):
        for _ in range(4):
            sequencer.post(Event("go"), after=1)

    whole = crashes(tmp_path, HURRY, prepare)
    for what, run in whole.resumed():
        speeds = [value for name, value in run.robot.told if name == "speed"]
        assert list(dict.fromkeys(speeds)) == [1, 2, 3], what
        assert run.robot.parameters == {"speed": 3}, what


LIVES = """
    plot: p
    states:
      a: {entry: [{switch: robot, to: careful}, {trigger: robot.work}], on: {did: b}}
      b: {entry: [{switch: robot, to: shutdown}], after: {seconds: 1, to: c}}
      c: {entry: [{switch: robot, to: init}, {trigger: robot.work}], on: {did: d}}
      d: {entry: [{trigger: robot.work}], on: {did: e}}
      e: {final: true}
"""


def test_mode_and_life_are_as_they_were(tmp_path):
    whole = crashes(tmp_path, LIVES)
    for what, run in whole.resumed():
        assert run.outcome() == whole.whole.outcome(), what
        assert (run.robot.mode, run.robot.life.state) == ("careful", "init"), what


def test_a_component_to_be_restarted_before_a_crash_starts_once_after_it(tmp_path):
    whole = crashes(tmp_path, LIVES)
    _, done, folder = whole.copies[-1]
    robot = Station(done)
    Run(folder, whole.plots, robot=robot, resume=True)
    assert robot.told.count(("life", "started")) == 1 + 2  # in the lives before, and now


WATCHED = """
    plot: p
    variables: {n: {type: number, initial: 0}}
    states:
      a:
        entry: [{trigger: robot.low, with: {below: 18}, as: {low: low_bat}}, {trigger: robot.work, with: {seconds: 10}}]
        on: {low_bat: {assign: {n: (+ ?n 1)}}, did: [{to: e, when: (= ?n 2)}, wrong]}
      wrong:
      e: {final: true}
"""


def test_an_event_is_activated_again_and_what_holds_then_is_told(tmp_path):
    alive = tmp_path / "alive"
    copies: list[Path] = []
    alive.mkdir()

    def at(seconds, level):
        def prepare(sequencer):
            robot = sequencer.dispatcher.component("robot")
            sequencer.clock.call_at(seconds, lambda: robot.update("low", level))
            sequencer.listen(lambda _: copies.append(copied(alive, tmp_path / f"c{len(copies)}")))

        return prepare

    Run(alive, [WATCHED], robot=Station(), prepare=at(1, 15))
    after_the_event = copies[2]
    run = Run(after_the_event, [WATCHED], robot=Station(), prepare=at(4, 12), resume=True)
    assert run.end.finished


def test_a_query_is_asked_again(tmp_path):
    whole = crashes(
        tmp_path,
        """
        plot: p
        states:
          a: {entry: [{trigger: robot.count}], on: {answered: [{to: b, when: (= ?event.n 7)}]}}
          b: {entry: [{trigger: robot.work}], on: {did: e}}
          e: {final: true}
    """,
    )
    for what, run in whole.resumed():
        assert run.outcome() == whole.whole.outcome(), what


@pytest.mark.parametrize("name", ["block", "climb"])
def test_blocking_skills_and_behaviour_trees_are_done_again_if_they_say_so(tmp_path, name):
    whole = crashes(
        tmp_path,
        f"""
        plot: p
        states:
          a: {{entry: [{{trigger: robot.{name}}}], after: {{seconds: 1.5, do: [{{tell: (told)}}]}}, on: {{did: b}}}}
          b: {{entry: [{{trigger: robot.work}}], on: {{did: e}}}}
          e: {{final: true}}
    """,
    )
    assert whole.whole.end.finished
    for what, run in whole.resumed():
        assert (run.end, run.facts, run.robot.done) == (whole.whole.end, whole.whole.facts, whole.whole.robot.done), (
            what
        )


class Composed(PlotComponent):
    """Works twice, and says so in between."""

    def __init__(self, done=(), crash=lambda: None):
        self.inside = Robot(done, crash)
        twice = plot("""
            plot: twice
            emits: {half: {n: number}}
            states:
              a: {entry: {trigger: robot.work}, on: {did: {to: b, emit: half, with: {n: ?event.n}}}}
              b: {entry: {trigger: robot.work}, on: {did: e}}
              e: {final: true}
        """)
        super().__init__("robot", Library([twice]), [self.inside], lambda: KnowledgeBase(SCHEMA), after_crash="repeat")

    @property
    def done(self):
        return self.inside.done


def test_a_plot_that_is_a_skill_is_done_again_if_it_says_so(tmp_path):
    whole = Crashes(
        tmp_path,
        """
        plot: p
        variables: {halves: {type: number, initial: 0}}
        states:
          a: {entry: {trigger: robot.twice}, on: {half: {assign: {halves: (+ ?halves 1)}}, completed: [{to: e, when: (= ?halves 1)}, wrong]}}
          wrong:
          e: {final: true}
    """,
        make=Composed,
    )
    assert whole.whole.end.finished
    assert list(whole.whole.robot.done.values()) == [1, 2]
    for what, run in whole.resumed():
        assert (run.end, run.robot.done) == (whole.whole.end, whole.whole.robot.done), what


@pytest.mark.parametrize("error", [ValueError("no such data"), SystemExit("no such data")])
def test_data_that_a_component_cannot_recall_end_the_run_with_that(tmp_path, error):
    class Forgetful(Station):
        def recall(self, memory):
            raise error

    whole = Crashes(tmp_path, MESSAGES, make=Forgetful)
    what, run = list(whole.resumed())[-1]
    assert not run.end.finished, what
    assert "component 'robot' cannot recall its data" in run.end.problem
    assert "no such data" in run.end.problem


def test_a_skill_that_was_not_believed_is_stopped_even_if_the_crash_came_first(tmp_path):
    whole = crashes(
        tmp_path,
        """
        plot: p
        states:
          a: {entry: [{trigger: robot.sees_nonsense}], on: {programming_error: b, seen: wrong}}
          b: {entry: [{trigger: robot.work}], on: {did: e}}
          wrong:
          e: {final: true}
    """,
    )
    assert whole.whole.end.finished
    abandoned = []
    for what, run in whole.resumed():
        assert run.outcome() == whole.whole.outcome(), what
        abandoned.append(run.robot.abandoned)
    assert abandoned == [[], ["sees_nonsense"], ["sees_nonsense"]]

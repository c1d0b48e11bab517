"""A run that is kept goes on after a crash at any boundary, and comes to the same end by the same steps."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest
from dsc_crashes import Crashes, Robot, Run, copied
from dsc_kept_charts import CHARTS, handed_in
from dsc_runs import SCHEMA, Ran

from dsc.calls import Ended, Status
from dsc.components.parameters import Parameters, parameter
from dsc.dynamic.library import Library
from dsc.errors import ChangedError
from dsc.events import Event
from dsc.outcomes import Outcome
from dsc.runs import store as store_module
from dsc.runs.archive import archive, has_run, is_unfinished, records_of
from dsc.runs.store import RunStore, RunWriter
from dsc.sequencer.replay import replay
from dsc.sequencer.run_end import RunEnd
from dsc.sequencer.sequencer import Sequencer
from dsc.skills import skill
from knowledge_base.errors import Place, StoreError, UnknownNameError
from knowledge_base.facts import Delta, fact
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema import Schema


@pytest.mark.parametrize("chart", CHARTS.values(), ids=CHARTS)
def test_wherever_it_is_broken_off_it_comes_to_the_same_end_by_the_same_steps(tmp_path, chart):
    crashes = Crashes(tmp_path, chart)
    assert len(crashes.copies) > 3
    for what, run in crashes.resumed():
        assert run.outcome() == crashes.whole.outcome(), what


def test_delayed_events_and_changes_come_at_their_time_after_a_crash(tmp_path):
    chart = """
        plot: p
        receives: {go: {n: number}}
        states:
          a: {on: {go: b}}
          b: {entry: [{trigger: robot.work, with: {seconds: 20}}], always: {to: c, when: (q)}}
          c: {on: {go: {to: e, when: (= ?event.n 2)}}}
          e: {final: true}
    """
    crashes = Crashes(tmp_path, chart, prepare=handed_in)
    assert crashes.whole.at == 9
    for what, run in crashes.resumed():
        assert run.outcome() == crashes.whole.outcome(), what


def test_more_may_be_handed_in_when_it_is_resumed(tmp_path):
    chart = """
        plot: p
        receives: {go: {n: number}}
        variables: {sum: {type: number, initial: 0}}
        states:
          a: {after: {seconds: 20, to: e}, on: {go: [{to: e, when: (= ?event.n 3)}, {assign: {sum: (+ ?sum ?event.n)}}]}}
          e: {final: true}
    """
    crashes = Crashes(tmp_path, chart, prepare=handed_in)
    assert crashes.whole.at == 20
    run = Run(crashes.copies[1][2], [chart], resume=True, prepare=lambda run: run.post(Event("go", {"n": 3}), after=8))
    assert [step.time for step in run.steps] == [0, 3, 6, 8]
    assert run.end.finished


def test_a_resumed_run_notices_a_change_between_crash_and_resume(tmp_path):
    chart = """
        plot: p
        states:
          a: {after: {seconds: 5, to: b}}
          b: {always: {to: e, when: (q)}, after: {seconds: 50, to: x}}
          x: {after: {seconds: 9, to: e}}
          e: {final: true}
    """
    crashes = Crashes(tmp_path, chart)
    folder = crashes.copies[2][2]  # before the commit of the step at 55 s
    with KnowledgeBase.open(SCHEMA, folder / "run.kb") as kb:
        kb.apply(Delta(added=(fact("q"),)), "another program")
    run = Run(folder, [chart], resume=True)
    assert run.end.finished
    assert run.at < 10


def test_without_a_component_that_it_needs_it_is_not_resumed(tmp_path):
    crashes = Crashes(tmp_path, TWICE)
    _, done, folder = crashes.copies[1]
    nobody = Robot()
    nobody.name = "nobody"
    with pytest.raises(UnknownNameError, match="there is no component 'robot'"):
        run_with(folder, TWICE, nobody, resume=True)
    assert Run(folder, [TWICE], done=done, resume=True).end == crashes.whole.end


# -- what is promised --------------------------------------------------------------------------------------

TWICE = CHARTS["one skill after the other"]


def test_a_run_is_the_same_with_a_store_and_without(tmp_path):
    for chart in (*CHARTS.values(),):
        if "robot.plan" not in chart:
            plain = Ran(chart, arm=Robot())
            kept = Run(new(tmp_path), [chart])
            assert [record.to_line() for record in kept.records] == plain.lines
            assert kept.end == plain.end


def run_with(folder, chart, robot, *, prepare=None, resume=False):
    run = Run(folder, [chart], robot=robot, prepare=prepare, resume=resume)
    return run.end, run.facts, run.at


def new(folder):
    made = folder / f"run{len(list(folder.iterdir()))}"
    made.mkdir()
    return made


class Fetched(Outcome): ...


class Did(Outcome): ...


class WorkDid(Outcome, event="did"):
    n: object


def test_nothing_is_started_that_is_not_committed(tmp_path):
    seen = []

    class Watching(Robot):
        @skill(after_crash="same_id")
        async def work(self, call, seconds=0, observes="") -> Did:  # type: ignore[override]
            with archive(tmp_path / "run.kb") as runs:
                seen.append((call.action_id, [start.action_id for start, _ in runs.running_actions()]))
            return Did()

    run_with(tmp_path, TWICE, Watching())
    assert len(seen) == 2
    assert all(committed == [started] for started, committed in seen)


def test_events_that_let_nothing_leave_are_committed_together_and_with_what_leaves_then(tmp_path):
    seen = []

    def committed():
        with archive(tmp_path / "run.kb") as runs:
            return len(list(runs.steps(1)))

    class Watching(Robot):
        @skill(after_crash="same_id")
        async def work(self, call) -> Did:  # type: ignore[override]
            seen.append(committed())
            return Did()

    def prepare(sequencer):
        for name in ("on", "on", "go"):
            sequencer.post(Event(name))
        sequencer.listen(lambda step: seen.append(committed() if step.event is not None else 0))

    chart = """
        plot: p
        receives: {on: null, go: null}
        states:
          a: {on: {on: a, go: b}}
          b: {entry: {trigger: robot.work}, on: {did: e}}
          e: {final: true}
    """
    assert Run(tmp_path, [chart], robot=Watching(), prepare=prepare).end.finished
    assert seen == [0, 1, 1, 1, 4, 4]  # the start alone; three events at once; the action, and then its answer


def test_parameters_and_modes_in_force_are_set_again_before_a_run_resumes(tmp_path):
    chart = """
        plot: p
        states:
          a: {entry: [{set: robot.speed, to: 1}, {set: robot.speed, to: 2}, {switch: robot, to: careful}, {trigger: robot.work}], on: {did: b}}
          b: {entry: [{trigger: robot.work}], on: {did: c}}
          c: {entry: [{trigger: robot.work}], on: {did: e}}
          e: {final: true}
    """
    crashes = Crashes(tmp_path, chart)
    (_, first), *_, (_, last) = crashes.resumed()
    assert first.robot.told == [("speed", 1), ("speed", 2), ("mode", "careful")]  # none of it may have left
    assert last.robot.told == [("speed", 2), ("mode", "careful")]
    assert last.robot.parameters == {"speed": 2}


class RelatedParameters(Parameters):
    speed: float = parameter(0.5, least=0.1, most=10.0)
    wheels: int = 4
    relations = ("(<= ?speed (/ ?wheels 4))",)


class Related(Robot):
    parameters: RelatedParameters


def test_parameters_in_force_come_back_as_one_set_whatever_order_they_were_set_in(tmp_path):
    chart = """
        plot: p
        emits: {because: {why: text}}
        states:
          a: {entry: [{set: robot.wheels, to: 8}, {set: robot.speed, to: 2}, {trigger: robot.work}], on: {did: b, skill_error: f}}
          b: {entry: [{set: robot.wheels, to: 16}, {trigger: robot.work}], on: {did: c, skill_error: f}}
          c: {entry: [{trigger: robot.work}], on: {did: d, skill_error: f}}
          d: {entry: [{trigger: robot.work}], on: {did: e, skill_error: f}}
          e: {final: true}
          f: {final: true, emit: because, with: {why: it_failed}}
    """
    crashes = Crashes(tmp_path, chart, make=Related)
    for what, run in crashes.resumed():
        assert run.outcome() == crashes.whole.outcome(), what
        assert run.robot.parameters == {"speed": 2, "wheels": 16}
    assert run.robot.told == [("speed", 2), ("wheels", 16)]


def test_a_refused_parameter_value_is_not_in_force_after_a_restart(tmp_path):
    chart = """
        plot: p
        states:
          a: {entry: [{set: robot.speed, to: 1}, {trigger: robot.work}], on: {did: b, skill_error: e}}
          b: {entry: [{set: robot.speed, to: 99}, {trigger: robot.work}], on: {did: e, programming_error: c}}
          c: {entry: [{trigger: robot.work}], on: {did: d, skill_error: e}}
          d: {entry: [{trigger: robot.work}], on: {did: e, skill_error: e}}
          e: {final: true}
    """
    crashes = Crashes(tmp_path, chart, make=Related)
    for what, run in crashes.resumed():
        assert run.outcome() == crashes.whole.outcome(), what
        assert run.robot.parameters == {"speed": 1, "wheels": 4}
    assert run.robot.told == [("speed", 1)]


def test_a_value_that_was_under_way_is_told_again_after_what_was_in_force(tmp_path):
    class Slow(Related):
        async def configure(self, parameter, value):
            if value == 0.75:
                await asyncio.sleep(3)
            await super().configure(parameter, value)

    chart = """
        plot: p
        states:
          a: {entry: [{set: robot.speed, to: 1}, {trigger: robot.work}], on: {did: b}}
          b: {entry: [{set: robot.speed, to: 0.75}], after: {seconds: 1, to: c}}
          c: {after: {seconds: 1, to: d}}
          d: {entry: [{trigger: robot.work}], on: {did: e}}
          e: {final: true}
    """
    crashes = Crashes(tmp_path, chart, make=Slow)
    for what, run in crashes.resumed():
        assert run.end == crashes.whole.end, what
        assert run.robot.parameters == {"speed": 0.75, "wheels": 4}


def test_listeners_of_a_resumed_run_hear_numbers_that_go_on(tmp_path):
    crashes = Crashes(tmp_path, TWICE)
    for _, run in crashes.resumed():
        with archive(run.path) as runs:
            kept = [record.seq for step in runs.steps(1) for record in step.records]
        assert kept == list(range(1, len(kept) + 1))
        assert run.records[-1].seq == len(kept)


def test_an_old_sequencer_cannot_write_where_a_new_one_has_taken_over(tmp_path):
    robot = Robot()

    def take_over():
        robot.crash = lambda: None
        (tmp_path / "run.kb-lock").unlink()  # as on a file system that knows no locks
        with KnowledgeBase.open(SCHEMA, tmp_path / "run.kb") as kb:
            RunStore(kb, tmp_path / "run.kb")

    robot.crash = take_over
    with pytest.raises(StoreError, match="another sequencer has taken this run over"):
        run_with(tmp_path, TWICE, robot)
    assert robot.told == []
    with archive(tmp_path / "run.kb") as runs:
        assert [step.configuration for step in runs.steps(1)] == [("a",)]
    assert Run(tmp_path, [TWICE], done=robot.done, resume=True).end == RunEnd(finished=True)


def test_a_run_ends_with_an_error_when_it_cannot_be_kept_and_nothing_is_started(tmp_path):
    running: list[Sequencer] = []

    class Talkative(Robot):
        @skill(after_crash="same_id")
        async def work(self, call, seconds=0, observes="") -> WorkDid:  # type: ignore[override]
            with running[0].knowledge.together() as connection:
                connection.execute("PRAGMA max_page_count = 1")  # as large as it is now
            self.done[call.action_id] = 1
            return WorkDid(n="so much " * 10_000)

    robot = Talkative()
    with pytest.raises(StoreError, match="full"):
        run_with(tmp_path, TWICE, robot, prepare=running.append)
    assert robot.told == []
    assert len(robot.done) == 1
    assert Run(tmp_path, [TWICE], done=robot.done, resume=True).end == RunEnd(finished=True)


@pytest.mark.parametrize(
    ("on_signal", "problem"), [("end", "it was cancelled"), ("suspend", None)], ids=["end", "suspend"]
)
def test_components_of_a_cancelled_run_are_stopped_and_a_suspended_one_can_be_resumed(tmp_path, on_signal, problem):
    chart = "{plot: p, states: {a: {entry: [{trigger: robot.work}], exit: [{switch: robot, to: neutral}], on: {did: e}}, e: {final: true}}}"
    robot = Robot()

    def cancel(sequencer):
        sequencer.on_signal = on_signal
        asyncio.get_running_loop().call_later(1, asyncio.current_task().cancel)

    with pytest.raises(asyncio.CancelledError):
        run_with(tmp_path, chart, robot, prepare=cancel)
    assert robot.told == [("mode", "neutral")]
    with archive(tmp_path / "run.kb") as runs:
        assert (runs.run().ended or {}).get("problem") == problem
    assert is_unfinished(tmp_path / "run.kb") is (on_signal == "suspend")


def test_texts_with_any_kind_of_line_break_are_kept_in_their_records(tmp_path):
    class Poet(Robot):
        @skill(after_crash="repeat")
        async def work(self, call, seconds=0, observes="") -> WorkDid:  # type: ignore[override]
            return WorkDid(n="one\u2028two\x85three\nfour\u2029five")

    run = Run(tmp_path, [TWICE], robot=Poet())
    _, records = records_of(run.path)
    assert [record.to_line() for record in records] == [record.to_line() for record in run.records]


def test_the_records_of_a_run_can_be_read_while_it_goes_on_and_only_the_new_ones(tmp_path):
    crashes = Crashes(tmp_path, TWICE)
    _, _, folder = crashes.copies[2]
    _, first = records_of(folder / "run.kb")
    _, whole = records_of(crashes.whole.path)
    _, rest = records_of(crashes.whole.path, after=first[-1].seq)
    assert first[0].type == "world"
    assert [one.to_line() for one in whole] == [one.to_line() for one in (*first, *rest)]
    assert whole[-1].type == "end"


def test_a_run_that_has_ended_is_not_resumed(tmp_path):
    Run(tmp_path, [TWICE])
    with pytest.raises(StoreError, match="no unfinished run"):
        Run(tmp_path, [TWICE], resume=True)
    assert has_run(tmp_path / "run.kb")


def test_a_store_holds_one_run_after_the_other_and_only_one_that_is_unfinished(tmp_path):
    crashes = Crashes(tmp_path, TWICE)
    _, done, folder = crashes.copies[2]
    with pytest.raises(StoreError, match="unfinished run, which can be resumed") as refused:
        Run(folder, [TWICE])
    assert refused.value.place == Place(str(folder / "run.kb"))
    Run(folder, [TWICE], done=done, resume=True)
    Run(folder, [TWICE])
    with archive(folder / "run.kb") as runs:
        assert [one.number for one in runs.runs()] == [1, 2]
        one, other = ([(s.time, s.configuration) for s in runs.steps(run.number)] for run in runs.runs())
        assert one == other


def test_no_two_runs_of_a_store_have_an_action_in_common(tmp_path):
    first = Run(tmp_path, [TWICE])
    second = Run(tmp_path, [TWICE], done=first.robot.done)
    assert len(second.robot.done) == 2 * len(first.robot.done)
    assert replay(tmp_path / "run.kb", 2).divergence is None


def test_a_mistake_in_what_is_to_be_run_leaves_the_store_as_it_was(tmp_path):
    with pytest.raises(UnknownNameError, match="nonsense"):
        Run(tmp_path, [TWICE], arguments={"nonsense": 1})
    assert not has_run(tmp_path / "run.kb")
    assert Run(tmp_path, [TWICE]).end.finished


def test_a_store_without_a_run_is_named(tmp_path):
    path = tmp_path / "world.kb"
    KnowledgeBase.open(Schema(), path).close()
    assert not is_unfinished(path)
    with pytest.raises(StoreError, match="no run was ever kept in this store") as refused, archive(path):
        pass
    assert refused.value.place == Place(str(path))


def test_a_run_is_unfinished_until_its_end(tmp_path):
    crashes = Crashes(tmp_path, TWICE)
    _, _, folder = crashes.copies[2]
    assert is_unfinished(folder / "run.kb")
    Run(folder, [TWICE], resume=True)
    assert not is_unfinished(folder / "run.kb")


def test_a_transaction_that_fails_leaves_neither_rows_nor_knowledge(tmp_path):
    path = tmp_path / "run.kb"
    schema = Schema.parse("(define (domain d) (:predicates (p)))")
    with KnowledgeBase.open(schema, path) as knowledge:
        writer = RunWriter(knowledge, path)
        with pytest.raises(StoreError, match="nonsense"), writer:  # noqa: PT012  all of the block is to be undone
            knowledge.apply(Delta(added=(fact("p"),)), "test")
            writer.connection.execute("DELETE FROM fence")
            writer.connection.execute("nonsense")
        assert writer.lost
    with KnowledgeBase.open(schema, path) as knowledge:
        assert not knowledge.ask("(p)")
        with knowledge.together() as connection:
            assert connection.execute("SELECT count(*) FROM fence").fetchone() == (1,)


# -- changed charts ----------------------------------------------------------------------------------------

CHANGES = {
    "a state that was changed": (
        TWICE.replace("seconds: 1.5", "seconds: 2.5"),
        (),
        "the plot 'p' has changed: ~ state b",
    ),
    "a plot that is missing": (TWICE.replace("plot: p", "plot: r"), (), "the plot 'p' is missing"),
}


@pytest.mark.parametrize(("chart", "more", "difference"), CHANGES.values(), ids=CHANGES)
def test_a_changed_chart_is_refused_with_the_difference(tmp_path, chart, more, difference):
    crashes = Crashes(tmp_path, TWICE)
    _, done, folder = crashes.copies[2]
    with pytest.raises(ChangedError, match=difference):
        Run(folder, [chart, *more], done=done, resume=True)
    assert Run(folder, [TWICE], done=done, resume=True).end == crashes.whole.end


USING = (
    "{plot: p, states: {a: {entry: {trigger: robot.work}, on: {did: b}}, b: {use: q, on: {done: e}}, e: {final: true}}}"
)
USED = "{plot: q, states: {a: {entry: {trigger: robot.work}, on: {did: e}}, e: {final: true}}}"
UNUSED = "{plot: other, states: {a: {final: true}}}"


@pytest.mark.parametrize(
    ("now", "difference"),
    [
        ([USING, USED, UNUSED], None),
        ([USING, USED], None),
        ([USING, USED, UNUSED.replace("a:", "b:")], None),
        ([USING, USED.replace("e:", "f:").replace("did: e", "did: f"), UNUSED], "the plot 'q' has changed"),
        ([USING, UNUSED], "'q'"),
    ],
    ids=["the same", "an unused plot fewer", "an unused plot changed", "a used plot changed", "a used plot fewer"],
)
def test_plots_that_the_run_cannot_reach_may_change(tmp_path, now, difference):
    crashes = Crashes(tmp_path, USING, USED, UNUSED)
    _, done, folder = crashes.copies[2]
    if difference is None:
        assert Run(folder, now, done=done, resume=True).end == crashes.whole.end
        return
    with pytest.raises((ChangedError, UnknownNameError), match=difference):
        Run(folder, now, done=done, resume=True)


PLANNING = [
    "{plot: p, states: {s: {entry: {trigger: robot.work}, on: {did: a}}, a: {use: helper, on: {done: b}}, b: {dynamic: [], goal: (told), on: {done: e, FAILURE: e}}, e: {final: true}}}",
    "{plot: achieve, parameters: {goal: text}, states: {z: {final: true}}}",
    "{plot: walk, implements: go, states: {z: {final: true}}}",
    "{plot: helper, states: {z: {final: true}}}",
]


@pytest.mark.parametrize("name", ["helper", "achieve", "walk"])
def test_changed_plots_of_a_run_that_plans(tmp_path, name):
    _, done, folder = Crashes(tmp_path, *PLANNING).copies[1]
    changed = [text.replace("z:", "y:") if f"plot: {name}," in text else text for text in PLANNING]
    with pytest.raises(ChangedError, match=f"the plot '{name}' has changed"):
        Run(folder, changed, done=done, resume=True)


def test_the_error_about_changes_names_the_choices(tmp_path):
    _, done, folder = Crashes(tmp_path, TWICE).copies[2]
    with pytest.raises(ChangedError, match=r"resume it with the earlier version, or end it: .*dsc runs end"):
        Run(folder, [TWICE.replace("seconds: 1.5", "seconds: 2.5")], done=done, resume=True)


def action(name):
    return f"planning action '{name}'"


def test_runs_in_tables_of_another_format_are_refused_with_that_reason(tmp_path):
    path = tmp_path / "run.kb"
    with KnowledgeBase.open(SCHEMA, path) as kb, kb.together() as connection:  # as they were before they had a number
        connection.execute("CREATE TABLE runs (run INTEGER PRIMARY KEY, ended TEXT)")
        connection.execute("CREATE TABLE fence (epoch INTEGER NOT NULL)")
        connection.execute("INSERT INTO runs VALUES (1, NULL)")
    for look in (has_run, records_of):
        with pytest.raises(StoreError, match="the runs in this store have format 1"):
            look(path)
    with KnowledgeBase.open(SCHEMA, path) as kb, pytest.raises(StoreError, match="resumes format 7"):
        RunStore(kb, path)
    assert run_with(new(tmp_path), TWICE, Robot())[0].finished


def test_a_restart_reads_no_more_macrosteps_than_since_all_was_written(tmp_path, monkeypatch):
    monkeypatch.setattr(store_module, "WHOLE_EVERY", 3)
    chart = CHARTS["one skill after the other"]
    crashes = Crashes(tmp_path, chart)
    with archive(crashes.copies[-1][2] / "run.kb") as runs:
        texts = [text for (text,) in runs.connection.execute("SELECT change FROM steps ORDER BY place")]
        assert [number for number, text in enumerate(texts) if '"whole":true' in text] == list(range(0, len(texts), 3))
    for what, run in crashes.resumed():
        assert run.outcome() == crashes.whole.outcome(), what


def test_a_changed_domain_is_refused_with_the_difference(tmp_path):
    with KnowledgeBase.open(SCHEMA, tmp_path / "run.kb") as kb:
        store = RunStore(
            kb, tmp_path / "run.kb", domain={action("go"): "(go)", action("come"): "(come)", action("stay"): "(stay)"}
        )
        with store.writing:
            store.begin("p", {}, Library())
        now = {action("go"): "(went)", action("come"): "(come)", action("eat"): "(eat)"}
        with pytest.raises(ChangedError) as found:
            RunStore(kb, tmp_path / "run.kb", domain=now).load_unfinished(Library())
    assert found.value.differences == (
        "the planning action 'go' was '(go)', now it is '(went)'",
        "the planning action 'stay' is missing",
        "the planning action 'eat' is new",
    )


# -- components are asked ----------------------------------------------------------------------------------

ASKING = """
    plot: p
    variables: {n: {type: number, initial: 0}}
    states:
      a:
        entry: [{trigger: robot.fetch}]
        after: {seconds: 1, do: [{assign: {n: 1}}]}
        on: {fetched: e, FAILURE: {to: unsure, tell: (told)}}
      unsure: {final: true}
      e: {final: true}
"""


def asked(tmp_path, after_crash, status, failure="skill_error"):
    """The end of a run that was broken off while `robot.fetch` was under way, and how often that was begun."""

    class Fetcher(Robot):
        begun = 0

        @skill(after_crash=after_crash)
        async def fetch(self, call) -> Fetched:
            Fetcher.begun += 1
            await call.clock.sleep(5)
            return Fetched()

        async def status(self, action_id, skill_name, arguments):
            assert (skill_name, arguments) == ("fetch", {})
            return status

    copies: list[Path] = []
    asking = ASKING.replace("FAILURE", failure)
    run_with(
        new(tmp_path),
        asking,
        Fetcher(),
        prepare=lambda sequencer: sequencer.listen(
            lambda step: copies.append(copied(tmp_path / "run0", tmp_path / f"c{len(copies)}"))
        ),
    )
    Fetcher.begun = 0
    run = run_with(copies[2], asking, Fetcher(), resume=True)
    return run, Fetcher.begun


@pytest.mark.parametrize(
    ("after_crash", "status", "begun"),
    [
        ("sense", Status.RUNNING, 1),
        ("sense", Status.NOT_BEGUN, 1),
        ("repeat", Status.UNKNOWN, 1),
        ("same_id", Status.UNKNOWN, 1),
        ("sense", Ended(Outcome("fetched")), 0),
        ("repeat", Ended(Outcome("fetched")), 0),
    ],
)
def test_the_status_of_an_action_decides_whether_it_begins_again(tmp_path, after_crash, status, begun):
    (end, known, at), times = asked(tmp_path, after_crash, status)
    assert end == RunEnd(finished=True)
    assert times == begun
    assert at == (5 if begun else 1)
    assert "(told)" not in known


def test_an_action_of_which_nobody_knows_is_not_done_again_and_the_chart_hears_of_it(tmp_path):
    (end, known, _), times = asked(tmp_path, "sense", Status.UNKNOWN)
    assert end == RunEnd(finished=True)
    assert times == 0
    assert "(told)" in known


def test_an_end_that_the_skill_does_not_declare_is_an_error_as_ever(tmp_path):
    (_, known, _), _ = asked(tmp_path, "repeat", Ended(Outcome("vanished")), "programming_error")
    assert "(told)" in known


CANCELLING = """
    plot: p
    states:
      a: {entry: [{trigger: robot.fetch}], after: {seconds: 1, to: b}, on: {fetched: e}}
      b: {entry: [{trigger: robot.work, with: {seconds: 3}}], on: {did: c}}
      c: {entry: [{trigger: robot.work, with: {seconds: 3}}], on: {did: e}}
      e: {final: true}
"""


class Stubborn(Robot):
    def __init__(self, fails=False):
        super().__init__()
        self.abandoned = []
        self.fails = fails

    @skill(after_crash="same_id")
    async def fetch(self, call) -> Fetched:
        await call.clock.sleep(50)
        return Fetched()

    async def abandon(self, action_id, skill_name, arguments):
        if self.fails:
            raise RuntimeError("no contact")
        self.abandoned.append((action_id, skill_name, arguments))


def cancelled(tmp_path):
    """Copies from after the macrostep that starts `fetch`, from after that which cancels it, and from after the next."""
    copies: list[Path] = []
    (tmp_path / "alive").mkdir()
    run_with(
        tmp_path / "alive",
        CANCELLING,
        Stubborn(),
        prepare=lambda run: run.listen(
            lambda _: copies.append(copied(tmp_path / "alive", tmp_path / f"c{len(copies)}"))
        ),
    )
    return copies[1:]


def test_an_action_that_was_cancelled_at_the_last_moment_is_stopped_and_not_done_again(tmp_path):
    ends, stopped = [], []
    for copy in cancelled(tmp_path):
        robot = Stubborn()
        ends.append(run_with(copy, CANCELLING, robot, resume=True))
        stopped.append(robot.abandoned)
    assert [(end.finished, at) for end, _, at in ends] == [(True, 7)] * 3
    assert stopped == [[], [("a2.0", "fetch", {})], []]


def test_an_observation_of_a_cancelled_but_ended_action_is_known_after_a_restart(tmp_path):
    class Quick(Stubborn):
        async def abandon(self, action_id, skill_name, arguments):
            return Ended(Outcome("fetched", observed=Delta(added=(fact("q"),))))

    known = [run_with(copy, CANCELLING, Quick(), resume=True)[1:] for copy in cancelled(tmp_path)]
    assert [("(q)" in facts, at) for facts, at in known] == [(False, 7), (True, 7), (False, 7)]


def test_a_component_that_cannot_stop_it_ends_the_run_with_that(tmp_path):
    end, _, _ = run_with(cancelled(tmp_path)[1], CANCELLING, Stubborn(fails=True), resume=True)
    assert str(end.problem).startswith("robot.fetch may continue: robot.abandon: RuntimeError: no contact (")
    assert str(end.programming_error).startswith("robot.abandon: RuntimeError: no contact (")

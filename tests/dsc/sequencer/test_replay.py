"""A replay takes what came in once more; where something else comes out, it says what."""

from __future__ import annotations

import asyncio
import json

import pytest
from dsc_charts import plot
from dsc_crashes import Crashes, Run, forged
from dsc_kept_charts import CHARTS, handed_in
from dsc_runs import SCHEMA
from typer.testing import CliRunner

from dsc.cli.runs import app
from dsc.dynamic.library import Library
from dsc.sequencer.replay import replay
from knowledge_base.errors import StoreError
from knowledge_base.facts import Delta, Fact
from knowledge_base.store import KnowledgeBase

GUARDED = CHARTS["variables, tells and guards"]


def command(*words):
    return CliRunner().invoke(app, [*map(str, words)])


@pytest.mark.parametrize("chart", CHARTS.values(), ids=CHARTS)
def test_a_run_that_is_replayed_comes_to_the_same_configurations_and_knowledge(tmp_path, chart):
    run = Run(tmp_path, [chart])
    done = replay(str(run.path))
    assert done.divergence is None
    assert done.steps == len(run.steps)


def test_a_run_in_two_lives_is_replayed_as_one(tmp_path):
    for _, run in Crashes(tmp_path, GUARDED).resumed():
        assert replay(run.path).divergence is None


def test_an_unfinished_run_is_replayed_as_far_as_it_came(tmp_path):
    _, _, folder = Crashes(tmp_path, GUARDED).copies[-1]
    assert 0 < replay(folder / "run.kb").steps < replay(tmp_path / "alive" / "run.kb").steps


def test_posted_events_and_changes_beside_the_run_are_replayed_too(tmp_path):
    chart = "{plot: p, receives: {go: {n: number}}, states: {a: {on: {go: {to: e, when: (and (q) (told))}}}, e: {final: true}}}"

    def meddled(sequencer):
        handed_in(sequencer)
        beside = Delta(added=(Fact("told"),))
        asyncio.get_running_loop().call_later(4, lambda: sequencer.knowledge.apply(beside, "somebody else"))

    run = Run(tmp_path, [chart], prepare=meddled)
    assert run.at == 9
    assert replay(run.path).divergence is None


def test_another_chart_diverges_where_it_does_something_else(tmp_path):
    run = Run(tmp_path, [GUARDED])
    other = Library([plot(GUARDED.replace("(= ?n 2)", "(= ?n 1)"))])
    done = replay(run.path, library=other)
    assert done.steps == 2
    assert str(done.divergence) == "step 3: the configuration was: a; now: b"


def test_a_chart_that_tells_something_else_diverges(tmp_path):
    run = Run(tmp_path, [GUARDED])
    done = replay(run.path, library=Library([plot(GUARDED.replace("tell: (told)", "tell: (and (told) (q))"))]))
    assert (
        str(done.divergence)
        == 'step 2: what was told was: {"added":[["p"]]}; {"added":[["told"]]}; now: {"added":[["p"]]}; {"added":[["told"],["q"]]}'
    )


def test_a_chart_that_does_not_start_what_answered_diverges(tmp_path):
    run = Run(tmp_path, ["{plot: p, states: {a: {entry: [{trigger: robot.work}], on: {did: e}}, e: {final: true}}}"])
    other = Library([plot("{plot: p, states: {a: {on: {did: e}}, e: {final: true}}}")])
    assert "not started at all" in str(replay(run.path, library=other).divergence)


ELSEWHERE = """UPDATE steps SET configuration = '["e"]' WHERE number = 2"""


def test_a_macrostep_that_led_elsewhere_is_noticed(tmp_path):
    run = Run(tmp_path, [GUARDED])
    forged(run.path, ELSEWHERE)
    assert replay(run.path).divergence.step == 2


# -- the command -------------------------------------------------------------------------------------------


def test_the_runs_of_a_store_are_listed_shown_and_replayed(tmp_path):
    run = Run(tmp_path, [CHARTS["one skill after the other"]])
    Run(tmp_path, [CHARTS["one skill after the other"]])
    assert command("list", run.path).output == "   1  p  3 steps, 3.5 s, finished\n   2  p  3 steps, 3.5 s, finished\n"
    assert command("show", run.path, "--run", "1").output == (
        "     0.0 s     1  start: a\n"
        "     2.0 s     2  did (robot.work): b\n"
        "     3.5 s     3  did (robot.work): \n"
        "p: finished\n"
    )
    replayed = command("replay", run.path)
    assert (replayed.exit_code, replayed.output) == (0, "run 2: 3 steps, all as they were\n")


def test_an_unfinished_run_shows_what_is_under_way(tmp_path):
    crashes = Crashes(tmp_path, CHARTS["one skill after the other"])
    path = crashes.copies[-1][2] / "run.kb"
    assert command("list", path).output.endswith("unfinished\n")
    assert "under way since 2.0 s: robot.work (" in command("show", path).output


def test_a_run_with_a_problem_shows_it(tmp_path):
    run = Run(tmp_path, [CHARTS["a problem at the end"]])
    shown = command("show", run.path).output
    assert "everything is left" in shown
    assert "p: ended early: no transition handles 'did' of robot.work" in shown


def test_a_divergence_has_its_own_exit_status(tmp_path):
    run = Run(tmp_path, [GUARDED])
    forged(run.path, ELSEWHERE)
    replayed = command("replay", run.path)
    assert replayed.exit_code == 1
    assert replayed.output == "run 1: 1 steps as they were, then step 2: the configuration was: e; now: a\n"


def test_everything_is_there_as_json(tmp_path):
    run = Run(tmp_path, [GUARDED])
    (listed,) = json.loads(command("list", run.path, "--json").output)
    shown = json.loads(command("show", run.path, "--json").output)
    assert listed == {"run": 1, "plot": "p", "steps": 5, "seconds": shown["macrosteps"][-1]["t"], "state": "finished"}
    assert [step["configuration"] for step in shown["macrosteps"]] == [list(step.configuration) for step in run.steps]
    assert json.loads(command("replay", run.path, "--json").output) == {"run": 1, "steps": 5, "divergence": None}


def test_a_store_without_runs_and_a_run_that_is_not_there_are_said_so(tmp_path):
    KnowledgeBase.open(SCHEMA, tmp_path / "facts.kb").close()
    with pytest.raises(StoreError, match="no run was ever kept in this store"):
        replay(tmp_path / "facts.kb")
    run = Run(tmp_path, [GUARDED])
    with pytest.raises(StoreError, match="there is no run 7; the only run is 1"):
        replay(run.path, 7)

from __future__ import annotations

import json
import subprocess

import pytest

from knowledge_base.facts import Fact
from knowledge_base.language.parser import parse_condition
from planning.engines.process import COMMAND, EngineProcess, EngineStoppedError, OutOfTimeError
from planning.plan import PlanStep
from planning.problem import pose
from planning.strips import GroundAction, Problem

ALL_TIDY = parse_condition("(forall (?i - item) (tidy ?i))")


def lights_out(size):
    """A puzzle in which h_FF is lost: each switch turns three lights; far too much for a second or two."""
    on = [Fact("on", (f"l{i}",)) for i in range(size)]
    off = [Fact("off", (f"l{i}",)) for i in range(size)]
    actions = []
    for i in range(size):
        near = [i - 1, i, (i + 1) % size]
        for mask in range(8):
            now = [(on if mask >> k & 1 else off)[n] for k, n in enumerate(near)]
            then = [(off if mask >> k & 1 else on)[n] for k, n in enumerate(near)]
            actions.append(GroundAction(PlanStep("press", (f"l{i}",)), tuple(now), tuple(then), tuple(now)))
    return Problem("lights", {}, (*on[::2], *off[1::2]), tuple(off), tuple(actions))


@pytest.fixture(scope="module")
def engine():
    process = EngineProcess()
    assert process.ask(None, 60) == {"ready": True}
    yield process
    process.kill()


def test_stacking_first_makes_three_trips(engine, clean_up, table):
    problem = pose(clean_up, table(4, 3, ["one", "two"]), ALL_TIDY)
    plan = problem.plan(engine.ask(problem.to_json(), 60)["actions"])
    assert [step.action for step in plan.steps].count("throw-away") == 3


def test_the_same_problem_gets_the_same_plan_fresh_or_warm(engine, clean_up, table):
    problems = [
        pose(clean_up, table(*size), ALL_TIDY).to_json() for size in [(4, 3, ["one", "two"]), (3,), (5,)]
    ]
    warm = [engine.ask(problem, 60) for problem in problems]
    again = [engine.ask(problem, 60) for problem in reversed(problems)]
    fresh = EngineProcess()
    fresh.ask(None, 60)
    assert fresh.ask(problems[0], 60) == warm[0]
    fresh.kill()
    assert again[::-1] == warm


def test_no_plan_is_proven(engine):
    goal, start = Fact("goal"), Fact("start")
    away = GroundAction(PlanStep("away"), (start,), (Fact("away"),), (start,))
    need = GroundAction(PlanStep("need"), (start, Fact("away")), (goal,), ())
    problem = Problem("d", {}, (start,), (goal,), (away, need))
    assert engine.ask(problem.to_json(), 60) == {"actions": None}


def test_a_fact_deleted_and_added_is_kept(engine):
    here, goal = Fact("here"), Fact("goal")
    act = GroundAction(PlanStep("act"), (here,), (goal, here), ())
    assert engine.ask(Problem("d", {}, (here,), (goal,), (act,)).to_json(), 60) == {"actions": [0]}


def test_rubbish_is_answered_and_survived(engine):
    assert "KeyError" in engine.ask({"no": "problem"}, 60)["failed"]
    assert engine.alive


def test_a_search_is_ended_when_its_time_is_up(engine):
    process = EngineProcess()
    process.ask(None, 60)
    with pytest.raises(OutOfTimeError):
        process.ask(lights_out(60).to_json(), 0.3)
    assert not process.alive


def test_a_worker_ends_with_its_owner_even_while_it_searches():
    worker = subprocess.Popen(COMMAND, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    with worker:
        assert json.loads(worker.stdout.readline()) == {"ready": True}
        worker.stdin.write(json.dumps(lights_out(60).to_json()).encode() + b"\n")
        worker.stdin.close()
        assert worker.wait(timeout=30) == 0


def test_a_killed_process_answers_no_more(engine):
    process = EngineProcess()
    process.kill()
    process.kill()
    with pytest.raises(EngineStoppedError):
        process.ask({}, 5)

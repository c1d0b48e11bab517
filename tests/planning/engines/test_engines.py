"""The worker process and what is left of it, with the embedded engine and with scripts that misbehave."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
from importlib.metadata import requires
from pathlib import Path
from typing import Any

import pytest
from fake_engines import HANGING, PROBLEM, READY, answering, descendants, gone, lights_out

from knowledge_base.facts import Fact
from knowledge_base.language.syntax.text import parse_condition
from planning.cli.doctor import DISTRIBUTION
from planning.engines.process import Deadline, EngineProcess, EngineStoppedError, OutOfTimeError, worker
from planning.engines.registry import ENGINES
from planning.engines.request import write_problem
from planning.model.ground_action import GroundAction
from planning.model.plan import PlanStep
from planning.model.problem import Problem
from planning.problem.construction import build_problem

ALL_TIDY = parse_condition("(forall (?i - item) (tidy ?i))")
HARD = lights_out(60)


@pytest.fixture(scope="module")
def engine():
    process = EngineProcess(worker("pyperplan"))
    process.start(60)
    yield process
    process.kill()


@pytest.fixture
def scripted():
    """Starts a worker that is a script."""
    started = []

    def start(script):
        started.append(EngineProcess((sys.executable, "-c", script)))
        return started[-1]

    yield start
    for process in started:
        process.kill()


def asked(process, problem, seconds=60.0):
    """The one answer."""
    answers: list[dict[str, Any]] = []
    process.ask(write_problem(problem), Deadline(seconds), answers.append)
    (answer,) = answers
    answer.pop("translated", None)  # it differs from time to time
    return answer


def test_stacking_first_makes_three_trips(engine, clean_up, table):
    problem = build_problem(clean_up, table(4, 3, ["one", "two"]), ALL_TIDY)
    plan = problem.plan(asked(engine, problem)["actions"])
    assert [step.action for step in plan.steps].count("throw-away") == 3


def test_the_same_problem_gets_the_same_plan_fresh_or_warm(engine, clean_up, table):
    problems = [build_problem(clean_up, table(*size), ALL_TIDY) for size in [(4, 3, ["one", "two"]), (3,), (5,)]]
    warm = [asked(engine, problem) for problem in problems]
    again = [asked(engine, problem) for problem in reversed(problems)]
    fresh = EngineProcess(worker("pyperplan"))
    fresh.start(60)
    assert asked(fresh, problems[0]) == warm[0]
    fresh.kill()
    assert again[::-1] == warm


def test_no_plan_is_proven(engine):
    goal, start = Fact("goal"), Fact("start")
    away = GroundAction(PlanStep("away"), (start,), (Fact("away"),), (start,))
    need = GroundAction(PlanStep("need"), (start, Fact("away")), (goal,), ())
    problem = Problem("d", {}, (start,), (goal,), (away, need))
    assert asked(engine, problem) == {"actions": None}


def test_a_fact_deleted_and_added_is_kept(engine):
    here, goal = Fact("here"), Fact("goal")
    act = GroundAction(PlanStep("act"), (here,), (goal, here), ())
    assert asked(engine, Problem("d", {}, (here,), (goal,), (act,))) == {"actions": [0]}


def test_rubbish_is_answered_and_survived(engine):
    answers: list[dict[str, Any]] = []
    engine.ask(b'{"no": "problem"}\n', Deadline(60), answers.append)
    assert "KeyError" in answers[0]["failed"]
    assert engine.alive


def test_a_search_is_ended_when_its_time_is_up_and_the_worker_stays_warm(engine):
    with pytest.raises(OutOfTimeError):
        asked(engine, HARD, 0.3)
    assert engine.alive
    assert descendants(engine._pid) == set()
    assert asked(engine, PROBLEM) == {"actions": [0, 1]}


def test_the_processes_of_a_search_that_has_ended_are_not_killed_with_the_worker(monkeypatch):
    """Their numbers may belong to other programs by then."""
    killed: list[int] = []
    engine = EngineProcess(worker("pyperplan"))
    engine.start(60)
    assert asked(engine, PROBLEM) == {"actions": [0, 1]}
    with pytest.raises(OutOfTimeError):
        asked(engine, HARD, 0.3)
    real = os.killpg

    def noted(group, number):
        killed.append(group)
        real(group, number)

    monkeypatch.setattr(os, "killpg", noted)
    engine.kill()
    assert killed == [engine._pid]


def test_a_search_that_dies_takes_nothing_with_it(engine):
    searching = threading.Thread(target=_kill_the_search, args=(engine,))
    searching.start()
    with pytest.raises(EngineStoppedError, match="killed by signal 9"):
        asked(engine, HARD)
    searching.join()
    assert asked(engine, PROBLEM) == {"actions": [0, 1]}


def _kill_the_search(process):
    (search,) = _searches(process)
    os.kill(search, signal.SIGKILL)


def _searches(process):
    """The processes that search, as soon as there are any."""
    while not (found := descendants(process._pid)):
        os.sched_yield()
    return found


def test_a_search_may_be_cut_short_from_another_thread(engine):
    deadline = Deadline(600)

    def hurry():
        _searches(engine)
        deadline.shorten(0)
        engine.wake()

    hurrying = threading.Thread(target=hurry)
    hurrying.start()
    with pytest.raises(OutOfTimeError):
        engine.ask(write_problem(HARD), deadline, print)
    hurrying.join()


def test_a_search_that_takes_too_much_memory_fails_and_says_so():
    process = EngineProcess(worker("pyperplan", megabytes=40))  # the worker has more before it searches
    process.start(60)
    assert asked(process, lights_out(100)) == {"failed": "it ran out of memory"}
    assert process.alive
    process.kill()


@pytest.mark.parametrize("way", ["its input ends", "it is killed"])
def test_a_search_ends_with_its_worker_and_the_worker_with_its_owner(way):
    popen = subprocess.Popen(worker("pyperplan"), stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    with popen:
        assert json.loads(popen.stdout.readline()) == {"ready": True}
        popen.stdin.write(write_problem(HARD))
        popen.stdin.flush()
        search = json.loads(popen.stdout.readline())["searching"]
        if way == "it is killed":
            popen.kill()
        popen.stdin.close()
        popen.wait(timeout=30)
        assert gone([search])


# A worker whose search starts a process in its own group and one in the worker's group.
TEEMING = READY + (
    "import subprocess\n"
    "sleep = [sys.executable, '-c', 'import time; time.sleep(600)']\n"
    "subprocess.Popen(sleep)\n"
    "sys.stdin.readline()\n"
    "if (child := os.fork()) == 0:\n"
    "    os.setpgid(0, 0)\n"
    "    subprocess.Popen(sleep)\n"
    "    print(json.dumps({'searching': os.getpid()}), flush=True)\n"
    "    print('{\"actions\": [0, 1]}', flush=True)\n"
    "time.sleep(600)\n"
)


def test_after_a_kill_nothing_that_the_worker_started_lives(scripted):
    process = scripted(TEEMING)
    process.start(60)
    family: set[Any] = set()

    def heard(_answer):
        family.update(descendants(process._pid), [process._pid])
        process.kill()

    with pytest.raises(EngineStoppedError):
        process.ask(write_problem(PROBLEM), Deadline(60), heard)
    assert len(family) == 4
    assert gone(family)


def test_a_worker_that_does_not_say_that_its_search_has_ended_is_ended_itself(scripted, monkeypatch):
    monkeypatch.setattr("planning.engines.process._GRACE", 0.1)
    process = scripted(TEEMING)
    process.start(60)
    with pytest.raises(OutOfTimeError):
        process.ask(write_problem(PROBLEM), Deadline(0.5), print)
    assert not process.alive


@pytest.mark.parametrize("group", ["0", "1", "-1", "true", "os.getppid()", "'all'", "10 ** 30"])
def test_a_worker_cannot_make_us_kill_others(scripted, group):
    words = "True" if group == "true" else group
    process = scripted(
        READY + f"sys.stdin.readline(); print(json.dumps({{'searching': {words}}}), flush=True); time.sleep(600)"
    )
    process.start(60)
    with pytest.raises(EngineStoppedError, match="no separate process group"):
        process.ask(write_problem(PROBLEM), Deadline(60), print)
    assert not process.alive


def test_a_worker_that_babbles_is_ended(scripted, monkeypatch):
    monkeypatch.setattr("planning.engines.process._LONGEST_ANSWER", 100_000)
    process = scripted(READY + "while True: print('bla' * 1000, end='', flush=True)")
    process.start(60)
    with pytest.raises(EngineStoppedError, match="over 100000 bytes without an end"):
        process.ask(write_problem(PROBLEM), Deadline(60), print)
    assert not process.alive


def test_an_answer_too_deep_to_be_read_is_no_answer(scripted):
    process = scripted(READY + "print('[' * 100_000, flush=True); time.sleep(600)")
    process.start(60)
    with pytest.raises(EngineStoppedError):
        process.ask(write_problem(PROBLEM), Deadline(60), print)
    assert not process.alive


def test_a_worker_must_begin_by_saying_that_it_is_ready(scripted):
    with pytest.raises(EngineStoppedError, match="did not say that it is ready"):
        scripted("print('{}', flush=True); import time; time.sleep(600)").start(60)


def test_a_killed_process_answers_no_more(scripted):
    process = scripted(HANGING)
    process.kill()
    process.kill()
    with pytest.raises(EngineStoppedError):
        process.ask(b"{}\n", Deadline(5), print)


def test_a_forgotten_process_is_ended(scripted):
    process = EngineProcess((sys.executable, "-c", HANGING))
    pid = process._pid
    del process
    assert gone([pid])


def test_temporary_files_of_an_engine_are_deleted_with_its_process(scripted):
    leaving = "import tempfile\nfor line in sys.stdin:\n    said = {'failed': tempfile.mkdtemp()}, {'ended': 0}\n"
    process = scripted(READY + leaving + "    print(*map(json.dumps, said), sep='\\n', flush=True)\n")
    process.start(60)
    left = Path(asked(process, PROBLEM)["failed"])
    assert left.is_dir()
    process.kill()
    assert not left.exists()
    assert not left.parent.exists()
    assert left.parent != Path(tempfile.gettempdir())


def test_messages_before_the_end_arrive_in_order(scripted):
    process = scripted(answering('{"actions": [1]}', '{"actions": [2]}'))
    process.start(60)
    heard: list[Any] = []
    process.ask(write_problem(PROBLEM), Deadline(60), heard.append)
    assert heard == [{"actions": [1]}, {"actions": [2]}]


def test_a_missing_engine_is_installed_by_what_this_project_itself_asks_for():
    asked = {one.split(";")[0].strip().replace("<2,", "") for one in requires(DISTRIBUTION)}
    assert {f"{one.package}>={one.at_least}" for one in ENGINES} <= asked

"""Every engine of the registry for real; those that are not installed are skipped with what they lack."""

from __future__ import annotations

import threading
from typing import Any

import pytest
from fake_engines import PROBLEM, descendants, gone, lights_out, session

from dsc import Component, Outcome, SkillCall, primitive_plot, skill
from knowledge_base.facts import Fact
from knowledge_base.language.syntax.text import parse_condition
from planning.engines.process import Deadline, EngineProcess, OutOfTimeError, worker
from planning.engines.registry import ENGINES
from planning.engines.request import write_problem
from planning.model.domain import PlanningDomain
from planning.model.ground_action import GroundAction
from planning.model.plan import PlanStep
from planning.model.problem import Problem
from planning.problem.construction import build_problem
from planning.robot.robot import Robot

NAMES = [
    pytest.param(one.name, marks=pytest.mark.skipif(bool(one.lacks()), reason=f"{one.name}: {one.lacks()}"))
    for one in ENGINES
]
BY_NAME = {one.name: one for one in ENGINES}

START, DEAR, CHEAP, GOAL = (Fact(name) for name in ("start", "dear", "cheap", "goal"))
# Two steps at 1 each are cheaper than one at 5.
PRICED = Problem(
    "priced", {}, (START,), (GOAL,),
    (
        GroundAction(PlanStep("leap"), (START,), (GOAL,), (), 5.0),
        GroundAction(PlanStep("walk"), (START,), (CHEAP,), (), 0.5),
        GroundAction(PlanStep("arrive"), (CHEAP,), (GOAL,), (), 0.5),
    ),
)  # fmt: skip


@pytest.fixture(scope="module")
def process_of():
    started = {}

    def start(name, **options):
        if name not in started:
            started[name] = EngineProcess(worker(name))
            started[name].start(60)
        return started[name]

    yield start
    for process in started.values():
        process.kill()


def answers(process, problem, seconds=60.0):
    heard: list[dict[str, Any]] = []
    try:
        process.ask(write_problem(problem), Deadline(seconds), heard.append)
    except OutOfTimeError:  # an engine that goes on to look for better plans
        assert heard
    for answer in heard:
        answer.pop("translated", None)  # it differs from time to time
    return heard


@pytest.mark.parametrize("name", NAMES)
def test_it_plans_and_the_plan_is_valid(process_of, name, clean_up, table):
    problem = build_problem(clean_up, table(2), parse_condition("(forall (?i - item) (tidy ?i))"))
    seconds = 1.0 if BY_NAME[name].anytime else 60.0
    for answer in answers(process_of(name), problem, seconds):
        plan = problem.plan(answer["actions"])
        assert not isinstance(plan, str), plan


@pytest.mark.parametrize("name", NAMES)
def test_it_gives_the_same_plan_again(process_of, name):
    one = BY_NAME[name]
    first, second = (answers(process_of(name), PROBLEM, 0.5 if one.anytime else 60.0)[0] for _ in range(2))
    assert first == second or not one.deterministic


@pytest.mark.parametrize("name", NAMES)
def test_it_knows_when_there_is_no_plan(process_of, name):
    if not BY_NAME[name].proves:
        pytest.skip(f"{name} goes on for ever when there is no plan")
    away = GroundAction(PlanStep("away"), (START,), (CHEAP,), (START,))
    need = GroundAction(PlanStep("need"), (START, CHEAP), (GOAL,), ())
    problem = Problem("d", {}, (START,), (GOAL,), (away, need))
    assert answers(process_of(name), problem) == [{"actions": None}]


@pytest.mark.parametrize("name", NAMES)
def test_an_engine_that_minds_costs_ends_with_the_cheaper_plan(process_of, name):
    one = BY_NAME[name]
    if "costs" not in one.features or not (one.optimal or one.anytime):
        pytest.skip(f"{name} promises no cheap plan")
    last = answers(process_of(name), PRICED, 1.0 if one.anytime else 60.0)[-1]
    assert PRICED.cost(last["actions"]) == 1.0


class Acted(Outcome): ...


COUNTING = """(define (domain count) (:functions (n)) (:predicates (done))
  (:action more :parameters () :precondition (< (n) 5) :effect (increase (n) 1))
  (:action stop :parameters () :precondition (>= (n) 3) :effect (done)))"""


@pytest.mark.parametrize("name", NAMES)
def test_an_engine_that_can_count_does(process_of, name, world_of):
    if "numeric" not in BY_NAME[name].features:
        pytest.skip(f"{name} does not say that it can")
    domain = PlanningDomain.parse(COUNTING)
    problem = build_problem(domain, world_of(domain.schema, {}, values={Fact("n"): 0}), parse_condition("(done)"))
    assert "numeric" in problem.features
    plan = problem.plan(answers(process_of(name), problem)[0]["actions"])
    assert [step.action for step in plan.steps] == ["more"] * 3 + ["stop"]


@pytest.mark.skipif(
    all(BY_NAME[name].lacks() for name in ("kairos", "enhsp")), reason="neither kairos nor enhsp is installed"
)
def test_a_simulated_run_with_numbers_uses_the_installed_engine():
    class Counter(Component):
        @skill(after_crash="repeat")
        async def act(self, call: SkillCall) -> Acted:
            return Acted()

    counter = Counter()
    plots = [
        primitive_plot(counter.skills()["act"], name=name, done="acted", implements=name, effects="assumed")
        for name in ("more", "stop")
    ]
    with Robot(COUNTING, plots, [counter], clock="simulated") as robot:
        with robot.knowledge.transaction(author="test") as world:
            world.set("n", 0)
        assert robot.achieve("(done)").reached
        assert robot.knowledge.value("n", ()) == 3


@pytest.mark.parametrize("name", NAMES)
def test_a_search_that_is_ended_leaves_nothing_behind(process_of, name):
    process, family = process_of(name), set()
    deadline = Deadline(60)

    def watch():
        """Note what the search has started, for a while; then end it."""
        limit = Deadline(1.5)
        while limit.left > 0:
            family.update(descendants(process._pid))
        deadline.shorten(0)
        process.wake()

    watching = threading.Thread(target=watch)
    watching.start()
    request = write_problem(lights_out(200 if name == "kairos" else 60))  # Kairos has an answer for 60 at once
    with pytest.raises(OutOfTimeError):
        process.ask(request, deadline, print)
    watching.join()
    assert family
    assert gone(family)
    assert process.alive
    assert session(process._pid) == {process._pid}  # nor is anything left unburied


def test_java_without_enough_memory_fails_and_leaves_no_files(tmp_path, monkeypatch):
    if lacks := BY_NAME["enhsp"].lacks():
        pytest.skip(f"enhsp: {lacks}")
    monkeypatch.chdir(tmp_path)
    process = EngineProcess(worker("enhsp", megabytes=180))
    process.start(60)
    (answer,) = answers(process, lights_out(40))
    assert "failed" in answer  # in which of its parts Java notices first differs
    process.kill()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", NAMES)
def test_a_kill_in_the_middle_of_a_search_leaves_nothing_behind(name):
    process, family = EngineProcess(worker(name)), set()
    process.start(60)

    def watch():
        limit = Deadline(1.5)
        while limit.left > 0:
            family.update(descendants(process._pid))
        process.kill()

    watching = threading.Thread(target=watch)
    watching.start()
    with pytest.raises(Exception, match=r"killed|Bad file|ended"):
        # so large that no engine has an answer by then: a search that has answered may end before the kill
        process.ask(write_problem(lights_out(200)), Deadline(60), print)
    watching.join()
    assert gone({*family, process._pid})

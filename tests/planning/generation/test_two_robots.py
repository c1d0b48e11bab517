"""Two robots clearing two tables: both work at once, and no step takes away what another one relies on (Show 3)."""

import importlib.util
from pathlib import Path

import pytest
from trace_replay import Replay

from dsc.chance import uniform
from dsc.runs.learning import tries_in
from dsc.trace import Record
from knowledge_base.world.overlay import Overlay
from planning.engines.planner import PlannerProcess

EXAMPLE = Path(__file__).parents[3] / "examples" / "two_tables.py"


@pytest.fixture(scope="module")
def two_tables():
    spec = importlib.util.spec_from_file_location("two_tables", EXAMPLE)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def planner():
    """One warm planner for all runs."""
    planner = PlannerProcess()
    yield planner
    planner.kill()


def is_robot_of(author, step):
    return author in step.args


def run(two_tables, planner, items, seed, *, parallel=True):
    records: list[Record] = []
    robots = two_tables.team(items, parallel=parallel, seed=seed, planner=planner)
    before = Overlay(robots.knowledge.snapshot())
    robots.listen(records.append)
    end = robots.achieve(two_tables.GOAL)
    assert end.finished
    assert robots.knowledge.ask(two_tables.GOAL)
    replay = Replay(robots.domain, before, two_tables.GOAL, is_robot_of)
    for record in records:
        replay.take(record)
    return records, replay


def sizes(seed):
    return {robot: int(7 * uniform(seed, robot, "items")) or 1 for robot in ("anna", "bert")}


@pytest.mark.parametrize("seed", range(12))
def test_no_causal_link_is_ever_violated(two_tables, planner, seed):
    records, replay = run(two_tables, planner, sizes(seed), seed)
    assert replay.problems == []
    assert replay.interfering(replay.world) == []
    assert len(replay.ended) == len(replay.steps)
    assert [record.type for record in records].count("plan.found") == 1  # nothing had to be planned again


@pytest.mark.parametrize("parallel", [True, False])
def test_the_trace_says_what_each_step_provides_to_whom(two_tables, planner, parallel):
    records, replay = run(two_tables, planner, {"anna": 2, "bert": 1}, 0, parallel=parallel)
    (ordered,) = [record.data for record in records if record.type == "plan.ordered"]
    assert ordered["steps"] == [str(step) for step in replay.steps.values()]
    said = [f"{provider} -{fact}-> {user}" for provider, fact, user in ordered["links"]]
    assert said
    assert sorted(said) == sorted(
        str(link) for link in replay.links if (link.provider, link.user) != (0, len(replay.steps) + 1)
    )


@pytest.mark.parametrize("seed", range(3))
def test_both_at_once_take_at_most_six_tenths_of_the_time(two_tables, planner, seed):
    items = {"anna": 2 + seed, "bert": 2 + seed}
    apart, replay = run(two_tables, planner, items, seed, parallel=False)
    assert replay.overlapping() == []
    together, replay = run(two_tables, planner, items, seed)
    assert replay.overlapping() != []
    assert together[-1].t <= 0.6 * apart[-1].t


def test_the_checker_finds_a_step_that_takes_away_what_another_one_needs(two_tables, planner):
    records, _ = run(two_tables, planner, {"anna": 2, "bert": 2}, 0)
    robots = two_tables.team({"anna": 2, "bert": 2})
    replay = Replay(robots.domain, Overlay(robots.knowledge.snapshot()), two_tables.GOAL, is_robot_of)
    for record in records:
        if record.type == "knowledge" and ["open", "bin"] in record.data.get("added", []):
            record.data["added"].remove(["open", "bin"])  # as if the lid had been seen to stay closed
        replay.take(record)
    assert any("(open bin)" in problem for problem in replay.problems)


@pytest.mark.parametrize("parallel", [True, False])
def test_each_step_of_a_parallel_plan_is_a_try(two_tables, planner, parallel):
    records, replay = run(two_tables, planner, {"anna": 2, "bert": 2}, 0, parallel=parallel)
    tried = [text for (_, _, situation), _ in tries_in(records, steps=True) for text, _ in situation]
    assert sorted(tried) == sorted(str(step) for step in replay.steps.values())

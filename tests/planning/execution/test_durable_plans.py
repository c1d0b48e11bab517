"""A run that plans, kept in a store: broken off while it plans, executes and replans, it goes on with the same plan."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import pytest

from dsc import Component, Outcome, SkillCall, primitive_plot, skill
from dsc.errors import ChangedError
from dsc.runs.archive import archive
from dsc.sequencer.clock import run_real, run_simulated
from dsc.sequencer.replay import replay
from dsc.trace import Record
from knowledge_base import Delta, InputError, KnowledgeBase, fact
from knowledge_base.errors import StoreError
from planning import PlannerProcess, PlanningDomain, Robot

TEXT = """
(define (domain lights)
  (:types lamp)
  (:predicates (on ?l - lamp) (works ?l - lamp))
  (:action switch-on :parameters (?lamp - lamp) :precondition (works ?lamp) :effect (on ?lamp))
  (:action mend :parameters (?lamp - lamp) :precondition (not (works ?lamp)) :effect (works ?lamp)))
"""
DOMAIN = PlanningDomain.parse(TEXT)
GOAL = "(and (on a) (on b) (on c))"


Lamp = Annotated[str, "lamp"]


class Lit(Outcome): ...


class Mended(Outcome): ...


class Lamps(Component):
    name = "lamps"

    def __init__(self):
        super().__init__()
        self.switched = []

    @skill(after_crash="repeat")
    async def light(self, call: SkillCall, lamp: Lamp) -> Lit:
        await call.clock.sleep(2.0)
        self.switched.append(lamp)
        return Lit(observed=Delta(added=(fact("on", lamp),)))

    @skill(after_crash="repeat")
    async def mend(self, call: SkillCall, lamp: Lamp) -> Mended:
        await call.clock.sleep(3.0)
        return Mended(observed=Delta(added=(fact("works", lamp),)))


def executive(planner, store=None, domain=DOMAIN, more=(), clock="simulated"):
    lamps = Lamps()
    skills = lamps.skills()
    light = primitive_plot(skills["light"], done="lit", implements="switch-on")
    mend = primitive_plot(skills["mend"], done="mended", implements="mend")
    return Robot(domain, [light, mend, *more], [lamps], None, planner, store=store, clock=clock)


def copied(folder, to):
    to.mkdir()
    for file in folder.iterdir():
        if not file.name.endswith(("-lock", "-shm")):
            shutil.copy(file, to)
    return to / "run.kb"


def told(path):
    with archive(path) as runs:
        return [replace(step, records=()) for step in runs.steps(1)], runs.run().ended


@pytest.fixture(scope="module")
def planner():
    process = PlannerProcess()
    yield process
    process.kill()


@pytest.fixture
def whole(planner, tmp_path):
    """A run in which somebody breaks a lamp, so that it plans twice; its records, and copies from each boundary."""
    copies: list[Path] = []
    records: list[Record] = []
    (alive := tmp_path / "alive").mkdir()

    def prepare(sequencer):
        lamps = dict.fromkeys("abc", "lamp")
        works = tuple(fact("works", name) for name in "abc")
        sequencer.knowledge.apply(Delta(nodes=lamps, added=works), "me")
        sequencer.change(Delta(removed=(fact("works", "c"),)), "somebody", after=3.0)
        sequencer.listen(lambda _: copies.append(copied(alive, tmp_path / f"copy{len(copies)}")))

    with executive(planner, alive / "run.kb") as robot:
        robot.listen(records.append)
        arguments = {"goal": GOAL, "holder": "", "replans": 3, "seconds": 5}
        assert robot.run("achieve", arguments, prepare=prepare).finished
        assert robot.knowledge.ask(GOAL)
    return alive / "run.kb", records, copies


def test_wherever_it_is_broken_off_it_goes_on_with_the_same_plan(whole, planner):
    path, records, copies = whole
    kinds = [record.type for record in records]
    assert kinds.count("plan.found") == 2
    assert kinds.count("plan.broken") == 1
    for copy in copies[1:]:
        heard: list[Record] = []
        with executive(planner, copy) as robot:
            robot.listen(heard.append)
            assert robot.resume().finished
            assert robot.knowledge.ask(GOAL)
        assert told(copy) == told(path)
        assert [one.data["plot"] for one in heard if one.type == "plan.found"] == ["plan_1", "plan_2"]
        assert [one.seq for one in heard] == list(range(1, len(heard) + 1))


def test_a_run_with_plans_is_replayed_without_a_planner(whole):
    assert replay(whole[0]).divergence is None


def test_the_planner_remembers_its_plans_as_plain_data(whole, planner):
    with archive(whole[2][-2]) as runs:
        text = runs.latest_snapshot().memory["planner"]
    assert '"plans":2' in text
    assert '"switch-on","c"' in text


def test_a_changed_planning_action_is_refused_with_the_difference(whole, planner):
    copy = whole[2][3]
    other = PlanningDomain.parse(TEXT.replace(":precondition (works ?lamp) :effect (on ?lamp)", ":effect (on ?lamp)"))
    with executive(planner, copy, other) as robot, pytest.raises(ChangedError) as found:
        robot.resume()
    (difference,) = found.value.differences
    assert difference == (
        "the planning action 'switch-on' was "
        "'(:action switch-on :parameters (?lamp - lamp) :precondition (works ?lamp) :effect (on ?lamp))', "
        "now it is '(:action switch-on :parameters (?lamp - lamp) :precondition (and) :effect (on ?lamp))'"
    )
    with executive(planner, copy) as robot:
        assert robot.resume().finished


def test_the_statements_of_a_domain_cover_durations_and_derived_predicates():
    text = """
    (define (domain d) (:types lamp) (:predicates (on ?l - lamp) (dark))
      (:derived (dark) (forall (?l - lamp) (not (on ?l))))
      (:durative-action light :parameters (?l - lamp) :duration (= ?duration 2) :condition (and) :effect (at end (on ?l))))
    """
    before = PlanningDomain.parse(text).statements()
    longer = PlanningDomain.parse(text.replace("duration 2", "duration 3")).statements()
    other = PlanningDomain.parse(text.replace("forall", "exists")).statements()
    assert [name for name in before if before[name] != longer[name]] == ["planning action 'light'"]
    assert [name for name in before if before[name] != other[name]] == ["derived predicate 'dark'"]


def test_only_what_was_begun_in_a_store_can_be_resumed(planner, tmp_path):
    with pytest.raises(StoreError, match="only a run with a store"):
        executive(planner).resume()
    with executive(planner, tmp_path / "run.kb") as robot, pytest.raises(StoreError, match="no unfinished run"):
        robot.resume()


def test_a_run_inside_a_loop_is_kept_and_gone_on_with_like_any_other(whole, planner, tmp_path):
    copies = whole[2]

    async def begun(robot, copy):
        robot.knowledge.apply(Delta(nodes={"a": "lamp"}, added=(fact("works", "a"),)), "me")
        seen: list[Path] = []

        def prepare(sequencer):
            sequencer.listen(lambda _: seen.append(copied(copy.parent, tmp_path / f"inside{len(seen)}")))

        arguments = {"goal": "(on a)", "holder": "", "replans": 3, "seconds": 5}
        assert (await robot.start("achieve", arguments, prepare=prepare)).reached
        return seen

    async def resumed(robot):
        return await robot.resuming()

    (tmp_path / "in").mkdir()
    with executive(planner, tmp_path / "in" / "run.kb") as robot:
        seen = run_simulated(begun(robot, tmp_path / "in" / "run.kb"))
        assert told(tmp_path / "in" / "run.kb")[1] == {
            "finished": True,
            "problem": None,
            "programming_error": None,
            "outputs": {},
        }
    for copy in (seen[-2], copies[-2]):
        with executive(planner, copy, clock=None) as robot:
            with pytest.raises(InputError, match="begun in simulated time and cannot be resumed in real time"):
                run_real(resumed(robot))
            assert run_simulated(resumed(robot)).reached


def test_a_store_brings_its_own_knowledge(planner, tmp_path):
    with pytest.raises(InputError, match="a store provides the knowledge"):
        Robot(DOMAIN, [], [], KnowledgeBase(DOMAIN.schema), planner, store=tmp_path / "run.kb", clock="simulated")


def test_knowledge_and_runs_persist_from_one_program_to_the_next(planner, tmp_path):
    with executive(planner, tmp_path / "run.kb") as robot:
        robot.knowledge.apply(Delta(nodes={"a": "lamp"}, added=(fact("works", "a"),)), "me")
        assert robot.achieve("(on a)").finished
    with executive(planner, tmp_path / "run.kb") as robot:
        assert robot.knowledge.ask("(on a)")
        assert robot.achieve("(on a)").finished
    with archive(tmp_path / "run.kb") as runs:
        assert [run.ended and run.ended["finished"] for run in runs.runs()] == [True, True]


def test_plans_that_are_over_are_not_remembered(whole):
    path, _, _ = whole
    with archive(path) as runs:
        text = runs.latest_snapshot().memory["planner"]
    assert json.loads(text)["runs"] == []

"""The relations of a run and of its design in conditions and queries (S1.6, S1.13, S1.17)."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from domains.clean_up_table.bringup import deploy
from dsc import (
    Component,
    Outcome,
    Parameters,
    SkillCall,
    has_run,
    is_unfinished,
    parse_plot,
    replay,
    run_simulated,
    skill,
)  # fmt: skip
from dsc.dynamic.library import Library
from dsc.reflection import design_rows
from dsc.testing import Crashes, one_history, replays, violations
from dsc.trace import Record
from knowledge_base.errors import InputError
from planning import PlanningDomain, Robot

DOMAIN = "(define (domain d) (:predicates (p)))"


def robot_of(*texts: str, **how: Any) -> tuple[Robot, list[Record]]:
    robot = Robot(DOMAIN, map(parse_plot, texts), how.pop("components", []), **{"clock": "simulated", **how})
    records: list[Record] = []
    robot.listen(records.append)
    return robot, records


def asked(robot: Robot, plot: str, at: float, *queries: str) -> list[list[dict[str, Any]]]:
    """Return the answers of queries at a second of a run."""

    async def main():
        run = robot.start(plot)
        await asyncio.sleep(at)
        answers = [robot.knowledge.query(query) for query in queries]
        run.cancel("asked")
        await run
        return answers

    return run_simulated(main())


# -- the design ----------------------------------------------------------------------------------------------


def test_the_design_is_asked_during_a_run():
    with deploy() as robot:
        touching, answering, implementing = asked(
            robot, "clean_up_table", 1.0,
            "(dsc:touches ?plot arm)", "(dsc:answers clean_up_table grasp_failed ?response)",
            "(and (dsc:implements ?plot pick-up) (dsc:triggers ?plot ?skill))",
        )  # fmt: skip
    assert {"plot": "stack"} in touching
    assert {"plot": "clean_up_table"} in touching  # by the plots that it uses
    assert {"plot": "drive_direct"} not in touching
    assert answering[0] == {"response": "grasp_failed: reposition, retry"}
    assert {one["plot"] for one in implementing} == {"pick_up_from_above", "pick_up_from_side"}


TOUCHING = """
plot: main
states: {ask: {dynamic: [], goal: (p), on: {done: over, no_plan: over, gave_up: over}}, over: {final: true}}
"""
LISTENING = """
plot: guard
states: {s: {use: main, on: {done: e}}, e: {final: true}}
handlers: [{on: moved, listen: {trigger: leg.walk}, do: {command: {switch: lamp, to: scan}}}]
"""


def test_plans_rules_and_handlers_touch_components_too():
    rows = design_rows(lambda: Library(map(parse_plot, (TOUCHING, LISTENING, MOVING))))
    touching = set(rows["dsc:touches"]())
    assert touching == {("main", "arm"), ("guard", "arm"), ("guard", "lamp"), ("guard", "leg"), ("move", "arm")}


MOVING = "{plot: move, implements: go, states: {s: {entry: {trigger: arm.move}, on: {moved: e}}, e: {final: true}}}"
DYNAMIC = """
plot: main
states:
  rest: {after: {seconds: 1, to: work}}
  work: {dynamic: {offers: job}, on: {done: over, no_candidate: over}}
  over: {final: true}
"""
JOB = "{plot: job, offers: job, states: {s: {after: {seconds: 1, to: e}}, e: {final: true}}}"


def test_a_plot_that_arrives_is_part_of_the_design():
    robot, _ = robot_of(DYNAMIC)
    query = "(dsc:candidate main work ?plot)"

    async def main():
        run = robot.start("main")
        await asyncio.sleep(0.2)
        assert robot.knowledge.query(query) == []
        run.install(parse_plot(JOB))
        await asyncio.sleep(0.1)
        assert robot.knowledge.query(query) == [{"plot": "job"}]
        assert (await run).reached

    with robot:
        run_simulated(main())


# -- the configuration ---------------------------------------------------------------------------------------

NESTED = """
plot: main
states:
  both:
    on: {done: over}
    regions:
      left: {states: {work: {use: part, on: {done: left_over}}, left_over: {final: true}}}
      right:
        states:
          wait: {always: {when: (dsc:active both/work/second), to: saw}}
          saw: {after: {seconds: 0.5, to: right_over}}
          right_over: {final: true}
  over: {final: true}
"""
PART = """
plot: part
states:
  first: {after: {seconds: 1, to: second}}
  second: {after: {seconds: 1, to: end}}
  end: {final: true}
"""


def test_active_states_and_running_plots_are_asked():
    robot, _ = robot_of(NESTED, PART)
    with robot:
        active, running = asked(robot, "main", 0.5, "(dsc:active ?state)", "(dsc:running ?state ?plot)")
    assert [one["state"] for one in active] == ["both", "work", "work/first", "wait"]
    assert running == [{"state": "work", "plot": "part"}]


def test_a_guard_on_the_configuration_is_taken_after_the_change():
    robot, records = robot_of(NESTED.replace("both/work/second", "work/second"), PART)
    with robot:
        assert robot.run("main").reached
    seen = [one.t for one in records if one.type == "step" and "saw" in str(one.data)]
    assert seen[0] == 1.0


CHOOSING = """
plot: main
variables: {n: {type: number, initial: 0}}
states:
  quick: {after: {seconds: 1, to: from_quick}}
  from_quick: {dynamic: [was_quick, other], on: {done: slow, no_candidate: slow}}
  slow: {after: {seconds: 1, to: from_slow}}
  from_slow: {dynamic: [was_quick, other], on: {done: over, no_candidate: over}}
  over: {final: true}
"""
WAS_QUICK = "{plot: was_quick, when: (dsc:active quick), states: {s: {final: true}}}"
OTHER = "{plot: other, states: {s: {final: true}}}"


def chosen(records: list[Record]) -> list[Any]:
    return [one.data["chosen"] for one in records if one.type == "decision"]


def test_a_candidate_reads_the_configuration_before_the_macrostep():
    robot, records = robot_of(CHOOSING, WAS_QUICK, OTHER)
    with robot:
        assert robot.run("main").reached
    assert chosen(records) == ["was_quick", "other"]


def test_an_installed_condition_on_the_configuration_fires():
    robot, _ = robot_of(CHOOSING, WAS_QUICK, OTHER)
    fired: list[object] = []

    async def main():
        condition = robot.knowledge.install("(dsc:active slow)")
        condition.listen(fired.append) if hasattr(condition, "listen") else condition.subscribe(fired.append)
        return await robot.start("main")

    with robot:
        assert run_simulated(main()).reached
    assert len(fired) == 1


def test_after_a_run_no_state_is_active():
    robot, _ = robot_of(CHOOSING, WAS_QUICK, OTHER)
    with robot:
        robot.run("main")
        assert robot.knowledge.query("(dsc:active ?state)") == []


# -- components ----------------------------------------------------------------------------------------------


class Moved(Outcome): ...


class ArmParameters(Parameters):
    speed: float = 1.0


class Arm(Component):
    """An arm with modes, whose `move` takes a second, and whose `break_down` ends its life."""

    name = "arm"
    modes = ("scan", "hold")
    parameters: ArmParameters

    @skill
    async def move(self, call: SkillCall) -> Moved:
        await call.clock.sleep(1)
        return Moved()

    @skill
    async def break_down(self, call: SkillCall) -> Moved:
        await call.clock.sleep(0.5)
        self.life.fail(RuntimeError("no power"))
        await call.clock.sleep(0.5)
        return Moved()


WAITING = """
plot: main
states:
  both:
    on: {done: over}
    regions:
      first: {states: {one: {entry: {trigger: arm.move}, on: {moved: first_over}}, first_over: {final: true}}}
      second: {states: {two: {entry: {trigger: arm.move}, on: {moved: second_over}}, second_over: {final: true}}}
  over: {final: true}
"""


def test_skills_and_waits_are_asked():
    robot, _ = robot_of(WAITING, components=[Arm()])
    with robot:
        executing, waiting, skills = asked(
            robot, "main", 0.5, "(dsc:executes ?state ?skill)", "(dsc:waits ?who arm)", "(dsc:outcome ?skill moved)"
        )
    assert executing == [{"state": "one", "skill": "arm.move"}]
    assert waiting == [{"who": "two"}]
    assert {one["skill"] for one in skills} == {"arm.move", "arm.break_down"}


FOLLOWING = """
plot: main
states:
  both:
    on: {done: over}
    regions:
      driving:
        states:
          idle: {after: {seconds: 1, to: scanning}}
          scanning: {entry: [{switch: arm, to: scan}, {set: arm.speed, to: 0.5}], after: {seconds: 1, to: holding}}
          holding: {entry: [{switch: arm, to: hold}], after: {seconds: 1, to: breaking}}
          breaking: {entry: {trigger: arm.break_down}, on: {moved: driven, skill_error: driven}}
          driven: {final: true}
      watching:
        states:
          wait: {always: {when: (dsc:component-mode arm scan), to: scans}}
          scans: {always: {when: (exists (?value) (and (dsc:component-parameter arm speed ?value) (< ?value 0.6))), to: slow}}
          slow: {always: {when: (exists (?arm) (dsc:component-mode ?arm hold)), to: holds}}
          holds: {always: {when: (dsc:component-life arm fatal_error), to: broken}}
          broken: {final: true}
  over: {final: true}
"""


def entered(records: list[Record], *states: str) -> list[float]:
    """Return the seconds at which the states were entered."""
    steps = [(one.t, micro) for one in records if one.type == "step" for micro in one.data["microsteps"]]
    return [round(t, 2) for state in states for t, micro in steps if state in micro["entered"]]


def test_guards_on_components_are_taken_after_the_change():
    robot, records = robot_of(FOLLOWING, components=[Arm()])
    with robot:
        assert robot.run("main").reached
    assert entered(records, "scans", "slow", "holds", "broken") == [1.0, 1.0, 2.0, 3.5]


@pytest.mark.parametrize("seed", range(10))
def test_a_replay_repeats_what_plots_read_of_components(seed, tmp_path):
    crashes: Crashes[list[Record]] = Crashes(tmp_path, seed, chance=0.1, most=3)

    def live(folder: Path):
        store = folder / "run.kb"
        robot, records = robot_of(FOLLOWING, components=[Arm()], store=store)
        with robot:
            if not has_run(store):
                robot.run("main", prepare=crashes.watch)
            elif is_unfinished(store):
                robot.resume(prepare=crashes.watch)
            return records

    crashes.survive(live)
    assert crashes.problems == []
    assert violations(crashes.folder / "run.kb", [one_history, replays()]) == []
    replayed = replay(crashes.folder / "run.kb")
    assert replayed.divergence is None
    assert replayed.steps >= 8


# -- mistakes and limits -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("domain", "said"),
    [
        ("(:action a :precondition (dsc:active work) :effect (p))", "cannot read it"),
        ("(:action a :effect (dsc:active work))", "read-only"),
        ("(:action a :effect (when (dsc:active work) (p)))", "cannot read it"),
    ],
)
def test_planning_does_not_read_the_run(domain, said):
    with pytest.raises(InputError, match=said):
        PlanningDomain.parse(f"(define (domain d) (:predicates (p)) {domain})")


def test_goals_do_not_read_the_run():
    robot, _ = robot_of(CHOOSING, WAS_QUICK, OTHER)
    with robot, pytest.raises(InputError, match="goals and planning actions cannot read it"):
        robot.achieve("(dsc:active slow)")


def test_a_wrong_name_has_its_nearest_valid_name():
    with pytest.raises(InputError, match="did you mean 'dsc:active'"):
        robot_of(CHOOSING, WAS_QUICK.replace("dsc:active", "dsc:actve"), OTHER)


def test_the_relations_are_read_only():
    with pytest.raises(InputError, match="read-only"):
        robot_of(CHOOSING.replace("to: from_quick}", "to: from_quick, tell: (dsc:active quick)}"), WAS_QUICK, OTHER)


# -- kept runs -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(10))
def test_a_run_that_is_killed_and_resumed_chooses_alike(seed, tmp_path):
    crashes: Crashes[list[Any]] = Crashes(tmp_path, seed, chance=0.2, most=4)

    def live(folder: Path):
        store = folder / "run.kb"
        robot, records = robot_of(CHOOSING, WAS_QUICK, OTHER, store=store)
        with robot:
            if not has_run(store):
                robot.run("main", prepare=crashes.watch)
            elif is_unfinished(store):
                robot.resume(prepare=crashes.watch)
            return chosen(records)

    assert crashes.survive(live) in ([], ["was_quick", "other"])
    assert crashes.problems == []
    assert violations(crashes.folder / "run.kb", [one_history, replays()]) == []
    assert replay(crashes.folder / "run.kb").divergence is None

"""Plots that are installed, replaced and removed during a run: checked, kept, killed and resumed (S0.19, S2.7, S2.8)."""

from __future__ import annotations

import asyncio
import random
from pathlib import Path
from typing import Any

import pytest

from dsc import Component, Outcome, SkillCall, has_run, is_unfinished, parse_plot, replay, run_simulated, skill
from dsc.testing import Crashes, one_history, replays, violations
from dsc.trace import Record
from knowledge_base.errors import InputError
from knowledge_base.facts import Delta, fact
from planning import Bundle, Robot

DOMAIN = "(define (domain d) (:predicates (p)))"


class Moved(Outcome): ...


class Arm(Component):
    name = "arm"

    def __init__(self) -> None:
        super().__init__()
        self.moves: list[tuple[float, str]] = []

    @skill(after_crash="repeat")
    async def move(self, call: SkillCall, to: str, seconds: float = 1.0) -> Moved:
        self.moves.append((call.clock.now(), to))
        await call.clock.sleep(seconds)
        return Moved()


MAIN = """
plot: main
variables: {rounds: {type: number, initial: 0}}
receives: {again: }
states:
  work: {use: part, with: {item: cup}, on: {done: {to: pause, assign: {rounds: (+ ?rounds 1)}}}}
  pause:
    after:
      - {seconds: 1, when: (< ?rounds 4), to: work}
      - {seconds: 1, when: (>= ?rounds 4), to: over}
  over: {final: true}
"""
PART = """
plot: part
parameters: {item: text}
variables: {count: {type: number, initial: 0}}
states:
  first: {entry: {trigger: arm.move, with: {to: a}}, on: {moved: {to: second, assign: {count: (+ ?count 1)}}}}
  second: {entry: {trigger: arm.move, with: {to: b}}, on: {moved: end}}
  end: {final: true}
"""
# `first` is equal; `second` is another one; `third` is new
OTHER = """
plot: part
parameters: {item: text}
variables: {count: {type: number, initial: 0}}
states:
  first: {entry: {trigger: arm.move, with: {to: a}}, on: {moved: {to: third, assign: {count: (+ ?count 10)}}}}
  third: {entry: {trigger: arm.move, with: {to: c}}, on: {moved: second}}
  second: {entry: {trigger: arm.move, with: {to: d}}, on: {moved: end}}
  end: {final: true}
"""


def robot_of(*texts: str, **how: Any) -> tuple[Robot, list[Record]]:
    plots = map(parse_plot, texts or (MAIN, PART))
    robot = Robot(DOMAIN, plots, [Arm()], **{"clock": "simulated", **how})
    records: list[Record] = []
    robot.listen(records.append)
    return robot, records


def changed(at: float, change: Any, *texts: str) -> tuple[Any, list[tuple[float, str]], list[Record]]:
    """Run the plot `main` with a change of plots at a second of run time; return end, moves and records."""
    robot, records = robot_of(*texts)

    async def main() -> Any:
        run = robot.start("main", open_ended=False)
        await asyncio.sleep(at)
        change(run)
        return await run

    with robot:
        end = run_simulated(main())
        return end, moves_of(robot), records


def moves_of(robot: Robot) -> list[tuple[float, str]]:
    (arm,) = robot.components
    assert isinstance(arm, Arm)
    return arm.moves


def destinations(moves: list[tuple[float, str]]) -> str:
    return "".join(to for _, to in moves)


# -- running plots -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("active", "at", "moves"),
    [
        ("at_next_entry", 0.5, "ab" + "acd" * 3),
        ("keep", 0.5, "acd" * 4),  # the skill of `first` continues
        ("keep", 1.5, "abacd" + "acd" * 3),  # `second` is another state, so that the plot starts again
        ("restart", 0.5, "aacd" + "acd" * 3),
        ("restart", 1.5, "abacd" + "acd" * 3),
        ("keep", 2.5, "ab" + "acd" * 3),  # it is not running
        ("restart", 2.5, "ab" + "acd" * 3),
    ],
)
def test_running_plots_are_treated_as_chosen(active, at, moves):
    end, done, records = changed(at, lambda run: run.replace(parse_plot(OTHER), active=active))
    assert end.reached
    assert destinations(done) == moves
    (record,) = [one for one in records if one.type == "plots"]
    assert record.data == {"replaced": ["part"], "active": active}


def test_a_kept_state_keeps_its_skill_and_the_plot_its_variables():
    _, moves, records = changed(0.5, lambda run: run.replace(parse_plot(OTHER), active="keep"))
    assert moves[:2] == [(0.0, "a"), (1.0, "c")]
    counts = [one.data["variables"].get("work", {}).get("count") for one in records if "variables" in one.data]
    assert 10 in counts
    assert not [one for one in records if one.data.get("action") == "cancel"]


def test_the_plot_of_the_run_itself_is_replaced():
    text = MAIN.replace("4", "2")
    for active, moves in (("keep", "abab"), ("restart", "ab" + "abab"), ("at_next_entry", "abababab")):
        end, done, _ = changed(2.5, lambda run, how=active: run.replace(parse_plot(text), active=how))
        assert end.reached
        assert destinations(done) == moves


def test_a_handler_is_added_to_a_running_plot():
    handler = """
handlers:
  - on: again
    do: {use: part, with: {item: can}}
"""
    robot, _ = robot_of()

    async def main() -> Any:
        run = robot.start("main")
        await asyncio.sleep(0.5)
        run.replace(parse_plot(MAIN + handler), active="keep")
        await asyncio.sleep(0.1)
        run.post("again")
        return await run

    with robot:
        assert run_simulated(main()).reached
        assert len(moves_of(robot)) == 10


def test_a_replaced_plot_can_be_replaced_again():
    def change(run):
        run.replace(parse_plot(OTHER))
        run.replace(parse_plot(PART.replace("to: b", "to: e")), active="keep")

    _, moves, _ = changed(0.5, change)
    assert destinations(moves) == "ae" * 4


def test_a_change_with_which_a_running_plot_cannot_continue_is_refused():
    needs = MAIN.replace("variables:", "parameters: {side: {type: text}}\nvariables:")
    end, moves, records = changed(0.5, lambda run: run.replace(parse_plot(needs), active="restart"))
    assert end.reached
    assert destinations(moves) == "ab" * 4
    (record,) = [one for one in records if one.type == "plots"]
    assert record.data["refused"] == "plot 'main' needs its parameter 'side'"


# -- arrivals ------------------------------------------------------------------------------------------------

OPEN = """
plot: main
variables: {rounds: {type: number, initial: 0}}
states:
  work: {dynamic: {offers: job}, on: {done: {to: pause, assign: {rounds: (+ ?rounds 1)}}, no_candidate: pause}}
  pause:
    after:
      - {seconds: 1, when: (< ?rounds 2), to: work}
      - {seconds: 1, when: (>= ?rounds 2), to: over}
  over: {final: true}
"""
JOB = """
plot: job
offers: job
states: {go: {entry: {trigger: arm.move, with: {to: x}}, on: {moved: end}}, end: {final: true}}
"""


def test_a_plot_that_arrives_during_a_run_is_chosen():
    bundle = Bundle("jobs", plots=(parse_plot(JOB),))
    end, moves, records = changed(3.5, lambda run: run.install(bundle), OPEN)
    assert end.reached
    assert moves == [(4.0, "x"), (6.0, "x")]
    assert [one.data for one in records if one.type == "plots"] == [{"installed": ["job"], "active": "at_next_entry"}]


def test_a_removed_plot_is_no_longer_chosen():
    def change(run):
        run.remove("job")
        run.install(parse_plot(JOB.replace("job", "task", 1).replace("to: x", "to: y")))

    end, moves, _ = changed(0.5, change, OPEN, JOB)
    assert end.reached
    assert destinations(moves) == "xy"


BAD = [
    (JOB.replace("arm.move", "arm.fly"), "fly"),
    (JOB.replace("arm.move", "leg.move"), "leg"),
    (JOB.replace("to: x", "too: x"), "too"),
    (JOB.replace("to: x", "to: 3"), "text"),
    (JOB.replace("moved: end", "movd: end"), "movd"),
    (JOB.replace("moved: end", "moved: ende"), "ende"),
    (JOB.replace("end: {final", "ende: {final"), "end"),
    (JOB.replace("plot: job", "plot: main"), "there is already a plot 'main'"),
    (JOB.replace("offers: job", "offers: job\nemits: {lost: }"), "lost"),
    (JOB.replace("offers: job", "offers: job\nparameters: {item: text}"), "item"),
    (JOB.replace("offers: job", "offers: job\nparameters: {item: thing}"), "thing"),
    (JOB.replace("offers: job", "offers: job\nwhen: (q)"), "'q'"),
    (JOB.replace("offers: job", "offers: job\nwhen: (p ?x)"), "p"),
    (JOB.replace("offers: job", "offers: job\nimplements: go"), "go"),
    (JOB.replace("offers: job", "offers: job\noutputs: {found: text}"), "found"),
    (JOB.replace("offers: job", "offers: job\nvariables: {n: numbr}"), "numbr"),
    (JOB.replace("offers: job", "offers: job\nutility: high"), "high"),
    (JOB.replace("offers: job", "offers: job\nrules: [{on: nothing, do: {then: retry}}]"), "nothing"),
    (JOB.replace("offers: job", "offers: job\nrules: [{on: done, do: {use: fix}}]"), "fix"),
    (JOB.replace("offers: job", "offers: job\nhandlers: [{on: bell, do: {use: fix}}]"), "fix"),
    (JOB.replace("entry: {trigger: arm.move, with: {to: x}}", "use: part"), "part"),
    (JOB.replace("entry: {trigger: arm.move, with: {to: x}}", "use: job"), "job"),
    (JOB.replace("entry: {trigger: arm.move, with: {to: x}}", "dynamic: [part]"), "part"),
    (JOB.replace("entry: {trigger: arm.move, with: {to: x}}", "goal: (q)"), "'q'"),
    (JOB.replace("entry: {trigger", "entry: {set: arm.speed, to: 1}, exit: {trigger"), ""),
    (JOB.replace("on: {moved: end}", "on: {moved: {to: end, tell: (q)}}"), "'q'"),
    (JOB.replace("on: {moved: end}", "on: {moved: {to: end, assign: {n: 1}}}"), "'n'"),
    (JOB.replace("on: {moved: end}", "on: {moved: {to: end, when: (p ?event.who)}}"), ""),
    (JOB.replace("on: {moved: end}", "after: {seconds: soon, to: end}"), ""),
    (JOB.replace("on: {moved: end}", "on: {done: end}"), ""),
]


def test_bad_arrivals_are_refused_and_the_run_goes_on():
    assert len(BAD) == 30
    refused: list[str] = []

    def change(run):
        for text, _ in BAD:
            try:
                run.install(parse_plot(text, "arrives.yaml"))
            except InputError as error:
                refused.append(str(error))

    end, moves, records = changed(0.5, change, OPEN, JOB.replace("plot: job", "plot: other"))
    assert end.reached
    assert destinations(moves) == "xx"
    assert not [one for one in records if one.type == "plots"]
    assert len(refused) == len(BAD)
    for said, (_, word) in zip(refused, BAD, strict=True):
        assert word in said
        assert any(one in said for one in ("arrives.yaml:", "main", f"{Path(__file__).name}:"))


def test_unknown_treatments_names_and_values_are_refused():
    wrong = [
        lambda run: run.replace(parse_plot(PART), active="kep"),
        lambda run: run.replace(parse_plot(JOB)),
        lambda run: run.install("part"),
        lambda run: run.install([parse_plot(JOB), parse_plot(JOB)]),
        lambda run: run.remove("prt"),
        lambda run: run.remove("part"),  # `main` needs it
    ]
    said: list[str] = []

    def change(run):
        for one in wrong:
            with pytest.raises(InputError) as error:
                one(run)
            said.append(str(error.value))

    end, moves, _ = changed(0.5, change)
    assert end.reached
    assert destinations(moves) == "ab" * 4
    assert "did you mean 'keep'?" in said[0]
    assert "did you mean 'part'?" in said[4]
    assert "there is no plot 'part'" in said[5]


def test_a_run_that_has_ended_is_not_changed():
    robot, _ = robot_of()

    async def main() -> None:
        run = robot.start("main")
        await run
        with pytest.raises(InputError, match="has ended"):
            run.replace(parse_plot(OTHER))

    with robot:
        run_simulated(main())


def test_later_runs_have_the_plots_of_the_robot():
    robot, _ = robot_of()

    async def main() -> None:
        run = robot.start("main")
        run.replace(parse_plot(OTHER))
        await run
        await robot.start("main")

    with robot:
        run_simulated(main())
        assert destinations(moves_of(robot))[-8:] == "ab" * 4


def test_plots_that_are_added_to_a_robot_are_checked_at_the_next_start():
    robot, _ = robot_of()
    with robot:
        robot.library.add(parse_plot(JOB.replace("arm.move", "arm.fly")))
        with pytest.raises(InputError, match="fly"):
            robot.run("main")


# -- kept runs -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(100))
def test_a_run_that_is_killed_and_resumed_has_an_equal_end(seed, tmp_path):
    chance = random.Random(f"changes {seed}")  # noqa: S311  no secret depends on it
    at, active = round(chance.uniform(0.0, 12.0), 3), chance.choice(["at_next_entry", "keep", "restart"])
    job = chance.random() < 0.5

    def change(sequencer):
        if job:
            sequencer.install(parse_plot(JOB))
        sequencer.replace([parse_plot(OTHER), parse_plot(MAIN.replace("4", "3"))], active=active)

    crashes: Crashes[list[tuple[float, str]]] = Crashes(tmp_path, seed, chance=0.15, most=6)

    def live(folder: Path):
        robot, records = robot_of(store=folder / "run.kb")

        def prepare(sequencer):
            crashes.watch(sequencer)
            if len([one for one in records if one.type == "plots"]) < 1 + job:
                sequencer.clock.call_at(max(at, sequencer.clock.now()), lambda: change(sequencer))

        with robot:
            crashes.inject(robot.components[0])
            if not has_run(folder / "run.kb"):
                robot.run("main", prepare=prepare)
            elif is_unfinished(folder / "run.kb"):
                robot.resume(prepare=prepare)
            return entered(records)

    found = crashes.survive(live)
    robot, records = robot_of()
    with robot:
        robot.run("main", prepare=lambda one: one.clock.call_at(at, lambda: change(one)))
    assert found in ([], entered(records))
    assert crashes.problems == []
    assert violations(crashes.folder / "run.kb", [one_history, replays()]) == []


def entered(records: list[Record]) -> list[tuple[float, str]]:
    return [(one.t, path) for one in records if one.type == "step" for path in one.data.get("entered", ())]


def test_changes_that_share_a_commit_with_other_messages_are_known(tmp_path):
    robot, records = robot_of(store=tmp_path / "run.kb")

    async def main() -> None:
        run = robot.start("main")
        await asyncio.sleep(0.5)
        run.install(parse_plot(JOB))
        run.change(Delta(added=(fact("p"),)), "test")
        await asyncio.sleep(0.5)
        run.remove("job")
        run.change(Delta(removed=(fact("p"),)), "test")
        await asyncio.sleep(0.5)
        run.install(parse_plot(JOB))
        await run

    with robot:
        run_simulated(main())
    assert [next(iter(one.data)) for one in records if one.type == "plots"] == ["installed", "removed", "installed"]


def test_a_kept_run_is_resumed_by_a_program_with_the_changed_plots(tmp_path):
    for texts in ((MAIN, PART), (MAIN, OTHER)):
        store = tmp_path / f"{len(texts[1])}.kb"
        robot, _ = robot_of(store=store)

        async def main(robot=robot) -> None:
            run = robot.start("main")
            await asyncio.sleep(0.5)
            run.replace(parse_plot(OTHER))
            await asyncio.sleep(3)
            await run.suspend()

        with robot:
            run_simulated(main())
        again, _ = robot_of(*texts, store=store)
        with again:
            assert again.resume().reached
            assert destinations(moves_of(again))[-6:] == "acd" * 2
        assert replay(store).divergence is None

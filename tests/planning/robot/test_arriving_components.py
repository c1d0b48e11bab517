"""Components that arrive during a run: they are checked, wired, used, kept and stopped (S0.19)."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

import pytest

from dsc import (
    Component,
    Outcome,
    Parameters,
    QueryClient,
    SkillCall,
    has_run,
    is_unfinished,
    parse_plot,
    query,
    replay,
    run_simulated,
    skill,
)  # fmt: skip
from dsc.runs.archive import archive
from dsc.testing import Crashes, one_history, replays, violations
from dsc.trace import Record
from knowledge_base.errors import InputError
from planning import Bundle, Robot, Run

DOMAIN = "(define (domain d) (:predicates (p)))"
OPEN = """
plot: main
states:
  rest: {after: {seconds: 1, to: work}}
  work: {dynamic: {offers: job}, on: {done: tired, no_candidate: tired}}
  tired: {after: {seconds: 1, to: again}}
  again: {dynamic: {offers: job}, on: {done: over, no_candidate: over}}
  over: {final: true}
"""
JOB = """
plot: job
offers: job
states: {go: {entry: {trigger: arm.move, with: {to: x}}, on: {moved: end}}, end: {final: true}}
"""


class Moved(Outcome): ...


class Charge(Outcome):
    volts: float


class Arm(Component):
    name = "arm"
    power = QueryClient({}, answer={"volts": "number"}, optional=True)

    def __init__(self) -> None:
        super().__init__()
        self.moves: list[tuple[str, str | None]] = []
        self.lives: list[str] = []

    async def start(self) -> None:
        self.lives.append("start")

    async def stop(self) -> None:
        self.lives.append("stop")

    @skill(after_crash="repeat")
    async def move(self, call: SkillCall, to: str) -> Moved:
        self.moves.append((to, self.power.provider_name()))
        await call.clock.sleep(0.5)
        return Moved()


class Cell(Component):
    name = "cell"

    @query
    async def charge(self) -> Charge:
        return Charge(volts=12.0)


class Battery(Cell):
    name = "battery"


def changed(
    at: float, change: Callable[[Run[Any]], object], *components: Component, plots: tuple[str, ...] = (OPEN,)
) -> tuple[Any, list[Record]]:
    """Return the end and the records of a run with a change at a second of run time."""
    robot = Robot(DOMAIN, map(parse_plot, plots), components, clock="simulated")
    records: list[Record] = []
    robot.listen(records.append)

    async def main() -> Any:
        run = robot.start("main")
        await asyncio.sleep(at)
        change(run)
        return await run

    with robot:
        return run_simulated(main()), records


def test_a_component_that_arrives_is_used_and_stopped_at_the_end():
    arm = Arm()
    end, records = changed(1.5, lambda run: run.install(parse_plot(JOB), [arm]))
    assert end.reached
    assert [to for to, _ in arm.moves] == ["x"]
    assert arm.lives == ["start", "stop"]
    (told,) = [one.data for one in records if one.type == "plots"]
    assert told == {"installed": ["job"], "components": ["arm"], "active": "at_next_entry"}


def test_a_component_may_precede_its_plots():
    arm = Arm()

    def change(run: Run[Any]) -> None:
        run.install(components=[arm])
        run.install(parse_plot(JOB))

    assert changed(0.5, change)[0].reached
    assert len(arm.moves) == 2


def test_a_bundle_brings_its_components():
    arms: list[Arm] = []

    def components() -> list[Component]:
        arms.append(Arm())
        return [arms[-1], Cell()]

    bundle = Bundle("jobs", plots=(parse_plot(JOB),), components=components)
    cell = Cell()
    assert changed(0.5, lambda run: run.install(bundle), cell)[0].reached
    assert arms[0].moves == [("x", "cell.charge")] * 2


def test_a_provider_that_arrives_is_wired_and_a_further_one_changes_no_wire():
    arm = Arm()

    def change(run: Run[Any]) -> None:
        run.install(components=[Cell()])
        run.install(components=[Battery()])

    assert changed(2.0, change, arm, plots=(OPEN, JOB))[0].reached
    assert arm.moves == [("x", None), ("x", "cell.charge")]


class Needy(Component):
    name = "needy"
    needs: ClassVar = {"neutral": ("motor",)}


class UnsetParameters(Parameters):
    port: str


class Unset(Component):
    name = "unset"
    parameters: UnsetParameters


class Choosy(Arm):
    name = "choosy"
    power = QueryClient({}, answer={"volts": "number"})


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda run: run.install(components=[Cell()]), "there is already a component 'cell'"),
        (lambda run: run.install(components=[Needy()]), "component 'needy' needs a component 'motor'"),
        (lambda run: run.install(components=[Unset()]), r"'unset.port' has no value"),
        (lambda run: run.install(components=[Battery(), Choosy()]), "cell.charge"),
        (lambda run: run.install(components=[Arm]), "a component is an instance"),
        (lambda run: run.install(components=[Arm(), Arm()]), "two components are named 'arm'"),
        (lambda run: run.install(parse_plot(JOB.replace("move", "fly")), [Arm()]), "fly"),
        (lambda run: run.install(parse_plot(JOB)), "arm"),
    ],
)
def test_a_bad_arrival_is_refused_and_the_run_is_unharmed(change, said):
    refused: list[InputError] = []

    def attempt(run: Run[Any]) -> None:
        with pytest.raises(InputError, match=said) as error:
            change(run)
        refused.append(error.value)

    end, records = changed(0.5, attempt, Cell())
    assert len(refused) == 1
    assert end.reached
    assert not any(one.type == "plots" for one in records)


@pytest.mark.parametrize("seed", range(20))
def test_a_run_with_an_arrived_component_is_resumed_and_replayed(seed, tmp_path):
    crashes: Crashes[Any] = Crashes(tmp_path, seed, chance=0.2, most=3)

    def live(folder: Path) -> Any:
        store = folder / "run.kb"
        begun = has_run(store)
        robot = Robot(DOMAIN, [parse_plot(OPEN)], [Arm()] if begun else [], store=store, clock="simulated")

        async def first() -> Any:
            run = robot.start("main", prepare=crashes.watch)
            await asyncio.sleep(0.5)
            run.install(parse_plot(JOB), [Arm()])
            return await run

        with robot:
            if not begun:
                return run_simulated(first()).reached
            return robot.resume(prepare=crashes.watch).reached if is_unfinished(store) else True

    assert crashes.survive(live)
    store = crashes.folder / "run.kb"
    assert violations(store, [one_history, replays()]) == []
    assert replay(store).divergence is None
    with archive(store) as runs:
        assert runs.run().ended is not None

"""Judgement of a run: the parts of its task that are left, in the true world or in the knowledge base."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from dsc.components.hooks import contained
from dsc.sequencer.clock import ClockKind
from dsc.sequencer.run_end import RunEnd
from knowledge_base.language.syntax.text import parse_condition
from knowledge_base.store import KnowledgeBase
from planning.analysis.explanation import unmet
from planning.model.domain import PlanningDomain
from planning.problem.derived import derivation
from planning.robot.bundles import Bundle
from planning.robot.report import Judge, Report, reason_of_end, summarise
from planning.robot.simulation import Left, Simulation, left_in
from planning.robot.tally import Tally
from planning.robot.task import Task


@dataclass(frozen=True, slots=True)
class Judgement:
    """Judgement of the runs of one task.

    Attributes:
        task: the task.
        bundle: the bundle of the robot, whose simulation checks only the bundle's own task; `None` without a bundle.
        simulation: the simulated world; `None` without a simulation.
        knowledge: the knowledge base after the run.
        domain: the planning domain of the robot.
    """

    task: Task
    bundle: Bundle | None
    simulation: Simulation | None
    knowledge: KnowledgeBase
    domain: PlanningDomain

    def left(self) -> int | None:
        """Return the number of parts of the task that are left in the simulated world; `None` if it checks no task."""
        found = self._left_in_world()
        return None if found is None else len(found)

    def report(
        self, name: str, end: RunEnd, tally: Tally, failures: frozenset[str], wall_s: float, clock: ClockKind
    ) -> Report:
        """Return the report of a run that has ended.

        Args:
            name: the name of the robot.
            end: the end of the run.
            tally: the counts of the run.
            failures: the outcomes of skills that count as failures, see `Robot.failures`.
            wall_s: the duration in real time, in seconds.
            clock: the kind of time of the run.
        """
        judge, left = self._verdict(end, tally.gave_up)
        report = summarise(name, judge, left, tally, end, failures, wall_s, clock)
        world = self.simulation
        if world is None:
            return report
        with contained(f"{type(world).__name__}.own_report"):
            own: Mapping[str, Any] = world.own_report(self.knowledge, end)
            headline = world.headline(own, reached=report.goal_reached) if judge == "world" else None
        return replace(report, own=own, faults=tuple(world.fired), headline=headline or report.headline)

    def _verdict(self, end: RunEnd, gave_up: str) -> tuple[Judge, list[Left]]:
        world, why = self.simulation, reason_of_end(end, gave_up)
        if world is not None and (left := self._left_in_world()) is not None:
            with contained(f"{type(world).__name__}.reason"):
                reasons = [world.reason(one, self.knowledge, end) or why for one in left]
            return "world", [replace(one, reason=reason) for one, reason in zip(left, reasons, strict=True)]
        goal = self.task.goal or (self.bundle.goal if self.bundle is not None and self._is_own_task else None)
        if goal is None:
            return "outcome", []
        wanted, derived = parse_condition(goal), derivation(self.domain)
        if derived.recursive:
            wanted = derived.at(self.knowledge).condition(wanted)
        return "knowledge", [Left(what, reason=why) for what in unmet(wanted, self.knowledge)]

    def _left_in_world(self) -> list[Left] | None:
        """Return the parts that are left in the world, which checks only the bundle's own task."""
        if self.simulation is None or not self._is_own_task:
            return None
        with contained(f"{type(self.simulation).__name__}.left"):
            return left_in(self.simulation)

    @property
    def _is_own_task(self) -> bool:
        bundle = self.bundle
        return bundle is not None and self.task in (Task(plot=bundle.main), Task(goal=bundle.goal))

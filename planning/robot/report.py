"""The report of a run of any robot: goal, remaining parts, plans, failures and recoveries."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, field
from json import dumps
from typing import Any, Literal

from dsc.sequencer.clock import ClockKind
from dsc.sequencer.run_end import RunEnd
from knowledge_base.notebook import text
from knowledge_base.spelling import number_text
from planning.robot.simulation import Fault, Left
from planning.robot.tally import Tally

Judge = Literal["world", "knowledge", "outcome"]
"""The source of `goal_reached`: the true state of a simulated world, the knowledge base, or the outcome of the plot."""
"""Maximum number of objects that are listed for one violated `forall` of a goal."""


@dataclass(frozen=True, slots=True)
class Report:
    """The result of a run.

    Attributes:
        robot: the name of the robot.
        goal_reached: whether the goal is reached according to `judge`, and the run ended without a problem.
        judge: see `Judge`.
        left: the parts of the goal that are not reached.
        outcome: the last outcome event of the plot; `None` if the plot emitted none.
        attributes: the attributes of this event.
        plans, replans: the number of plans found, and the number of plans that replaced another plan.
        wrong_plans: the number of plans of the planner that do not lead to the goal.
        skill_failures: the number of each failure outcome of skills.
        recoveries: the number of uses of each rule.
        candidates_chosen: the number of choices of each plot by dynamic states.
        excluded: the number of exclusions of each plan step after failures.
        not_observed: the number of times that the effects of each planning action were not observed.
        faults: the faults of the simulation, in order.
        clock: the kind of time of the run.
        simulated_s, wall_s: the duration of the run in run time and in real time, in seconds.
        problem: the reason why the run ended early; `None` otherwise.
        programming_error: as in `RunEnd`.
        outputs: the outputs of the plot by name.
        own: the robot's own fields, under the name of the robot in JSON.
        headline: the first line for people.
    """

    robot: str
    goal_reached: bool
    judge: Judge
    left: tuple[Left, ...]
    outcome: str | None
    attributes: Mapping[str, Any]
    plans: int
    replans: int
    wrong_plans: int
    skill_failures: Mapping[str, int]
    recoveries: Mapping[str, int]
    candidates_chosen: Mapping[str, int]
    excluded: Mapping[str, int]
    not_observed: Mapping[str, int]
    faults: tuple[Fault, ...]
    clock: ClockKind
    simulated_s: float
    wall_s: float
    problem: str | None
    programming_error: str | None
    outputs: Mapping[str, Any]
    own: Mapping[str, Any] = field(default_factory=dict)
    headline: str = ""

    def to_json(self) -> dict[str, Any]:
        """Return the report as plain data."""
        data = asdict(self)
        del data["headline"]
        own = data.pop("own")
        return {**data, self.robot: own} if own else data

    def lines(self) -> list[str]:
        """Return the report as lines of text."""
        lines = [
            f"{self.headline}, {self.simulated_s:.0f} s of {self.clock} time.",
            *([] if self._names_bug else [f"  programming error in {self.programming_error}"]),
            *map(self._left_line, self.left),
            f"  plans {self.plans}, replans {self.replans}"
            + (f", wrong plans {self.wrong_plans}" * bool(self.wrong_plans)),
        ]
        for title, counts in (
            ("skill failures", self.skill_failures),
            ("rules used", self.recoveries),
            ("candidates chosen", self.candidates_chosen),
            ("excluded for a while", self.excluded),
            ("effects not observed", self.not_observed),
        ):
            if counts:
                lines.append(f"  {title}: " + ", ".join(f"{name} {n}" for name, n in counts.items()))
        own = {} if self.judge == "world" else self.own  # its headline has them
        for title, values in (("outputs", self.outputs), (self.robot, own)):
            if values:
                lines.append(f"  {title}: " + ", ".join(f"{name} {dumps(one)}" for name, one in values.items()))
        if self.faults and not self.skill_failures:
            drawn = number_text(len(self.faults), "fault")
            lines.append(f"  {drawn} drawn, and no outcome of a skill is one of the bundle's `failures`")
        return lines

    def _repr_html_(self) -> str:
        return text(self.lines())

    @property
    def _names_bug(self) -> bool:
        return self.programming_error is None or self.programming_error in self.headline

    def _left_line(self, left: Left) -> str:
        where = f" ({left.where})" if left.where else ""
        reason = "" if left.reason in self.headline else f": {left.reason}"  # said in the first line already
        return f"  left: {left.what}{where}{reason}"


def summarise(
    robot: str,
    judge: Judge,
    left: Collection[Left],
    tally: Tally,
    end: RunEnd,
    failures: Collection[str],
    wall_s: float,
    clock: ClockKind,
) -> Report:
    """Return the report of a run that has ended, without the robot's own fields and faults.

    Args:
        robot: the name of the robot.
        judge: see `Judge`.
        left: the parts of the goal that are not reached; empty for `outcome`.
        tally: the counts of the run.
        end: the end of the run.
        failures: the outcomes of skills that count as failures, see `Robot.failures`.
        wall_s: the duration in real time, in seconds.
        clock: the kind of time of the run.
    """
    reached = end.reached if judge == "outcome" else end.finished and end.failure is None and not left
    said = "Goal reached" if reached else "Goal not reached"
    return Report(
        robot=robot,
        goal_reached=reached,
        judge=judge,
        left=tuple(left),
        outcome=end.emitted[-1].name if end.emitted else None,
        attributes=dict(end.emitted[-1].attributes) if end.emitted else {},
        plans=tally.plans,
        replans=tally.replans,
        wrong_plans=tally.wrong_plans,
        skill_failures={name: n for name, n in sorted(tally.outcomes.items()) if name in failures},
        recoveries=dict(sorted(tally.recoveries.items())),
        candidates_chosen=dict(sorted(tally.candidates.items())),
        excluded=dict(sorted(tally.excluded.items())),
        not_observed=dict(sorted(tally.unobserved.items())),
        faults=(),
        clock=clock,
        simulated_s=round(tally.seconds, 3),
        wall_s=round(wall_s, 3),
        problem=end.problem,
        programming_error=end.programming_error,
        outputs=end.outputs,
        headline=f"{said}{'' if reached else f': {reason_of_end(end, tally.gave_up)}'} (judge: {judge})",
    )


def reason_of_end(end: RunEnd, gave_up: str = "") -> str:
    """Return the reason why a run ended without its goal; `gave_up` is the reason of the last goal without a plan."""
    if end.problem is not None or not gave_up or gave_up in end.reason:
        return end.reason
    return f"{end.reason}: {gave_up}" if end.emitted else gave_up

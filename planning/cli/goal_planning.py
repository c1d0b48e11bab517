"""The process that plans a goal for an editor: `python -m planning.cli.goal_planning TARGET KIND SUBJECT SECONDS`.

For the kind `condition`, the subject is a goal, to reach from the world with which a run of the target begins. For the
kind `problem`, it is a PDDL problem with its own initial state. Standard output receives the answer of `dsc plan
--explain --json` without purposes, with `text` for users.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from knowledge_base.errors import DscError
from knowledge_base.language.syntax.text import parse_condition
from knowledge_base.pddl import ProblemText
from knowledge_base.store import KnowledgeBase
from planning.cli.editor_process import answer_editor
from planning.cli.plan_report import describe
from planning.cli.solving import late, read_world, reason_of, solved
from planning.model.cancellable_work import WorkLimitError
from planning.problem.construction import check_goal
from planning.robot.bringup import begin, simulated
from planning.robot.bundles import Bundle
from planning.robot.simulation import Setup
from planning.robot.targets import bundle_at


def goal_plan(target: str, kind: str, subject: str, seconds: float) -> dict[str, Any]:
    """Return the plan of a goal, or the reason why there is none; for the arguments see the module."""
    try:
        answer = _answer(bundle_at(target), kind, subject, seconds)
    except DscError as error:
        return {"outcome": "mistake", "steps": [], "text": str(error)}
    return answer | {"text": describe(answer)}


def _answer(bundle: Bundle, kind: str, subject: str, seconds: float) -> dict[str, Any]:
    domain = bundle.planning_domain
    read, world = read_world(Path(subject), domain) if kind == "problem" else _first_world(bundle, subject)
    try:
        _, outcome = solved(domain, read, world, seconds, None)
    except WorkLimitError as error:
        return late(error, seconds)
    return reason_of(outcome, domain, read, world, seconds)[1]


def _first_world(bundle: Bundle, text: str) -> tuple[ProblemText, KnowledgeBase]:
    """Return a goal, and the world with which a run of the robot begins."""
    domain = bundle.planning_domain
    world = KnowledgeBase(domain.schema)
    begin(world, bundle, simulated(bundle, Setup()), "plan")
    goal = parse_condition(text, "goal")
    check_goal(goal, world)
    return ProblemText("goal", domain.name, {}, (), {}, goal, has_goal=True), world


def main() -> None:
    """Plan the goal of the command line, with the texts on standard input."""
    target, kind, subject, seconds = sys.argv[1:]
    answer_editor(lambda: goal_plan(target, kind, subject, float(seconds)))


if __name__ == "__main__":
    main()

"""`dsc plan`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from planning.cli.answers import TIMED_OUT, answer_of, end, ordered, purposes
from planning.cli.solving import read_files, solved, why_none

if TYPE_CHECKING:
    from knowledge_base.language.expression import Expression
    from knowledge_base.store import KnowledgeBase
    from planning.domain import PlanningDomain
    from planning.ordering.order import PartialOrder
    from planning.plan import Plan

PLOT_NAME = "plan"


def plan_command(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="DOMAIN... PROBLEM", help="PDDL: the domain, in one file or several, and the problem.",
            show_default=False,
        ),
    ],
    engine: Annotated[
        str | None, typer.Option(metavar="NAME", help="Which engine plans.  [default: those that suit it race]")
    ] = None,
    seconds: Annotated[float, typer.Option(min=0.0, help="Stop posing and planning after this long.")] = 10.0,
    parallel: Annotated[bool, typer.Option("--parallel", help="Show which steps can go side by side.")] = False,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write it as a plot (YAML) to complete; - is standard output.")
    ] = None,
    explain: Annotated[
        bool, typer.Option("--explain", help="Say what each step is for, or why there is no plan.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:  # fmt: skip
    """Find a plan and print its steps.

    Exit status: 0 a plan, 1 there is none, 2 bad input, 3 out of time, 4 the planner failed.
    """
    from knowledge_base.outputs import Output
    from planning.cli.notes import valueless
    from planning.patience import OutOfPatienceError
    from planning.plan import NobodyCan, PlanFound, ProvenUnsolvable
    from planning.posing.constructs import why_no_engine

    output = None if plot is None else Output(plot, "--plot", *files)
    domain, read, world = read_files(files)
    notes = [*domain.notes, *read.notes]
    try:
        problem, outcome = solved(domain, read, world, seconds, engine)
    except OutOfPatienceError as error:
        late: dict[str, Any] = {"outcome": "timed_out", "steps": [], "engine": None, "seconds": seconds}
        end(TIMED_OUT, late | {"while": error.doing}, notes, as_json=as_json)
    notes += problem.notes
    status, answer = answer_of(outcome)
    if isinstance(outcome, NobodyCan):
        answer["reason"] = why_no_engine(domain, read.goal, outcome)
    if isinstance(outcome, ProvenUnsolvable) and explain:
        answer["why"] = why_none(domain, read, world, seconds)
    if isinstance(outcome, PlanFound):
        plan = outcome.plan
        notes += valueless(plan, domain, read)
        order = _order(plan, domain, world, read.goal)
        notes += _untraced(domain) if parallel or explain or plot else []
        answer |= ordered(order) if parallel else {}
        answer |= purposes(order) if explain else {}
        if output is not None:
            output.write(_plot_text(outcome.plan, domain, order if parallel else None))
    end(status, answer, notes, as_json=as_json)


def _order(plan: Plan, domain: PlanningDomain, world: KnowledgeBase, goal: Expression) -> PartialOrder:
    from planning.ordering.order import deordered, in_sequence
    from planning.ordering.timed_links import linked
    from planning.posing.axioms import Derivable

    if Derivable.of(domain) is not None:
        return in_sequence(plan)
    return (linked if plan.schedule else deordered)(plan, domain, world, goal)


def _untraced(domain: PlanningDomain) -> list[str]:
    """A note where plans are only for looking at."""
    from planning.posing.axioms import Derivable

    form = Derivable.of(domain)
    names = ", ".join(f"'{one}'" for one in sorted(form.predicates)) if form else ""
    why = "planning actions change what it follows from, itself included"
    return [f"{names}: {why}, so who needs what is not traced, and no robot can carry the plan out"] if form else []


def _plot_text(plan: Plan, domain: PlanningDomain, order: PartialOrder | None) -> str:
    from dsc.text.plots import plot_to_yaml
    from planning.generation.plot import plot_from_plan

    return plot_to_yaml(plot_from_plan(plan, domain, None, name=PLOT_NAME, order=order))

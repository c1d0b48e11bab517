"""The PDDL files that come with unified-planning, read, posed and planned for here; see docs/pddl.md.

`python tests/conformance/pddl_sweep.py [--write] [--seconds N] [NAME ...]` prints what becomes of each file, and with
`--write` puts the table into docs/pddl.md. NAME: only files with that in their name. Exit status 1: a file is refused
without a reason, or a plan is none for unified-planning's own reader and validator.
"""

from __future__ import annotations

import argparse
import asyncio
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import unified_planning.test
from unified_planning.engines import SequentialPlanValidator, TimeTriggeredPlanValidator
from unified_planning.environment import get_environment
from unified_planning.exceptions import UPException
from unified_planning.io import PDDLReader, PDDLWriter
from unified_planning.plans import ActionInstance, SequentialPlan, TimeTriggeredPlan
from unified_planning.test.examples import get_example_problems

from knowledge_base.errors import InputError, UnsupportedConstructError
from knowledge_base.language.evaluation.evaluator import evaluate_term
from knowledge_base.pddl import ProblemText, read_problem
from knowledge_base.store import KnowledgeBase
from planning.engines import registry
from planning.engines.race import PlannerRace
from planning.model.domain import PlanningDomain
from planning.model.plan import (
    EngineFailed,
    NoneFound,
    Plan,
    PlanFound,
    PlanningOutcome,
    ProvenUnsolvable,
    TimedOut,
    Unsupported,
)
from planning.model.problem import UnsupportedActionError, UnsupportedGoalError
from planning.problem.construction import build_problem
from planning.problem.relevance import why_no_engine

PAGE = Path(__file__).parents[2] / "docs" / "pddl.md"
TEST_FOLDER = Path(unified_planning.test.__path__[0])
FOLDERS = ("pddl", "hddl", "contingent_pddl")
SECONDS = 20.0
REFUSED: dict[type[InputError], str] = {
    UnsupportedConstructError: "not read",
    UnsupportedActionError: "not posed",
    UnsupportedGoalError: "not posed",
}
"""What is said of files that are refused with a reason."""
PAUSE = Fraction(1, 100)
"""Between the steps of a plan that is timed here, so that none touches the next."""


@dataclass(frozen=True, slots=True)
class Pair:
    """A domain file and a problem file that belong together."""

    name: str
    domain: Path
    problem: Path


@dataclass(frozen=True, slots=True)
class Result:
    """What became of one pair.

    Attributes:
        verdict: `plan`, `unsolvable`, `no sequential plan`, `timed out`, `not read`, `not posed`, `engine failed`,
            `no engine` or `wrong`.
        engine: who said so.
        steps: the length of the plan.
        detail: why not; for a plan, what unified-planning says to it.
    """

    name: str
    verdict: str
    engine: str = ""
    steps: int | None = None
    detail: str = ""


def shipped() -> list[Pair]:
    """The files in unified-planning's test folder."""
    domains = [file for folder in FOLDERS for file in sorted((TEST_FOLDER / folder).rglob("d*.*ddl"))]
    return [
        Pair(str(problem.relative_to(TEST_FOLDER)), domain, problem)
        for domain in domains
        for problem in sorted(set(domain.parent.glob("*.*ddl")) - {domain})
    ]


def written(folder: Path) -> Iterator[Pair]:
    """Unified-planning's example problems, as its own writer writes them into `folder`; some it cannot write."""
    for name, example in sorted(get_example_problems().items()):
        texts = _written(example.problem)
        if texts is None:
            continue
        pair = Pair(f"examples/{name}", folder / name / "domain.pddl", folder / name / "problem.pddl")
        pair.domain.parent.mkdir()
        pair.domain.write_text(texts[0], encoding="utf-8")
        pair.problem.write_text(texts[1], encoding="utf-8")
        yield pair


def _written(problem: Any) -> tuple[str, str] | None:
    """Domain and problem as PDDL, unless it has something that PDDL cannot say."""
    try:
        writer = PDDLWriter(problem)
        return writer.get_domain(), writer.get_problem()
    except (UPException, NotImplementedError, AttributeError):
        return None


def read(pair: Pair) -> tuple[PlanningDomain, ProblemText]:
    """Both files, by our reader."""
    domain = PlanningDomain.from_pddl(pair.domain)
    return domain, read_problem(pair.problem, domain.schema, domain=domain.name)


def read_by_peer(pair: Pair) -> Any:
    """Both files, by unified-planning's reader."""
    get_environment().credits_stream = None
    return PDDLReader().parse_problem(str(pair.domain), str(pair.problem))


def world_of(domain: PlanningDomain, problem: ProblemText) -> KnowledgeBase:
    """The problem's first state."""
    world = KnowledgeBase(domain.schema)
    world.apply(problem.delta(), author="problem")
    return world


def tried(pair: Pair, seconds: float) -> Result:
    """What becomes of one pair of files."""
    try:
        domain, problem = read(pair)
        posed = build_problem(
            domain, world_of(domain, problem), problem.goal, problem.metric, durations=bool(registry.timing())
        )
    except InputError as error:
        verdicts = [verdict for kind, verdict in REFUSED.items() if isinstance(error, kind)]
        said = str(error).replace(f"{pair.problem.parent}/", "")
        return Result(pair.name, verdicts[0] if verdicts else "wrong", detail=said)
    outcome = asyncio.run(_solved(posed, seconds))
    if isinstance(outcome, Unsupported):
        return Result(pair.name, "no engine", detail=why_no_engine(domain, problem.goal, outcome))
    if isinstance(outcome, PlanFound):
        said = judged(pair, outcome.plan, domain, problem)
        verdict = "wrong" if said.startswith("invalid") else "plan"
        return Result(pair.name, verdict, outcome.engine, len(outcome.plan.steps), said)
    return _planless(pair.name, outcome)


def _planless(name: str, outcome: PlanningOutcome) -> Result:
    match outcome:
        case ProvenUnsolvable(engine, reason):
            return Result(name, "unsolvable", engine, detail=reason)
        case NoneFound(engine, reason):
            return Result(name, "no sequential plan", engine, detail=reason)
        case TimedOut(engine, limit):
            return Result(name, "timed out", engine, detail=f"after {limit:g} s")
        case EngineFailed(engine, message):
            return Result(name, "engine failed", engine, detail=message)
        case _:
            raise TypeError(outcome)


def judged(pair: Pair, plan: Plan, domain: PlanningDomain, problem: ProblemText) -> str:
    """What unified-planning's validator says to the plan, on its own reading of the same files."""
    try:
        theirs = read_by_peer(pair)
    except (UPException, SyntaxError, AssertionError, KeyError) as error:
        return f"unchecked: its reader fails ({type(error).__name__})"
    instances = [
        ActionInstance(theirs.action(step.action), tuple(map(theirs.object, step.args))) for step in plan.steps
    ]
    try:
        if _durative(domain):
            timed = TimeTriggeredPlan(list(_timed(plan, instances, domain, problem)))
            verdict = TimeTriggeredPlanValidator().validate(theirs, timed)
        else:
            verdict = SequentialPlanValidator().validate(theirs, SequentialPlan(instances))
    except (UPException, AssertionError, NotImplementedError) as error:
        return f"unchecked: its validator fails ({type(error).__name__})"
    return "valid" if verdict else f"invalid: {verdict.reason}"


def _timed(
    plan: Plan, instances: list[ActionInstance], domain: PlanningDomain, problem: ProblemText
) -> Iterator[tuple[Fraction, ActionInstance, Fraction | None]]:
    """As the engine says; if it does not, one step after the other, each as short as it may be."""
    for timing, step, instance in zip(plan.schedule, plan.steps, instances, strict=bool(plan.schedule)):
        lasts = domain.action(step).duration is not None
        yield Fraction(str(timing.start)), instance, Fraction(str(timing.duration)) if lasts else None
    if plan.schedule:
        return
    world, now = world_of(domain, problem), PAUSE
    for step, instance in zip(plan.steps, instances, strict=True):
        duration = domain.action(step).duration
        bindings = domain.bindings(step)
        seconds = None if duration is None else Fraction(str(evaluate_term(duration.least, world, bindings)))
        yield now, instance, seconds
        world.apply(domain.effects(step, world), author="plan")
        now += (seconds or 0) + PAUSE


def _durative(domain: PlanningDomain) -> bool:
    return any(action.duration is not None for action in domain.actions.values())


async def _solved(posed: Any, seconds: float) -> PlanningOutcome:
    planner = PlannerRace()
    try:
        return await planner.solve(posed, seconds)
    finally:
        await planner.close()


def table(results: list[Result]) -> str:
    """The published list."""
    rows = [
        f"| {one.name} | {one.verdict} | {one.engine} | {'' if one.steps is None else one.steps}"
        f" | {one.detail.replace('|', '&#124;')} |"
        for one in results
    ]
    head = ["| file | outcome | engine | steps | what unified-planning says, or why not |", "|---|---|---|---|---|"]
    return "\n".join([f"{score(results)}.", "", *head, *rows])


def score(results: list[Result]) -> str:
    """How many of each outcome."""
    found = Counter(one.verdict for one in results)
    return f"{len(results)} pairs of files: " + ", ".join(
        f"{count} {verdict}" for verdict, count in found.most_common()
    )


def main() -> int:
    """Try all files and say how it went."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--seconds", type=float, default=SECONDS, help="the time limit for each")
    parser.add_argument("--write", action="store_true", help="put the table into docs/pddl.md")
    given = parser.parse_args()
    results = []
    with tempfile.TemporaryDirectory() as folder:
        for pair in (*shipped(), *written(Path(folder))):
            if not given.names or any(name in pair.name for name in given.names):
                results.append(tried(pair, given.seconds))
                one = results[-1]
                print(f"{one.verdict:13} {one.name:50} {one.engine} {one.steps or ''} {one.detail}", flush=True)
    print(score(results))
    if given.write:
        head, mark, _ = PAGE.read_text(encoding="utf-8").partition("<!-- results -->\n")
        PAGE.write_text(f"{head}{mark}{table(results)}\n", encoding="utf-8")
    return 1 if any(one.verdict == "wrong" for one in results) else 0


if __name__ == "__main__":
    sys.exit(main())

"""Random small domains with plans that are found by walking at random, and goals that hold where the walk ends."""

from __future__ import annotations

from dataclasses import dataclass

from hypothesis import strategies as st

from knowledge_base.facts import Delta, fact
from knowledge_base.language.evaluation.evaluator import holds
from knowledge_base.language.syntax.expression import Expression
from knowledge_base.language.syntax.text import parse_condition
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.overlay import Overlay
from planning.model.domain import PlanningDomain
from planning.model.plan import Plan, PlanStep

THINGS = ("a", "b")
MOST_STEPS = 5


@dataclass(frozen=True)
class Planned:
    """A plan that is known to lead from its world to its goal."""

    domain: PlanningDomain
    world: KnowledgeBase
    plan: Plan
    goal: Expression
    text: str

    def __repr__(self) -> str:
        facts = " ".join(map(str, self.world.facts()))
        return f"{self.text}\nfrom: {facts}\nplan: {self.plan}\ngoal: {self.goal}"


def atoms(terms: tuple[str, ...]) -> st.SearchStrategy[str]:
    """Facts that some action may change."""
    return st.one_of(
        st.sampled_from(["(p)", "(q)"]),
        st.builds("({} {})".format, st.sampled_from(["r", "s"]), st.sampled_from(terms)),
    )


def conditions(terms: tuple[str, ...]) -> st.SearchStrategy[str]:
    """Literals most of the time, but also what cannot be split into literals."""
    literal = st.one_of(atoms(terms), atoms(terms).map("(not {})".format))
    bound = (*terms, "?y")
    number = st.builds("({} (n) {})".format, st.sampled_from(["<", ">=", "="]), st.integers(0, 2))
    return st.one_of(
        literal, literal, literal, number,
        st.builds("(or {} {})".format, literal, literal),
        st.builds("(imply {} {})".format, literal, literal),
        st.builds("({} (?y - thing) {})".format, st.sampled_from(["forall", "exists"]), conditions_on(bound)),
    )  # fmt: skip


def conditions_on(terms: tuple[str, ...]) -> st.SearchStrategy[str]:
    literal = st.one_of(atoms(terms), atoms(terms).map("(not {})".format))
    return st.one_of(literal, st.builds("(or {} {})".format, literal, literal))


def effects(terms: tuple[str, ...]) -> st.SearchStrategy[str]:
    literal = st.one_of(atoms(terms), atoms(terms).map("(not {})".format))
    number = st.one_of(
        st.builds("({} (n) {})".format, st.sampled_from(["increase", "decrease", "assign"]), st.integers(1, 2)),
        st.just("(increase (m) (n))"),
    )
    inner = st.one_of(atoms((*terms, "?y")), atoms((*terms, "?y")).map("(not {})".format))
    return st.one_of(
        literal, literal, literal, number,
        st.builds("(when {} {})".format, literal, literal),
        st.builds("(forall (?y - thing) (when {} {}))".format, inner, inner),
    )  # fmt: skip


@st.composite
def domains(draw: st.DrawFn) -> str:
    actions = []
    for number in range(draw(st.integers(2, 4))):
        terms = draw(st.sampled_from([("a", "b"), ("?x", "a"), ("?x",)]))
        needed = draw(st.lists(conditions(terms), max_size=1 if number else 0))  # the first one always applies
        done = draw(st.lists(effects(terms), min_size=1, max_size=3).filter(_does_not_contradict_itself))
        parameters = "?x - thing" if "?x" in terms else ""
        actions.append(
            f"(:action act{number} :parameters ({parameters})"
            f" :precondition (and {' '.join(needed)}) :effect (and {' '.join(done)}))"
        )
    return (
        "(define (domain random) (:types thing) (:constants a b - thing)\n"
        "(:predicates (p) (q) (r ?t - thing) (s ?t - thing)) (:functions (n) (m))\n" + "\n".join(actions) + ")"
    )


def _does_not_contradict_itself(done: list[str]) -> bool:
    return sum("(n) " in one and one.startswith(("(assign", "(increase (n)", "(decrease")) for one in done) < 2


@st.composite
def planned(draw: st.DrawFn) -> Planned:
    text = draw(domains())
    domain = PlanningDomain.parse(text)
    world = KnowledgeBase(domain.schema)
    facts = [fact("p"), fact("q"), *(fact(name, thing) for name in "rs" for thing in THINGS)]
    world.apply(
        Delta(nodes=dict.fromkeys(THINGS, "thing"), added=tuple(draw(st.lists(st.sampled_from(facts), unique=True)))),
        "test",
    )
    ahead, steps = Overlay(world), []
    for _ in range(draw(st.sampled_from((0, *range(2, MOST_STEPS + 1), 4, 5)))):
        possible = [step for step in _steps(domain) if domain.applicable(step, ahead)]
        if not possible:
            break
        step = draw(st.sampled_from(possible))
        ahead.apply(domain.effects(step, ahead))
        steps.append(step)
    wanted = draw(st.lists(conditions(THINGS), max_size=3))
    reached = [one for one in wanted if holds(parse_condition(one), ahead)]
    return Planned(domain, world, Plan(tuple(steps)), parse_condition(f"(and {' '.join(reached)})"), text)


def _steps(domain: PlanningDomain) -> list[PlanStep]:
    return [
        PlanStep(action.name, args)
        for action in domain.actions.values()
        for args in ([(thing,) for thing in THINGS] if action.parameters else [()])
    ]

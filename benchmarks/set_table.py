"""Tables of any size, as knowledge and as a PDDL problem: 4 cups to 3 cans to 2 crisp cans, all seen."""

from __future__ import annotations

from pathlib import Path

from domains.clean_up_table import bringup
from knowledge_base.facts import Delta, Fact, fact
from knowledge_base.language.syntax.text import parse_condition
from knowledge_base.store import KnowledgeBase
from planning.model.domain import PlanningDomain
from planning.model.plan import PlanStep

FILE = Path(bringup.HOME) / "domain.pddl"
GOAL = parse_condition("(forall (?i - item) (tidy ?i))")
TRIP = "throw-away"
_PLACES = {
    "table": "surface", "shelf": "surface", "floor": "surface", "sink": "destination", "bin": "destination",
    "operator": "place",
}  # fmt: skip


def domain() -> PlanningDomain:
    return PlanningDomain.from_pddl(FILE)


def world(items: int) -> KnowledgeBase:
    """Return the knowledge of a robot at the operator's place that has seen all items."""
    kinds, facts = _kinds(items), []
    for item, kind in kinds.items():
        facts += [fact("lies-at", item, "table"), fact("graspable", item), fact("seen", item)]
        facts.append(fact("goes-to", item, "sink" if kind == "cup" else "bin"))
        facts.append(fact("free-room", item, _room(item, kind)))
        into = {"cup": "cup", "can": "crisp-can"}.get(kind)
        facts += [fact("fits", item, other) for other, k in kinds.items() if k == into and other != item]
    facts += [fact("robot-at", "operator"), fact("hand-free")]
    facts += [fact("one-less", "one", "none"), fact("one-less", "two", "one")]
    facts += [fact("passable", place) for place in _PLACES]
    kb = KnowledgeBase(domain().schema)
    kb.apply(Delta(nodes={**_PLACES, **kinds}, added=tuple(facts)), author="benchmark")
    return kb


def problem_text(items: int) -> str:
    """Return the same as a PDDL problem; its goal has no quantifier, which some planners lack."""
    known, kinds = world(items), _kinds(items)
    objects = " ".join(f"{name} - {kind}" for name, kind in {**_PLACES, **kinds}.items())
    init = "\n".join(str(one) for one in known.facts() if isinstance(one, Fact))
    goal = " ".join(f"(tidy {item})" for item in kinds)
    return f"(define (problem p) (:domain clean-up-table) (:objects {objects})\n(:init {init})\n(:goal (and {goal})))\n"


def trips(steps: tuple[PlanStep, ...]) -> int:
    return sum(step.action == TRIP for step in steps)


def _kinds(items: int) -> dict[str, str]:
    crisp_cans, cans = items * 2 // 9, items * 3 // 9
    numbers = {"cup": items - cans - crisp_cans, "can": cans, "crisp-can": crisp_cans}
    return {f"{kind}{n}": kind for kind, number in numbers.items() for n in range(1, number + 1)}


def _room(item: str, kind: str) -> str:
    if kind == "crisp-can":
        return "two" if int(item.removeprefix(kind)) % 2 == 0 else "one"
    return "one" if kind == "cup" else "none"

from __future__ import annotations

from pathlib import Path

import pytest

from knowledge_base.facts import Delta, fact
from knowledge_base.store import KnowledgeBase
from planning.model.domain import PlanningDomain

DOMAIN_FILE = Path(__file__).parents[2] / "domains" / "clean_up_table" / "domain.pddl"


@pytest.fixture(scope="session")
def domain_file():
    return DOMAIN_FILE


@pytest.fixture(scope="session")
def clean_up():
    """The planning domain of the clean-up table."""
    return PlanningDomain.from_pddl(DOMAIN_FILE)


@pytest.fixture
def table(clean_up):
    """Sets a table: `table(cups=4, cans=3, crisp_cans=("one", "two"))`, the robot at the operator."""

    def set_table(cups=0, cans=0, crisp_cans=(), robot_at="operator"):
        places = dict.fromkeys(("table", "shelf", "floor"), "surface")
        places |= dict.fromkeys(("sink", "bin"), "destination") | {"operator": "place"}
        kinds = {f"cup{i + 1}": "cup" for i in range(cups)} | {f"can{i + 1}": "can" for i in range(cans)}
        kinds |= {f"crisp{i + 1}": "crisp-can" for i in range(len(crisp_cans))}
        facts = [fact("robot-at", robot_at), fact("hand-free")]
        facts += [fact("one-less", "one", "none"), fact("one-less", "two", "one")]
        facts += [fact("passable", place) for place in places]
        rooms = {f"crisp{i + 1}": room for i, room in enumerate(crisp_cans)}
        for item, kind in kinds.items():
            facts += [fact("lies-at", item, "table"), fact("graspable", item), fact("seen", item)]
            facts.append(fact("goes-to", item, "sink" if kind == "cup" else "bin"))
            room = rooms.get(item, "one" if kind == "cup" else "none")
            facts.append(fact("free-room", item, room))
            into = {"cup": "cup", "can": "crisp-can"}.get(kind)
            facts += [fact("fits", item, other) for other, k in kinds.items() if k == into and other != item]
        kb = KnowledgeBase(clean_up.schema)
        kb.apply(Delta(nodes={**places, **kinds}, added=tuple(facts)), author="test")
        return kb

    return set_table


@pytest.fixture
def world_of():
    """Makes a world from a schema, things with types, facts and numbers."""

    def make(schema, nodes, facts=(), values=None):
        kb = KnowledgeBase(schema)
        kb.apply(Delta(nodes=nodes, added=tuple(facts), values=values or {}), author="test")
        return kb

    return make

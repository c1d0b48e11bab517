"""How far the watching of a plan is, as plain data and back."""

import json

import pytest

from planning.execution.monitor import Broken, GoalReached, Shorter
from planning.execution.watched import StepEnded, Watched
from planning.plan import PlanStep

BROKEN = Broken("(open office) is false", "(open office)", 2, "eve", 7)
SHORTER = Shorter((PlanStep("take", ("bob", "p1")), PlanStep("wait", ())))
FORMS = [
    (BROKEN, {"broken": {"why": BROKEN.why, "needed": BROKEN.needed, "user": 2, "author": "eve", "version": 7}}),
    (SHORTER, {"shorter": [step.to_json() for step in SHORTER.steps]}),
    (GoalReached("eve"), {"reached": "eve"}),
    (StepEnded(), None),
]


@pytest.mark.parametrize(("heard", "form"), FORMS, ids=lambda one: type(one).__name__)
def test_what_was_heard_comes_back(heard, form):
    watched = Watched()
    watched.heard.append(heard)
    written = json.loads(json.dumps(watched.to_json()))
    assert written == {"heard": [form], "said_broken": False, "searching_since": None}
    assert list(Watched.from_json(written).heard) == [heard]


def test_what_was_said_and_is_under_way_comes_back():
    watched = Watched(said_broken=True, searching_since=4.5)
    assert Watched.from_json(watched.to_json()) == watched

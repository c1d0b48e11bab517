"""Conditions that states watch are checked before a run: values, ports, facts and their form."""

from __future__ import annotations

import pytest

from dsc import Component, Push, parse_plot
from dsc.errors import PlotError
from planning import Robot

DOMAIN = "(define (domain d) (:types cup) (:predicates (held ?c - cup)) (:functions (limit ?c - cup)))"
PLOT = """
plot: main
parameters: {cup: {type: cup}}
states:
  go:
    entry:
      trigger: %s
      with:
        condition: '"%s"'
        values: {cup: ?cup}
    on: {became_true: end, became_false: {}}
  end: {final: true}
"""


class Hand(Component):
    name = "hand"
    pose = Push({"x": "number"})


class Wrist(Component):
    name = "wrist"
    force = Push({"x": "number"})


def check(skill, condition):
    Robot(DOMAIN, [parse_plot(PLOT % (skill, condition))], [Hand(), Wrist()])


@pytest.mark.parametrize(
    ("skill", "condition", "said"),
    [
        ("hand.watch_values", "(< pose.y 1)", "component 'hand' pushes no value 'pose.y'; did you mean 'pose.x'?"),
        ("hand.watch_values", "(< force.x 1)", "component 'hand' pushes no value 'force.x'; did you mean 'pose.x'?"),
        ("hand.watch_values", "(< pose.x 1", "never closed"),
        ("conditions.watch_truth", "(< hand.pose.y 1)", "no component pushes a value 'hand.pose.y'"),
        ("conditions.watch_truth", "(silent hand.poze 1)", "no component pushes a value 'hand.poze'"),
        ("conditions.watch_truth", "(or (helt ?cup) (< hand.pose.x 1))", "did you mean 'held'?"),
        ("conditions.watch_truth", "(or (held ?cup cup1) (< hand.pose.x 1))", "held"),
        ("conditions.watch_truth", "(< hand.pose.x (limit))", "limit"),
        ("conditions.watch_truth", "(exists (?c - cup) (< hand.pose.x 1))", "no quantifiers"),
    ],
)
def test_a_mistake_has_its_place_and_its_remedy(skill, condition, said):
    with pytest.raises(PlotError) as error:
        check(skill, condition)
    assert said in str(error.value)
    assert str(error.value).startswith("<text>:9:")


@pytest.mark.parametrize(
    ("skill", "condition"),
    [
        ("hand.watch_values", "(and (< pose.x 1) (not (silent pose 2)) (> (rate pose.x) ?cup))"),
        ("conditions.watch_truth", "(imply (held ?cup) (< (distance hand.pose.x (limit ?cup)) wrist.force.x))"),
        ("conditions.watch_truth", "(or (exists (?c - cup) (held ?c)) (silent wrist.force 2) (near-edge hand.pose.x))"),
    ],
)
def test_conditions_without_mistakes(skill, condition):
    check(skill, condition)

"""Conditions that states watch are checked before a run: values, ports, facts and their form."""

from __future__ import annotations

import pytest

from dsc import Component, Library, Push, parse_plot
from dsc.components.checks import Series
from dsc.components.interface import Interface
from dsc.errors import PlotError
from dsc.sensing.condition_handler import ConditionHandler
from dsc.skills import signatures
from dsc.validation import validate_plot
from knowledge_base import Schema
from planning import Robot

DOMAIN = """
(define (domain d) (:types cup) (:constants cup1 - cup)
  (:predicates (held ?c - cup)) (:functions (limit ?c - cup) - number (pose ?c - cup) - geometry))
"""
PLOT = """
plot: main
parameters: {cup: {type: cup}}
states:
  go:
    entry:
      trigger: %s
      with:
        condition: '"%s"'
        values: {%s}
    on: {became_true: end, became_false: {}}
  end: {final: true}
"""


def near_edge(value: Series) -> bool:
    return value.number < 0.1


class Hand(Component):
    name = "hand"
    pose = Push({"x": "number", "place": "list of number", "name": "text", "mode": "air | ground"}, checks=(near_edge,))


class Wrist(Component):
    name = "wrist"
    force = Push({"x": "number"})


def written(skill, condition, values="cup: ?cup"):
    return PLOT % (skill, condition, values if "?cup" in condition or "?m" in condition else "")


def check(skill, condition, values="cup: ?cup"):
    Robot(DOMAIN, [parse_plot(written(skill, condition, values))], [Hand(), Wrist()])


@pytest.mark.parametrize(
    ("skill", "condition", "said"),
    [
        (
            "hand.watch_values",
            "(< pose.y 1)",
            "component 'hand' pushes no value 'pose.y' (line 1, column 4 of the condition); did you mean 'pose.x'?",
        ),
        ("hand.watch_values", "(< force.x 1)", "component 'hand' pushes no value 'force.x'"),
        ("hand.watch_values", "(< pose.x 1", "never closed"),
        ("conditions.watch_truth", "(< hand.pose.y 1)", "no component pushes a value 'hand.pose.y'"),
        ("conditions.watch_truth", "(silent hand.poze 1)", "no component pushes a value 'hand.poze'"),
        ("conditions.watch_truth", "(or (helt ?cup) (< hand.pose.x 1))", "did you mean 'held'?"),
        ("conditions.watch_truth", "(or (held ?cup cup1) (< hand.pose.x 1))", "held"),
        ("conditions.watch_truth", "(< hand.pose.x (limit))", "limit"),
        ("conditions.watch_truth", "(exists (?c - cup) (< hand.pose.x 1))", "no quantifiers"),
        (
            "conditions.watch_truth",
            "(< hand.pose.x (limt cup1))",
            "no check or function 'limt' (line 1, column 16 of the condition); did you mean 'limit'?",
        ),
        (
            "conditions.watch_truth",
            "(< hand.pose.x (limit ?cpu))",
            "no value for '?cpu' in `values`",
        ),
        ("conditions.watch_truth", "(or (held ?cpu) (silent hand.pose 1))", "no value for '?cpu' in `values`"),
        ("conditions.watch_truth", "(< hand.pose.x (limit cup1 3))", "'limit' takes 1 argument"),
        ("conditions.watch_truth", "(< hand.pose 1)", "a port, whose values are hand.pose.x, hand.pose.place"),
        ("conditions.watch_truth", "(< hand.pose.name 1)", "needs numbers, and hand.pose.name is of type text"),
        ("conditions.watch_truth", "(< (distance hand.pose.x (pose cup1)) 1)", "a list of numbers"),
        ("conditions.watch_truth", "(near-edges hand.pose.x)", "did you mean 'near-edge'?"),
        ("hand.watch_values", "(in-range pose.x 1)", "as in (in-range value least most)"),
        ("hand.watch_values", "(in-range pose.x 3 1)", "the lower bound 3 is above the upper bound 1"),
        ("hand.watch_values", "(> (mean pose.x 0) 1)", "a whole number of values from 1 to 100, not 0"),
        ("hand.watch_values", "(= pose.name 3)", "compares text with number, which are never equal"),
        ("hand.watch_values", "(= pose.mode airr)", "'pose.mode' is never airr"),
        ("hand.watch_values", "(silent pose.x 3)", "'pose.x' is a value; a port is silent, as in (silent pose 2)"),
        ("conditions.watch_truth", "(silent hand 3)", "no component pushes a value 'hand'"),
        ("conditions.watch_truth", "(> (magnitude (pose cup1)) 3)", "'magnitude' is a check of pushed values"),
        ("conditions.watch_truth", "(< hand.pose.x (pose cup1))", "needs numbers, and (pose cup1) is of type list"),
        ("hand.watch_values", "(near-edge 3)", "'value' is a value of a port, not 3"),
        ("hand.watch_values", "(< pose.x ?cpu)", "no value for '?cpu' in `values`"),
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
        ("conditions.watch_truth", "(imply (held ?cup) (< (distance (pose ?cup) hand.pose.place) wrist.force.x))"),
        ("conditions.watch_truth", "(or (exists (?c - cup) (held ?c)) (silent wrist.force 2) (near-edge hand.pose.x))"),
    ],
)
def test_conditions_without_mistakes(skill, condition):
    check(skill, condition)


@pytest.mark.parametrize("condition", ["(< hand.pose.x (limit cpu1))", "(or (silent hand.pose 1) (held cpu1))"])
def test_unknown_objects(condition):
    plot, hand = parse_plot(written("conditions.watch_truth", condition)), Hand()
    skills = [*hand.skills().values(), *signatures(ConditionHandler, "conditions").values()]
    interfaces = {"hand": hand.interface(), "conditions": Interface()}
    (found,) = validate_plot(plot, Library([plot]), Schema.parse(DOMAIN), skills, interfaces, objects={})
    assert "there is no object 'cpu1' of type cup" in str(found.error)
    assert "did you mean 'cup1'?" in str(found.error)


@pytest.mark.parametrize("condition", ["(< hand.pose.x (limit cpu1))", "(or (silent hand.pose 1) (held cpu1))"])
def test_unknown_objects_in_a_run(condition):
    text = written("conditions.watch_truth", condition)
    with Robot(DOMAIN, [parse_plot(text)], [Hand(), Wrist()], clock="simulated") as robot:
        end = robot.run("main", {"cup": "cup1"})
    assert "there is no object 'cpu1'" in (end.programming_error or "")
    assert "did you mean 'cup1'?" in (end.programming_error or "")


@pytest.mark.parametrize(
    ("condition", "values", "said"),
    [
        ("(< pose.x ?m)", "m: (pose cup1)", "needs numbers, and ?m is of type list"),
        ("(< pose.x ?m)", "m: true", "needs numbers, and ?m is of type boolean"),
        ("(< pose.x ?m)", "m: 3, more: 4", "the condition does not use 'more' of `values`"),
    ],
)
def test_kinds_of_variables(condition, values, said):
    with pytest.raises(PlotError) as error:
        check("hand.watch_values", condition, values)
    assert said in str(error.value)


@pytest.mark.parametrize(
    ("option", "condition", "said"),
    [
        ("times: 3", "(< pose.x 1)", "write both: `times: 3, out_of: 5`"),
        ("times: 6, out_of: 5", "(< pose.x 1)", "not 6 of 5"),
        ("hysteresis: 2", "(= pose.x 1)", "hysteresis"),
    ],
)
def test_options_that_do_not_fit(option, condition, said):
    text = written("hand.watch_values", condition).replace("values: {}", option.replace(", ", "\n        "))
    with pytest.raises(PlotError) as error:
        Robot(DOMAIN, [parse_plot(text)], [Hand(), Wrist()])
    assert said in str(error.value)


@pytest.mark.parametrize("trigger", ["lift.watch_values", "conditions.watch_truth"])
def test_an_own_check_precedes_one_of_the_library(trigger):
    def in_range(value: Series) -> bool:
        return value.number < 2

    class Lift(Component):
        name = "lift"
        height = Push({"x": "number"}, checks=(in_range,))

    name = "height.x" if trigger.startswith("lift") else "lift.height.x"
    Robot(DOMAIN, [parse_plot(written(trigger, f"(in-range {name})"))], [Lift()])

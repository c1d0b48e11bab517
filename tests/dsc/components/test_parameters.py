"""Parameters with roles: the builder's range, the integrator's value, who may change them at run time (S1.11)."""

from __future__ import annotations

import asyncio
import re
from typing import ClassVar

import pytest
from dsc_base import Base

from dsc import Component, Library, Outcome, Sequencer, parse_plot, skill, validate_plot
from dsc.components.parameters import Parameter
from dsc.profiles import configure
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.sequencer.sequencer import RunEnd
from dsc.text.profiles import parse_profile
from knowledge_base import InputError, KnowledgeBase
from knowledge_base.world.schema import Schema


def test_each_instance_begins_with_what_its_builder_says_and_has_values_of_its_own():
    front, rear = Base("front"), Base("rear")
    asyncio.run(front.configure("speed", 1.0))
    assert (front.parameters["speed"], rear.parameters["speed"]) == (1.0, 0.5)
    assert "port" not in rear.parameters


@pytest.mark.parametrize(
    ("parameter", "value", "said"),
    [
        ("speed", 2.0, "'base.speed' is from 0.1 to 1.5; found 2"),
        ("speed", "fast", "'base.speed' is from 0.1 to 1.5; found fast"),
        ("speed", True, "found true"),
        ("speed", float("nan"), "'base.speed' is from 0.1 to 1.5; found nan"),
        ("mode", "brisc", "'base.mode' is one of calm, brisk; found brisc; did you mean 'brisk'?"),
        ("cycle", -1, "'base.cycle' is 0 or more"),
        ("port", 3, "'base.port' is a text"),
        ("sped", 1, "component 'base' has no parameter 'sped'; did you mean 'speed'?"),
        ("speed", 1.4, "component 'base' needs (<= ?speed (* 0.5 ?cycle)), but cycle is 2, speed is 1.4"),
        ("light", [1], "'base.light' is a boolean"),
    ],
)
def test_what_does_not_fit_is_refused_and_changes_nothing(parameter, value, said):
    base = Base()
    before = dict(base.parameters)
    with pytest.raises(InputError, match=re.escape(said)):
        asyncio.run(base.configure(parameter, value))
    assert base.parameters == before


def test_a_component_that_declares_nothing_takes_anything():
    plain = Component("plain")
    asyncio.run(plain.configure("anything", [1, 2]))
    assert plain.parameters == {"anything": [1, 2]}


HOLDER = """plot: p
states:
  a:
    entry: {set: base.%s}
    on: {done: e}
  e: {final: true}
"""
ANSWERING = """plot: p
states:
  a: {use: q, on: {done: e}}
  e: {final: true}
rules:
  - on: lost
    do: {command: {set: base.%s}, then: e}
"""
INNER = parse_plot("plot: q\nemits: {lost: }\nstates: {b: {on: {done: {to: f, emit: lost}}}, f: {final: true}}")


def findings_of(text, setting):
    plot = parse_plot(text % setting, "p.yaml")
    return [str(one) for one in validate_plot(plot, Library([plot, INNER]), None, [], {"base": Base.declares})]


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("speed, to: 3", "p.yaml:4:30: 'base.speed' is from 0.1 to 1.5; found 3"),
        ("sped, to: 1", "p.yaml:4:13: component 'base' has no parameter 'sped'; did you mean 'speed'?"),
        ("wheels, to: 3", "'base.wheels' is not changed by plots, but by nobody"),
        ("port, to: tty", "'base.port' is not changed by plots, but by profile"),
        ("light, to: true", "'base.light' is not changed by plots, but by rules"),
    ],
)
def test_what_a_plot_may_not_set_is_found_before_it_runs(setting, said):
    (finding,) = findings_of(HOLDER, setting)
    assert said in finding


@pytest.mark.parametrize("setting", ["speed, to: 1", "speed, to: ?x", "mode, to: brisk"])
def test_what_a_plot_may_set(setting):
    assert [one for one in findings_of(HOLDER, setting) if "?x" not in one] == []


def test_what_rules_may_set_and_what_not():
    assert findings_of(ANSWERING, "light, to: true") == []
    (finding,) = findings_of(ANSWERING, "port, to: tty")
    assert "p.yaml:7:" in finding
    assert "not changed by rules, but by profile" in finding


def test_names_of_components_alone_say_nothing_about_their_parameters():
    plot = parse_plot(HOLDER % "speed, to: 3")
    assert validate_plot(plot, Library([plot]), None, [], {"base"}) == []


# -- what a builder declares is checked when the class is made ---------------------------------------------------


def a_class(relations=(), **declares):
    return type(
        "Crane", (Component,), {"name": "crane", "declares": declares, "relations": relations, "__module__": __name__}
    )


@pytest.mark.parametrize(
    ("declared", "said"),
    [
        (Parameter("number", default=5, least=10), "the default of parameter 'crane.lift' is 5, but it is 10 or more"),
        (Parameter("number", default="fast"), "the default of parameter 'crane.lift' is fast, but it is a number"),
        (
            Parameter("text", default="upp", among=("up", "down")),
            "is upp, but it is one of up, down; did you mean 'up'?",
        ),
        (
            Parameter("number", default=5, least=9, most=1),
            "parameter 'crane.lift': no number is 9 or more and 1 or less",
        ),
        (Parameter("text", least=1), "`least` and `most` are about numbers, and this is a text"),
        (
            Parameter("nmber", default=5),  # type: ignore[arg-type]
            "the type of parameter 'crane.lift' is 'nmber', which does not exist; did you mean 'number'?",
        ),
        (
            Parameter("number", default=5, changed_by="operater"),  # type: ignore[arg-type]
            "'operater', which is not a role; did you mean 'operator'?",
        ),
    ],
)
def test_a_parameter_that_cannot_be_meant_is_refused_with_its_file(declared, said):
    with pytest.raises(InputError) as refused:
        a_class(lift=declared)
    assert said in str(refused.value)
    assert str(refused.value).startswith(f"{__file__}: ")


@pytest.mark.parametrize(
    ("relations", "said"),
    [
        (
            ("(< ?lft 3)",),
            "the relation (< ?lft 3) of component 'crane' reads '?lft', which it does not declare; did you mean 'lift'?",
        ),
        (("(< ?lift 3",), "the relation (< ?lift 3 of component 'crane' is not a condition"),
        ("(< ?lift 3)", "`relations` of component 'crane' is a tuple of conditions, not one text"),
    ],
)
def test_a_relation_that_cannot_be_meant_is_refused(relations, said):
    with pytest.raises(InputError) as refused:
        a_class(relations, lift=Parameter("number", default=1))
    assert said in str(refused.value)


# -- what relies on other parameters ---------------------------------------------------------------------------


class Axle(Component):
    """A worst-case time that is measured for each processor, and what follows from it (S1.11)."""

    name = "axle"
    declares: ClassVar = {
        "period": Parameter("number", follows="(* 2 ?worst)", most=100),
        "processor": Parameter("text", default="a", among=("a", "b"), changed_by="operator"),
        "worst": Parameter("number", default=3, depends_on=("processor",)),
        "label": Parameter("text", changed_by="profile", depends_on=("period",)),
    }
    relations = ("(>= ?period ?worst)",)


def axle(**said):
    made = Axle()
    for name, value in said.items():
        asyncio.run(made.configure(name, value))
    return made


def test_what_follows_has_a_value_from_the_beginning_and_whenever_its_reasons_are_said_anew():
    assert axle().parameters == {"period": 6, "processor": "a", "worst": 3}
    assert axle(worst=5).parameters["period"] == 10
    assert axle(worst=5, period=7).parameters["period"] == 7
    assert axle(period=7, worst=5).parameters["period"] == 10


def test_what_relies_on_what_is_said_anew_is_unbound_all_along_the_chain():
    bound = axle(worst=5, period=8, label="measured", processor="b")
    assert bound.parameters == {"period": 6, "processor": "b", "worst": 3}


def test_what_was_said_is_taken_back():
    assert axle(worst=5, period=7, label="x").parameters["label"] == "x"
    assert axle(worst=5, label="x", period=None).parameters == {"processor": "a", "worst": 5, "period": 10}
    made = axle(label="x")
    asyncio.run(made.configure("label", None))
    assert "label" not in made.parameters


def test_what_follows_is_in_its_range_or_nothing_changes():
    made = axle()
    with pytest.raises(InputError, match=r"'axle\.period' is 100 or less; found 120"):
        asyncio.run(made.configure("worst", 60))
    assert made.parameters == {"period": 6, "processor": "a", "worst": 3}


def test_a_profile_binds_what_relies_on_each_other_at_once():
    made = axle()
    with pytest.raises(InputError, match=r"'axle\.label' has no value: .* a new value of 'period' resets it"):
        configure([made])
    configure([made], parse_profile("profile: p\ncomponents: {axle: {label: x, worst: 9, processor: b}}"))
    assert made.parameters == {"period": 18, "processor": "b", "worst": 9, "label": "x"}


@pytest.mark.parametrize(
    ("declared", "said"),
    [
        (
            Parameter("number", follows="(* 2 ?lft)"),
            "parameter 'crane.lift' depends on 'lft', which is not declared; did you mean 'lift'?",
        ),
        (Parameter("number", default=1, depends_on=("lft",)), "depends on 'lft', which is not declared"),
        (
            Parameter("number", follows="(* 2 ?lift)"),
            "parameters of component 'crane' depend on each other in a cycle: 'lift', 'lift'",
        ),
        (Parameter("number", default=1, follows="2"), "has a default and follows from others"),
        (Parameter("number", follows="(* 2"), "is not a term"),
        (Parameter("number", follows="2", most=1), "'crane.lift' is 1 or less; found 2"),
        (Parameter("number", default=1, depends_on="lift"), "is a tuple of names, not one text"),  # type: ignore[arg-type]
    ],
)
def test_a_dependency_that_cannot_be_meant_is_refused(declared, said):
    with pytest.raises(InputError) as refused:
        a_class(lift=declared)
    assert said in str(refused.value)


class Rolled(Outcome): ...


def test_an_operator_changes_what_others_rely_on_and_the_next_skill_says_what_is_missing():
    class Wheel(Component):
        name = "wheel"
        declares: ClassVar = {
            "tyre": Parameter("text", default="soft", among=("soft", "hard"), changed_by="operator"),
            "slip": Parameter("number", changed_by="operator", depends_on=("tyre",)),
        }

        @skill
        async def roll(self, call) -> Rolled:
            return Rolled()

    text = """
    plot: p
    emits: {lost: {why: text}}
    states:
      one: {entry: {trigger: wheel.roll}, on: {rolled: rest, skill_error: lost}}
      rest: {after: {seconds: 2, to: two}}
      two:
        entry: {trigger: wheel.roll}
        on: {rolled: over, skill_error: {to: over, emit: lost, with: {why: ?event.reason}}}
      lost: {final: true}
      over: {final: true}
    """

    def ran(*said):
        wheel = Wheel()
        configure([wheel], parse_profile("profile: p\ncomponents: {wheel: {slip: 3}}"))

        async def main():
            sequencer = Sequencer(Library([parse_plot(text)]), KnowledgeBase(Schema()), [wheel], LoopClock())
            for name, value in said:
                sequencer.set_parameter("wheel", name, value, after=1)
            return await sequencer.run("p")

        return run_simulated(main())

    assert ran() == RunEnd(finished=True)
    (lost,) = ran(("tyre", "hard")).emitted
    assert "'wheel.slip' has no value" in lost.attributes["why"]
    assert ran(("tyre", "hard"), ("slip", 4)) == RunEnd(finished=True)
    (lost,) = ran(("slip", None)).emitted
    assert "'wheel.slip' has no value" in lost.attributes["why"]

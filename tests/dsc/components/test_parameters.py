"""Parameters with roles: the builder's range, the integrator's value, who may change them at run time (S1.11)."""

from __future__ import annotations

import asyncio
import re
import textwrap
from typing import Literal

import pytest
from dsc_base import Base

from dsc import Component, Library, Outcome, Parameters, Sequencer, parameter, parse_plot, skill, validate_plot
from dsc.profiles import configure
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.sequencer.run_end import RunEnd
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
        ("speed", "fast", "'base.speed' is a number, from 0.1 to 1.5; found the text fast"),
        ("speed", True, "found the truth value true"),
        ("speed", float("nan"), "'base.speed' is from 0.1 to 1.5; found nan"),
        ("mode", "brisc", "'base.mode' is one of calm, brisk; found brisc; did you mean 'brisk'?"),
        ("cycle", -1, "'base.cycle' is 0 or more"),
        ("port", 3, "'base.port' is a text"),
        ("sped", 1, "component 'base' has no parameter 'sped'; did you mean 'speed'?"),
        ("speed", 1.4, "component 'base' needs (<= ?speed (* 0.5 ?cycle)), but cycle is 2, speed is 1.4"),
        ("light", [1], "'base.light' is a boolean"),
    ],
)
def test_an_invalid_setting_is_refused_and_changes_no_parameter(parameter, value, said):
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
    return [str(one) for one in validate_plot(plot, Library([plot, INNER]), None, [], {"base": Base().interface()})]


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
def test_an_invalid_setting_in_a_plot_is_found_before_the_run(setting, said):
    (finding,) = findings_of(HOLDER, setting)
    assert said in finding


@pytest.mark.parametrize("setting", ["speed, to: 1", "speed, to: ?x", "mode, to: brisk"])
def test_a_valid_setting_in_a_plot_has_no_finding(setting):
    assert [one for one in findings_of(HOLDER, setting) if "?x" not in one] == []


def test_rules_set_only_parameters_open_to_rules():
    assert findings_of(ANSWERING, "light, to: true") == []
    (finding,) = findings_of(ANSWERING, "port, to: tty")
    assert "p.yaml:7:" in finding
    assert "not changed by rules, but by profile" in finding


def test_names_of_components_alone_say_nothing_about_their_parameters():
    plot = parse_plot(HOLDER % "speed, to: 3")
    assert validate_plot(plot, Library([plot]), None, [], {"base"}) == []


# -- what a builder declares is checked when the class is made ---------------------------------------------------


def a_class(body):
    """Make a class of parameters from the text of its body."""
    text = "from __future__ import annotations\nclass Crane(Parameters):\n" + textwrap.indent(body, "    ")
    names = {"Literal": Literal, "Parameters": Parameters, "parameter": parameter, "__name__": __name__}
    exec(compile(text, "crane.py", "exec", dont_inherit=True), names)  # noqa: S102  # the text is the test's


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("lift: float = parameter(5, least=10)", "the default of parameter 'Crane.lift' is 5, but it is 10 or more"),
        ('lift: float = "fast"', "the default of parameter 'Crane.lift' is fast, but it is a number"),
        ("lift: int = 2.5", "the default of parameter 'Crane.lift' is 2.5, but it is an integer"),
        ('lift: Literal["up", "down"] = "upp"', "is upp, but it is one of up, down; did you mean 'up'?"),
        ("lift: float = parameter(5, least=9, most=1)", "parameter 'Crane.lift': no number is 9 or more and 1 or less"),
        ("lift: str = parameter(least=1)", "`least` and `most` are about numbers, and this is a text"),
        ("lift: nmber = 5", "the annotation of parameter 'lift' of Crane names 'nmber', which does not exist"),
        ("lift: list[int] = 5", "is list, which is none of float, int, bool, str or a Literal of one type"),
        ('lift: Literal["up", 1]', "which is none of float, int, bool, str or a Literal of one type"),
        ("lift: float | None = None", "which is none of float, int, bool, str or a Literal of one type"),
        (
            'lift: float = parameter(5, changed_by="operater")',
            "'operater', which is not a role; did you mean 'operator'?",
        ),
        ("lift = 5", "'lift' of Crane has no annotation, which is the type: lift: float = …"),
        ("values: float = 5", "parameter 'values' of Crane hides an attribute of every `Parameters`"),
    ],
)
def test_a_parameter_that_cannot_be_meant_is_refused_with_its_line(body, said):
    with pytest.raises(InputError) as refused:
        a_class(body)
    assert said in str(refused.value)
    assert str(refused.value).startswith("crane.py:2: ")


@pytest.mark.parametrize(
    ("relations", "said"),
    [
        (
            ("(< ?lft 3)",),
            "the relation (< ?lft 3) of Crane reads '?lft', which it does not declare; did you mean 'lift'?",
        ),
        (("(< ?lift 3",), "the relation (< ?lift 3 of Crane is not a condition"),
        ("(< ?lift 3)", "`relations` of Crane is a tuple of conditions, not one text"),
    ],
)
def test_a_relation_that_cannot_be_meant_is_refused(relations, said):
    with pytest.raises(InputError) as refused:
        a_class(f"lift: float = 1\nrelations = {relations!r}")
    assert said in str(refused.value)


def test_the_annotation_of_parameters_names_a_class_of_parameters():
    with pytest.raises(InputError, match=r"`parameters` of .*Crane is dict, which is not a subclass of Parameters"):

        class Crane(Component):
            parameters: dict  # type: ignore[assignment,type-arg]


def test_skills_read_parameters_and_only_the_component_sets_them():
    base = Base()
    assert base.parameters.speed == base.parameters["speed"] == 0.5
    with pytest.raises(InputError, match=r"'base\.port' has no value: its builder leaves it to a profile"):
        _ = base.parameters.port
    with pytest.raises(AttributeError, match=r"use `await self\.configure\('speed', …\)` of the component"):
        base.parameters.speed = 1.0  # type: ignore[misc]


def test_a_whole_number_stays_an_integer():
    class WheelParameters(Parameters):
        teeth: int = parameter(9, least=1)
        step: Literal[1, 2, 4] = 1

    class Wheel(Component):
        parameters: WheelParameters

    wheel = Wheel()
    asyncio.run(wheel.configure("teeth", 12.0))
    assert repr(wheel.parameters) == "WheelParameters(teeth=12, step=1)"
    for name, value, said in (("teeth", 2.5, "is an integer 1 or more; found 2.5"), ("step", 3, "is one of 1, 2, 4")):
        with pytest.raises(InputError, match=f"'wheel.{name}' {said}"):
            asyncio.run(wheel.configure(name, value))


# -- what relies on other parameters ---------------------------------------------------------------------------


class AxleParameters(Parameters):
    """A worst-case time that is measured for each processor, and what follows from it (S1.11)."""

    period: float = parameter(follows="(* 2 ?worst)", most=100)
    processor: Literal["a", "b"] = parameter("a", changed_by="operator")
    worst: float = parameter(3, depends_on=("processor",))
    label: str = parameter(changed_by="profile", depends_on=("period",))
    relations = ("(>= ?period ?worst)",)


class Axle(Component):
    name = "axle"
    parameters: AxleParameters


def axle(**said):
    made = Axle()
    for name, value in said.items():
        asyncio.run(made.configure(name, value))
    return made


def test_a_derived_parameter_has_an_initial_value_and_follows_each_change_of_its_source():
    assert axle().parameters == {"period": 6, "processor": "a", "worst": 3}
    assert axle(worst=5).parameters["period"] == 10
    assert axle(worst=5, period=7).parameters["period"] == 7
    assert axle(period=7, worst=5).parameters["period"] == 10


def test_a_setting_resets_all_parameters_that_depend_on_it():
    bound = axle(worst=5, period=8, label="measured", processor="b")
    assert bound.parameters == {"period": 6, "processor": "b", "worst": 3}


def test_a_parameter_set_to_none_loses_the_value_it_was_given():
    assert axle(worst=5, period=7, label="x").parameters["label"] == "x"
    assert axle(worst=5, label="x", period=None).parameters == {"processor": "a", "worst": 5, "period": 10}
    made = axle(label="x")
    asyncio.run(made.configure("label", None))
    assert "label" not in made.parameters


def test_a_derived_value_out_of_range_refuses_the_change():
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
    ("body", "said"),
    [
        (
            'lift: float = parameter(follows="(* 2 ?lft)")',
            "parameter 'Crane.lift' depends on 'lft', which is not declared; did you mean 'lift'?",
        ),
        ('lift: float = parameter(1, depends_on=("lft",))', "depends on 'lft', which is not declared"),
        (
            'lift: float = parameter(follows="(* 2 ?lift)")',
            "parameters of Crane depend on each other in a cycle: 'lift', 'lift'",
        ),
        ('lift: float = parameter(1, follows="2")', "has a default and follows from others"),
        ('lift: float = parameter(follows="(* 2")', "is not a term"),
        ('lift: float = parameter(follows="2", most=1)', "'Crane.lift' is 1 or less; found 2"),
        ('lift: float = parameter(1, depends_on="lift")', "is a tuple of names, not one text"),
    ],
)
def test_a_dependency_that_cannot_be_meant_is_refused(body, said):
    with pytest.raises(InputError) as refused:
        a_class(body)
    assert said in str(refused.value)


class Rolled(Outcome): ...


def test_an_operator_changes_what_others_rely_on_and_the_next_skill_says_what_is_missing():
    class WheelParameters(Parameters):
        tyre: Literal["soft", "hard"] = parameter("soft", changed_by="operator")
        slip: float = parameter(changed_by="operator", depends_on=("tyre",))

    class Wheel(Component):
        name = "wheel"
        parameters: WheelParameters

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

"""Parameters of plots with roles: range, default, and who may say another value, before the run and while it goes on."""

from __future__ import annotations

import asyncio
import re

import pytest
from dsc_crashes import Crashes, Robot
from dsc_runs import Ran

from dsc import Component, Library, Outcome, Sequencer, parse_plot, skill, validate_plot
from dsc.components.parameters import Parameters, parameter
from dsc.model.plot import ActionPlot
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.sequencer.replay import replay
from dsc.text.plot_files import plot_to_yaml
from knowledge_base import InputError, KnowledgeBase
from knowledge_base.world.schema import Schema

WAIT = """plot: wait
parameters:
  seconds: {type: number, default: 10, least: 1, most: 60, changed_by: WHO}
  mood: {type: text, default: calm, among: [calm, brisk]}
states:
  a: {after: {seconds: ?seconds, to: e}}
  e: {final: true}
"""
USING = """plot: p
states:
  a: {use: wait, with: {WITH}, on: {done: e}}
  e: {final: true}
"""
HANDING_BY_RULE = """plot: p
states:
  a: {use: lost, on: {done: e}}
  e: {final: true}
rules:
  - {on: lost, do: {use: wait, with: {seconds: 3}, then: e}}
"""
LOST = parse_plot("plot: lost\nemits: {lost: }\nstates: {b: {on: {done: {to: f, emit: lost}}}, f: {final: true}}")


def wait(who="plots", text=WAIT):
    return parse_plot(text.replace("WHO", who), "wait.yaml")


def findings(plot, *others):
    return [str(one) for one in validate_plot(plot, Library([plot, *others]), None, [], [])]


@pytest.mark.parametrize(
    ("handed", "said"),
    [
        ("seconds: 100", "p.yaml:3:25: 'wait.seconds' is from 1 to 60; found 100"),
        ("seconds: 0.5", "'wait.seconds' is from 1 to 60; found 0.5"),
        ("mood: brisc", "'wait.mood' is one of calm, brisk; found brisc; did you mean 'brisk'?"),
    ],
)
def test_a_value_passed_to_a_plot_outside_its_range_is_a_finding(handed, said):
    (finding,) = findings(parse_plot(USING.replace("WITH", handed), "p.yaml"), wait())
    assert said in finding


@pytest.mark.parametrize("who", ["nobody", "profile", "operator", "rules"])
def test_plots_hand_only_what_is_left_to_them(who):
    (finding,) = findings(parse_plot(USING.replace("WITH", "seconds: 5"), "p.yaml"), wait(who))
    assert f"p.yaml:3:25: 'wait.seconds' is not changed by plots, but by {who}" in finding


@pytest.mark.parametrize(("who", "allowed"), [("operator", False), ("rules", True), ("plots", True)])
def test_rules_hand_what_is_left_to_them(who, allowed):
    found = findings(parse_plot(HANDING_BY_RULE, "p.yaml"), wait(who), LOST)
    assert (found == []) is allowed
    assert allowed or "p.yaml:6:39: 'wait.seconds' is not changed by rules, but by operator" in found[0]


def test_rules_pass_to_steps_of_plans_what_is_left_to_them():
    drive = parse_plot(
        "plot: drive\nimplements: go\nparameters: {speed: {type: number, default: 1, most: 2, changed_by: WHO}}\nemits: {blocked: }\nstates: {b: {on: {done: {to: f, emit: blocked}}}, f: {final: true}}".replace(
            "WHO", "rules"
        )
    )
    text = "plot: p\nstates:\n  a: {goal: (x), on: {done: e, no_plan: e, gave_up: e}}\n  e: {final: true}\nrules:\n  - {on: blocked, do: {then: retry, pass: {speed: 1}}}\n"
    assert findings(parse_plot(text), drive) == []
    (finding,) = findings(parse_plot(text.replace("speed: 1", "speed: 3"), "p.yaml"), drive)
    assert "p.yaml:6:44: 'drive.speed' is 2 or less; found 3" in finding
    (finding,) = findings(
        parse_plot(text),
        parse_plot(
            drive.text.replace('"changed_by":"rules"', '"changed_by":"operator"').replace(
                '"changed_by": "rules"', '"changed_by": "operator"'
            )
        ),
    )
    assert "'drive.speed' is not changed by rules, but by operator" in finding


def test_a_transition_passes_what_is_in_range():
    text = "plot: p\nstates:\n  b: {on: {done: {to: a, pass: {seconds: 99}}}}\n  a: {use: wait, on: {done: e}}\n  e: {final: true}\n"
    (finding,) = findings(parse_plot(text, "p.yaml"), wait())
    assert "p.yaml:3:33: 'wait.seconds' is from 1 to 60; found 99" in finding


@pytest.mark.parametrize(
    ("declared", "said"),
    [
        ("{type: number, default: 0, least: 1}", "wait.yaml:3:27: 'wait.seconds' is 1 or more; found 0"),
        ("{type: text, default: x, least: 1}", "`least` and `most` are about numbers, and this is a text"),
        ("{type: number, default: 3, least: 5, most: 4}", "no number is 5 or more and 4 or less"),
        ("{type: number, default: 1, among: [1, two]}", "two is no number"),
        ("{type: number, changed_by: operator}", "'seconds' needs a default"),
    ],
)
def test_a_declaration_makes_sense(declared, said):
    text = re.sub(r"seconds: \{type.*\}", f"seconds: {declared}", WAIT)
    assert any(said in one for one in findings(wait(text=text)))


def test_an_unknown_role_is_refused_with_the_right_ones():
    with pytest.raises(InputError, match=r"wait.yaml:3:.*'nobody', 'profile', 'operator', 'rules' or 'plots'"):
        wait("opperator")


def test_roles_are_written_and_read():
    assert parse_plot(plot_to_yaml(wait("rules"))) == wait("rules")
    assert ActionPlot.model_validate(wait("rules").to_form()) == wait("rules")


def test_another_default_is_another_text():
    before = wait("operator")
    assert "10" in before.text
    assert before.with_default("seconds", 20, "operator").to_form()["parameters"]["seconds"]["default"] == 20


def test_a_value_known_only_at_run_time_is_checked_when_the_plot_is_entered():
    holder = USING.replace("plot: p\n", "plot: p\nvariables: {n: {type: number, initial: 70}}\n").replace(
        "WITH", "seconds: ?n"
    )
    ran = Ran(holder, WAIT.replace("WHO", "plots"))
    assert not ran.end.finished
    assert "'wait.seconds' is from 1 to 60; found 70" in (ran.end.problem or "")


# -- while the run goes on ---------------------------------------------------------------------------------


class Arrived(Outcome): ...


class BaseParameters(Parameters):
    speed: float = parameter(0.5, least=0.1, most=1.5, changed_by="operator")
    light: bool = False
    port: str = parameter("a", changed_by="profile")
    cycle: float = 2.0
    relations = ("(<= ?speed (* 0.5 ?cycle))",)


class Base(Component):
    name = "base"
    parameters: BaseParameters

    def __init__(self):
        super().__init__()
        self.driven = []

    @skill
    async def drive(self, call) -> Arrived:
        self.driven.append(self.parameters.speed)
        await call.clock.sleep(1.0)
        return Arrived()


DRIVING = """plot: p
variables: {n: {type: number, initial: 0}}
states:
  drive: {entry: {trigger: base.drive}, on: {arrived: rest}}
  rest:
    use: wait
    on: {done: [{to: drive, when: (< ?n 1), assign: {n: (+ ?n 1)}}, e]}
  e: {final: true}
"""


def driven(act, after=0.5):
    """What the base drove with and when the run ended, if an operator acts after a while."""
    base = Base()

    async def main():
        clock = LoopClock()
        library = Library([parse_plot(DRIVING), wait("operator")])
        sequencer = Sequencer(library, KnowledgeBase(Schema()), [base], clock)
        running = asyncio.ensure_future(sequencer.run("p"))
        await clock.sleep(after)
        act(sequencer)
        end = await running
        assert end.finished, end.problem
        return base.driven, clock.now()

    return run_simulated(main())


def test_an_operator_changes_a_component_for_the_next_skill():
    assert driven(lambda run: run.set_parameter("base", "speed", 0.9)) == ([0.5, 0.9], 22.0)


def test_an_operator_changes_a_plot_for_the_next_time_it_is_entered():
    assert driven(lambda run: run.set_parameter("wait", "seconds", 2)) == ([0.5, 0.5], 6.0)
    assert driven(lambda run: run.set_parameter("wait", "seconds", 2), after=5) == ([0.5, 0.5], 14.0)


@pytest.mark.parametrize(
    ("owner", "name", "value", "said"),
    [
        ("base", "speed", 2, "'base.speed' is from 0.1 to 1.5; found 2"),
        ("base", "port", "b", "'base.port' is not changed by operator, but by profile"),
        ("base", "sped", 1, "component 'base' has no parameter 'sped'; did you mean 'speed'?"),
        ("base", "cycle", 0.5, "needs (<= ?speed (* 0.5 ?cycle)), but cycle is 0.5, speed is 0.5"),
        ("bse", "speed", 1, "there is no component or plot 'bse'; did you mean 'base'?"),
        ("wait", "seconds", 61, "'wait.seconds' is from 1 to 60; found 61"),
        ("wait", "second", 6, "plot 'wait' has no parameter 'second'; did you mean 'seconds'?"),
        ("wait", "seconds", [1], "'wait.seconds' is from 1 to 60; found [1]"),
    ],
)
def test_an_invalid_setting_by_an_operator_is_refused_and_changes_no_value(owner, name, value, said):
    def act(sequencer):
        with pytest.raises(InputError, match=re.escape(said)):
            sequencer.set_parameter(owner, name, value)

    assert driven(act) == ([0.5, 0.5], 22.0)


def test_an_operator_may_set_a_parameter_open_to_rules():
    assert driven(lambda run: run.set_parameter("base", "light", value=True)) == ([0.5, 0.5], 22.0)


class DialParameters(Parameters):
    speed: int = parameter(1, least=1, most=9, changed_by="operator")


class Dial(Robot):
    parameters: DialParameters


KEPT = """
    plot: p
    variables: {n: {type: number, initial: 0}}
    states:
      work: {entry: {trigger: robot.work, with: {seconds: 1}}, on: {did: rest}}
      rest: {use: wait, on: {done: [{to: work, when: (< ?n 2), assign: {n: (+ ?n 1)}}, e]}}
      e: {final: true}
"""


def test_settings_by_an_operator_outlive_a_crash_and_are_replayed(tmp_path):
    def prepare(sequencer):
        sequencer.set_parameter("wait", "seconds", 3, after=0.5)
        sequencer.set_parameter("robot", "speed", 7, after=1.5)
        sequencer.set_parameter("wait", "seconds", 2, after=4.5)

    crashes = Crashes(tmp_path, KEPT, WAIT.replace("WHO", "operator"), prepare=prepare, make=Dial)
    assert crashes.whole.end.finished
    assert crashes.whole.at == pytest.approx(1 + 3 + 1 + 2 + 1 + 2)
    for what, run in crashes.resumed():
        assert run.outcome() == crashes.whole.outcome(), what
        assert run.robot.parameters == {"speed": 7}, what
    assert replay(crashes.whole.path).divergence is None

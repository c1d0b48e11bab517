"""Rules that insert steps, leave them out, hand them other arguments and command components (S1.4)."""

from __future__ import annotations

import pytest
from dsc_charts import Run, plot

from dsc.dynamic.library import Library
from dsc.engine.situation import Decision
from dsc.engine.steps import SendMessage, SetParameter, SwitchMode
from dsc.model.transitions import ChoiceState
from dsc.text.plot_files import parse_plot, plot_to_yaml
from knowledge_base.errors import InputError, SchemaError
from knowledge_base.facts import Fact, fact
from knowledge_base.language.syntax.expression import Constant

LOOK = """
    plot: look
    implements: inspect
    parameters: {item: item, light: {type: symbol, default: dim}}
    outputs: {seen: {type: number, initial: 3}}
    emits: {blurred: {item: item, lamp: symbol}}
    states:
      work:
        entry: {set: camera.light, to: ?light}
        on: {ok: over, bad: {to: over, emit: blurred, with: {item: ?item, lamp: bright}}}
      over: {final: true}
"""
WIPE = """
    plot: wipe
    parameters: {item: {type: item, default: none}}
    emits: {torn: }
    states:
      wiping: {entry: {set: arm.wipes, to: ?item}, on: {ok: over, bad: {to: over, emit: torn}}}
      over: {final: true}
"""
HOLDER = """
    plot: p
    variables: {mine: {type: item, initial: cup1}, n: {type: number, initial: 0}}
    receives: {go: }
    states:
      start: {on: {go: step}}
      step: {use: look, with: {item: ?mine}, on: {done: {to: fine, assign: {n: ?event.seen}}, blurred: other}}
      fine: {on: {go: step}}
      other:
    rules:
"""


def library_of(rules, text=HOLDER):
    indented = "".join(f"      - {rule}\n" for rule in rules)
    return [plot(text + indented), plot(LOOK), plot(WIPE)]


def run_of(rules, text=HOLDER, facts=()):
    run = Run(*library_of(rules, text), facts=facts)
    run.start()
    return run


def rules_taken(step):
    return [taken.rule for micro in step.microsteps for taken in micro.taken if taken.rule]


# -- before a step -----------------------------------------------------------------------------------------


def test_a_rule_inserts_a_step_before_another_whenever_its_condition_holds():
    run = run_of(["{before: step, when: (dirty lens), do: {use: wipe}}"], facts=[fact("dirty", "lens")])
    step = run.send("go")
    assert run.machine.state.is_active("wiping")
    assert rules_taken(step) == ["before step: wipe"]
    run.facts.clear()
    run.send("ok")
    assert run.active == ["step", "step/work"]
    run.send("ok")
    run.send("go")
    assert run.active == ["step", "step/work"]


def test_it_is_asked_once_whenever_the_step_is_entered():
    run = run_of(["{before: step, when: (dirty lens), do: {use: wipe}}"], facts=[fact("dirty", "lens")])
    for _ in range(5):
        run.send("go")
        assert run.machine.state.is_active("wiping")
        run.send("bad")  # whatever it ends with
        assert run.active == ["step", "step/work"]
        run.send("ok")


def test_a_retry_enters_the_step_by_way_of_what_is_inserted():
    text = HOLDER.replace(", blurred: other", "")
    rules = [
        "{on: blurred, do: {tell: (dirty lens), then: retry}}",
        "{before: step, when: (dirty lens), do: {use: wipe}}",
    ]
    run = run_of(rules, text)
    run.send("go")
    assert run.active == ["step", "step/work"]
    run.send("bad")
    assert run.machine.state.is_active("wiping")
    run.send("ok")
    assert run.active == ["step", "step/work"]


def test_several_insertions_stand_one_behind_the_other():
    rules = [
        "{before: step, when: (p), do: {use: wipe, with: {item: a}}}",
        "{before: step, when: (q), do: {use: wipe, with: {item: b}}}",
    ]
    run = run_of(rules, facts=[Fact("p"), Fact("q")])
    assert SetParameter("arm", "wipes", "a") in run.send("go").output
    assert SetParameter("arm", "wipes", "b") in run.send("ok").output
    run.send("ok")
    assert run.active == ["step", "step/work"]
    run = run_of(rules, facts=[Fact("q")])
    assert SetParameter("arm", "wipes", "b") in run.send("go").output


def test_the_first_state_too_has_something_before_it():
    text = HOLDER.replace("      start: {on: {go: step}}\n", "").replace(
        "      other:", "      other: {on: {go: step}}"
    )
    run = run_of(["{before: step, when: (p), do: {use: wipe}}"], text, facts=[Fact("p")])
    assert run.machine.state.is_active("wiping")
    run.send("ok")
    assert run.active == ["step", "step/work"]


@pytest.mark.parametrize(
    "around", ["c: {on: {stop: far}, states: {%s}}", "c: {on: {stop: far}, regions: {r: {states: {%s}}}}"]
)
def test_inside_a_composite_and_a_region_too(around):
    inner = "start: {on: {go: step}}, step: {use: look, with: {item: cup1}, on: {done: start, blurred: start}}"
    text = "    plot: p\n    states:\n      " + around % inner + "\n      far:\n    rules:\n"
    run = run_of(["{before: step, do: {use: wipe}}"], text)
    run.send("go")
    assert run.machine.state.is_active("wiping")
    run.send("ok")
    assert run.active[-2:] == ["step", "step/work"]


def test_a_rule_speaks_of_the_arguments_of_the_step():
    rule = "{before: step, when: (dirty ?step.item), do: {tell: (wiped ?step.item), command: {set: arm.of, to: ?step.item}, use: wipe, with: {item: ?step.item}}}"
    run = run_of([rule], facts=[fact("dirty", "cup2")])
    run.send("go")
    assert run.active == ["step", "step/work"]
    run = run_of([rule], facts=[fact("dirty", "cup1")])
    step = run.send("go")
    assert step.knowledge.added == (fact("wiped", "cup1"),)
    assert {SetParameter("arm", "of", "cup1"), SetParameter("arm", "wipes", "cup1")} <= set(step.output)


def test_an_argument_that_a_quantifier_of_the_rule_hides_is_refused():
    rule = "{before: step, when: (exists (?mine - item) (on ?mine ?step.item)), do: {use: wipe}}"
    with pytest.raises(SchemaError, match="is the plot's '\\?mine', and the rule means another"):
        Library(library_of([rule])).compiled("p")


def test_a_rule_leaves_a_step_out():
    text = HOLDER.replace("assign: {n: ?event.seen}", "assign: {n: 7}")
    run = run_of(
        ["{before: step, when: (known ?step.item), do: {then: continue}}"], text, facts=[fact("known", "cup1")]
    )
    run.send("go")
    assert run.active == ["fine"]
    assert run.variables()["n"] == 7


def test_a_rule_puts_another_plot_in_the_place_of_a_step():
    text = HOLDER.replace("assign: {n: ?event.seen}", "assign: {n: 7}")
    run = run_of(["{before: step, do: {use: wipe, then: continue}}"], text)
    run.send("go")
    assert run.machine.state.is_active("wiping")
    run.send("ok")
    assert run.active == ["fine"]


def test_a_rule_goes_elsewhere_instead_of_into_a_step():
    run = run_of(["{before: step, when: (p), do: {then: other}}"], facts=[Fact("p")])
    run.send("go")
    assert run.active == ["other"]


def test_passed_values_reach_a_step_behind_an_inserted_plot():
    text = HOLDER.replace(
        "start: {on: {go: step}}",
        "start: {on: {go: {to: step, assign: {mine: ?event.item}, pass: {item: ?mine, light: ?event.light}}}}",
    )
    for facts in ([], [Fact("p")]):
        run = run_of(["{before: step, when: (p), do: {use: wipe}}"], text, facts=facts)
        run.send("go", item="cup9", light="green")
        if facts:
            run.send("ok", light="of another event")
        assert run.variables("step") == {"item": "cup9", "light": "green", "seen": 3}


def test_a_step_is_named_by_the_planning_action_that_it_carries_out():
    run = run_of(["{before: inspect, do: {use: wipe}}"])
    run.send("go")
    assert run.machine.state.is_active("wiping")


# -- after a step ------------------------------------------------------------------------------------------


def test_a_rule_inserts_a_step_after_another():
    run = run_of(["{after: step, when: (p), do: {use: wipe}}"], facts=[Fact("p")])
    run.send("go")
    run.send("ok")
    assert run.machine.state.is_active("wiping")
    assert run.variables()["n"] == 3  # what is done with the result is done when it comes
    run.send("ok")
    assert run.active == ["fine"]


def test_after_a_failure_there_is_no_after():
    run = run_of(["{after: step, do: {use: wipe}}"])
    run.send("go")
    run.send("bad")
    assert run.active == ["other"]


def test_a_rule_has_a_step_done_again_a_bounded_number_of_times():
    run = run_of(["{after: step, when: (p), do: {then: retry, pass: {light: bright}, limit: 2}}"], facts=[Fact("p")])
    run.send("go")
    for _ in range(2):
        assert SetParameter("camera", "light", "bright") in run.send("ok").output
        assert run.active == ["step", "step/work"]
    run.send("ok")
    assert run.active == ["fine"]


# -- arguments and commands --------------------------------------------------------------------------------

FAILING = HOLDER.replace(", blurred: other", "")


def test_a_retry_hands_over_other_arguments():
    run = run_of(["{on: blurred, do: {then: retry, pass: {light: ?event.lamp}}}"], FAILING)
    run.send("go")
    assert run.variables("step")["light"] == "dim"
    run.send("bad")
    assert run.variables("step") == {"item": "cup1", "light": "bright", "seen": 3}


def test_also_behind_a_recovery_when_the_event_is_long_gone():
    run = run_of(["{on: blurred, do: {use: wipe, then: retry, pass: {light: ?event.lamp}}}"], FAILING)
    run.send("go")
    run.send("bad")
    run.send("ok", lamp="of another event")
    assert run.variables("step")["light"] == "bright"


def test_a_rule_commands_components():
    commands = "[{set: camera.gain, to: ?event.lamp}, {switch: camera, to: night}, {send: voice.say, with: {text: ?event.item}}]"
    run = run_of([f"{{on: blurred, do: {{command: {commands}, then: retry}}}}"], FAILING)
    run.send("go")
    output = run.send("bad").output
    wanted = [
        SetParameter("camera", "gain", "bright"),
        SwitchMode("camera", "night"),
        SendMessage("voice", "say", {"text": "cup1"}),
    ]
    assert [one for one in output if one in wanted] == wanted
    assert run.active == ["step", "step/work"]


def test_commands_come_before_the_recovery():
    run = run_of(["{on: blurred, do: {command: {set: camera.gain, to: 2}, use: wipe, then: other}}"], FAILING)
    run.send("go")
    output = list(run.send("bad").output)
    assert output.index(SetParameter("camera", "gain", 2)) < output.index(SetParameter("arm", "wipes", "none"))
    run.send("ok")
    assert run.active == ["other"]


# -- in generated plots ------------------------------------------------------------------------------------


def generated(*rules):
    made = plot(
        """
    plot: plan
    generated: true
    variables: {reason: {type: text, initial: unknown}}
    emits: {replan: {reason: text}, gave_up: {reason: text}}
    states:
      step_1: {dynamic: [look], with: {item: cup1}, on: {done: after_1}}
      after_1: {always: {to: finished, when: (seen cup1)}}
      step_1_skipped: {always: finished}
      finished: {final: true}
      replan: {final: true, emit: replan, with: {reason: ?reason}}
      gave_up: {final: true, emit: gave_up, with: {reason: ?reason}}
    rules: [RULES]
    """.replace("RULES", ", ".join(rules))
    )
    host = plot("plot: p\nstates: {h: {use: plan, on: {done: fine, replan: again, gave_up: again}}, fine: , again: }")
    run = Run(
        host,
        made,
        plot(LOOK),
        plot(WIPE),
        choices={"look": Decision("look", {"item": "cup1"})},
        facts=[fact("known", "cup1")],
    )
    run.start()
    return run


def test_in_a_plan_a_step_is_left_out_without_waiting_for_its_effects():
    assert generated("{before: inspect, when: (known ?step.item), do: {then: continue}}").active == ["fine"]


def test_in_a_plan_a_step_is_inserted_and_a_plan_given_up():
    run = generated("{before: inspect, when: (known ?step.item), do: {use: wipe, with: {item: ?step.item}}}")
    assert run.machine.state.is_active("wiping")
    run.send("ok")
    assert run.machine.state.is_active("work")
    assert generated("{before: inspect, do: {then: replan}}").active == ["again"]


# -- what can be seen --------------------------------------------------------------------------------------


def test_insertions_are_connectors_and_states_like_all_others():
    holder, *others = library_of(["{before: step, when: (p), do: {use: wipe}}"])
    expanded = Library([holder, *others]).expanded(holder)
    added = {name: state for name, state in expanded.states.items() if name not in holder.states}
    connector, inserted = added.values()
    assert isinstance(connector, ChoiceState)
    assert inserted.use == "wipe"
    assert {way.target for way in expanded.states["start"].on["go"]} == {next(iter(added))}
    assert not expanded.rules


def test_both_spellings_are_read_and_written():
    text = plot_to_yaml(
        library_of(["{before: [step], when: (p), do: {command: [{set: a.b, to: 1}], pass: {light: x}}}"])[0]
    )
    assert "before: step" in text
    assert parse_plot(text).rules[0].do.passed == {"light": Constant("x")}
    assert plot_to_yaml(parse_plot(text)) == text


@pytest.mark.parametrize(
    ("rule", "message"),
    [
        ("{do: {then: retry}}", "a rule has one of the keys on, before and after"),
        ("{on: blurred, before: step, do: {}}", "found on and before"),
        ("{before: step, of: [step], do: {}}", "`of` goes with `on`"),
        ("{before: step, do: {command: {trigger: arm.go}}}", "one of the keys set, switch, send"),
    ],
)
def test_a_rule_that_is_none_is_refused_with_its_line(rule, message):
    with pytest.raises(InputError, match=message) as error:
        library_of([rule])
    assert error.value.place is not None

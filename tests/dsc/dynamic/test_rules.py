"""Contingency rules: what each response does, in which order, how often, and that it can be seen."""

from __future__ import annotations

import pytest
from dsc_charts import Run, modes, plot

from dsc.dynamic.library import Library
from dsc.dynamic.responses import DEFAULT_RETRIES
from dsc.engine.situation import Decision
from dsc.engine.steps import SetParameter
from dsc.model.actions import Tell
from dsc.model.states import SubmachineState
from dsc.text.plot_files import parse_plot, plot_to_yaml
from dsc.validation import validate_plot
from knowledge_base.errors import InputError, SchemaError, UnknownNameError
from knowledge_base.facts import Fact, fact
from knowledge_base.language.syntax.expression import Constant
from knowledge_base.world.schema import Schema

STEP = """
    plot: step
    parameters: {item: {type: item, default: cup1}}
    emits: {failed: {item: item}, broken: {item: item}}
    states:
      work:
        on:
          ok: over
          bad: {to: over, emit: failed, with: {item: ?item}}
          worse: {to: over, emit: broken, with: {item: ?item}}
      over: {final: true}
"""
RECOVER = """
    plot: recover
    parameters: {item: {type: item, default: none}}
    emits: {stuck: }
    states:
      mend: {entry: {set: c.mends, to: ?item}, on: {ok: over, bad: {to: over, emit: stuck}}}
      over: {final: true}
"""
HOLDER = """
    plot: p
    states:
      do_it: {use: step, on: {done: fine, gave_up: given_up}}
      fine:
      given_up:
      elsewhere:
    rules:
"""


def run_of(rules, text=HOLDER, facts=()):
    indented = "".join(f"      - {rule}\n" for rule in rules)
    run = Run(plot(text + indented), plot(STEP), plot(RECOVER), facts=facts)
    run.start()
    return run


READING = """
    plot: p
    parameters: {most: {type: number, default: 1}, what: {type: item, default: cup2}}
    variables: {done: {type: number, initial: 0}}
    states:
      do_it: {use: step, on: {done: again}}
      again: {use: step, on: {done: fine}}
      fine:
      elsewhere:
    rules:
      - {on: failed, when: (> ?most 1), do: {then: elsewhere}}
      - {on: failed, when: (and (< ?done ?most) (on cup3 ?what)), do: {use: recover, with: {item: ?what}, on: {stuck: continue}, then: continue}}
"""


@pytest.mark.parametrize(("most", "states"), [(1, ["do_it_failed_1_recover"]), (2, ["elsewhere"]), (0, ["again"])])
def test_a_rule_reads_the_parameters_and_variables_of_its_plot(most, states):
    run = Run(plot(READING), plot(STEP), plot(RECOVER), facts=[fact("on", "cup3", "cup2")])
    run.start(most=most)
    step = run.send("bad")
    assert [name for name in run.active if "/" not in name] == states
    told = [one.value for one in step.output if isinstance(one, SetParameter)]
    assert told == (["cup2"] if most == 1 else [])


def test_rules_that_read_variables_of_their_plot_pass_the_validator():
    text = READING.replace("fine:\n", "fine: {final: true}\n").replace("elsewhere:\n", "elsewhere: {final: true}\n")
    others = "      - {on: failed, do: {then: continue}}\n      - {on: broken, do: {then: continue}}\n"
    holder = parse_plot(text + others)
    assert validate_plot(holder, Library([holder, parse_plot(STEP), parse_plot(RECOVER)])) == []


# -- messages that say what is meant ---------------------------------------------------------------------------


def said_of(*rules):
    holder = parse_plot(
        HOLDER.replace("fine:\n", "fine: {final: true}\n")
        .replace("given_up:\n", "given_up: {final: true}\n")
        .replace("      elsewhere:\n", "")
        + "".join(f"      - {rule}\n" for rule in rules)
    )
    return [str(one) for one in validate_plot(holder, Library([holder, parse_plot(STEP), parse_plot(RECOVER)]))]


@pytest.mark.parametrize(
    ("rule", "often"), [("then: retry", 3), ("then: retry, limit: 5", 5), ("then: fine, limit: 2", 2)]
)
def test_a_rule_that_answers_only_so_often_is_said_to(rule, often):
    others = "{on: broken, do: {then: continue}}"
    (said,) = said_of(f"{{on: failed, do: {{{rule}}}}}", others)
    then = rule.split(",")[0].removeprefix("then: ")
    assert (
        f"'do_it' may not handle its outcome 'failed': the rule that answers it with '{then}' does so {often} times"
        in said
    )
    assert f"add a last rule that does not '{then}'" in said


def test_a_step_that_a_rule_always_replaces_is_said_to_be():
    ends = ("{on: failed, do: {then: continue}}", "{on: broken, do: {then: continue}}")
    said, _ = said_of("{before: do_it, do: {use: recover, on: {stuck: continue}, then: continue}}", *ends)
    assert "the rule 'before do_it: recover, continue' always replaces step 'do_it', which is never entered" in said


def test_a_rule_before_a_plot_is_told_how_steps_are_named():
    ends = ("{on: failed, do: {then: continue}}", "{on: broken, do: {then: continue}}")
    (said,) = said_of("{before: step, do: {use: recover}}", *ends)
    assert "'step' is a plot; a rule names steps by their state or planning action, here state 'do_it'" in said
    (said,) = said_of("{after: recover, do: {use: recover}}", *ends)
    assert (
        "'recover' is a plot; a rule names steps by their state or planning action, and no state here holds it" in said
    )


def generated(rules=(), on="done: finished"):
    indented = "".join(f"      - {rule}\n" for rule in rules)
    made = plot(f"""
    plot: plan
    generated: true
    variables: {{reason: {{type: text, initial: unknown}}}}
    emits: {{replan: {{reason: text}}, gave_up: {{reason: text}}}}
    states:
      step_1: {{dynamic: [step], on: {{{on}}}}}
      finished: {{final: true}}
      replan: {{final: true, emit: replan, with: {{reason: ?reason}}}}
      gave_up: {{final: true, emit: gave_up, with: {{reason: ?reason}}}}
    rules:
{indented or "      []"}
    """)
    host = plot("""
        plot: p
        variables: {why: text}
        states:
          h:
            use: plan
            on:
              done: fine
              replan: {to: again, assign: {why: ?event.reason}}
              gave_up: {to: sad, assign: {why: ?event.reason}}
          fine:
          again:
          sad:
    """)
    return host, made


def run_generated(rules=(), choices=None, on="done: finished"):
    run = Run(*generated(rules, on), plot(STEP), plot(RECOVER), choices=choices or {"step": Decision("step")})
    run.start()
    return run


# -- responses ---------------------------------------------------------------------------------------------


def test_retry_enters_the_state_anew():
    run = run_of(["{on: failed, do: {then: retry}}"])
    before = run.serial("do_it")
    run.send("bad")
    assert run.active == ["do_it", "do_it/work"]
    assert run.serial("do_it") > before


def test_retry_is_bounded_even_if_nobody_says_so():
    run = run_of(["{on: failed, do: {then: retry}}", "{on: failed, do: {then: elsewhere}}"])
    for _ in range(DEFAULT_RETRIES):
        run.send("bad")
        assert run.active == ["do_it", "do_it/work"]
    run.send("bad")
    assert run.active == ["elsewhere"]


def test_a_limit_is_counted_for_each_rule_and_then_the_next_rule_answers():
    run = run_of(["{on: failed, do: {then: retry, limit: 1}}", "{on: failed, do: {use: recover, then: retry, limit: 1}}",
                  "{on: failed, do: {then: give_up}}"])  # fmt: skip
    run.send("bad")
    assert run.active == ["do_it", "do_it/work"]
    run.send("bad")
    assert run.machine.state.is_active("mend")
    run.send("ok")
    assert run.active == ["do_it", "do_it/work"]
    run.send("bad")
    assert run.active == ["given_up"]


def test_a_limit_is_counted_for_each_state():
    text = """
    plot: p
    states:
      one: {use: step, on: {done: two}}
      two: {use: step, on: {done: fine}}
      fine:
      elsewhere:
    rules:
"""
    run = run_of(["{on: failed, do: {then: retry, limit: 1}}", "{on: failed, do: {then: elsewhere}}"], text)
    run.send("bad")
    run.send("ok")
    assert run.active == ["two", "two/work"]
    run.send("bad")
    assert run.active == ["two", "two/work"]
    run.send("bad")
    assert run.active == ["elsewhere"]


def test_a_limit_begins_anew_when_the_plot_is_entered_anew():
    outer = plot("{plot: o, states: {h: {use: p, on: {again: h}}}}")
    inner = plot(
        HOLDER + "      - {on: failed, do: {then: retry, limit: 1}}\n      - {on: failed, do: {then: elsewhere}}\n"
    )
    run = Run(outer, inner, plot(STEP))
    run.start()
    run.send("bad")
    run.send("again")
    run.send("bad")
    assert run.machine.state.is_active("work")
    run.send("bad")
    assert run.machine.state.is_active("elsewhere")


def test_states_whose_names_differ_by_little_have_counters_of_their_own():
    text = """
    plot: p
    states:
      do-it: {use: step, on: {done: do_it}}
      do_it: {use: step, on: {done: Do_it}}
      Do_it: {use: step, on: {done: fine}}
      fine:
      elsewhere:
    rules:
"""
    run = run_of(["{on: failed, do: {then: retry, limit: 1}}", "{on: failed, do: {then: elsewhere}}"], text)
    for name in ("do-it", "do_it", "Do_it"):
        run.send("bad")
        assert run.active == [name, f"{name}/work"]
        run.send("ok")
    assert run.active == ["fine"]


def test_continue_goes_on_as_if_the_state_were_done():
    run = run_of(["{on: failed, do: {then: continue}}"])
    run.send("bad")
    assert run.active == ["fine"]


def test_continue_does_what_done_does_too():
    text = """
    plot: p
    variables: {n: {type: number, initial: 0}}
    states:
      do_it: {use: step, on: {done: [{to: fine, when: (p), assign: {n: 1}}, {to: other, assign: {n: 2}, tell: (q)}]}}
      fine:
      other:
    rules:
"""
    run = run_of(["{on: failed, do: {tell: (p), then: continue}}"], text, facts=[])
    step = run.send("bad")
    assert run.variables()["n"] == 2  # the guard of `done` is asked before the rule tells anything
    assert step.knowledge.added == (Fact("p"), Fact("q"))
    assert run_of(["{on: failed, do: {then: continue}}"], text, facts=[Fact("p")]).send("bad").entered("fine")


def test_give_up_takes_what_the_state_wires_for_it():
    run = run_of(["{on: failed, do: {then: give_up}}"])
    run.send("bad")
    assert run.active == ["given_up"]


def test_gave_up_carries_the_name_of_the_outcome_as_its_reason():
    text = """
        plot: p
        variables: {why: text}
        receives: {go: }
        states:
          wait: {on: {go: do_it}}
          do_it:
            goal: (p)
            dynamic: [step]
            on:
              done: fine
              no_plan: fine
              gave_up: {to: fine, assign: {why: ?event.reason}, do: [{emit: told, with: {why: ?event.reason}}]}
          fine: {on: {told: heard}}
          heard:
        rules: [{on: failed, do: {then: give_up}}]
    """
    run = Run(plot(text), plot(STEP), choices={"step": Decision("step")})
    run.start()
    run.send("go")
    run.send("bad")
    assert run.active == ["heard"]
    assert run.variables()["why"] == "failed"


def test_a_rule_may_go_to_a_named_state():
    run = run_of(["{on: failed, do: {then: elsewhere}}"])
    run.send("bad")
    assert run.active == ["elsewhere"]


def test_replan_outside_of_a_plan_enters_the_dynamic_state_anew():
    run = run_of(["{on: failed, do: {then: replan}}"])
    before = run.serial("do_it")
    run.send("bad")
    assert run.serial("do_it") > before


def test_a_rule_tells_the_knowledge_base_what_the_event_says():
    run = run_of(["{on: failed, do: {tell: (unreachable ?event.item), then: continue}}"])
    step = run.send("bad")
    assert step.knowledge.added == (fact("unreachable", "cup1"),)


def test_a_recovery_gets_its_arguments_from_the_event_and_then_the_response_follows():
    run = run_of(["{on: failed, do: {use: recover, with: {item: ?event.item}, then: continue}}"])
    step = run.send("bad")
    assert SetParameter("c", "mends", "cup1") in step.output
    run.send("ok")
    assert run.active == ["fine"]


@pytest.mark.parametrize(
    ("then", "active"),
    [
        ("elsewhere", ["elsewhere"]),
        ("give_up", ["given_up"]),
        ("continue", ["fine"]),
        ("retry", ["do_it", "do_it/work"]),
    ],
)
def test_an_outcome_of_a_recovery_has_its_own_continuation(then, active):
    run = run_of([f"{{on: failed, do: {{use: recover, on: {{stuck: {then}}}, then: elsewhere}}}}"])
    run.send("bad")
    run.send("bad")
    assert run.active == active


def test_retries_after_an_outcome_of_a_recovery_are_bounded():
    run = run_of(
        ["{on: failed, do: {use: recover, on: {stuck: retry}, then: continue}}", "{on: failed, do: {then: elsewhere}}"]
    )
    for _ in range(DEFAULT_RETRIES):
        run.send("bad")
        run.send("bad")
        assert run.active == ["do_it", "do_it/work"]
    run.send("bad")
    assert run.active == ["elsewhere"]


@pytest.mark.parametrize(("place", "by_default"), [("before", "{then: enter}"), ("after", "{}")])
def test_an_outcome_of_an_inserted_plot_has_its_own_continuation(place, by_default):
    text = HOLDER.replace("states:", "initial: zero\n    states:\n      zero: {on: {go: do_it}}")
    run = run_of([f"{{{place}: do_it, do: {{use: recover, on: {{stuck: elsewhere}}}}}}"], text)
    for event in ("go", "bad") if place == "before" else ("go", "ok", "bad"):
        run.send(event)
    assert run.active == ["elsewhere"]


def test_an_outcome_of_a_recovery_that_nothing_handles_is_an_error():
    rule = "{on: failed, do: {use: recover, then: elsewhere}}"
    run = run_of([rule])
    run.send("bad")
    (error,) = run.send("bad").errors
    assert error == "state 'do_it_failed_0_recover' does not handle 'stuck' of plot 'recover'"
    (found,) = said_of(rule.replace("elsewhere", "fine"), "{on: broken, do: {then: continue}}")
    assert "nothing handles the outcome 'stuck' of plot 'recover' (add `on: {stuck: give_up}` here" in found


# -- which rule answers ------------------------------------------------------------------------------------


def test_rules_are_tried_in_order_with_their_conditions():
    rules = ["{on: failed, when: (p ?event.item), do: {then: elsewhere}}", "{on: failed, do: {then: continue}}"]
    run = run_of(rules)
    run.send("bad")
    assert run.active == ["fine"]
    run = run_of(rules, facts=[fact("p", "cup1")])
    run.send("bad")
    assert run.active == ["elsewhere"]


def test_rules_answer_their_own_event_alone():
    run = run_of(["{on: broken, do: {then: elsewhere}}", "{on: failed, do: {then: continue}}"])
    run.send("worse")
    assert run.active == ["elsewhere"]


def test_a_transition_of_the_state_itself_beats_every_rule():
    text = HOLDER.replace("on: {done: fine,", "on: {failed: elsewhere, done: fine,")
    run = run_of(["{on: failed, do: {then: retry}}"], text)
    run.send("bad")
    assert run.active == ["elsewhere"]


def test_a_rule_answers_where_a_states_own_guards_do_not_hold():
    text = HOLDER.replace("on: {done: fine,", "on: {failed: {to: elsewhere, when: (p)}, done: fine,")
    run = run_of(["{on: failed, do: {then: continue}}"], text)
    run.send("bad")
    assert run.active == ["fine"]
    run = run_of(["{on: failed, do: {then: continue}}"], text, facts=[Fact("p")])
    run.send("bad")
    assert run.active == ["elsewhere"]


def test_a_rule_may_be_for_certain_states():
    run = run_of(
        ["{on: failed, of: [other], do: {then: elsewhere}}", "{on: failed, of: [do_it], do: {then: continue}}"]
    )
    run.send("bad")
    assert run.active == ["fine"]


def test_rules_answer_states_inside_composites_and_regions():
    text = """
    plot: p
    states:
      c: {states: {do_it: {use: step, on: {done: fine}}, fine: {on: {go: o}}}, on: {go: o}}
      o: {regions: {r: {states: {do_too: {use: step, on: {done: good}}, good: }}}}
    rules:
"""
    run = run_of(["{on: failed, do: {then: continue}}"], text)
    run.send("bad")
    assert run.active == ["c", "fine"]
    run.send("go")
    run.send("bad")
    assert run.active == ["o", "good"]


def test_the_transition_names_the_rule_it_comes_from():
    run = run_of(["{on: failed, do: {use: recover, then: retry}}"])
    step = run.send("bad")
    rules = [taken.rule for micro in step.microsteps for taken in micro.taken if taken.rule]
    assert rules == ["failed: recover, retry"]


# -- plans -------------------------------------------------------------------------------------------------


def test_in_a_plan_what_no_rule_answers_leads_to_replanning_with_the_reason():
    run = run_generated()
    run.send("bad")
    assert run.active == ["again"]
    assert run.variables()["why"] == "failed"


def test_in_a_plan_no_candidate_leads_to_replanning():
    run = run_generated(choices={"step": Decision(None)})
    assert run.active == ["again"]
    assert run.variables()["why"] == "no candidate fits"


def test_in_a_plan_rules_come_before_replanning():
    run = run_generated(["{on: failed, do: {use: recover, then: retry, limit: 1}}"])
    run.send("bad")
    run.send("ok")
    assert run.active == ["h", "h/step_1", "h/step_1/work"]
    run.send("bad")
    assert run.active == ["again"]


@pytest.mark.parametrize(("on", "active", "why"), [("{}", ["again"], "stuck"), ("{stuck: give_up}", ["sad"], "failed")])
def test_in_a_plan_an_outcome_of_a_recovery_leads_to_replanning_or_to_its_continuation(on, active, why):
    run = run_generated([f"{{on: failed, do: {{use: recover, on: {on}, then: retry}}}}"])
    run.send("bad")
    run.send("bad")
    assert run.active == active
    assert run.variables()["why"] == why


def test_a_rule_may_replan_or_give_up_a_plan():
    run = run_generated(["{on: failed, do: {then: replan}}", "{on: broken, do: {then: give_up}}"])
    run.send("bad")
    assert run.active == ["again"]
    run = run_generated(["{on: failed, do: {then: replan}}", "{on: broken, do: {then: give_up}}"])
    run.send("worse")
    assert run.active == ["sad"]
    assert run.variables()["why"] == "broken"


def test_a_rule_that_tells_and_replans_does_both():
    run = run_generated(["{on: failed, do: {tell: (unreachable ?event.item), then: replan}}"])
    assert run.send("bad").knowledge.added == (fact("unreachable", "cup1"),)
    assert run.active == ["again"]


def test_a_plan_without_failure_is_done():
    run = run_generated()
    run.send("ok")
    assert run.active == ["fine"]


# -- what can be seen --------------------------------------------------------------------------------------


def test_recoveries_are_states_like_all_others():
    holder = plot(HOLDER + "      - {on: failed, do: {use: recover, on: {stuck: retry}, then: retry}}\n")
    expanded = Library([holder, plot(STEP), plot(RECOVER)]).expanded(holder)
    recoveries = {n: s for n, s in expanded.states.items() if n not in holder.states}
    ((name, state),) = recoveries.items()
    assert isinstance(state, SubmachineState)
    assert state.use == "recover"
    assert set(state.on) == {"done", "stuck"}
    targets = [t.target for t in expanded.states["do_it"].on["failed"]]
    assert targets == [name]
    assert not expanded.rules


def test_a_plot_without_rules_is_what_it_is():
    holder = plot(HOLDER.replace("    rules:\n", ""))
    assert Library([holder, plot(STEP)]).expanded(holder) is holder


def test_a_plot_expanded_by_rules_can_be_written_and_read_again():
    holder = plot(HOLDER + "      - {on: failed, when: (p ?event.item), do: {use: recover, tell: (q), then: retry}}\n")
    expanded = Library([holder, plot(STEP), plot(RECOVER)]).expanded(holder)
    assert parse_plot(plot_to_yaml(expanded)) == expanded


def test_a_recovery_takes_no_name_that_is_there_already():
    text = """
    plot: p
    states:
      do_it: {use: step, on: {done: fine}}
      fine:
      do_it_failed_0_recover: {entry: {switch: log, to: mine}}
    rules:
"""
    run = run_of(["{on: failed, do: {use: recover, then: retry}}"], text)
    step = run.send("bad")
    assert run.machine.state.is_active("mend")
    assert modes(step) == []


def test_a_rule_keeps_all_that_the_transition_it_takes_says():
    text = """
        plot: p
        dialect: scxml
        states:
          do_it: {use: step, on: {done: {to: next, pass: {item: cup2}, clear: box, also: [other], emit: e}}}
          next: {use: step}
          other:
          box:
        rules:
          - {on: failed, of: [do_it], do: {tell: (p), then: continue}}
    """
    holder = plot(text)
    expanded = Library([holder, plot(STEP)]).expanded(holder)
    done, failed = (expanded.states["do_it"].on[event][0] for event in ("done", "failed"))
    (tell, emit) = failed.effect
    assert (tell, emit) == (Tell(tell="(p)"), *done.effect)
    assert (failed.targets, failed.passed, failed.clear) == (done.targets, done.passed, done.clear)
    assert failed.rule == "failed: continue"


def test_a_transition_on_giving_up_passes_the_reason():
    text = """
        plot: p
        states:
          do_it: {use: step, on: {done: next, gave_up: {to: next, pass: {item: ?event.reason}}}}
          next: {use: step, on: {done: over}}
          over: {final: true}
        rules:
          - {on: failed, of: [do_it], do: {then: give_up}}
    """
    holder = plot(text)
    expanded = Library([holder, plot(STEP)]).expanded(holder)
    assert expanded.states["do_it"].on["failed"][0].passed == {"item": Constant("failed")}


def test_rules_leave_connectors_alone_and_their_names():
    text = """
        plot: p
        outputs: {tries_do_it_failed_1: {type: number, initial: 0}}
        states:
          do_it: {use: step, on: {done: which}}
          which: {choice: [{when: (p), to: do_it}, do_it_failed_0_recover]}
          do_it_failed_0_recover: {select: 1, cases: {1: over}, else: do_it}
          over: {final: true}
        rules:
          - {on: failed, do: {use: recover, then: over}}
          - {on: failed, do: {then: retry}}
    """
    holder = plot(text)
    expanded = Library([holder, plot(STEP), plot(RECOVER)]).expanded(holder)
    for name in ("which", "do_it_failed_0_recover"):
        assert expanded.states[name] == holder.states[name]
    assert expanded.states["do_it_failed_0_recover_2"].use == "recover"
    assert list(expanded.variables) == ["tries_do_it_failed_1_2"]


# -- mistakes ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("then", "lacks"), [("give_up", "gave_up"), ("continue", "done")])
def test_a_response_that_the_state_does_not_wire_is_refused_with_its_place(then, lacks):
    text = (
        "plot: p\nstates:\n  do_it: {use: step, on: {e: do_it}}\nrules:\n  - on: failed\n    do: {then: " + then + "}\n"
    )
    holder = plot(text, "p.yaml")
    with pytest.raises(SchemaError, match=f"does not wire '{lacks}'") as caught:
        Library([holder, plot(STEP)]).expanded(holder)
    assert (caught.value.place.source, caught.value.place.line) == ("p.yaml", 6)


def test_a_rule_with_an_unknown_plot_is_refused():
    holder = plot(HOLDER + "      - {on: failed, do: {use: recovr}}\n")
    with pytest.raises(UnknownNameError, match="did you mean 'recover'"):
        Library([holder, plot(STEP), plot(RECOVER)]).expanded(holder)


def test_a_rule_to_an_unknown_state_is_refused():
    with pytest.raises(InputError, match="did you mean 'elsewhere'"):
        run_of(["{on: failed, do: {then: elsewere}}"])


# -- what is handed over, by type ------------------------------------------------------------------------------

KINDS = """
    plot: p
    states:
      do_it: {use: step, with: {item: cup1}, on: {done: fine, broken: fine}}
      fine: {final: true}
    rules:
      - RULE
"""


@pytest.mark.parametrize(
    ("rule", "said"),
    [
        (
            "{on: failed, do: {use: count, with: {n: ?event.item}, then: fine}}",
            "'n' is of type number, and ?event.item is of type item",
        ),
        (
            "{on: failed, do: {use: count, with: {n: ?step.item}, then: fine}}",
            "there is no variable '?step.item'",
        ),  # no step is named
        (
            "{on: failed, of: do_it, do: {use: count, with: {n: ?step.item}, then: fine}}",
            "'n' is of type number, and ?step.item is of type item",
        ),
        ("{on: failed, do: {then: retry, pass: {item: 3}}}", "'item' is of type item, and 3 is of type number"),
        ("{on: failed, do: {then: retry, pass: {item: ?event.item}}}", ""),
        ("{before: do_it, do: {use: count, with: {n: ?step.item}}}", "'n' is of type number"),
    ],
)
def test_values_passed_by_a_rule_must_fit_by_type(rule, said):
    count = plot("plot: count\nparameters: {n: number}\nstates: {e: {final: true}}")
    made = [plot(KINDS.replace("RULE", rule)), plot(STEP), count]
    schema = Schema.parse("(define (domain d) (:types item) (:constants cup1 - item))")
    found = [str(one) for one in validate_plot(made[0], Library(made), schema) if one.code != "every-outcome-is-wired"]
    assert len(found) == bool(said)
    assert said in "".join(found)


def test_names_that_rules_add_have_words_for_people():
    retry = "{on: failed, do: {use: recover, on: {stuck: give_up}, then: retry}}"
    plots = [plot(HOLDER + f"      - {retry}\n"), plot(STEP), plot(RECOVER)]
    words = Library(plots).expanded(plots[0]).words
    assert words.states == {"do_it_failed_0_recover": "failed: recover, retry"}
    assert words.variables == {"tries_do_it_failed_0": "tries of failed: recover, retry"}

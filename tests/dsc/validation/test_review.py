"""Warnings: what can never happen, candidates that overlap or leave gaps; and nothing about what is meant so."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from dsc_charts import plot
from typer.testing import CliRunner

from dsc.cli.plots import app
from dsc.dynamic.library import Library
from dsc.skills import SkillSignature
from dsc.text.plot_files import Neighbours, load_plot, parse_plot
from dsc.validation import review_plot, validate_plot

ROOT = Path(__file__).parents[3]
SHIPPED = sorted(file for room in ("domains", "planning") for file in (ROOT / room).glob("**/plots/*.yaml"))

STEP = plot("""
    plot: step
    parameters: {item: {type: item, default: cup}}
    emits: {failed: {item: item}, lost: }
    receives: {bad: , worse: , ok: }
    states:
      s: {on: {bad: {to: e, emit: failed, with: {item: ?item}}, worse: {to: e, emit: lost}, ok: e}}
      e: {final: true}
""")
HOLDER = "plot: p\nstates:\n  a: {use: step, on: {done: e}}\n  b: {use: step, on: {done: e}}\n  e: {final: true}\ninitial: a\n"


def candidate(name, when=None, **more):
    form = {"plot": name, "parameters": {"n": {"type": "number", "default": 0}}, "states": {"e": {"final": True}}}
    return parse_plot(json.dumps({**form, **({"when": when} if when else {}), **more}), f"{name}.yaml")


def warnings_of(text, *others):
    made = parse_plot(text, "p.yaml")
    found = review_plot(made, Library([made, STEP, *others]))
    assert all(finding.level == "warning" for finding in found)
    return [str(finding) for finding in found]


def about_rules(*rules, holder=HOLDER):
    return warnings_of(holder + "rules:\n" + "".join(f"  - {rule}\n" for rule in rules))


# -- rules -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "rules",
    [
        ["{on: lost, do: {then: e}}", "{on: lost, do: {then: retry}}"],
        ["{on: lost, do: {then: continue}}", "{on: lost, of: a, do: {then: retry}}"],
        ["{on: failed, when: (p ?event.item), do: {then: e}}", "{on: failed, when: (and (q) (p ?event.item)), do: {then: retry}}"],
        ["{on: failed, when: (< (f) 4), do: {then: e}}", "{on: failed, when: (>= (f) 4), do: {then: give_up}}", "{on: failed, do: {then: retry}}"],
        ["{before: a, do: {then: e}}", "{before: a, when: (q), do: {use: step}}"],
        ["{on: lost, when: (and (p) (not (p))), do: {then: e}}"],
    ],
)  # fmt: skip
def test_a_rule_that_can_never_answer_is_found_where_it_stands(rules):
    (warning,) = about_rules(*rules)
    assert warning.startswith(f"p.yaml:{7 + len(rules)}:")
    assert "can never answer" in warning


PLANNED = "plot: p\nstates:\n  a: {goal: (q), on: {done: e, no_plan: e, gave_up: e}}\n  b: {use: step, on: {done: e}}\n  e: {final: true}\n"


@pytest.mark.parametrize(
    "rule",
    ["{before: put, do: {then: e}}", "{after: put, do: {use: step, then: e}}", "{on: failed, of: put, do: {then: e}}", "{on: spilt, do: {then: e}}"],
)  # fmt: skip
def test_a_rule_for_steps_of_plans_alone_leads_out_of_the_plan(rule):
    assert about_rules(rule, holder=PLANNED) == []


@pytest.mark.parametrize(
    "rule",
    ["{before: put, do: {then: give_up}}", "{on: failed, do: {then: e}}", "{before: [put, b], do: {then: e}}", "{on: gave_up, do: {then: e}}"],
)  # fmt: skip
def test_a_rule_that_is_for_a_state_too_may_lead_on(rule):
    assert about_rules(rule, holder=PLANNED) == []


@pytest.mark.parametrize(
    "rules",
    [
        ["{on: lost, do: {then: retry}}", "{on: lost, do: {then: e}}"],  # after three times
        ["{on: lost, do: {use: step, then: e, limit: 1}}", "{on: lost, do: {then: e}}"],
        ["{on: lost, of: a, do: {then: e}}", "{on: lost, do: {then: retry}}"],
        ["{on: lost, of: a, do: {then: e}}", "{on: lost, of: b, do: {then: retry}}"],
        ["{on: lost, when: (p), do: {then: e}}", "{on: lost, do: {then: retry}}"],
        ["{on: failed, when: (< (f) 4), do: {then: e}}", "{on: failed, when: (<= (f) 4), do: {then: e}}"],
        ["{before: a, do: {use: step}}", "{before: a, do: {use: step}}"],  # all are asked, one behind the other
        ["{before: a, do: {then: e}}", "{after: a, do: {use: step}}"],
    ],
)
def test_a_rule_that_may_answer_is_no_warning(rules):
    assert about_rules(*rules) == []


def test_a_rule_for_what_every_state_answers_itself_can_never_answer():
    holder = HOLDER.replace("done: e}", "done: e, lost: e}")
    (warning,) = about_rules("{on: lost, do: {then: e}}", holder=holder)
    assert "every state that can end with 'lost' answers it itself" in warning
    guarded = HOLDER.replace("b: {use: step, on: {done: e", "b: {use: step, on: {done: e, lost: {to: e, when: (p)}")
    assert (
        about_rules(
            "{on: lost, do: {then: e}}", holder=guarded.replace("a: {use: step, on: {", "a: {use: step, on: {lost: e, ")
        )
        == []
    )


def test_a_rule_that_leads_to_a_state_comes_before_others_in_plans_too():
    holder = HOLDER.replace("b: {use: step, on: {done: e}}", "b: {goal: (p), on: {done: e, no_plan: e, gave_up: e}}")
    (warning,) = about_rules("{on: lost, do: {then: e}}", "{on: lost, do: {then: retry}}", holder=holder)
    assert "the rule 'lost: retry' can never answer" in warning


# -- transitions -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "ways",
    [
        "[e, {to: f}]",
        "[{to: e, when: (p)}, {to: f, when: (and (p) (q))}]",
        "[{to: e, when: (p)}, {to: e, when: (not (p))}, f]",
    ],
)
def test_a_transition_that_is_never_taken_is_found(ways):
    (warning,) = warnings_of(
        f"plot: p\nstates:\n  a:\n    on: {{x: {ways}}}\n  e: {{final: true}}\n  f: {{final: true}}\n"
    )
    assert "transition on 'x' out of 'a' is never taken" in warning


def test_transitions_on_other_events_do_not_count():
    assert (
        warnings_of("plot: p\nstates:\n  a: {on: {x: e, y: e}, always: {to: e, when: (p)}}\n  e: {final: true}\n") == []
    )


# -- candidates --------------------------------------------------------------------------------------------


def about_candidates(*candidates, extra=""):
    names = ", ".join(one.name for one in candidates)
    text = f"plot: p\nstates:\n  a: {{dynamic: [{names}], {extra}on: {{done: e, no_candidate: e, no_plan: e, gave_up: e}}}}\n  e: {{final: true}}\n"
    return warnings_of(text, *candidates)


def test_a_candidate_that_is_never_chosen():
    (warning,) = about_candidates(candidate("one"), candidate("two", "(p)"))
    assert "the candidate 'two' is never chosen: whenever it fits, one before it does" in warning
    (warning,) = about_candidates(candidate("one", "(and (p) (not (p)))"), candidate("two"))
    assert "'one' is never chosen: its condition cannot hold" in warning


MODES = {"parameters": {"mode": {"type": "slow | fast | still", "default": "slow"}}}


def test_candidates_that_do_not_cover_the_values_of_a_choice():
    few = [candidate("slow", "(= ?mode slow)", **MODES), candidate("fast", "(= ?mode fast)", **MODES)]
    (warning,) = about_candidates(*few, extra="with: {mode: ?way}, ")
    assert "no candidate fits if ?mode is still (add a candidate for it)" in warning
    rest = candidate("still", "(not (or (= ?mode slow) (= ?mode fast)))", **MODES)
    assert about_candidates(*few, rest, extra="with: {mode: ?way}, ") == []
    assert about_candidates(*few, extra="with: {mode: ?way}, goal: (p), ") == []  # then the planner is asked


def test_candidates_that_do_not_cover_both_truth_values():
    flag = {"parameters": {"on": {"type": "boolean", "default": True}}}
    (warning,) = about_candidates(candidate("lit", "(= ?on true)", **flag), extra="with: {on: ?way}, ")
    assert "no candidate fits if ?on is false" in warning


def test_a_handler_that_plans_without_the_rules_of_its_plot():
    plans = "states: {s: {goal: (q), on: {done: e, no_plan: e, gave_up: e}}, e: {final: true}}\n"
    step = plot(
        "plot: act\nimplements: act\nemits: {lost: }\nstates: {s: {on: {done: {to: e, emit: lost}}}, e: {final: true}}"
    )
    rule = "rules: [{on: lost, do: {then: retry}}]\n"
    handler = "receives: {low: }\nhandlers: [{on: low, do: {use: charge}}]\n"
    charge = parse_plot(f"plot: charge\n{plans}", "charge.yaml")
    (warning,) = warnings_of(f"plot: p\n{plans}{rule}{handler}", charge, step)
    assert "the plot 'charge' plans with steps that end with 'lost', and has no rule for it" in warning
    assert warnings_of(f"plot: p\n{plans}{rule}{handler}", parse_plot(f"plot: charge\n{plans}{rule}"), step) == []
    assert warnings_of(f"plot: p\n{plans}{handler}", charge, step) == []


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "states: {wait: {on: {done: Wait}}, Wait: {on: {done: e}}, e: {final: true}}",
            "the states 'wait' and 'Wait' differ only in their case",
        ),
        (
            "states: {caf\u00e9: {on: {done: cafe\u0301}}, cafe\u0301: {on: {done: e}}, e: {final: true}}",
            "differ only in their Unicode form",
        ),
        (
            "variables: {caf\u00e9: number, cafe\u0301: number}\nstates: {s: {on: {done: e}}, e: {final: true}}",
            "differ only in their Unicode form",
        ),
        (
            "receives: {low: , LOW: }\nstates: {s: {on: {low: e, LOW: e}}, e: {final: true}}",
            "the events 'low' and 'LOW' differ only in their case",
        ),
        ("states: {s: {use: step, on: {done: e}}, e: {final: true}}", None),
    ],
)
def test_names_that_look_alike(text, said):
    found = warnings_of(f"plot: p\n{text}")
    assert [one for one in found if said is None or said not in one] == []
    assert len(found) == (said is not None)


def test_plots_that_look_alike():
    (warning,) = warnings_of("plot: Step\nstates: {s: {on: {done: e}}, e: {final: true}}")
    assert "the plots 'step' and 'Step' differ only in their case" in warning


def test_candidates_that_overlap():
    (warning,) = about_candidates(candidate("few", "(<= (f) 3)"), candidate("many", "(>= (f) 3)"))
    assert "'few' and 'many' overlap: both can fit, and then 'few' is chosen" in warning


def test_a_gap_between_candidates_is_answered_by_no_candidate():
    assert about_candidates(candidate("few", "(< (f) 3)"), candidate("many", "(> (f) 3)")) == []


@pytest.mark.parametrize(
    "conditions",
    [
        ["(= (f) 0)", "(> (f) 0)"],  # a count is never below 0
        ["(< (f) 3)", None],
        ["(= (f) 0)", "(>= (f) 0)"],  # the special case before the general one
        ["(p)", "(q)"],  # nobody knows
        ["(p)"],
        ["(and (p) (q))", "(p)", "(not (p))"],
    ],
)
def test_candidates_about_which_nothing_is_said(conditions):
    assert about_candidates(*(candidate(f"c{n}", when) for n, when in enumerate(conditions))) == []


def test_a_parameter_of_one_candidate_is_distinct_from_that_of_another():
    low = candidate("low", "(< ?n 3)", parameters={"n": "number"})
    assert about_candidates(low, candidate("other", "(< ?n 2)", parameters={"n": "number"})) == []
    (warning, *_) = about_candidates(low, candidate("lower", "(< ?n 2)"), extra="with: {n: 1}, ")
    assert "'lower' is never chosen" in warning


@pytest.mark.parametrize(
    "conditions",
    [("(= ?arm left)", "(= ?arm right)"), ("(and (= ?arm left) (< (f) 3))", "(and (= ?arm right) (< (f) 4))")],
)
def test_plots_for_steps_with_conditions_on_names_leave_no_gap(conditions):
    goal = "plot: p\nstates:\n  a: {goal: (p), on: {done: e, no_plan: e, gave_up: e}}\n  e: {final: true}\n"
    arms = [
        candidate(f"c{n}", when, implements="count", parameters={"arm": "object"}) for n, when in enumerate(conditions)
    ]
    assert warnings_of(goal, *arms) == []


def test_plots_for_the_steps_of_plans_that_leave_a_gap():
    goal = "plot: p\nstates:\n  a: {goal: (p), on: {done: e, no_plan: e, gave_up: e}}\n  e: {final: true}\n"
    few, many = (candidate(n, w, implements="count") for n, w in (("few", "(< (f) 3)"), ("many", "(> (f) 3)")))
    (warning,) = warnings_of(goal, few, many)
    assert warning.startswith("many.yaml:")
    assert "the plots for 'count' leave a gap, where none of them fits: few, many" in warning


# -- large ones --------------------------------------------------------------------------------------------


def test_of_what_is_too_large_to_decide_nothing_is_said():
    ways = ", ".join(f"{{to: e, when: (= ?x {n})}}" for n in range(2_000))
    assert (
        warnings_of(f"plot: p\nvariables: {{x: number}}\nstates: {{a: {{on: {{x: [{ways}]}}}}, e: {{final: true}}}}\n")
        == []
    )
    many = " ".join(f"(p {n})" for n in range(10_000))
    assert (
        about_rules(f"{{on: lost, when: (and {many}), do: {{then: e}}}}", "{on: lost, when: (p 1), do: {then: e}}")
        == []
    )
    assert about_candidates(*(candidate(f"c{n}", f"(= (f) {n})") for n in range(500))) == []


def test_rules_and_handlers_that_would_make_too_many_transitions_are_refused():
    states = "".join(f"  s{n}: {{on: {{go: s{n + 1}}}}}\n" for n in range(600)) + "  s600: {final: true}\n"
    text = (
        f"plot: p\nreceives: {{go: , x: }}\nstates:\n{states}handlers:\n"
        + "  - {on: x, interrupt: true, do: {use: step}}\n" * 2
    )
    made = parse_plot(text, "p.yaml")
    (finding,) = validate_plot(made, Library([made, STEP]))
    assert "the handlers would make 1202 transitions; at most 1000" in str(finding)


# -- no false alarm ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("file", SHIPPED, ids=lambda file: file.stem)
def test_nothing_is_said_about_shipped_plots(file):
    made = load_plot(file)
    library = Neighbours().of(file, made)[0]
    needs = [one for name in ("*_skills", "attention", "dialogue") for one in ROOT.glob(f"domains/{name}/plots/*.yaml")]
    for needed in needs:  # bundles that other bundles need
        if load_plot(needed).name not in library:
            library.add(load_plot(needed))
    assert review_plot(made, library) == []


def test_nothing_is_said_about_plots_in_the_docs():
    pages = [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    blocks = [
        block
        for page in pages
        for block in re.findall(r"^```yaml\n(plot:.*?)^```", page.read_text(), re.MULTILINE | re.DOTALL)
    ]
    made = [parse_plot(block) for block in blocks]
    assert len(made) > 5
    for each in made:
        library = Library([each])
        if not [finding for finding in validate_plot(each, library) if finding.code == "known-plot"]:
            assert review_plot(each, library) == []


# -- the command -------------------------------------------------------------------------------------------


def test_the_command_gives_warnings_which_count_only_if_asked_to(tmp_path):
    (tmp_path / "p.yaml").write_text(
        "plot: p\nstates:\n  a:\n    on: {done: [e, {to: f}, {to: e}]}\n  e: {final: true}\n  f: {final: true}\n"
    )
    runner = CliRunner()
    shown = runner.invoke(app, ["check", str(tmp_path / "p.yaml")])
    assert shown.exit_code == 0
    assert "never taken" in shown.output
    assert "[transitions, warning]" in shown.output
    assert runner.invoke(app, ["check", "--strict", str(tmp_path / "p.yaml")]).exit_code == 2
    data = json.loads(runner.invoke(app, ["check", "--json", str(tmp_path / "p.yaml")]).output)
    assert {one["level"] for one in data} == {"warning"}
    assert data[0]["line"] == 4


# -- handlers ----------------------------------------------------------------------------------------------

HANDLING = "plot: p\nreceives: {low: {level: number}}\nstates:\n  a: {on: {done: b}}\n  b: {after: {seconds: 3, to: e}}\n  e: {final: true}\nhandlers:\n"


def about_handlers(*handlers, text=HANDLING):
    return warnings_of(text + "".join(f"  - {one}\n" for one in handlers), STEP)


@pytest.mark.parametrize(
    "handlers",
    [
        ["{on: low, do: {use: step}}", "{on: low, do: {tell: (p)}}"],
        [
            "{on: low, when: (< ?event.level 20), do: {use: step}}",
            "{on: low, when: (< ?event.level 10), do: {tell: (p)}}",
        ],
        ["{on: low, interrupt: true, do: {use: step}}", "{on: low, interrupt: true, do: {use: step}}"],
        ["{on: low, when: (and (p) (not (p))), do: {tell: (p)}}"],
    ],
)
def test_a_handler_that_can_never_answer_is_found_where_it_stands(handlers):
    (warning,) = about_handlers(*handlers)
    assert warning.startswith(f"p.yaml:{7 + len(handlers)}:")
    assert "can never answer" in warning


@pytest.mark.parametrize(
    "handlers",
    [
        ["{on: low, when: (< ?event.level 10), do: {use: step}}", "{on: low, do: {tell: (p)}}"],
        ["{on: low, interrupt: true, do: {use: step}}", "{on: low, do: {tell: (p)}}"],  # one beside, one instead
        ["{on: low, do: {use: step}}"],
    ],
)
def test_a_handler_that_may_answer_is_no_warning(handlers):
    assert about_handlers(*handlers) == []


LATE = "plot: late\nstates:\n  a: {entry: {trigger: arm.go, within: 5}, on: {gone: b}}\n  b: {final: true}\n"


@pytest.mark.parametrize(
    ("handler", "plot", "warned"),
    [
        ("{on: low, do: {use: late}}", LATE, True),
        ("{on: low, do: {use: outer}}", LATE, True),
        ("{on: low, do: {use: late, on: {timed_out: resume}}}", LATE, False),
        ("{on: low, do: {use: late}}", LATE.replace("gone: b", "gone: b, timed_out: b"), False),
        ("{on: low, do: {use: late}}", LATE.replace(", within: 5", ""), False),
        ("{on: low, do: {use: late}}", LATE + "rules: [{on: timed_out, do: {then: retry}}]\n", False),
    ],
)
def test_a_reaction_that_may_time_out_without_an_answer_is_a_warning(handler, plot, warned):
    outer = "plot: outer\nstates:\n  a: {use: late, on: {done: b}}\n  b: {final: true}\n"
    found = warnings_of(HANDLING + f"  - {handler}\n", parse_plot(plot), parse_plot(outer))
    assert [one for one in found if "may time out, which then ends the run" in one] == found
    assert len(found) == warned


def test_a_handler_that_interrupts_is_never_asked_where_every_state_answers_itself():
    text = HANDLING.replace("done: b}", "done: b, low: e}").replace("b: {after", "b: {on: {low: e}, after")
    (warning,) = about_handlers("{on: low, interrupt: true, do: {use: step}}", text=text)
    assert "every state answers 'low' itself" in warning
    assert about_handlers("{on: low, do: {use: step}}", text=text) == []
    guarded = text.replace("b: {on: {low: e}", "b: {on: {low: {to: e, when: (p)}}")
    assert about_handlers("{on: low, interrupt: true, do: {use: step}}", text=guarded) == []


# -- outcomes ----------------------------------------------------------------------------------------------

GRIP = SkillSignature("arm", "grip", {}, {}, {"slipped": {}})
INNER = parse_plot("plot: inner\nemits: {lost: }\nstates: {e: {final: true, emit: lost}}\n")


@pytest.mark.parametrize(
    ("states", "never"),
    [
        ("{e: {final: true, emit: lost}}", []),
        ("{a: {after: {seconds: 1, to: e, emit: lost}}, e: {final: true}}", []),
        ("{a: {use: inner, on: {done: e}}, e: {final: true}}", []),
        ("{a: {dynamic: [inner], on: {done: e, no_candidate: e}}, e: {final: true}}", []),
        ("{a: {entry: {trigger: arm.grip, as: {slipped: lost}}, on: {done: e}}, e: {final: true}}", []),
        ("{a: {use: ?which, on: {done: e}}, e: {final: true}}", []),  # any plot
        ("{a: {entry: {trigger: other.go}, on: {done: e}}, e: {final: true}}", []),  # an unknown skill
        ("{a: {entry: {trigger: arm.grip}, on: {done: e, slipped: e}}, e: {final: true}}", ["lost"]),
        ("{a: {use: step, on: {done: e, lost: e, failed: e}}, e: {final: true}}", []),  # passes on if not active
        ("{a: {on: {lost: e}}, e: {final: true}}", ["lost"]),
    ],
)
def test_an_outcome_that_nothing_emits_is_a_warning_where_it_is_declared(states, never):
    made = parse_plot(f"plot: p\nemits:\n  lost:\nstates: {states}\n", "p.yaml")
    found = review_plot(made, Library([made, STEP, INNER]), [GRIP])
    assert [one.error.found for one in found if one.code == "emitted-outcome"] == never
    assert all(str(one).startswith("p.yaml:3:") for one in found if one.code == "emitted-outcome")

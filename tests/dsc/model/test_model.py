"""Plots as values: kinds by key, short forms, both spellings, the form they are written in, their digest."""

from __future__ import annotations

import functools
import json
from typing import Any

import pytest
from dsc_charts import EVERYTHING, PROPERTY, plot
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from dsc.model.actions import Assign, Configure, Emit, Switch, Trigger
from dsc.model.plot import ActionPlot, initial_of
from dsc.model.rules import Rule
from dsc.model.states import (
    CompositeState,
    DynamicState,
    FinalState,
    OrthogonalState,
    State,
    SubmachineState,
)
from dsc.model.transitions import ChoiceState, SelectState, Transition, case_value
from dsc.text.plot_files import parse_plot, plot_to_yaml
from knowledge_base.errors import InputError
from knowledge_base.language.syntax.effect import Add, When
from knowledge_base.language.syntax.expression import (
    TRUE,
    And,
    Arithmetic,
    Atom,
    Comparison,
    Constant,
    Expression,
    Not,
    Variable,
)


@pytest.mark.parametrize(
    ("form", "kind"),
    [
        ({}, State),
        (None, State),
        ({"on": {"e": "s"}}, State),
        ({"states": {"a": {}}}, CompositeState),
        ({"regions": {"a": {"states": {"b": {}}}}}, OrthogonalState),
        ({"use": "p"}, SubmachineState),
        ({"dynamic": ["p"]}, DynamicState),
        ({"goal": "(p)"}, DynamicState),
        ({"final": True}, FinalState),
        ({"choice": ["s"]}, ChoiceState),
        ({"select": "?x", "cases": {"a": "s"}, "else": "s"}, SelectState),
    ],
)
def test_the_kind_of_a_state_follows_from_its_telling_key(form, kind):
    made = ActionPlot.model_validate({"plot": "p", "states": {"s": form}})
    assert type(made.states["s"]) is kind


def test_a_state_may_be_given_as_a_value_too():
    inner = SubmachineState(use="p", on={"done": "over"})
    made = ActionPlot(name="p", states={"s": inner, "over": FinalState(final=True)})
    assert made == plot("{plot: p, states: {s: {use: p, on: {done: over}}, over: {final: true}}}")


def test_short_forms_mean_the_long_ones():
    short = plot("""
        plot: p
        parameters: {a: item}
        variables: {b: number}
        states:
          s: {entry: {switch: arm, to: up}, on: {e: t}, after: {seconds: 1, to: t}, always: t}
          r: {on_break: {switch: arm, to: up}, every: {seconds: 1, to: t}, on: {e: {to: s, clear: b}}}
          c: {choice: t}
          v: {select: ?b, cases: {1: t}, else: t}
          t:
    """)
    long = plot("""
        plot: p
        parameters: {a: {type: item}}
        variables: {b: {type: number}}
        states:
          s:
            entry: [{switch: arm, to: up}]
            on: {e: [{to: t}]}
            after: [{seconds: 1, to: t}]
            always: [{to: t}]
          r:
            on_break: [{switch: arm, to: up}]
            every: [{seconds: 1, to: t}]
            on: {e: [{to: s, clear: [b]}]}
          c: {choice: [{to: t}]}
          v: {select: ?b, cases: {"1": {to: t}}, else: {to: t}}
          t: {}
    """)
    assert short == long
    assert short.digest == long.digest


def test_python_takes_both_spellings_and_they_are_the_same():
    yaml = {"to": "s", "when": "(p)", "emit": "e", "with": {"a": 1}}
    python: dict[str, Any] = {"target": "s", "guard": "(p)", "emit": "e", "arguments": {"a": 1}}
    assert Transition.model_validate(yaml) == Transition.model_validate(python)
    assert Transition(**python).model_dump(mode="json", by_alias=True, exclude_defaults=True) == yaml
    assert Trigger(trigger="a.b", names={"x": "y"}) == Trigger.model_validate({"trigger": "a.b", "as": {"x": "y"}})


def test_parsed_values_are_as_good_as_text():
    condition = Atom("on", (Variable("x"), Constant("table")))
    assert Transition(guard=condition) == Transition(guard="(on ?x table)")
    assert Emit(emit="e", arguments={"a": Constant(3)}) == Emit(emit="e", arguments={"a": 3})
    assert Transition(guard=TRUE).model_dump(mode="json", exclude_defaults=True) == {"guard": "(and)"}


def test_parsed_values_are_no_deeper_than_text_may_be():
    free: Expression = Atom("free")
    deep = functools.reduce(lambda e, _: Not(e), range(100_000), free)
    with pytest.raises(ValidationError, match="nested more than 100 deep"):
        Transition(to="s", guard=deep)  # type: ignore[call-arg]
    with pytest.raises(ValidationError, match="nested more than 100 deep"):
        Transition(to="s", tell=When(deep, Add(Atom("free"))))  # type: ignore[call-arg]


def test_a_list_of_effects_is_all_of_them():
    both = Transition.model_validate({"tell": ["(p)", "(not (q))"]})
    assert both == Transition.model_validate({"tell": "(and (p) (not (q)))"})


@pytest.mark.parametrize(
    ("written", "term"),
    [
        ("table", Constant("table")),
        ("two words", Constant("two words", quoted=True)),
        (3, Constant(3)),
        (0.5, Constant(0.5)),
        (True, Constant(True)),
        ("?item", Variable("item")),
        ("?event.item", Variable("event.item")),
        ("(+ ?n 1)", Arithmetic("+", (Variable("n"), Constant(1)))),
    ],
)
def test_terms_are_constants_variables_or_arithmetic(written, term):
    action = Configure(set="arm.x", to=written)
    assert action.to == term
    assert action.model_dump(mode="json")["to"] == written


def test_values_are_frozen():
    with pytest.raises(ValidationError):
        EVERYTHING.name = "other"


@pytest.mark.parametrize(
    "form",
    [
        {"plot": "p", "states": {"s": {}}, "colour": "red"},
        {"plot": "p", "states": {"s": {"onn": {}}}},
        {"plot": "p", "states": {"s": {"use": "q", "dynamic": ["q"]}}},
        {"plot": "p", "states": {"s": {"states": {"t": {}}, "regions": {}}}},
        {"plot": "p", "states": {"s": {"final": True, "on": {"e": "s"}}}},
        {"plot": "p", "states": {"s": {"on": {"e": {"go": "s"}}}}},
        {"plot": "p", "states": {"s": {"entry": {"trigger": "a.b", "switch": "a"}}}},
        {"plot": "p", "states": {"s": {}}, "rules": [{"on": "e", "do": {"then": "retry", "times": 3}}]},
    ],
)
def test_unknown_keys_are_refused(form):
    with pytest.raises(InputError):
        ActionPlot.model_validate(form)


@pytest.mark.parametrize(
    "form",
    [
        {"states": {"s": {}}},
        {"plot": "p"},
        {"plot": "p", "states": {}},
        {"plot": "no name", "states": {"s": {}}},
        {"plot": "p", "confirm": 0, "states": {"s": {}}},
        {"plot": "p", "effects": "hoped", "states": {"s": {}}},
        {"plot": "p", "states": {"s": {"entry": {"trigger": "pick"}}}},
        {"plot": "p", "states": {"s": {"entry": {"trigger": "a.b", "within": 0}}}},
        {"plot": "p", "states": {"s": {"regions": {}}}},
        {"plot": "p", "states": {"s": {"goal": "(p)", "budget": {"replans": -1}}}},
        {"plot": "p", "states": {"s": {}}, "rules": [{"on": "e", "do": {"limit": 0}}]},
        {"plot": "p", "states": {"s": {"states": {"s": {}}}}},
        {"plot": "p", "states": {"a/b": {}}},
        {"plot": "p", "states": {"#1": {}}},
        {"plot": "p", "states": {"": {}}},
        # Values where the language stands: neither text nor a parsed value.
        {"plot": "p", "when": 5, "states": {"s": {}}},
        {"plot": "p", "when": ["(p)"], "states": {"s": {}}},
        {"plot": "p", "when": Variable("x"), "states": {"s": {}}},
        {"plot": "p", "states": {"s": {"use": "q", "with": {"a": [None]}}}},
        {"plot": "p", "states": {"s": {"use": "q", "with": {"a": {"b": None}}}}},
        {"plot": "p", "states": {"s": {"use": "q", "with": {"a": None}}}},
        {"plot": "p", "states": {"s": {"on": {"e": {"tell": 5}}}}},
        {"plot": "p", "states": {"s": {"on": {"e": {"tell": ["(p)", 5]}}}}},
        {"plot": "p", "states": {"s": {"after": {"seconds": -1, "to": "s"}}}},
        {"plot": "p", "states": {"s": {"every": {"seconds": 0, "to": "s"}}}},
        {"plot": "p", "states": {"s": {"at_least": "soon"}}},
        {"plot": "p", "states": {"s": {"at_least": -1}}},
        {"plot": "p", "parameters": {"a": "item"}, "outputs": {"a": "item"}, "states": {"s": {}}},
        {"plot": "p", "variables": {"a": "item"}, "outputs": {"a": "item"}, "states": {"s": {}}},
        {"plot": "p", "outputs": {"Where": "place"}, "states": {"s": {}}},
        # Connectors: nothing rests there, something is always true, every value stands once.
        {"plot": "p", "states": {"s": {"choice": []}}},
        {"plot": "p", "states": {"s": {"choice": [{"when": "(p)"}, "s"]}}},
        {"plot": "p", "states": {"s": {"select": "?x", "cases": {}, "else": "s"}}},
        {"plot": "p", "states": {"s": {"select": "?x", "cases": {"a": "s"}}}},
        {"plot": "p", "states": {"s": {"select": "?x", "cases": {"a": {"emit": "e"}}, "else": "s"}}},
        {"plot": "p", "states": {"s": {"select": "?x", "cases": {"a": "s"}, "else": {"emit": "e"}}}},
        {"plot": "p", "states": {"s": {"select": "?x", "cases": {1: "s", "1.0": "s"}, "else": "s"}}},
        {"plot": "p", "states": {"s": {"select": "?x", "cases": {1: "s", "true": "s"}, "else": "s"}}},
        {"plot": "p", "states": {"s": {"select": "?x", "cases": {None: "s"}, "else": "s"}}},
        {"plot": "p", "states": {"s": {"select": "?x", "cases": {float("inf"): "s"}, "else": "s"}}},
    ],
)
def test_an_invalid_plot_form_is_refused(form):
    with pytest.raises(InputError):
        ActionPlot.model_validate(form)


@pytest.mark.parametrize(
    ("form", "said"),
    [
        ({"plot": "p", "stats": {}, "states": {"s": {}}}, "stats: unknown key 'stats'; did you mean 'states'?"),
        (
            {"plot": "p", "states": {"s": {"on": {"e": [{"too": "s"}]}}}},
            "states.s.on.e.0.too: unknown key 'too'; did you mean 'to'?",
        ),
        (
            {"plot": "p", "states": {"s": {"entry": ({"trigger": "a.b", "wihtin": 3},)}}},
            "states.s.entry.0.wihtin: unknown key 'wihtin'; did you mean 'within'?",
        ),
        (
            {"plot": "p", "states": {"s": {"entry": {"triger": "a.b"}}}},
            "states.s.entry: one of the keys trigger, set, switch,",
        ),
        ({"plot": "p", "when": "(and (p", "states": {"s": {}}}, "when: "),
        (
            {"plot": "p", "when": 5, "states": {"s": {}}},
            "when: a condition was expected, as text such as (on ?o table); found 5",
        ),
        ({"plot": "p"}, "the key 'states' is missing"),
        (
            {"plot": "p", "states": {"s": {"states": {"s": {}}}}},
            "states.s.states.s: two states are named 's'; names are unique in a plot",
        ),
        ("plot: p", "a mapping was expected; found 'plot: p'"),
        (None, "a mapping was expected; found nothing"),
    ],
)
def test_an_error_of_a_plot_form_names_its_path_without_words_of_pydantic(form, said):
    with pytest.raises(InputError) as error:
        ActionPlot.model_validate(form)
    assert said in str(error.value)
    assert "pydantic" not in str(error.value)


def test_parts_of_plots_say_what_is_wrong_as_well():
    with pytest.raises(InputError, match="unknown key 'dynamik'; did you mean 'dynamic'"):
        DynamicState.model_validate({"dynamik": ["a"]})


def test_the_form_reads_back_as_the_same_plot():
    form = EVERYTHING.to_form()
    again = ActionPlot.model_validate(json.loads(json.dumps(form)))
    assert again == EVERYTHING
    assert again.to_form() == form
    assert again.digest == EVERYTHING.digest


def test_equality_of_plots_ignores_their_source():
    one, other = plot("{plot: p, states: {s: {}}}", "a.yaml"), plot("plot: p\nstates:\n  s: {}", "b.yaml")
    assert one == other
    assert hash(one) == hash(other)


def test_the_yaml_of_a_plot_reads_back_as_the_same_plot():
    text = plot_to_yaml(EVERYTHING)
    assert parse_plot(text).to_form() == EVERYTHING.to_form()
    assert plot_to_yaml(parse_plot(text)) == text


def test_equal_plots_have_equal_digests_and_others_have_others():
    same = plot("{plot: p, states: {a: {on: {e: b}}, b: {}}}")
    assert same.digest == plot("plot: p\nstates:\n  a:\n    on:\n      e: {to: b}\n  b:\n").digest
    assert same.digest != plot("{plot: p, states: {a: {on: {f: b}}, b: {}}}").digest


def test_the_order_of_states_is_part_of_a_plot():
    forward, backward = plot("{plot: p, states: {a: {}, b: {}}}"), plot("{plot: p, states: {b: {}, a: {}}}")
    assert initial_of(forward) != initial_of(backward)
    assert forward.digest != backward.digest
    assert forward != backward


def test_a_copy_that_says_something_else_is_another_plot_even_if_the_first_was_compared_before():
    first = plot("plot: p\nstates:\n  a:\n    on:\n      e: b\n  b:\n")
    digest = first.digest
    copy = first.model_copy(update={"about": "another"})
    assert copy.digest != digest
    assert copy != first
    assert copy.model_copy(update={"about": None}) == first


def test_states_are_walked_in_document_order_with_their_paths():
    names = [name for name, _, _ in EVERYTHING.walk()]
    assert names == ["first", "second", "third", "box", "in_a", "in_b", "both", "l", "r", "either", "which", "over"]
    paths = {name: path for name, _, path in EVERYTHING.walk()}
    assert paths["in_b"] == ("states", "box", "states", "in_b")
    assert paths["r"] == ("states", "both", "regions", "right", "states", "r")
    assert EVERYTHING.uses() == {"other", "one", "two"}


def test_the_actions_of_a_transition_are_done_before_its_own_shorthand():
    transition = Transition.model_validate(
        {"do": [{"emit": "a"}], "assign": {"n": 1}, "tell": "(p)", "emit": "b", "with": {"x": 1}}
    )
    assert [type(a).__name__ for a in transition.effect] == ["Emit", "Assign", "Tell", "Emit"]
    assert transition.emitted == ("a", "b")


def test_pass_and_clear_of_a_transition_are_no_actions():
    assert Transition.model_validate({"to": "s", "pass": {"a": 1}, "clear": "t"}).effect == ()


def test_the_branches_of_a_choice_are_transitions_in_order():
    choice = EVERYTHING.state("either")
    assert [(path, label, one.target) for path, label, one in choice.placed_transitions()] == [
        (("choice", 0), "choice", "first"),
        (("choice", 1), "choice", "second"),
    ]
    assert next(iter(choice.transitions()))[1].effect == (Assign(assign={"n": 1}),)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("1.0", 1),
        ("-0.0", 0),
        ("1e16", 10**16),
        ("1.50", 1.5),
        ("9007199254740993", 2**53 + 1),
        ("1" * 30, int("1" * 30)),
        ('"-0"', 0),
    ],
)
def test_a_number_as_a_case_is_that_number_after_writing_and_reading_too(key, value):
    made = parse_plot(f"plot: p\nstates:\n  s: {{select: 1, cases: {{{key}: t}}, else: t}}\n  t:\n")
    ((case, _),) = made.states["s"].cases.items()
    assert case_value(case) == value
    assert parse_plot(plot_to_yaml(made)) == made


def test_a_case_is_a_number_of_any_size_and_never_infinite():
    form = {"plot": "p", "states": {"s": {"select": "?x", "cases": {10**400: "s"}, "else": "s"}}}
    assert list(ActionPlot.model_validate(form).states["s"].cases) == [str(10**400)]
    with pytest.raises(InputError, match="a case is text, a number or a truth value"):
        ActionPlot.model_validate(
            {"plot": "p", "states": {"s": {"select": "?x", "cases": {"1e400": "s"}, "else": "s"}}}
        )


def test_the_cases_of_a_select_are_guarded_by_their_values():
    guarded = {path: one.guard for path, _, one in EVERYTHING.state("which").placed_transitions()}
    item = Variable("item")
    assert guarded == {
        ("cases", "cup"): Comparison("=", item, Constant("cup")),
        ("cases", 3): And((Comparison("=", item, Constant(3)), Atom("p"))),
        ("cases", True): Comparison("=", item, Constant(True)),
        ("cases", '"4"'): Comparison("=", item, Constant("4")),
        ("else",): None,
    }


def test_reactions_that_come_again_stand_between_timeouts_and_what_needs_no_trigger():
    state = State.model_validate({
        "always": "c", "every": [{"seconds": "?n", "to": "b"}, {"seconds": 1}], "after": {"seconds": 0, "to": "a"},
    })  # fmt: skip
    assert [(path, label) for path, label, _ in state.placed_transitions()] == [
        (("after", 0), "after"), (("every", 0), "every"), (("every", 1), "every"), (("always", 0), "always"),
    ]  # fmt: skip


def test_a_rule_says_what_it_does():
    rule = Rule.model_validate({"on": "failed", "do": {"use": "reposition"}})
    assert rule.label == "failed: reposition, retry"
    assert Switch(switch="arm", to="up").to == "up"


NAMES = st.sampled_from(["a", "b", "on", "to", "use", "event", "transition", "states", "with", "do", "after", "x_1"])
SCALARS = st.one_of(
    st.integers(-5, 5),
    st.sampled_from(["red", "two words", "?x", "(+ ?x 1)", "true", "1", "null", "a: b", "# no", "Upper", " x "]),
)
TERMS = st.dictionaries(NAMES, SCALARS, max_size=2)
TYPES = st.dictionaries(NAMES, st.sampled_from(["item", "number"]), max_size=3)
TRANSITIONS = st.fixed_dictionaries(
    {},
    optional={
        "to": NAMES, "when": st.sampled_from(["(p)", "(not (p ?x))"]), "assign": TERMS,
        "tell": st.just("(p)"), "emit": NAMES, "with": TERMS, "pass": TERMS,
        "bind": st.dictionaries(NAMES, st.just("(p ?x)"), max_size=2), "bind_all": st.just({"x": "(p ?x)"}), "order_by": st.just([]),
    },
)  # fmt: skip
CASES = st.sampled_from(["a", "on", "4", 2, 0.5, '"3"', "Big Cup", "null", "true", "a: b"])
SELECTS = st.fixed_dictionaries(
    {"select": SCALARS, "cases": st.dictionaries(CASES, NAMES, min_size=1, max_size=3), "else": NAMES}
)
SIMPLE = st.fixed_dictionaries(
    {},
    optional={
        "about": st.text(st.characters(codec="utf-8", exclude_categories=["C"]), max_size=12),
        "on": st.dictionaries(NAMES, st.one_of(NAMES, TRANSITIONS, st.lists(TRANSITIONS, max_size=2)), max_size=3),
        "always": st.lists(TRANSITIONS, max_size=2),
        "entry": st.lists(
            st.one_of(
                st.fixed_dictionaries({"switch": NAMES, "to": NAMES}),
                st.fixed_dictionaries({"set": st.just("a.b"), "to": SCALARS}),
                st.fixed_dictionaries({"trigger": st.just("a.b")}, optional={"with": TERMS}),
            ),
            max_size=2,
        ),
    },
)


@PROPERTY
@given(
    form=st.fixed_dictionaries(
        {"plot": st.just("p")},
        optional={
            "parameters": TYPES,
            "emits": st.dictionaries(NAMES, st.one_of(st.none(), TYPES), max_size=3),
            "states": st.just({}),
        },
    ),
    states=st.dictionaries(NAMES, st.one_of(SIMPLE, SELECTS), min_size=1, max_size=3),
    regions=st.lists(NAMES, max_size=2, unique=True),
)
def test_any_plot_survives_json_and_yaml(form, states, regions):
    inner: dict[str, object] = {name: {"states": {f"in_{name}": {}}} for name in regions}
    form = {**form, "states": {**states, **({"both": {"regions": inner}} if inner else {})}}
    made = ActionPlot.model_validate(form)
    assert ActionPlot.model_validate(json.loads(json.dumps(made.to_form()))) == made
    again = parse_plot(plot_to_yaml(made))
    assert again.digest == made.digest


def test_rules_with_equal_responses_are_told_apart_by_name_or_number():
    plot = parse_plot("""
        plot: p
        states: {x: {use: y, on: {done: e}}, e: {final: true}}
        rules:
          - {on: a, of: x, do: {then: retry}}
          - {on: a, do: {then: retry}}
          - {on: a, name: last resort, do: {use: z, then: retry, on: {lost: give_up}}}
        handlers:
          - {on: low, when: (p), do: {use: go}}
          - {on: low, do: {use: go}}
    """)
    assert [rule.label for rule in plot.rules] == ["a: retry", "a: retry (2)", "last resort"]
    assert [one.label for one in plot.rules[2].continuations] == ["last resort", "last resort, give_up"]
    assert [one.label for one in plot.handlers] == ["handler low: go", "handler low: go (2)"]
    assert ActionPlot.model_validate(plot.to_form()) == plot


QUOTED = """
    plot: p
    variables: {t: {type: text, initial: '"two words"'}, u: {type: text, initial: two words}}
    parameters: {mood: {type: text, default: '"very good"', among: [very good, '"bad"']}}
    emits: {said: {what: text}}
    states:
      a:
        entry: {trigger: voice.say, with: {a: '"off I go"', b: off I go, c: '"(not a call)"', d: '"say \\"hi\\""'}}
        on: {done: {to: b, assign: {t: '"hi"'}, emit: said, with: {what: '"hi"'}}}
      b: {select: ?t, cases: {'"hi"': e}, else: e}
      e: {final: true}
"""


def test_a_text_in_quotes_is_the_text_wherever_a_value_is_written():
    found = plot(QUOTED)
    trigger = found.states["a"].entry[0]
    assert [term.value for term in trigger.arguments.values()] == ["off I go", "off I go", "(not a call)", 'say "hi"']
    assert found.variables["t"].initial == found.variables["u"].initial
    assert (found.parameters["mood"].default.value, found.parameters["mood"].among) == (
        "very good",
        ("very good", "bad"),
    )
    (way,) = found.states["a"].on["done"]
    assert ActionPlot.model_validate(found.to_form()) == found
    assert (way.assign["t"].value, way.arguments["what"].value) == ("hi", "hi")


@PROPERTY
@given(st.text(st.sampled_from('"\\(?a 1'), max_size=6))
def test_a_text_survives_being_written_in_a_plot(text):
    state = State(entry=[Trigger(trigger="voice.say", arguments={"a": Constant(text, quoted=True)})])
    made = ActionPlot(name="p", states={"a": state})
    assert parse_plot(plot_to_yaml(made)).states["a"].entry[0].arguments["a"].value == text

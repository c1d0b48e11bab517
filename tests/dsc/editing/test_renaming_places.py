"""Renames of each kind of name at each place of a text where conditions, terms and constants stand."""

from __future__ import annotations

import re

import pytest

from dsc.editing.renaming import rename_named
from dsc.text.plot_files import parse_plot

DOMAIN = """\
(define (domain d) (:types item) (:constants cup - item) (:predicates (held ?i - item) (near-by ?i - item))
 (:functions (weight ?i - item) - number (pose ?i - item) - geometry)
 (:action take :parameters (?item - item) :precondition (held ?item) :effect (not (held ?item))))
"""
PLOT = """\
plot: main
about: cup held weight
parameters: {item: item, aim: {type: text, default: here}}
variables: {found: {type: item, initial: cup}, all: {type: list of item, initial: []}}
emits: {lost: {what: item}}
%s
states:
%s
  go: {entry: {trigger: arm.go}, on: {gone: over}}
  over: {final: true}
"""
CONDITION = "(exists (?i - item) (and (held ?i) (> (weight cup) 2) (held ?item)))"
TERM = "(+ (weight cup) (weight ?item))"
STATE = "  here: {entry: {trigger: arm.go%s}, on: {gone: %s}%s}"
WITH = "  here: {entry: {trigger: arm.go, with: {%s}}, on: {gone: over}}"
BLOCK = 'entry:\n      trigger: arm.go\n      with:\n        condition: >-\n          "%s"\n'
PLACES = {
    "when of a transition": ("", STATE % ("", "{to: over, when: %s}", "")),
    "single quotes": ("", STATE % ("", "{to: over, when: '%s'}", "")),
    "double quotes": ("", STATE % ("", '{to: over, when: "%s"}', "")),
    "block": ("", "  here:\n    always:\n      to: over\n      when: >-\n        %s\n"),
    "bind": ("", STATE % ("", "{to: over, bind: {found: %s}}", "")),
    "bind_all": ("", STATE % ("", "{to: over, bind_all: {all: %s}}", "")),
    "order_by": ("", STATE % ("", "{to: over, bind: {found: (held ?found)}, order_by: [%s]}", "")),
    "tell": ("", STATE % ("", "{to: over, tell: (forall (?i - item) (when (held ?i) (assign (weight cup) 2)))}", "")),
    "tell in do": ("", STATE % ("", "{to: over, do: [{tell: (and (held cup) (assign (weight ?item) 2))}]}", "")),
    "assign": ("", STATE % ("", "{to: over, assign: {found: %s}}", "")),
    "assign of an object": ("", STATE % ("", "{to: over, assign: {found: cup}}", "")),
    "with of an event": ("", STATE % ("", "{to: over, emit: lost, with: {what: cup}}", "")),
    "pass": ("", "  here: {use: main, with: {item: cup}, on: {lost: {to: here, pass: {item: cup}}, done: over}}"),
    "time": ("", "  here: {after: {seconds: %s, to: over}}"),
    "when of a timed transition": ("", "  here: {after: {seconds: 1, to: over, when: %s}}"),
    "choice": ("", "  here: {choice: [{to: go, when: %s}, {to: over}]}"),
    "cases": ("", "  here: {select: ?item, cases: {cup: over}, else: go}"),
    "select": ("", "  here: {select: %s, cases: {2: over}, else: go}"),
    "goal": ("", "  here: {goal: %s, on: {done: over, no_plan: over, gave_up: over}}"),
    "situation": ("", "  here: {dynamic: [main], situation: [%s], with: {item: cup}, on: {done: over, lost: over}}"),
    "argument of a plot": ("", "  here: {use: main, with: {item: cup}, on: {done: over, lost: over}}"),
    "argument of a skill": ("", WITH % "at: cup"),
    "argument in a map": ("", WITH % "at: {first: cup, second: [cup]}"),
    "term": ("", WITH % "at: %s"),
    "message": ("", "  here: {entry: [{send: arm.say, with: {about: cup}}, {trigger: arm.go}], on: {gone: over}}"),
    "condition as a text": ("", WITH % "condition: '\"%s\"'"),
    "condition as an escaped text": ("", WITH % 'condition: "\\"%s\\""'),
    "condition as a text in a block": ("", f"  here:\n    on: {{gone: over}}\n    {BLOCK}"),
    "values of a condition": ("", WITH % "condition: '\"(held ?x)\"', values: {x: cup, y: (weight cup)}"),
    "default of a parameter": ("", "  here: {always: over}"),
    "final state": ("", "  here: {always: end}\n  end: {final: true, emit: lost, with: {what: cup}}"),
    "when of the plot": ("when: %s", "  here: {always: over}"),
    "utility of the plot": ("utility: %s", "  here: {always: over}"),
    "when of a rule": ("rules: [{on: lost, when: %s, do: {then: retry}}]", "  here: {always: over}"),
    "tell of a rule": ("rules: [{on: lost, do: {tell: (held cup), then: retry}}]", "  here: {always: over}"),
    "when of a handler": ("handlers: [{on: lost, when: %s, do: {tell: (held cup)}}]", "  here: {always: over}"),
}  # fmt: skip
TERMS = {"order_by", "assign", "time", "select", "term", "utility of the plot"}
KINDS = {"predicate": ("held", "grasped"), "function": ("weight", "mass"), "object": ("cup", "mug"),
         "type": ("item", "thing"), "parameter": ("item", "part")}  # fmt: skip
TYPES = re.compile(r"(?<=- )item|(?<=[:{] )item|(?<=of )item")
PARAMETER = re.compile(r"(?<=\?)item|(?<=[{])item(?=:)")


def files(tmp_path, place, **others):
    top, state = PLACES[place]
    text = PLOT % (top, state)
    if "%s" in text:
        text %= TERM if place in TERMS else CONDITION
    found = {"domain.pddl": DOMAIN, "plots/main.yaml": text, **others}
    for name, content in found.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(content)
    parse_plot(text)
    return found


def meant(text, kind):
    """Return the text with the new name of a kind, by the syntax of the places above."""
    old, new = KINDS[kind]
    about = "about: cup held weight\n"
    pattern = {"type": TYPES, "parameter": PARAMETER}.get(kind, re.compile(rf"(?<![\w?-]){old}\b"))
    return pattern.sub(new, text.replace(about, "#")).replace("#", about)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("place", PLACES)
def test_a_name_at_a_place(tmp_path, place, kind):
    before = files(tmp_path, place)["plots/main.yaml"]
    if "condition as" in place:
        before = before.replace("(held ?item)", "(held ?x)")
        (tmp_path / "plots/main.yaml").write_text(before)
    old, new = KINDS[kind]
    found, texts = rename_named(tmp_path, kind, f"main.{old}" if kind == "parameter" else old, new)
    assert texts.get(tmp_path / "plots/main.yaml", before) == meant(before, kind)
    assert found.in_texts == ()


WATCHED = """\
plot: main
parameters: {limit: {type: number, default: 3}}
states:
  look:
    entry:
      - {trigger: hand.watch_values, with: {condition: '"(or (silent tool 2) (near-by tool.way) (< tool.way ?limit))"'}}
      - trigger: conditions.watch_truth
        with:
          condition: >-
            "(or (held ?cup) (near-by hand.tool.way)  (near-by cup) (silent hand.tool 2)
                 (< (distance hand.tool.way (pose cup)) 0.1))"
          values: {cup: cup, limit: ?limit}
    on: {became_true: over, became_false: over}
  over: {final: true}
"""


@pytest.mark.parametrize(
    ("kind", "old", "line"),
    [
        ("predicate", "held", '"(or (new ?cup) (near-by hand.tool.way)  (near-by cup) (silent hand.tool 2)'),
        ("predicate", "near-by", '"(or (held ?cup) (near-by hand.tool.way)  (new cup) (silent hand.tool 2)'),
        ("function", "pose", '(< (distance hand.tool.way (new cup)) 0.1))"'),
        ("object", "cup", "values: {cup: new, limit: ?limit}"),
        ("object", "cup", '"(or (held ?cup) (near-by hand.tool.way)  (near-by new) (silent hand.tool 2)'),
        ("parameter", "limit", "values: {cup: cup, limit: ?new}"),
    ],
)
def test_a_watched_condition(tmp_path, kind, old, line):
    (tmp_path / "domain.pddl").write_text(DOMAIN.replace("cup -", "cup tool -"))
    (tmp_path / "main.yaml").write_text(WATCHED)
    lines = rename_named(tmp_path, kind, old, "new")[1][tmp_path / "main.yaml"].splitlines()
    assert line in map(str.strip, lines)
    assert sum(one != other for one, other in zip(lines, WATCHED.splitlines(), strict=True)) <= 3
    port = rename_named(tmp_path, "object", "tool", "new")[1]
    assert [*port] == [tmp_path / "domain.pddl"]


def test_objects_of_scenarios_and_words_that_may_be_names(tmp_path):
    files(tmp_path, "tell of a rule", **{
        "scenarios/a.yaml": "cup: 1\nthings: {cup: table}\nsays: [fetch the cup, cup]\nfacts: [(held cup)]\n",
        "profiles/p.yaml": "profile: p\nplots: {main: {aim: 'cup', item: cup}}\ncomponents: {arm: {first: cup}}\n",
    })  # fmt: skip
    found, texts = rename_named(tmp_path, "object", "cup", "mug")
    named = {file.name: text for file, text in texts.items()}
    assert named["a.yaml"] == "cup: 1\nthings: {mug: table}\nsays: [fetch the cup, mug]\nfacts: [(held mug)]\n"
    assert "{main: {aim: 'mug', item: mug}}" in named["p.yaml"]
    assert [(file.name, line) for file, line in found.in_texts] == [("p.yaml", 3), ("a.yaml", 1), ("a.yaml", 3)]


def test_a_quoted_word_and_a_sentence_in_a_plot(tmp_path):
    files(tmp_path, "argument of a skill")
    file = tmp_path / "plots/main.yaml"
    file.write_text(file.read_text().replace("at: cup", "at: '\"cup\"', say: '\"the cup\"'").replace("gone: over", "gone: "
        "{to: over, when: (= \"the cup\" ?aim)}", 1))  # fmt: skip
    found, texts = rename_named(tmp_path, "object", "cup", "mug")
    assert "the mug" not in texts[file]
    assert len(found.in_texts) == 1

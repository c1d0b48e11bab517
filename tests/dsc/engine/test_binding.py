"""Transitions that bind variables to what a condition finds: `bind`, `bind_all`, `order_by` (S4.3)."""

import pytest

from dsc import Component, Library, Outcome, SkillCall, parse_plot, skill, validate_plot
from dsc.text.plot_files import plot_to_yaml
from dsc.validation import review_plot
from knowledge_base import Schema
from planning import Robot

DOMAIN = """
(define (domain hall)
  (:types person place - object guest - person)
  (:constants robot - person)
  (:predicates (want-to-talk ?p ?r - person) (in ?p - person ?l - place) (asked ?p - person ?what - text)
               (served ?p - person))
  (:functions (distance ?p - person) - number (name ?p - person) - text))
"""
WORLD = """
(person ann) (person bob) (guest cid) (place bar) (place desk)
(= (distance ann) 5) (= (distance bob) 2) (= (distance cid) 3)
(in ann bar) (in bob desk) (in cid bar)
"""


class Said(Outcome): ...


class Voice(Component):
    name = "voice"

    def __init__(self):
        super().__init__()
        self.said = []

    @skill
    async def say(self, call: SkillCall, to: str) -> Said:
        self.said.append(to)
        return Said()


HEAD = "plot: host\nvariables: {person: person, people: list of person, guest: guest, place: place, what: text}\n"


def run(states, facts, *, plot_head=HEAD, outcome=True):
    voice = Voice()
    plot = parse_plot(f"{plot_head}states:\n{states}")
    with Robot(DOMAIN, [plot], [voice], clock="simulated") as robot:
        robot.knowledge.apply(WORLD + facts, author="test")
        end = robot.run("host")
        world = robot.knowledge.query("(served ?p)")
    assert bool(end) is outcome, end
    return voice.said, [one["p"] for one in world]


SERVE = """
  idle:
    always:
      - {to: talk, bind: {person: "(want-to-talk ?person robot)"}, tell: (not (want-to-talk ?person robot))}
      - over
  talk:
    entry: {trigger: voice.say, with: {to: ?person}}
    on: {said: {to: idle, tell: (served ?person)}}
  over: {final: true}
"""


def test_a_witness_is_bound_and_none_refuses_the_transition():
    assert run(SERVE, "") == ([], [])
    said, served = run(SERVE, "(want-to-talk cid robot) (want-to-talk ann robot)")
    assert said == ["cid", "ann"]
    assert set(served) == {"ann", "cid"}


def test_the_smallest_term_comes_first():
    nearest = SERVE.replace('robot)"}, tell', 'robot)"}, order_by: (distance ?person), tell')
    everyone = "(want-to-talk ann robot) (want-to-talk bob robot) (want-to-talk cid robot)"
    assert run(nearest, everyone)[0] == ["bob", "cid", "ann"]
    farthest = nearest.replace("(distance ?person)", "(- 0 (distance ?person))")
    assert run(farthest, everyone)[0] == ["ann", "cid", "bob"]


def test_the_condition_of_the_transition_counts():
    near = SERVE.replace('robot)"}, tell', 'robot)"}, when: (< (distance ?person) 4), tell')
    assert run(near, "(want-to-talk ann robot) (want-to-talk cid robot)")[0] == ["cid"]


def test_several_variables_fulfil_their_conditions_together():
    states = """
  idle:
    always:
      - to: talk
        bind: {place: (in ?person ?place), person: "(want-to-talk ?person robot)", what: (asked ?person ?what)}
        tell: (not (want-to-talk ?person robot))
      - over
  talk:
    entry: {trigger: voice.say, with: {to: ?what}}
    on: {said: {to: idle, tell: (served ?person)}}
  over: {final: true}
"""
    facts = '(want-to-talk ann robot) (want-to-talk bob robot) (asked bob "Coffee, please")'
    assert run(states, facts) == (["Coffee, please"], ["bob"])


def test_the_type_of_the_variable_restricts_what_is_found():
    states = """
  idle: {always: [{to: talk, bind: {guest: (in ?guest bar)}}, over]}
  talk: {entry: {trigger: voice.say, with: {to: ?guest}}, on: {said: over}}
  over: {final: true}
"""
    assert run(states, "")[0] == ["cid"]


def test_a_list_of_all_values():
    states = """
  idle: {always: {to: tell, bind_all: {people: (in ?people bar)}, order_by: (distance ?people)}}
  tell: {always: [{to: talk, when: (> (size ?people) 0)}, over]}
  talk: {entry: {trigger: voice.say, with: {to: ?people.0}}, on: {said: last}}
  last: {entry: {trigger: voice.say, with: {to: ?people.1}}, on: {said: over}}
  over: {final: true}
"""
    assert run(states, "")[0] == ["cid", "ann"]
    empty = states.replace("(in ?people bar)", "(served ?people)")
    assert run(empty, "")[0] == []


def test_a_waiting_transition_is_taken_when_somebody_is_found():
    states = """
  both:
    regions:
      people: {states: {nobody: {after: {seconds: 3, to: come, tell: (want-to-talk ann robot)}}, come: {final: true}}}
      talk:
        states:
          idle: {always: {to: found, bind: {person: "(want-to-talk ?person robot)"}, tell: (served ?person)}}
          found: {final: true}
    on: {done: over}
  over: {final: true}
"""
    assert run(states, "") == ([], ["ann"])


def test_the_old_value_of_the_variable_does_not_count():
    states = SERVE.replace(
        "      - over", '      - {to: over, bind: {person: "(in ?person desk)"}, tell: (served ?person)}'
    )
    assert run(states, "(want-to-talk ann robot)")[1] == ["ann", "bob"]


SCHEMA = Schema.parse(DOMAIN)


@pytest.mark.parametrize(
    ("transition", "message"),
    [
        ("bind: {persn: (in ?persn bar)}", "there is no variable 'persn'"),
        ("bind: {person: (inn ?person bar)}", "inn"),
        ("bind: {person: (in ?person ?where)}", "where"),
        ("bind: {person: (in ?place ?person)}", "type"),
        ("bind: {people: (in ?people bar)}", "use `bind_all`"),
        ("bind_all: {person: (in ?person bar)}", "use `bind`"),
        ("bind: {what: (!= ?what hello)}", "finds no values"),
        ("bind: {person: (in ?person bar)}, order_by: (name ?person)", "number"),
        ("bind: {person: (in ?person bar)}, order_by: (distanc ?person)", "distanc"),
    ],
)
def test_mistakes_are_findings(transition, message):
    plot = parse_plot(f"{HEAD}states:\n  a: {{always: [{{to: b, {transition}}}, b]}}\n  b: {{final: true}}")
    found = validate_plot(plot, Library([plot]), SCHEMA)
    assert any(message in str(one) for one in found), found


def test_a_transition_after_one_that_binds_is_taken_if_nothing_is_found():
    plot = parse_plot(HEAD + "states:" + SERVE)
    assert validate_plot(plot, Library([plot]), SCHEMA) == []
    assert [str(one) for one in review_plot(plot, Library([plot])) if one.code == "transitions"] == []


def test_order_without_bind_is_refused():
    with pytest.raises(Exception, match="order_by"):
        parse_plot(HEAD + "states:\n  a: {always: {to: b, order_by: (distance ann)}}\n  b: {final: true}")


def test_written_and_read_again():
    text = HEAD + "states:" + SERVE
    plot = parse_plot(text)
    assert parse_plot(plot_to_yaml(plot)) == plot

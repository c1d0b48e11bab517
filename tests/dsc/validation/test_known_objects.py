"""Names of objects in plots: unknown ones, and those of another type, are findings where the plot writes them."""

from __future__ import annotations

import pytest
from dsc_charts import plot

from dsc.dynamic.library import Library
from dsc.skills import SkillSignature
from dsc.validation import validate_plot
from planning.model.domain import PlanningDomain

SCHEMA = PlanningDomain.from_fragments(
    ["""(define (domain d) (:types room thing cup) (:constants dock - room)
      (:predicates (in ?t - thing ?r - room) (near ?r - room) (free) (labelled ?t - thing ?l - text))
      (:functions (mass ?t - thing)))"""]
).schema  # fmt: skip
OBJECTS = {"hall": "room", "lab": "room", "box": "thing"}
GO = SkillSignature("base", "go", {"to": "room", "fast": "optional room"}, {"fast": None}, {"went": {}})
DRIVE = plot("plot: drive\nparameters: {to: room}\nstates: {s: {after: {seconds: 1, to: e}}, e: {final: true}}")
FORMS = [
    "states: {s: {goal: (near @), on: {done: e, no_plan: e, gave_up: e}}, e: {final: true}}",
    "when: (and (free) (near @))\nstates: {s: {after: {seconds: 1, to: e}}, e: {final: true}}",
    "states: {s: {after: {seconds: 1, to: e, when: (in box @)}}, e: {final: true}}",
    "states: {s: {after: {seconds: 1, to: e, tell: (near @)}}, e: {final: true}}",
    "states: {s: {after: {seconds: 1, to: e, tell: (forall (?t - thing) (in ?t @))}}, e: {final: true}}",
    "states: {s: {use: drive, with: {to: @}, on: {done: e}}, e: {final: true}}",
    "states: {s: {entry: {trigger: base.go, with: {to: @}}, on: {went: e}}, e: {final: true}}",
    "states: {s: {entry: {trigger: base.go, with: {to: hall, fast: @}}, on: {went: e}}, e: {final: true}}",
    "parameters: {r: {type: room, default: @}}\nstates: {s: {after: {seconds: 1, to: e}}, e: {final: true}}",
    "variables: {r: {type: room, initial: @}}\nstates: {s: {after: {seconds: 1, to: e}}, e: {final: true}}",
    "variables: {r: {type: list of room, initial: [hall, @]}}\nstates: {s: {after: {seconds: 1, to: e}}, e: {final: true}}",
    "parameters: {r: room}\nstates: {s: {after: {seconds: 1, to: e, when: (= ?r @)}}, e: {final: true}}",
    "parameters: {r: room}\nstates: {s: {select: ?r, cases: {@: e}, otherwise: e}, e: {final: true}}",
    "rules: [{on: gave_up, when: (near @), do: {then: e}}]\nstates: {s: {goal: (free), on: {done: e, no_plan: e, gave_up: e}}, e: {final: true}}",
]  # fmt: skip


def findings(text, name, objects=OBJECTS):
    made = plot(f"plot: p\n{text.replace('@', name)}")
    return [str(one) for one in validate_plot(made, Library([made, DRIVE]), SCHEMA, [GO], [], objects=objects)]


@pytest.mark.parametrize("text", FORMS)
def test_an_unknown_object_is_found_wherever_a_plot_names_it(text):
    (found,) = findings(text, "lba")
    assert "there is no object 'lba' of type room; did you mean 'lab'?" in found


@pytest.mark.parametrize("text", FORMS)
def test_an_object_of_another_type_is_found(text):
    (found,) = findings(text, "box")
    assert "'box' is of type thing, not of type room" in found


@pytest.mark.parametrize("text", FORMS)
@pytest.mark.parametrize("name", ["lab", "dock"])
def test_known_objects_and_constants_are_accepted(text, name):
    assert findings(text, name) == []


@pytest.mark.parametrize("text", FORMS)
def test_without_known_objects_each_name_is_accepted(text):
    assert findings(text, "lba", None) == []


def test_texts_and_objects_of_types_that_a_run_fills_are_accepted():
    waits = "states: {s: {after: {seconds: 1, to: e, when: @}}, e: {final: true}}"
    assert findings(waits, '(labelled box "red")') == []
    assert findings(waits, "(exists (?c - cup) (= ?c cup7))") == []

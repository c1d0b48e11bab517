"""Which transitions are taken, and who sees an event (SCXML 1.0, 3.13; scopes S0.6, S2.5)."""

from __future__ import annotations

import pytest
from dsc_charts import Run, plot

from dsc.events import Event
from knowledge_base.facts import Fact


def run_of(text, *inner, facts=()):
    run = Run(plot(text), *map(plot, inner), facts=facts)
    run.start()
    return run


# -- priority ----------------------------------------------------------------------------------------------


def test_the_inner_state_is_asked_first():
    run = run_of("{plot: p, states: {a: {on: {e: out}, states: {b: {on: {e: c}}, c: }}, out: }}")
    run.send("e")
    assert run.active == ["a", "c"]
    run.send("e")
    assert run.active == ["out"]


def test_a_plot_inside_is_asked_before_the_state_that_holds_it():
    run = run_of("{plot: p, states: {a: {use: q, on: {e: out}}, out: }}", "{plot: q, states: {b: {on: {e: c}}, c: }}")
    run.send("e")
    assert run.active == ["a", "a/c"]
    run.send("e")
    assert run.active == ["out"]


def test_an_inner_guard_that_does_not_hold_lets_the_outer_state_answer():
    run = run_of("{plot: p, states: {a: {on: {e: out}, states: {b: {on: {e: {to: c, when: (p)}}}, c: }}, out: }}")
    run.send("e")
    assert run.active == ["out"]


@pytest.mark.parametrize(("facts", "target"), [(("p", "q"), "x"), (("q",), "y"), ((), "z")])
def test_transitions_of_a_state_are_tried_in_order(facts, target):
    text = "{plot: p, states: {a: {on: {e: [{to: x, when: (p)}, {to: y, when: (q)}, z]}}, x: , y: , z: }}"
    run = run_of(text, facts=map(Fact, facts))
    run.send("e")
    assert run.active == [target]


def test_a_transition_without_target_satisfies_the_event_for_its_ancestors():
    run = run_of("{plot: p, states: {a: {on: {e: out}, states: {b: {on: {e: {}}}}}, out: }}")
    assert run.send("e").handled
    assert run.active == ["a", "b"]


def test_an_event_nobody_takes_is_not_handled():
    run = run_of("{plot: p, states: {a: {on: {e: {to: b, when: (p)}}}, b: }}")
    assert not run.send("other").handled
    assert not run.send("e").handled


# -- regions -----------------------------------------------------------------------------------------------

PARALLEL = """
    plot: p
    states:
      o:
        on: {all: out}
        regions:
          r1: {states: {x: {on: {e: x2, mixed: x2, one: x2}}, x2: }}
          r2: {states: {y: {on: {e: y2, mixed: {}}}, y2: }}
      out:
"""


def test_one_event_moves_all_regions_in_one_microstep():
    run = run_of(PARALLEL)
    step = run.send("e")
    assert run.active == ["o", "x2", "y2"]
    assert [len(micro.taken) for micro in step.microsteps] == [2]
    assert step.microsteps[0].exited == ("y", "x")
    assert step.microsteps[0].entered == ("x2", "y2")


def test_regions_that_do_not_care_stay_as_they_are():
    run = run_of(PARALLEL)
    step = run.send("one")
    assert run.active == ["o", "x2", "y"]
    assert not step.entered("y")


def test_a_transition_of_the_state_around_is_taken_once_for_all_regions():
    run = run_of(PARALLEL)
    step = run.send("all")
    assert len(step.microsteps[0].taken) == 1
    assert run.active == ["out"]


def test_a_region_that_answers_beats_the_state_around_that_would_leave_it():
    run = run_of("""
        plot: p
        states:
          o:
            on: {e: out}
            regions: {r1: {states: {x: }}, r2: {states: {y: {on: {e: y2}}, y2: }}}
          out:
    """)
    run.send("e")
    assert run.active == ["o", "x", "y2"]


def test_of_two_regions_that_leave_together_the_first_wins():
    run = run_of("""
        plot: p
        states:
          o: {regions: {r1: {states: {x: {on: {e: out1}}}}, r2: {states: {y: {on: {e: out2}}}}}}
          out1:
          out2:
    """)
    run.send("e")
    assert run.active == ["out1"]


def test_a_region_that_stays_does_not_hinder_one_that_leaves():
    run = run_of("""
        plot: p
        variables: {n: {type: number, initial: 0}}
        states:
          o: {regions: {r1: {states: {x: {on: {e: {assign: {n: 1}}}}}}, r2: {states: {y: {on: {e: out}}}}}}
          out:
    """)
    run.send("e")
    assert run.active == ["out"]
    assert run.variables()["n"] == 1


def test_an_outcome_fired_while_another_region_leaves_the_host_is_dropped():
    run = run_of(
        "{plot: p, states: {h: {use: q, on: {e: out, lost: wrong}}, out: {on: {lost: wrong}}, wrong: }}",
        """
        plot: q
        emits: {lost: }
        states:
          o: {regions: {r1: {states: {x: {on: {e: {emit: lost}}}}}, r2: {states: {y: }}}}
        """,
    )
    step = run.send("e")
    assert len(step.microsteps[0].taken) == 2
    assert run.active == ["out"]


def test_a_plot_inside_a_region_conflicts_with_what_would_leave_its_host():
    run = run_of(
        """
        plot: p
        states:
          o:
            regions: {r1: {states: {x: {on: {e: out}}}}, r2: {states: {y: {use: q}}}}
          out:
        """,
        "{plot: q, states: {a: {on: {e: b}}, b: }}",
    )
    run.send("e")
    assert run.active == ["out"]


ASKS = "entry: {trigger: arm.move}"
"""Keys of a state that starts a skill: only such a state is sent events of its own."""

# -- who sees an event -------------------------------------------------------------------------------------


def test_an_event_from_outside_is_seen_everywhere():
    run = run_of("{plot: p, states: {h: {use: q}}}", "{plot: q, states: {a: {on: {stop: b}}, b: }}")
    assert run.send("stop").handled


def test_a_skills_event_is_seen_by_the_state_that_asked_and_those_around_it():
    run = run_of(
        f"{{plot: p, states: {{c: {{on: {{failed: sad}}, states: {{a: {{{ASKS}, on: {{ok: b}}}}, b: {{{ASKS}}}}}}}, sad: }}}}"
    )
    assert run.send("ok", to="a").handled
    assert run.send("failed", to="b").handled
    assert run.active == ["sad"]


def test_a_skills_event_is_not_seen_by_a_sibling_region():
    run = run_of(f"""
        plot: p
        states:
          o:
            regions:
              r1: {{states: {{x: {{on: {{ok: x2}}}}, x2: }}}}
              r2: {{states: {{y: {{{ASKS}, on: {{ok: y2}}}}, y2: }}}}
    """)
    run.send("ok", to="y")
    assert run.active == ["o", "x", "y2"]


def test_a_skills_event_is_not_seen_inside_nor_in_the_plot_around():
    run = run_of(
        "{plot: p, states: {h: {use: q, on: {ok: wrong}}, wrong: }}",
        "{plot: q, states: {a: {use: r}}}",
        "{plot: r, states: {deep: {on: {ok: wrong}}, wrong: }}",
    )
    assert not run.send("ok", to="h/a").handled


def test_an_event_for_a_state_that_was_left_is_dropped():
    run = run_of(f"{{plot: p, states: {{a: {{{ASKS}, on: {{ok: b, again: a}}}}, b: }}}}")
    old = Event("ok", to=run.serial("a"))
    run.send("again")
    step = run.machine.send(old, run.situation())
    assert not step.handled
    assert run.active == ["a"]


def test_an_exact_event_is_seen_by_one_state_alone():
    run = run_of(f"{{plot: p, states: {{c: {{{ASKS}, on: {{ok: out}}, states: {{a: {{{ASKS}}}}}}}, out: }}}}")
    assert not run.send("ok", to="a", exact=True).handled
    assert run.send("ok", to="c", exact=True).handled


def test_a_local_event_stays_in_its_plot_instance():
    run = run_of(
        """
        plot: p
        states:
          o:
            on: {local: out}
            regions: {r1: {states: {x: {use: q}}}, r2: {states: {y: {use: q}}}}
          out:
        """,
        """
        plot: q
        states:
          a: {on: {go: {to: b, when: (p), emit: local}, local: wrong}}
          b: {on: {local: c}}
          c:
          wrong:
        """,
    )  # fmt: skip
    first = run.machine.state.root.children["x"]
    run.facts.add(Fact("p"))
    step = run.machine.send(Event("go", frame=first.serial), run.situation())
    assert step.handled
    assert run.active == ["o", "x", "x/c", "y", "y/a"]


def test_a_local_event_reaches_all_regions_of_its_plot():
    run = run_of("""
        plot: p
        states:
          o:
            regions:
              r1: {states: {x: {on: {e: {to: x2, emit: both}}}, x2: {on: {both: x3}}, x3: }}
              r2: {states: {y: {on: {both: y2}}, y2: }}
    """)
    run.send("e")
    assert run.active == ["o", "x3", "y2"]


def test_a_declared_outcome_is_no_local_event():
    run = run_of(
        "{plot: p, states: {h: {use: q, on: {lost: out}}, out: }}",
        "{plot: q, emits: {lost: }, states: {a: {on: {e: {emit: lost}, lost: wrong}}, wrong: }}",
    )
    run.send("e")
    assert run.active == ["out"]


def test_an_error_is_seen_in_the_plot_where_it_happened():
    run = run_of(
        "{plot: p, states: {h: {use: q, on: {error: wrong}}, wrong: }}",
        "{plot: q, states: {a: {on: {e: {tell: (p ?nope)}}}}}",
    )
    step = run.send("e")
    assert run.active == ["h", "h/a"]
    assert len(step.errors) == 1

"""Ways through a chart: breaks, connectors, what transitions pass, what plots hand back, history that is cleared."""

from __future__ import annotations

import pytest
from dsc_charts import Run, modes, plot

from dsc.dynamic.knowledge_situation import KnowledgeSituation
from dsc.dynamic.library import Library
from dsc.engine.machine import Machine
from dsc.events import Event
from knowledge_base.facts import Fact
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema import Schema


def started(text, *inner, **keys):
    run = Run(plot(text), *map(plot, inner), **keys)
    run.start()
    return run


# -- breaks ------------------------------------------------------------------------------------------------


def breakable(name):
    return f"exit: {{switch: log, to: -{name}}}, on_break: {{switch: log, to: '!{name}'}}"


def test_a_state_left_by_a_transition_of_its_own_is_left_regularly():
    run = started(f"{{plot: p, states: {{a: {{{breakable('a')}, on: {{go: b}}}}, b: }}}}")
    assert modes(run.send("go")) == ["-a"]


def test_a_state_left_by_another_transition_is_interrupted():
    run = started(f"""
        plot: p
        states:
          o: {{{breakable("o")}, on: {{stop: out}}, states: {{a: {{{breakable("a")}, on: {{go: b}}}}, b: {{exit: {{switch: log, to: -b}}}}}}}}
          out:
    """)
    assert modes(run.send("stop")) == ["!a", "-o"]
    again = started("{plot: p, states: {o: {on: {stop: out}, states: {b: {exit: {switch: log, to: -b}}}}, out: }}")
    assert modes(again.send("stop")) == ["-b"]


def test_a_nested_plot_is_interrupted_when_its_holder_is_left():
    run = started(
        f"{{plot: p, states: {{h: {{use: q, {breakable('h')}, on: {{stop: out}}}}, out: }}}}",
        f"{{plot: q, states: {{a: {{{breakable('a')}}}}}}}",
    )
    assert modes(run.send("stop")) == ["!a", "-h"]


def test_the_end_of_the_run_interrupts():
    run = started(f"{{plot: p, states: {{a: {{{breakable('a')}}}}}}}")
    assert modes(run.machine.leave(run.situation())) == ["!a"]


def test_another_region_interrupts_only_what_its_transition_leaves():
    run = started(f"""
        plot: p
        states:
          o:
            regions:
              r1: {{states: {{x: {{{breakable("x")}, on: {{go: x2}}}}, x2: }}}}
              r2: {{states: {{y: {{{breakable("y")}, on: {{go: y2}}}}, y2: }}}}
    """)
    assert modes(run.send("go")) == ["-y", "-x"]


# -- connectors --------------------------------------------------------------------------------------------

CHOICE = """
    plot: p
    variables: {n: {type: number, initial: 0}}
    states:
      a: {on: {go: {to: which, assign: {n: ?event.n}}}}
      which: {choice: [{when: (> ?n 5), to: many}, {when: (p), to: known, assign: {n: 100}}, few]}
      many:
      known:
      few:
"""


@pytest.mark.parametrize(("n", "facts", "state"), [(9, [], "many"), (1, [Fact("p")], "known"), (1, [], "few")])
def test_a_choice_leads_on_by_the_first_condition_that_holds_after_the_way_in(n, facts, state):
    run = started(CHOICE, facts=facts)
    step = run.send("go", n=n)
    assert run.active == [state]
    assert step.entered("which")
    assert run.variables()["n"] == (100 if state == "known" else n)


SELECT = """
    plot: p
    states:
      a: {on: {found: kind}}
      kind: {select: ?event.kind, cases: {cup: wash, 2: two, can: {to: throw, when: (p)}}, else: ask}
      wash:
      two:
      throw:
      ask:
"""


@pytest.mark.parametrize(("kind", "state"), [("cup", "wash"), (2, "two"), ("can", "ask"), ("plate", "ask")])
def test_a_selection_leads_on_by_value(kind, state):
    run = started(SELECT)
    run.send("found", kind=kind)
    assert run.active == [state]


def test_a_connector_may_be_the_way_into_a_composite_a_region_or_a_plot():
    entrance = "{choice: [{when: (p), to: %s}, %s]}"
    text = f"""
        plot: p
        states:
          first: {entrance % ("o", "o")}
          o:
            regions:
              r1: {{states: {{c1: {entrance % ("x", "y")}, x: , y: }}}}
              r2: {{states: {{c2: {entrance % ("v", "w")}, v: {{initial: c3, states: {{c3: {entrance % ("deep", "deep")}, deep: }}}}, w: }}}}
    """
    assert started(text, facts=[Fact("p")]).active == ["o", "x", "v", "deep"]
    assert started(text).active == ["o", "y", "w"]


def test_connectors_may_follow_each_other():
    run = started(
        """
        plot: p
        states:
          one: {choice: [{when: (p), to: two}, none]}
          two: {choice: [{when: (q), to: both}, one_only]}
          none:
          both:
          one_only:
    """,
        facts=[Fact("p"), Fact("q")],
    )
    assert run.active == ["both"]


# -- what is passed, what is handed back -------------------------------------------------------------------

PASSING = """
    plot: p
    states:
      look: {use: looking, on: {done: {to: take, pass: {item: ?event.best}}, go: take}}
      take: {use: taking, with: {item: any, hand: left}, on: {again: {to: take, pass: {hand: right}}}}
"""
LOOKING = """
    plot: looking
    outputs: {best: {type: symbol, initial: nothing}, n: {type: number, initial: 0}}
    states:
      a: {on: {saw: {to: b, assign: {best: ?event.item, n: (+ ?n 1)}}}}
      b: {final: true}
"""
TAKING = "{plot: taking, parameters: {item: symbol, hand: symbol}, states: {a: }}"


def test_a_plots_outputs_come_with_done_and_can_be_passed_on():
    run = started(PASSING, LOOKING, TAKING)
    run.send("saw", item="cup3")
    assert run.variables("take") == {"item": "cup3", "hand": "left"}


def test_without_anything_passed_the_states_own_arguments_count():
    run = started(PASSING, LOOKING, TAKING)
    run.send("go")
    assert run.variables("take") == {"item": "any", "hand": "left"}
    run.send("again")
    assert run.variables("take") == {"item": "any", "hand": "right"}


def test_an_output_has_its_initial_value_until_it_is_assigned():
    run = started(
        "{plot: p, variables: {w: symbol}, states: {h: {use: q, on: {done: {to: e, assign: {w: ?event.o}}}}, e: }}",
        "{plot: q, outputs: {o: {type: symbol, initial: none}}, states: {a: {final: true}}}",
    )
    assert run.variables()["w"] == "none"


def test_passed_values_are_for_the_target_alone():
    run = started(
        "{plot: p, states: {a: {on: {go: {to: o, pass: {x: 1}}}}, o: {states: {h: {use: q, with: {x: 2}}}}}}",
        "{plot: q, parameters: {x: number}, states: {s: }}",
    )
    run.send("go")
    assert run.variables("h") == {"x": 2}


def test_passed_values_reach_the_candidates_of_a_dynamic_state():
    library = Library(
        map(
            plot,
            (
                "{plot: p, states: {a: {on: {go: {to: d, pass: {n: ?event.n}}}}, d: {dynamic: [q], with: {n: 0}, on: {no_candidate: none}}, none: }}",
                "{plot: q, parameters: {n: number}, when: (> ?n 3), states: {s: }}",
            ),
        )
    )
    knowledge = KnowledgeBase(Schema.parse("(define (domain d))"))
    for n, active in ((7, ("d", "d/s")), (2, ("none",))):
        machine = Machine(library)
        machine.start("p", {}, KnowledgeSituation(knowledge, library))
        step = machine.send(Event("go", {"n": n}), KnowledgeSituation(knowledge, library))
        assert step.state.configuration() == active
    assert step.decisions[0].decision.chosen is None


def test_a_value_that_cannot_be_passed_is_an_error_of_the_plot():
    run = started(
        "{plot: p, states: {a: {on: {go: {to: h, pass: {x: ?event.nothing}}}}, h: {use: q, on: {error: e}}, e: }}",
        "{plot: q, parameters: {x: {type: number, default: 5}}, states: {s: }}",
    )
    run.send("go")
    assert run.active == ["e"]


# -- history that is cleared -------------------------------------------------------------------------------

PLAYER = """
    plot: p
    dialect: scxml
    states:
      off: {on: {on: h, fresh: {to: h, clear: player}, all: {to: h, clear: "player*"}}}
      player:
        initial: song
        on: {off: off}
        states:
          h: {history: shallow, to: song}
          song: {on: {next: album, resume: deep}}
          album:
            initial: one
            states: {deep: {history: shallow, to: one}, one: {on: {next: two}}, two: }
"""


def at_two():
    run = started(PLAYER)
    for name in ("on", "next", "next", "off"):
        run.send(name)
    return run


def test_a_history_remembers():
    run = at_two()
    run.send("on")
    assert run.active == ["player", "album", "one"]


def test_a_cleared_history_leads_where_it_leads_at_first():
    run = at_two()
    run.send("fresh")
    assert run.active == ["player", "song"]
    run.send("resume")
    assert run.active == ["player", "album", "two"]


def test_a_star_clears_all_levels_below():
    run = at_two()
    run.send("all")
    run.send("resume")
    assert run.active == ["player", "album", "one"]


def test_an_orthogonal_state_is_cleared_with_the_histories_of_its_regions():
    run = started("""
        plot: p
        dialect: scxml
        states:
          out: {on: {in: {to: h, also: [h2], clear: o}}}
          o:
            on: {out: out}
            regions:
              r1: {states: {h: {history: shallow, to: a}, a: {on: {go: b}}, b: }}
              r2: {states: {h2: {history: shallow, to: c}, c: {on: {go: d}}, d: }}
    """)
    for name in ("in", "go", "out", "in"):
        run.send(name)
    assert run.active == ["o", "a", "c"]

"""A chart at work with skills, in simulated time: order, cancelling, answers, ends, and the same run twice."""

from __future__ import annotations

import asyncio
import threading

import pytest
from charts import plot

from dsc.dynamic.library import Library
from dsc.events import Event
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.sequencer.sequencer import Sequencer
from dsc.skills import Component, Outcome, check_arguments, skill
from dsc.trace import Trace
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.facts import Delta, Fact, fact
from knowledge_base.schema import Schema
from knowledge_base.store import KnowledgeBase

SCHEMA = Schema.parse("""
    (define (domain kitchen)
      (:types item - object)
      (:predicates (seen ?i - item) (p) (q) (told)))
""")

SLOW = 1000.0


class Arm(Component):
    """Skills that end in every way there is; `log` is what happened, in order, with the time."""

    name = "arm"

    def __init__(self, name=None, slow_to_configure=0.0):
        super().__init__(name)
        self.log = []
        self.clock = None
        self.slow = slow_to_configure

    def note(self, text):
        self.log.append(text)

    async def configure(self, parameter, value):
        if self.slow:
            await asyncio.sleep(self.slow)
        if value == "impossible":
            raise RuntimeError("cannot be set")
        await super().configure(parameter, value)
        self.note(f"{parameter}={value}")

    async def switch(self, mode):
        if self.slow:
            await asyncio.sleep(self.slow)
        await super().switch(mode)
        self.note(f"mode {mode}")

    @skill(outcomes={"grasped": {}, "slipped": {"item": "item"}}, types={"item": "item"})
    async def grasp(self, call, item="cup1", seconds=2.0, ends="grasped"):
        self.note(f"grasp {item}")
        try:
            await call.clock.sleep(seconds)
        except asyncio.CancelledError:
            self.note("cancelled")
            raise
        return Outcome(ends, {"item": item} if ends == "slipped" else {})

    @skill(outcomes={"found": {"item": "item"}, "glimpse": {"n": "number"}})
    async def look(self, call, glimpses=0, seconds=1.0):
        for n in range(glimpses):
            await call.clock.sleep(seconds)
            call.report(Outcome("glimpse", {"n": n}, Delta(added=(Fact("p"),))))
        await call.clock.sleep(seconds)
        return Outcome("found", {"item": "cup1"}, Delta(nodes={"cup1": "item"}, added=(fact("seen", "cup1"),)))

    @skill(outcomes={"ok": {}})
    async def breaks(self, call, how="raise"):
        await call.clock.sleep(1)
        if how == "raise":
            raise RuntimeError("the gripper is stuck")
        if how == "timeout":
            raise TimeoutError("the bus does not answer")
        if how == "cancel":
            raise asyncio.CancelledError
        if how == "undeclared":
            return Outcome("splendid")
        if how == "nothing":
            return None
        if how == "no_data":
            return Outcome("ok", {"thing": object()})
        return Outcome("ok", observed=Delta(added=(fact("nonsense", "x"),)))

    @skill(outcomes={"ok": {}})
    async def waits_for_a_thread(self, call):
        with call.clock.hold():
            await asyncio.to_thread(threading.Event().wait, 0.02)
        return Outcome("ok")


class Ran:
    """A whole run: how it ended, when, what was traced and what is known then."""

    def __init__(self, text, *inner, arm=None, prepare=None, facts=(), open_ended=False, arguments=None):
        self.kb = KnowledgeBase(SCHEMA)
        self.kb.apply(Delta(added=tuple(facts)), "test")
        self.arm = arm or Arm()
        self.records = []
        library = Library([plot(text), *map(plot, inner)])

        async def main():
            clock = LoopClock()
            trace = Trace(clock.now)
            trace.listen(self.records.append)
            sequencer = Sequencer(library, self.kb, [self.arm], clock, trace, open_ended=open_ended)
            self.sequencer = sequencer
            if prepare is not None:
                prepare(sequencer)
            self.end = await sequencer.run(library_first, arguments or {})
            self.at = clock.now()

        library_first = next(iter(library)).name
        run_simulated(main())

    def of_type(self, type_):
        return [record.data for record in self.records if record.type == type_]

    @property
    def lines(self):
        return [record.to_line() for record in self.records]


GRASP = """
    plot: p
    emits: {lost: {item: item}}
    states:
      a: {entry: {trigger: arm.grasp, with: {item: cup1}}, on: {grasped: e, slipped: {to: e, emit: lost, with: {item: ?event.item}}}}
      e: {final: true}
"""


# -- everyday ----------------------------------------------------------------------------------------------


def test_a_skill_is_started_and_its_outcome_moves_the_chart():
    ran = Ran(GRASP)
    assert ran.end.finished
    assert ran.end.problem is None
    assert ran.at == pytest.approx(2)
    assert ran.arm.log == ["grasp cup1"]


def test_the_outcome_of_the_plot_is_handed_out():
    ran = Ran(GRASP.replace("{item: cup1}}, on", "{item: cup1, ends: slipped}}, on"))
    assert ran.end.emitted == (Event("lost", {"item": "cup1"}),)


def test_an_outcome_may_have_another_name_in_the_chart():
    ran = Ran("""
        plot: p
        states:
          a: {entry: {trigger: arm.grasp, as: {grasped: taken}}, on: {taken: e}}
          e: {final: true}
    """)
    assert ran.end.finished
    (event,) = ran.of_type("event")
    assert (event["name"], event["original"], event["source"]) == ("taken", "grasped", "arm.grasp")


def test_a_component_is_configured_before_the_skill_that_follows_is_started():
    ran = Ran(
        """
        plot: p
        states:
          a:
            entry: [{set: arm.approach, to: side}, {switch: arm, to: careful}, {trigger: arm.grasp}]
            on: {grasped: e}
          e: {final: true}
        """,
        arm=Arm(slow_to_configure=5),
    )
    assert ran.arm.log == ["approach=side", "mode careful", "grasp cup1"]
    assert ran.at == pytest.approx(12)


def test_two_skills_of_one_state_run_side_by_side():
    ran = Ran("""
        plot: p
        variables: {n: {type: number, initial: 0}}
        states:
          a:
            entry: [{trigger: arm.grasp, with: {item: cup1}}, {trigger: arm.grasp, with: {item: cup2, seconds: 3}}]
            on: {grasped: [{to: e, when: (= ?n 1)}, {assign: {n: 1}}]}
          e: {final: true}
    """)
    assert ran.at == pytest.approx(3)


def test_intermediate_reports_reach_the_chart_and_the_knowledge_base():
    ran = Ran("""
        plot: p
        variables: {n: {type: number, initial: 0}}
        states:
          a:
            entry: {trigger: arm.look, with: {glimpses: 3}}
            on:
              glimpse: {assign: {n: (+ ?n 1)}}
              found: [{to: e, when: (and (= ?n 3) (p))}, wrong]
          wrong:
          e: {final: true}
    """)
    assert ran.end.finished
    assert ran.at == pytest.approx(4)


# -- leaving -----------------------------------------------------------------------------------------------


def test_leaving_a_state_cancels_its_skill_before_the_exit_actions():
    ran = Ran(f"""
        plot: p
        states:
          a:
            entry: {{trigger: arm.grasp, with: {{seconds: {SLOW}}}}}
            exit: {{switch: arm, to: neutral}}
            after: {{seconds: 3, to: e}}
            on: {{grasped: e}}
          e: {{after: {{seconds: 1, to: f}}}}
          f: {{final: true}}
    """)
    assert ran.at == pytest.approx(4)
    assert ran.arm.log == ["grasp cup1", "cancelled", "mode neutral"]


def test_the_exit_actions_of_the_last_step_are_carried_out_too():
    ran = Ran(
        """
        plot: p
        states:
          a: {entry: {trigger: arm.grasp}, exit: {switch: arm, to: neutral}, on: {grasped: e}}
          e: {final: true}
        """,
        arm=Arm(slow_to_configure=1),
    )
    assert ran.end.finished
    assert ran.arm.log == ["grasp cup1", "mode neutral"]


def test_a_state_left_while_its_component_is_configured_spoils_nothing():
    ran = Ran(
        """
        plot: p
        states:
          a:
            entry: [{set: arm.approach, to: side}, {trigger: arm.grasp, with: {item: cup1}}]
            exit: {switch: arm, to: neutral}
            after: {seconds: 1, to: b}
            on: {grasped: e}
          b: {entry: {trigger: arm.grasp, with: {item: cup2}}, on: {grasped: e}}
          e: {final: true}
        """,
        arm=Arm(slow_to_configure=5),
    )
    assert ran.end.finished
    assert ran.arm.log == ["approach=side", "mode neutral", "grasp cup2"]


def test_a_timeout_of_a_state_that_was_left_does_nothing():
    ran = Ran("""
        plot: p
        states:
          a: {entry: {trigger: arm.grasp}, after: {seconds: 5, to: wrong}, on: {grasped: b}}
          b: {after: {seconds: 10, to: e}}
          wrong:
          e: {final: true}
    """)
    assert ran.at == pytest.approx(12)
    assert [event["source"] for event in ran.of_type("event")] == ["arm.grasp", "timer"]


def test_several_timeouts_of_a_state_each_come_in_time():
    ran = Ran("""
        plot: p
        variables: {n: {type: number, initial: 0}}
        states:
          a: {after: [{seconds: 0.3, assign: {n: 1}}, {seconds: 0.1, assign: {n: 2}}, {seconds: 0.7, to: e, when: (= ?n 1)}]}
          e: {final: true}
    """)
    assert ran.end.finished
    assert ran.at == pytest.approx(0.7)


def test_what_was_observed_is_known_even_if_the_state_was_left_meanwhile():
    ran = Ran("""
        plot: p
        states:
          o:
            regions:
              r1: {states: {x: {entry: {trigger: arm.look, with: {seconds: 2}}, on: {found: x2}}, x2: {}}}
              r2: {states: {y: {entry: {trigger: arm.grasp, with: {seconds: 2}}, on: {grasped: y2}}, y2: {}}}
            on: {out: e}
            always: {to: e, when: (seen cup1)}
          e: {final: true}
    """.replace("(seen cup1)", "(exists (?i - item) (seen ?i))"))
    # Both answers come at the same time; the first one leaves the state, the second is dropped.
    assert ran.end.finished
    assert ran.kb.ask("(exists (?i - item) (seen ?i))")

    late = Ran("""
        plot: p
        states:
          o:
            regions:
              r1: {states: {x: {entry: {trigger: arm.grasp, with: {seconds: 2}}, on: {grasped: {emit: out}}}}}
              r2: {states: {y: {entry: {trigger: arm.look, with: {seconds: 2}}, on: {found: wrong}}, wrong: {}}}
            on: {out: b}
          b: {always: {to: e, when: (exists (?i - item) (seen ?i))}}
          e: {final: true}
    """)
    assert late.end.finished
    assert late.kb.ask("(seen cup1)")


# -- when skills go wrong ----------------------------------------------------------------------------------

BREAKS = """
    plot: p
    variables: {why: text}
    emits: {because: {why: text}}
    states:
      a:
        entry: {trigger: arm.breaks, with: {how: HOW}, within: 100}
        on: {ok: e, skill_error: {to: f, assign: {why: ?event.reason}}, timed_out: e}
      e: {final: true}
      f: {final: true, emit: because, with: {why: ?why}}
"""


@pytest.mark.parametrize(
    ("how", "reason"),
    [
        ("raise", "RuntimeError: the gripper is stuck"),
        ("timeout", "TimeoutError: the bus does not answer"),
        ("cancel", "CancelledError"),
        ("undeclared", "'splendid', which it does not declare"),
        ("nothing", "None"),
        ("no_data", "object"),
    ],
)
def test_whatever_a_skill_does_wrong_is_a_skill_error(how, reason):
    ran = Ran(BREAKS.replace("HOW", how))
    assert ran.end.finished
    (event,) = ran.end.emitted
    assert reason in event.attributes["why"]


def test_an_observation_the_schema_does_not_know_ends_the_run_with_a_problem():
    ran = Ran(BREAKS.replace("HOW", "observes"))
    assert not ran.end.finished
    assert "nonsense" in ran.end.problem


def test_a_skill_that_takes_too_long_is_cancelled_and_timed_out():
    ran = Ran(f"""
        plot: p
        states:
          a: {{entry: {{trigger: arm.grasp, with: {{seconds: {SLOW}}}, within: 3}}, on: {{grasped: wrong, timed_out: e}}}}
          wrong:
          e: {{final: true}}
    """)
    assert ran.at == pytest.approx(3)
    assert ran.arm.log == ["grasp cup1", "cancelled"]
    (event,) = ran.of_type("event")
    assert event["attributes"] == {"skill": "arm.grasp", "seconds": 3.0}


def test_a_skill_has_a_bound_even_if_nobody_says_so():
    ran = Ran(GRASP.replace("{item: cup1}}, on", "{seconds: 1000000}}, on"))
    assert not ran.end.finished
    assert "nobody handles 'timed_out' of arm.grasp" in ran.end.problem


@pytest.mark.parametrize("entry", ["{trigger: arm.grap}", "{trigger: arm.grasp, with: {itm: cup1}}", "{trigger: arm.grasp}"])
def test_a_wrong_call_of_a_skill_is_a_skill_error_that_says_so(entry):
    class Strict(Arm):
        @skill(outcomes={"grasped": {}})
        async def grasp(self, call, item):
            return Outcome("grasped")

    ran = Ran("{plot: p, states: {a: {entry: " + entry + ", on: {grasped: e}}, e: {final: true}}}", arm=Strict())
    assert not ran.end.finished
    assert "nobody handles 'skill_error'" in ran.end.problem
    assert "grasp" in ran.end.problem


def test_a_component_that_cannot_be_configured_fails_the_skill_that_needs_it():
    ran = Ran("""
        plot: p
        states:
          a:
            entry: [{set: arm.approach, to: impossible}, {trigger: arm.grasp}]
            on: {grasped: wrong, skill_error: b}
          b: {entry: [{set: arm.approach, to: side}, {trigger: arm.grasp}], on: {grasped: e}}
          wrong:
          e: {final: true}
    """)
    assert ran.end.finished
    assert ran.arm.log == ["approach=side", "grasp cup1"]
    assert "cannot be set" in ran.of_type("event")[0]["attributes"]["reason"]


def test_a_component_that_is_for_ever_being_configured_is_timed_out():
    ran = Ran(
        """
        plot: p
        states:
          a: {entry: [{set: arm.x, to: 1}, {trigger: arm.grasp, within: 3}], on: {grasped: e, timed_out: e}}
          e: {final: true}
        """,
        arm=Arm(slow_to_configure=1e6),
    )
    assert ran.end.finished
    assert ran.at < 1000


# -- ends --------------------------------------------------------------------------------------------------


def test_an_outcome_nobody_handles_ends_the_run_with_a_problem():
    ran = Ran("{plot: p, states: {a: {entry: {trigger: arm.grasp}, on: {slipped: e}}, e: {final: true}}}")
    assert not ran.end.finished
    assert ran.end.problem == "nobody handles 'grasped' of arm.grasp"
    assert ran.of_type("end") == [{"finished": False, "problem": ran.end.problem}]


def test_an_outcome_whose_guards_do_not_hold_ends_the_run_with_a_problem():
    ran = Ran("{plot: p, states: {a: {entry: {trigger: arm.grasp}, on: {grasped: {to: e, when: (p)}}}, e: {final: true}}}")
    assert "nobody handles 'grasped'" in ran.end.problem


def test_nothing_to_wait_for_ends_the_run_with_a_problem():
    ran = Ran("{plot: p, states: {a: {on: {stop: e}}, e: {final: true}}}")
    assert not ran.end.finished
    assert ran.end.problem == "nothing is going on and nothing can happen any more"


def test_a_timeout_that_leads_nowhere_does_not_keep_the_run_alive():
    ran = Ran("{plot: p, states: {a: {after: [{seconds: 0.1, to: e, when: (p)}, {seconds: 0.3, to: e, when: (p)}]}, e: {final: true}}}")
    assert "nothing is going on" in ran.end.problem
    assert ran.at == pytest.approx(0.3)


def test_an_error_of_the_chart_ends_the_run_with_a_problem():
    ran = Ran("{plot: p, states: {a: {entry: {trigger: arm.grasp}, on: {grasped: {to: e, tell: (nonsense)}}}, e: {final: true}}}")
    assert "nonsense" in ran.end.problem


@pytest.mark.parametrize(
    "states",
    [
        "{a: {always: b}, b: {always: a}}",
        "{a: {entry: {trigger: arm.grasp}, on: {grasped: b}}, b: {always: c}, c: {always: b}}",
        "{a: {use: p}}",
    ],
)
def test_a_chart_that_goes_round_in_circles_ends_the_run_with_a_problem(states):
    ran = Ran("{plot: p, states: " + states + "}")
    assert not ran.end.finished
    assert "goes round" in ran.end.problem or "nested deeper" in ran.end.problem
    assert ran.of_type("end") == [{"finished": False, "problem": ran.end.problem}]


@pytest.mark.parametrize("entry", ["{trigger: am.grasp}", "{set: am.x, to: 1}", "{switch: am, to: up}"])
@pytest.mark.parametrize("at_once", [True, False])
def test_a_component_that_is_not_there_ends_the_run_with_a_problem(entry, at_once):
    first = "a: {always: b}" if at_once else "a: {after: {seconds: 1, to: b}}"
    ran = Ran("{plot: p, states: {" + first + ", b: {entry: " + entry + ", on: {grasped: e}}, e: {final: true}}}")
    assert not ran.end.finished
    assert "there is no component 'am'; did you mean 'arm'?" in ran.end.problem


def test_a_wrong_start_is_refused():
    with pytest.raises(UnknownNameError, match="has no parameter 'x'"):
        Ran(GRASP, arguments={"x": 1})


# -- from outside ------------------------------------------------------------------------------------------

STOPPABLE = f"""
    plot: p
    receives: {{stop: }}
    states:
      work:
        on: {{stop: stopped}}
        states: {{a: {{entry: {{trigger: arm.grasp, with: {{seconds: {SLOW}}}, within: {SLOW * 2}}}, on: {{grasped: a}}}}}}
      stopped: {{final: true}}
"""


def post_after(seconds, event):
    def prepare(sequencer):
        asyncio.get_running_loop().call_later(seconds, sequencer.post, event)

    return prepare


def test_an_operators_stop_is_obeyed_while_a_skill_runs():
    ran = Ran(STOPPABLE, prepare=post_after(7, Event("stop")))
    assert ran.end.finished
    assert ran.at == pytest.approx(7)
    assert ran.arm.log == ["grasp cup1", "cancelled"]


def test_an_event_handed_in_before_the_start_is_taken_after_it():
    ran = Ran(STOPPABLE, prepare=lambda sequencer: sequencer.post(Event("stop")))
    assert ran.end.finished
    assert ran.at == 0


def test_a_run_may_wait_for_events_from_outside():
    text = "{plot: p, receives: {go: }, states: {a: {on: {go: e}}, e: {final: true}}}"
    ran = Ran(text, prepare=post_after(100, Event("go")), open_ended=True)
    assert ran.end.finished
    assert ran.at == pytest.approx(100)


def test_a_change_of_knowledge_from_outside_is_seen_at_once():
    def prepare(sequencer):
        loop = asyncio.get_running_loop()
        loop.call_later(5, sequencer.change, Delta(added=(Fact("q"),)), "somebody")

    ran = Ran("{plot: p, states: {a: {always: {to: e, when: (q)}, after: {seconds: 50, to: a}}, e: {final: true}}}", prepare=prepare)
    assert ran.at == pytest.approx(5)
    (change,) = ran.of_type("knowledge")
    assert (change["author"], change["added"]) == ("somebody", ["(q)"])


# -- knowledge and trace -----------------------------------------------------------------------------------


def test_what_was_observed_is_known_before_the_event_is_handled():
    ran = Ran("""
        plot: p
        states:
          a: {entry: {trigger: arm.look}, on: {found: {to: e, when: (seen ?event.item), tell: (told)}}}
          e: {final: true}
    """)
    assert ran.end.finished
    assert [(change["author"], change["added"]) for change in ran.of_type("knowledge")] == [
        ("arm", ["(seen cup1)"]),
        ("chart", ["(told)"]),
    ]


def test_every_record_names_what_caused_it():
    ran = Ran("""
        plot: p
        states:
          a: {entry: {trigger: arm.look}, on: {found: {to: e, tell: (told)}}}
          e: {final: true}
    """)
    by_seq = {record.seq: record for record in ran.records}
    assert [record.seq for record in ran.records] == list(range(1, len(ran.records) + 1))
    chain = []
    record = next(r for r in ran.records if r.type == "knowledge" and r.data["author"] == "chart")
    while record is not None:
        chain.append(record.type)
        record = by_seq.get(record.cause)
    assert chain == ["knowledge", "step", "event", "action", "step"]


BUSY = """
    plot: p
    states:
      o:
        on: {done: e}
        regions:
          r1:
            states:
              a: {entry: [{set: arm.x, to: 1}, {trigger: arm.grasp}], on: {grasped: b}}
              b: {entry: {trigger: arm.look, with: {glimpses: 2}}, on: {found: c, glimpse: {tell: (q)}}}
              c: {final: true}
          r2:
            states:
              d: {entry: {trigger: arm.grasp, with: {item: cup2, ends: slipped}}, on: {slipped: f, grasped: f}}
              f: {after: {seconds: 3, to: g}}
              g: {final: true}
      e: {final: true}
"""


def test_the_same_run_twice_gives_the_same_trace():
    one, other = Ran(BUSY), Ran(BUSY)
    assert one.end.finished
    assert one.lines == other.lines
    assert len(one.lines) > 10


def test_a_component_counts_as_busy_until_its_answer_is_taken():
    seen = []

    class Watched(Arm):
        async def switch(self, mode):
            seen.append(sorted(ran_holder[0].dispatcher.busy))

    ran_holder = []
    Ran(
        """
        plot: p
        states:
          a: {entry: [{trigger: arm.grasp}], after: {seconds: 1, to: b}, on: {grasped: e}}
          b: {entry: [{switch: arm, to: up}], after: {seconds: 1, to: e}}
          e: {final: true}
        """,
        arm=Watched(),
        prepare=ran_holder.append,
    )
    assert seen == [[]]  # what was cancelled is busy no more
    ran_holder.clear()
    Ran(
        """
        plot: p
        states:
          a: {entry: [{trigger: arm.grasp}, {switch: arm, to: up}], on: {grasped: e}}
          e: {final: true}
        """,
        arm=Watched(),
        prepare=ran_holder.append,
    )
    assert seen[1:] == [["arm"]]


def test_time_stands_still_while_a_thread_works():
    ran = Ran("""
        plot: p
        states:
          a: {entry: {trigger: arm.waits_for_a_thread}, after: {seconds: 0.001, to: wrong}, on: {ok: e}}
          wrong:
          e: {final: true}
    """)
    assert ran.end.finished
    assert ran.at == 0


def test_arguments_and_answers_are_copies():
    class Greedy(Arm):
        @skill(outcomes={"ok": {"things": None}})
        async def take(self, call, things):
            things.append("mine")
            return Outcome("ok", {"things": things})

    made = {"things": ["yours"]}
    ran = Ran(
        """
        plot: p
        parameters: {things: symbol}
        emits: {end: {yours: symbol, mine: symbol}}
        variables: {got: symbol}
        states:
          a: {entry: {trigger: arm.take, with: {things: ?things}}, on: {ok: {to: e, assign: {got: ?event.things}}}}
          e: {final: true, emit: end, with: {yours: ?things, mine: ?got}}
        """,
        arm=Greedy(),
        arguments=made,
    )
    assert ran.end.emitted[0].attributes == {"yours": ["yours"], "mine": ["yours", "mine"]}


# -- components --------------------------------------------------------------------------------------------


def test_a_component_tells_its_skills():
    signature = Arm("left").skills()["grasp"]
    assert signature.component == "left"
    assert signature.parameters == {"item": "item", "seconds": None, "ends": None}
    assert signature.optional == {"item", "seconds", "ends"}
    assert signature.outcomes == {"grasped": {}, "slipped": {"item": "item"}}
    assert set(Arm().skills()) == {"grasp", "look", "breaks", "waits_for_a_thread"}


def test_arguments_are_checked_against_the_signature():
    class Strict(Component):
        @skill(outcomes={})
        async def go(self, call, to, speed=1):
            return Outcome("ok")

    signature = Strict().skills()["go"]
    check_arguments(signature, {"to": 1})
    with pytest.raises(InputError, match=r"'strict\.go' needs its parameter 'to'"):
        check_arguments(signature, {})
    with pytest.raises(UnknownNameError, match="did you mean 'speed'"):
        check_arguments(signature, {"to": 1, "sped": 2})


def test_components_remember_parameters_and_modes():
    async def main():
        component = Component("c")
        assert component.mode == "neutral"
        await component.configure("x", 1)
        await component.switch("up")
        return component

    component = run_simulated(main())
    assert component.parameters == {"x": 1}
    assert component.mode == "up"

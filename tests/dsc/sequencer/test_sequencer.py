"""A chart at work in simulated time: everyday runs, ends, events from outside, and what is recorded."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from dsc_charts import plot
from dsc_runs import SCHEMA, SLOW, Arm, Item, Ran

from dsc.calls import SkillCall
from dsc.dynamic.library import Library
from dsc.events import Event
from dsc.outcomes import Outcome
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.sequencer.sequencer import Sequencer
from dsc.skills import skill
from dsc.trace import Record
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.facts import Delta, Fact, fact
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema import Schema

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
    ran = Ran(GRASP.replace("{item: cup1}}, on", "{item: cup1, ends: slipped}}, on"), things=["cup1"])
    assert ran.end.emitted == (Event("lost", {"item": "cup1"}),)


def test_a_plot_that_emits_for_ever_keeps_the_latest_outcomes_and_one_of_each_name():
    ran = Ran("""
        plot: p
        variables: {n: {type: number, initial: 0}}
        emits: {gave_up: {reason: symbol}, count: {n: number}}
        states:
          a: {on: {done: {to: b, emit: gave_up, with: {reason: early}}}}
          b:
            on:
              done:
                - {when: (< ?n 150), to: b, assign: {n: (+ ?n 1)}, emit: count, with: {n: ?n}}
                - {to: e}
          e: {final: true}
    """)
    first, *others = ran.end.emitted
    assert first == Event("gave_up", {"reason": "early"})
    assert [event.attributes["n"] for event in others] == list(range(51, 151))
    assert not ran.end.reached


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


@pytest.mark.parametrize(("concurrent", "at"), [(True, 3), (False, 5)])
def test_two_skills_of_one_state_run_side_by_side_on_a_concurrent_component(concurrent, at):
    ran = Ran(
        """
        plot: p
        variables: {n: {type: number, initial: 0}}
        states:
          a:
            entry: [{trigger: arm.grasp, with: {item: cup1}}, {trigger: arm.grasp, with: {item: cup2, seconds: 3}}]
            on: {grasped: [{to: e, when: (= ?n 1)}, {assign: {n: 1}}]}
          e: {final: true}
    """,
        arm=Arm(concurrent=concurrent),
    )
    assert ran.at == pytest.approx(at)


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


# -- ends --------------------------------------------------------------------------------------------------


def test_an_outcome_nobody_handles_ends_the_run_with_a_problem():
    ran = Ran("{plot: p, states: {a: {entry: {trigger: arm.grasp}, on: {slipped: e}}, e: {final: true}}}")
    assert not ran.end.finished
    assert ran.end.problem == "no transition handles 'grasped' of arm.grasp; the caller is state 'a' of plot 'p'"
    (end,) = ran.of_type("end")
    assert (end["finished"], end["reached"], end["problem"]) == (False, False, ran.end.problem)


def test_an_outcome_whose_guards_do_not_hold_ends_the_run_with_a_problem():
    ran = Ran(
        "{plot: p, states: {a: {entry: {trigger: arm.grasp}, on: {grasped: {to: e, when: (p)}}}, e: {final: true}}}"
    )
    assert "no transition handles 'grasped'" in (ran.end.problem or "")


def test_nothing_to_wait_for_ends_the_run_with_a_problem():
    ran = Ran("{plot: p, states: {a: {on: {stop: e}}, e: {final: true}}}")
    assert not ran.end.finished
    assert ran.end.problem == "deadlock: no skill, timer or event is pending"


def test_a_timeout_that_leads_nowhere_does_not_keep_the_run_alive():
    ran = Ran(
        "{plot: p, states: {a: {after: [{seconds: 0.1, to: e, when: (p)}, {seconds: 0.3, to: e, when: (p)}]}, e: {final: true}}}"
    )
    assert "deadlock: no skill, timer or event is pending" in (ran.end.problem or "")
    assert ran.at == pytest.approx(0.3)


def test_an_error_of_the_chart_ends_the_run_with_a_problem():
    ran = Ran(
        "{plot: p, states: {a: {entry: {trigger: arm.grasp}, on: {grasped: {to: e, tell: (nonsense)}}}, e: {final: true}}}"
    )
    assert "nonsense" in (ran.end.problem or "")


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
    assert "goes round" in (ran.end.problem or "") or "nested deeper" in (ran.end.problem or "")
    (end,) = ran.of_type("end")
    assert (end["finished"], end["reached"], end["problem"]) == (False, False, ran.end.problem)


@pytest.mark.parametrize("entry", ["{trigger: am.grasp}", "{set: am.x, to: 1}", "{switch: am, to: up}"])
@pytest.mark.parametrize("at_once", [True, False])
def test_a_component_that_is_never_deployed_is_in_the_end_of_the_run(entry, at_once):
    first = "a: {always: b}" if at_once else "a: {after: {seconds: 1, to: b}}"
    ran = Ran("{plot: p, states: {" + first + ", b: {entry: " + entry + ", on: {grasped: e}}, e: {final: true}}}")
    assert not ran.end.finished
    assert "there is no component 'am'; did you mean 'arm'?" in (ran.end.problem or "")


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

    ran = Ran(
        "{plot: p, states: {a: {always: {to: e, when: (q)}, after: {seconds: 50, to: a}}, e: {final: true}}}",
        prepare=prepare,
    )
    assert ran.at == pytest.approx(5)
    (change,) = ran.of_type("knowledge")
    assert (change["author"], change["added"]) == ("somebody", [["q"]])


# -- knowledge and trace -----------------------------------------------------------------------------------


def test_an_observation_is_known_before_its_event_is_handled():
    ran = Ran("""
        plot: p
        states:
          a: {entry: {trigger: arm.look}, on: {found: {to: e, when: (seen ?event.item), tell: (told)}}}
          e: {final: true}
    """)
    assert ran.end.finished
    assert [(change["author"], change["added"]) for change in ran.of_type("knowledge")] == [
        ("arm", [["seen", "cup1"]]),
        ("chart", [["told"]]),
    ]


def test_every_record_names_what_caused_it():
    ran = Ran("""
        plot: p
        states:
          a: {entry: {trigger: arm.look}, on: {found: {to: e, tell: (told)}}}
          e: {final: true}
    """)
    by_seq: dict[int | None, Record] = {record.seq: record for record in ran.records}
    assert [record.seq for record in ran.records] == list(range(1, len(ran.records) + 1))
    chain = []
    record: Record | None = next(r for r in ran.records if r.type == "knowledge" and r.data["author"] == "chart")
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
    one, other = Ran(BUSY, things=["cup2"]), Ran(BUSY, things=["cup2"])
    assert one.end.finished
    assert one.lines == other.lines
    assert len(one.lines) > 10


def test_a_component_counts_as_busy_until_its_answer_is_taken():
    seen = []

    class Watched(Arm):
        async def switch(self, mode):
            seen.append(sorted(start.component for start in ran_holder[0].dispatcher.started()))

    ran_holder: list[Sequencer] = []
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


class Ok(Outcome):
    things: object


def test_arguments_and_answers_are_copies():
    class Greedy(Arm):
        @skill
        async def collect(self, call, things) -> Ok:
            things.append("mine")
            return Ok(things=things)

    made = {"things": ["yours"]}
    ran = Ran(
        """
        plot: p
        parameters: {things: list of symbol}
        emits: {end: {yours: list of symbol, mine: list of symbol}}
        variables: {got: list of symbol}
        states:
          a: {entry: {trigger: arm.collect, with: {things: ?things}}, on: {ok: {to: e, assign: {got: ?event.things}}}}
          e: {final: true, emit: end, with: {yours: ?things, mine: ?got}}
        """,
        arm=Greedy(),
        arguments=made,
    )
    assert ran.end.emitted[0].attributes == {"yours": ["yours"], "mine": ["yours", "mine"]}


def test_a_run_that_ends_with_a_problem_puts_its_components_at_rest():
    ran = Ran(
        """
        plot: p
        states:
          a:
            entry: {switch: arm, to: busy}
            exit: {switch: arm, to: neutral}
            on: {done: b}
            states:
              c: {entry: {trigger: arm.grasp}, exit: {set: arm.speed, to: 0}, on: {slipped: d}}
              d: {final: true}
          b: {final: true}
        """
    )
    assert "no transition handles 'grasped'" in (ran.end.problem or "")
    assert ran.arm.log[-2:] == ["speed=0", "mode neutral"]
    assert ran.of_type("end")[0]["problem"] == ran.end.problem
    assert ran.sequencer.machine.state.root is None


def test_a_run_that_is_cancelled_puts_its_components_at_rest():
    def prepare(sequencer):
        asyncio.get_running_loop().call_later(1.0, asyncio.current_task().cancel)

    arm = Arm()
    text = """
        plot: p
        states:
          a: {entry: {trigger: arm.grasp, with: {seconds: 50}}, exit: {switch: arm, to: neutral}, on: {grasped: e, slipped: e}}
          e: {final: true}
    """
    with pytest.raises(asyncio.CancelledError):
        Ran(text, arm=arm, prepare=prepare)
    assert arm.log[-1] == "mode neutral"


@pytest.mark.parametrize("name", ["done", "timed_out", "error"])
def test_events_of_the_executive_itself_cannot_be_posted_from_outside(name):
    def prepare(sequencer):
        with pytest.raises(InputError, match=f"the event '{name}' is fired by the executive itself"):
            sequencer.post(Event(name))

    Ran("{plot: p, states: {e: {final: true}}}", prepare=prepare)


# -- listening, and what is still to come ------------------------------------------------------------------


def test_a_listener_receives_every_step_before_its_actions_leave():
    def prepare(sequencer):
        sequencer.listen(lambda step: heard.append((step, list(arm.log))))
        sequencer.post(Event("nonsense"), after=1)
        sequencer.change(Delta(added=(Fact("q"),)), "somebody", after=1.5)

    heard: list[tuple[Any, list[str]]] = []
    arm = Arm()
    ran = Ran(GRASP.replace("emits:", "receives: {nonsense: }\n    emits:"), arm=arm, prepare=prepare)
    assert ran.end.finished
    assert [(step.event and step.event.name, step.moved) for step, _ in heard] == [
        (None, True), ("nonsense", False), (None, False), ("grasped", True),
    ]  # fmt: skip
    assert [log for _, log in heard] == [[], *[["grasp cup1"]] * 3]


def test_a_run_that_ends_with_a_problem_tells_the_step_that_leaves_everything():
    heard: list[Any] = []
    ran = Ran(
        "{plot: p, states: {a: {on: {stop: e}}, e: {final: true}}}",
        prepare=lambda sequencer: sequencer.listen(heard.append),
    )
    assert not ran.end.finished
    assert [step.exited("a") for step in heard] == [False, True]


def test_a_run_waits_for_what_is_still_to_come_and_for_no_longer():
    def prepare(sequencer):
        sequencer.post(Event("nonsense"), after=9)
        sequencer.change(Delta(added=(Fact("q"),)), "somebody", after=20)

    text = "{plot: p, receives: {go: , nonsense: }, states: {a: {on: {go: e}, always: {to: b, when: (q)}}, b: {on: {go: e}}, e: {final: true}}}"
    ran = Ran(text, prepare=prepare)
    assert ran.end.problem == "deadlock: no skill, timer or event is pending"
    assert ran.at == pytest.approx(20)
    assert any("b" in micro["entered"] for step in ran.of_type("step") for micro in step["microsteps"])


def test_an_event_still_pending_when_a_run_ends_is_dropped():
    listening = GRASP.replace("    emits:", "    receives: {late: }\n    emits:").replace(
        "on: {grasped", "on: {late: e, grasped"
    )
    ran = Ran(listening, prepare=lambda sequencer: sequencer.post(Event("late"), after=50))
    assert ran.end.finished
    assert ran.at == pytest.approx(2)
    assert [event["name"] for event in ran.of_type("event")] == ["grasped"]


def test_the_outcome_of_a_skill_is_no_event_from_outside():
    def post(sequencer):
        with pytest.raises(UnknownNameError, match="no plot receives the event 'slipped'"):
            sequencer.post(Event("slipped"))

    assert Ran(GRASP, prepare=post).end.finished


def test_an_event_pending_at_the_end_of_a_run_does_not_come_in_the_next_run():
    heard: list[Any] = []

    async def main():
        waits = Library(
            [plot("{plot: p, receives: {stop: }, states: {a: {after: {seconds: 3, to: e}}, e: {final: true}}}")]
        )
        sequencer = Sequencer(waits, KnowledgeBase(SCHEMA), [], LoopClock())
        sequencer.listen(heard.append)
        sequencer.post(Event("stop"), after=4)
        await sequencer.run("p")
        await sequencer.run("p")

    run_simulated(main())
    assert [step.event and step.event.name for step in heard] == [None, "after"] * 2


def test_an_invalid_event_or_change_is_refused_at_once_despite_its_delay():
    def prepare(sequencer):
        with pytest.raises(InputError, match="fired by the executive itself"):
            sequencer.post(Event("done"), after=5)
        with pytest.raises(UnknownNameError, match="'nonsense'"):
            sequencer.change(Delta(added=(Fact("nonsense"),)), "me", after=5)

    assert Ran(GRASP, prepare=prepare).at == pytest.approx(2)


def test_plots_that_share_knowledge_see_what_the_others_told_with_their_next_event():
    kb = KnowledgeBase(SCHEMA)
    library = Library(
        [
            plot("""
        plot: p
        receives: {say: null, look: null}
        states:
          a: {on: {say: {to: a, tell: (p)}, look: [{to: e, when: (p)}, a]}}
          e: {final: true}
    """)
        ]
    )

    async def main():
        clock = LoopClock()
        one, other = (Sequencer(library, kb, [], clock, open_ended=True) for _ in range(2))
        other.post(Event("look"))
        one.post(Event("say"), after=1)
        other.post(Event("look"), after=2)
        one.post(Event("look"), after=3)
        return await asyncio.gather(one.run("p"), other.run("p")), clock.now()

    ends, at = run_simulated(main())
    assert [end.finished for end in ends] == [True, True]
    assert at == pytest.approx(3)


RECEIVES = """
    plot: p
    receives: {deliver: {parcel: item, floor: number}}
    states:
      a: {on: {deliver: e}}
      e: {final: true}
"""


@pytest.mark.parametrize(
    ("attributes", "said"),
    [
        ({"parcel": "cup1"}, "the event 'deliver' needs its attribute 'floor' of type number"),
        ({"parcel": "cup1", "floor": "two"}, "the attribute 'floor' of 'deliver' is a finite number, not 'two'"),
        ({"parcel": "cup1", "flor": 2}, "the event 'deliver' has no attribute 'flor'; did you mean 'floor'?"),
        ({"parcel": "cap1", "floor": 2}, "there is no object 'cap1'; did you mean 'cup1'?"),
        ({"parcel": "shelf", "floor": 2}, "'shelf' is of type object"),
        ({}, "the event 'deliver' needs its attribute 'parcel' of type item"),
    ],
)
def test_an_event_from_outside_fits_the_declaration_of_a_plot_that_receives_it(attributes, said):
    errors = []

    def prepare(sequencer):
        sequencer.change(Delta(nodes={"shelf": "object"}), "test")
        sequencer.knowledge.apply(Delta(nodes={"shelf": "object"}), "test")
        for wrong in (attributes, {"parcel": "cup1", "floor": 2}):
            try:
                sequencer.post(Event("deliver", wrong), after=1)
            except InputError as error:
                errors.append(str(error))

    ran = Ran(RECEIVES, things=["cup1"], prepare=prepare)
    (error,) = errors
    assert said in error
    assert ran.end.finished


class There(Outcome):
    pass


class Wanderer(Arm):
    @skill
    async def drive(self, call: SkillCall, start: Item, to: Item) -> There:
        return There(observed=Delta(removed=(fact("seen", start),), added=(fact("seen", to),)))


def test_an_observation_with_one_fact_removed_and_added_is_true_as_in_an_effect():
    text = "{plot: p, states: {a: {entry: {trigger: arm.drive, with: {start: cup1, to: cup1}}, on: {there: e}}, e: {final: true}}}"
    ran = Ran(text, things=["cup1"], arm=Wanderer())
    assert ran.end.finished
    assert ran.kb.ask("(seen cup1)")


def test_an_event_that_no_plot_receives_is_refused_with_the_nearest_name():
    refused = []

    def prepare(sequencer):
        for name in ("delivr", "grasped", "deliver"):
            try:
                sequencer.post(Event(name, {"parcel": "cup1", "floor": 2} if name == "deliver" else {}), after=1)
            except UnknownNameError as error:
                refused.append(str(error))

    ran = Ran(RECEIVES, things=["cup1"], prepare=prepare)
    assert ran.end.finished
    assert refused[0] == "no plot receives the event 'delivr'; did you mean 'deliver'?"
    assert len(refused) == 2


def test_an_event_after_the_end_is_refused():
    ran = Ran(GRASP, things=["cup1"])
    with pytest.raises(InputError, match="the run has ended and receives nothing"):
        ran.sequencer.post(Event("grasped"))


WAITS = """
    plot: p
    receives: {quit: }
    states:
      a: {always: {to: e, when: (and (p) (q))}, on: {quit: e}}
      e: {final: true}
"""


def told_by_the_program(*predicates, text=WAITS):
    """The end and the steps of a run whose program changes the knowledge base itself, one fact per second."""

    async def main():
        kb = KnowledgeBase(SCHEMA)
        sequencer = Sequencer(Library([plot(text)]), kb, [], LoopClock(), open_ended=True)
        steps: list[Any] = []
        sequencer.listen(steps.append)
        loop = asyncio.get_running_loop()
        for second, predicate in enumerate(predicates, 1):
            loop.call_later(second, kb.apply, Delta(added=(Fact(predicate),)), "program")
        sequencer.post(Event("quit"), after=60)
        return await sequencer.run("p"), sequencer.clock.now(), steps

    return run_simulated(main())


def test_a_waiting_guard_is_evaluated_after_a_change_by_the_program_itself():
    end, at, steps = told_by_the_program("q", "p")
    assert (end.finished, at) == (True, 2)
    assert len(steps) == 2  # the first change enables nothing


def test_a_change_by_the_program_wakes_no_plot_that_waits_for_events_only():
    end, at, steps = told_by_the_program("q", "p", text=WAITS.replace("always: {to: e, when: (and (p) (q))}, ", ""))
    assert (end.finished, at) == (True, 60)
    assert len(steps) == 2


def test_a_change_by_another_thread_wakes_a_waiting_guard():
    async def main():
        kb = KnowledgeBase(SCHEMA)
        sequencer = Sequencer(Library([plot(WAITS)]), kb, [], LoopClock(), open_ended=True)
        change = Delta(added=(Fact("p"), Fact("q")))
        sequencer.post(Event("quit"), after=60)
        _, end = await asyncio.gather(asyncio.to_thread(kb.apply, change, "thread"), sequencer.run("p"))
        return end, sequencer.clock.now()

    end, at = run_simulated(main())
    assert (end.finished, at) == (True, 0)


FED = """
    plot: p
    receives: {quit: }
    states:
      a: {always: {to: e, when: (> (force) 5)}, on: {quit: e}}
      e: {final: true}
"""


@pytest.mark.parametrize("threaded", [False, True])
def test_a_new_value_of_a_source_wakes_a_waiting_guard(threaded):
    async def main():
        kb = KnowledgeBase(Schema.parse("(define (domain d) (:functions (force)))"))
        source = kb.bind_source("force", reference="ft")
        sequencer = Sequencer(Library([plot(FED)]), kb, [], LoopClock(), open_ended=True)
        steps: list[Any] = []
        sequencer.listen(steps.append)

        async def feed():
            for force in (1, 2, 3, 9, 2):
                await asyncio.sleep(1)
                if threaded:
                    await asyncio.to_thread(source.update, force)
                else:
                    source.update(force)

        sequencer.post(Event("quit"), after=60)
        end, _ = await asyncio.gather(sequencer.run("p"), feed())
        return end, len(steps), sequencer.machine.state.finished

    end, steps, _ = run_simulated(main())
    assert (end.finished, steps) == (True, 2)  # only the value that enables the transition causes a macrostep


def test_the_end_of_a_source_wakes_a_waiting_guard():
    async def main():
        kb = KnowledgeBase(Schema.parse("(define (domain d) (:functions (force)))"))
        kb.apply(Delta(values={fact("force"): 9}), "program")
        source = kb.bind_source("force", reference="ft")
        source.update(1)
        sequencer = Sequencer(Library([plot(FED)]), kb, [], LoopClock(), open_ended=True)
        asyncio.get_running_loop().call_later(2, source.close)
        sequencer.post(Event("quit"), after=60)
        return await sequencer.run("p"), sequencer.clock.now()

    end, at = run_simulated(main())
    assert (end.finished, at) == (True, 2)


LATE = """
    plot: p
    emits: {late: {why: text}}
    states:
      a:
        entry: [{set: arm.speed, to: fast}, {trigger: arm.grasp, with: {item: cup1}, within: 60}]
        on: {grasped: e, timed_out: {to: e, emit: late, with: {why: ?event.reason}}}
        after: {seconds: LEFT, to: b}
      b: {after: {seconds: 100, to: e}}
      e: {final: true}
"""


@pytest.mark.parametrize(("deployed", "left", "at", "log"), [
    (7, 90, 9, ["speed=fast", "grasp cup1"]), (70, 90, 60, []), (7, 5, 105, ["speed=fast"]), (900, 5, 105, []),
])  # fmt: skip
def test_a_skill_waits_for_its_component_within_its_time_limit(deployed, left, at, log):
    arm = Arm()

    async def main():
        kb = KnowledgeBase(SCHEMA)
        kb.apply(Delta(nodes={"cup1": "item"}), "test")
        sequencer = Sequencer(Library([plot(LATE.replace("LEFT", str(left)))]), kb, [], LoopClock())
        asyncio.get_running_loop().call_later(deployed, sequencer.dispatcher.deploy, arm)
        return await sequencer.run("p"), sequencer.clock.now()

    end, ended = run_simulated(main())
    assert (ended, arm.log) == (at, log)
    if deployed == 7:
        assert end.finished
    elif left == 90:
        assert "waited for its component: there is no component 'arm'" in end.emitted[0].attributes["why"]
    if not log:
        assert end.problem.startswith("set arm.speed: there is no component 'arm'")


def test_the_first_state_may_choose_its_content():
    text = "{plot: p, states: {a: {dynamic: [busy, free], on: {done: e}}, e: {final: true}}}"
    busy = "{plot: busy, when: (p), states: {b: {}}}"
    free = "{plot: free, when: (not (p)), states: {f: {final: true}}}"
    ran = Ran(text, busy, free)
    assert ran.end.finished, ran.end


@pytest.mark.parametrize(
    ("made", "said"),
    [
        ("parameters: {x: text}\nstates: {s: {after: {seconds: 1, to: e}}, e: {final: true}}", "'made.x' is text, not 2"),
        ("parameters: {x: number}\nemits: {odd: }\nstates: {s: {on: {done: {to: e, emit: odd}}}, e: {final: true}}",
         "state 'run' does not handle 'odd'"),
        ("parameters: {x: number}\nstates: {s: {on: {done: nowhere}}, e: {final: true}}", "nowhere"),
        ("parameters: {x: sort}\nstates: {s: {after: {seconds: 1, to: e}}, e: {final: true}}", "there is no type 'sort'"),
    ],
)  # fmt: skip
def test_a_plot_given_as_data_is_checked_as_one_of_the_library(made, said):
    ran = Ran(
        """
        plot: p
        parameters: {plan: plot}
        emits: {failed: {reason: text}}
        states:
          run: {use: ?plan, with: {x: 2}, on: {done: e, error: {to: e, emit: failed, with: {reason: ?event.reason}}}}
          e: {final: true}
        """,
        arm=Arm(),
        arguments={"plan": plot(f"plot: made\n{made}").to_form()},
    )
    assert ran.end.finished
    assert said in ran.end.emitted[0].attributes["reason"]

"""A component that is not concurrent executes one skill at a time; the others wait by rank (S1.21)."""

from __future__ import annotations

import asyncio

import pytest
from dsc_charts import plot
from dsc_runs import ran

from dsc import Component, Event, Library, LoopClock, Outcome, Sequencer, SkillCall, Trace, skill
from dsc.sequencer.clock import run_simulated
from dsc.trace import Record
from dsc.wire.endpoint import LocalTransport
from dsc.wire.host import Host
from dsc.wire.remote import RemoteComponent
from knowledge_base import KnowledgeBase, Schema


class Moved(Outcome): ...


class Arm(Component):
    """Logs when each movement begins and ends, and how many run at once."""

    name = "arm"

    def __init__(self, name=None, *, concurrent=False, releasing=0.0):
        super().__init__(name)
        self.concurrent = concurrent
        self.releasing = releasing
        self.log = []
        self.busy = self.most = 0

    @skill
    async def move(self, call: SkillCall, to: str, seconds: float = 5.0) -> Moved:
        self.log.append((call.clock.now(), to))
        self.busy += 1
        self.most = max(self.most, self.busy)
        try:
            await call.clock.sleep(seconds)
        except asyncio.CancelledError:
            await call.clock.sleep(self.releasing)
            self.log.append((call.clock.now(), f"{to} cancelled"))
            raise
        finally:
            self.busy -= 1
        return Moved()


def region(name, after, *, more="", seconds=5.0):
    """A region that moves the arm once, at once or after some seconds."""
    first = "" if after is None else f"{name}_w: {{after: {{seconds: {after}, to: {name}_s}}}}, "
    move = f"{{trigger: arm.move, with: {{to: {name}, seconds: {seconds}}}}}"
    moving = f"{name}_s: {{{more} entry: {move}, on: {{moved: {name}_e}}}}"
    return f"{name}: {{states: {{{first}{moving}, {name}_e: {{final: true}}}}}}"


def regions(*inner):
    return "{plot: p, states: {s: {regions: {" + ", ".join(inner) + "}, on: {done: over}}, over: {final: true}}}"


def order(arm):
    return [to for _, to in arm.log]


def test_regions_use_a_component_one_after_the_other():
    arm = Arm()
    end, at = ran(regions(region("a", 0), region("b", 1), region("c", 2)), arm)
    assert end.finished
    assert (arm.log, arm.most, at) == ([(0, "a"), (5, "b"), (10, "c")], 1, 15)


def test_a_concurrent_component_waits_for_nothing():
    arm = Arm(concurrent=True)
    _, at = ran(regions(region("a", 0), region("b", 1)), arm)
    assert (arm.most, at) == (2, 6)


def test_the_higher_priority_comes_first_also_within_one_macrostep():
    arm = Arm()
    ran(
        regions(
            region("a", 0), region("b", 1), region("c", 2, more="priority: 3,"), region("d", 2, more="priority: -1,")
        ),
        arm,
    )
    assert order(arm) == ["a", "c", "b", "d"]


def test_skills_of_one_macrostep_are_compared():
    arm = Arm()
    ran(regions(region("a", None), region("b", None, more="priority: 1,"), region("c", None, more="priority: 2,")), arm)
    assert order(arm) == ["c", "b", "a"]


INNER = "{plot: inner, states: {i: {entry: {trigger: arm.move, with: {to: inner}}, on: {moved: e}}, e: {final: true}}}"


def executed(*plots, arm, prepare=None, records=None):
    async def main():
        clock = LoopClock()
        trace = Trace(clock.now)
        if records is not None:
            trace.listen(records.append)
        kb, library = KnowledgeBase(Schema()), Library(map(plot, plots))
        sequencer = Sequencer(library, kb, [arm], clock, trace)
        if prepare is not None:
            prepare(sequencer)
        return await sequencer.run(next(iter(library)).name)

    return run_simulated(main())


def test_of_equal_priorities_the_inner_skill_comes_first():
    arm = Arm()
    inner = (
        "inner: {states: {i_w: {after: {seconds: 2, to: i_s}}, i_s: {use: inner, on: {done: i_e}}, i_e: {final: true}}}"
    )
    end = executed(regions(region("a", 0), region("b", 1), inner), INNER, arm=arm)
    assert end.finished
    assert order(arm) == ["a", "inner", "b"]


def test_the_priority_of_a_state_holds_for_the_plots_inside():
    arm = Arm()
    inner = (
        "inner: {states: {i_w: {after: {seconds: 2, to: i_s}},"
        " i_s: {priority: -1, use: inner, on: {done: i_e}}, i_e: {final: true}}}"
    )
    executed(regions(region("a", 0), region("b", 1), inner), INNER, arm=arm)
    assert order(arm) == ["a", "b", "inner"]


HANDLED = """
    plot: p
    receives: {call: }
    states:
      s: {regions: {REGIONS}, on: {done: over}}
      over: {final: true}
    handlers:
      - {on: call, MORE do: {use: inner}}
"""


@pytest.mark.parametrize(("more", "expected"), [("", ["a", "inner", "b"]), ("priority: -1,", ["a", "b"])])
def test_handlers_come_before_their_plot_unless_they_declare_otherwise(more, expected):
    arm = Arm()
    text = HANDLED.replace("REGIONS", ", ".join((region("a", 0), region("b", 1)))).replace("MORE", more)

    def prepare(sequencer):
        sequencer.post(Event("call"), after=2)

    executed(text, INNER, arm=arm, prepare=prepare)
    assert order(arm) == expected


def test_a_declared_preemption_interrupts_the_other_state_which_waits_and_begins_again():
    arm = Arm(releasing=1.0)
    interrupted = "on_break: {set: arm.stopped, to: true}, exit: {set: arm.stopped, to: false},"
    records: list[Record] = []
    end = executed(
        regions(region("a", 0, more=interrupted), region("b", 2, more="priority: 1, preempt: true,", seconds=3)),
        arm=arm,
        records=records,
    )
    assert end.finished
    assert arm.log == [(0, "a"), (3, "a cancelled"), (3, "b"), (6, "a")]
    sets = [one.data["value"] for one in records if one.data.get("action") == "set"]
    assert sets == [True, False]


def test_a_state_may_answer_its_preemption():
    arm = Arm()
    text = (
        regions(region("a", 0, more="HERE"), region("b", 2, more="priority: 1, preempt: true,"))
        .replace("on: {moved: a_e}", "on: {moved: a_e, preempted: a_e}")
        .replace("HERE", "")
    )
    end, at = ran(text, arm)
    assert (end.finished, at) == (True, 7)
    assert order(arm) == ["a", "a cancelled", "b"]


def test_an_equal_priority_is_not_preempted():
    arm = Arm()
    ran(regions(region("a", 0, more="priority: 1,"), region("b", 2, more="priority: 1, preempt: true,")), arm)
    assert order(arm) == ["a", "b"]


def test_a_wait_counts_against_the_limit_and_names_what_the_component_does():
    text = """
        plot: p
        emits: {late: {why: text}}
        states:
          s:
            regions:
              r1: {states: {a: {entry: {trigger: arm.move, with: {to: left, seconds: 50}}, on: {moved: ae}}, ae: {final: true}}}
              r2:
                states:
                  w: {after: {seconds: 1, to: b}}
                  b:
                    entry: {trigger: arm.move, with: {to: right}, within: 4}
                    on: {moved: be, timed_out: {to: be, emit: late, with: {why: ?event.reason}}}
                  be: {final: true}
            on: {done: over}
          over: {final: true}
    """
    end, at = ran(text, Arm())
    assert at == 50
    (late,) = end.emitted
    assert late.attributes["why"] == (
        "arm.move: no outcome within 4 s, it waited for component 'arm', which executes arm.move of state 'a'"
    )


def test_a_skill_that_waits_is_cancelled_with_its_state():
    arm = Arm()
    text = regions(region("a", 0), region("b", 1), region("c", 2)).replace(
        "b_s: {", "b_s: {after: {seconds: 2, to: b_e},"
    )
    ran(text, arm)
    assert arm.log == [(0, "a"), (5, "c")]


def test_several_runs_share_the_turns_of_a_component():
    arm = Arm()

    async def main():
        library = Library([plot(INNER)])
        runs = [Sequencer(library, KnowledgeBase(Schema()), [arm], LoopClock()).run("inner") for _ in range(3)]
        return [end.finished for end in await asyncio.gather(*runs)]

    assert run_simulated(main()) == [True] * 3
    assert (arm.most, [at for at, _ in arm.log]) == (1, [0, 5, 10])


def test_a_hosted_component_executes_one_skill_at_a_time_for_all_its_clients():
    arm = Arm()

    async def main():
        transport = LocalTransport()
        host = Host(arm, transport, LoopClock())
        library = Library([plot(INNER)])
        remotes = [await RemoteComponent.connect("arm", transport) for _ in range(2)]
        runs = [Sequencer(library, KnowledgeBase(Schema()), [one], LoopClock()).run("inner") for one in remotes]
        ends = await asyncio.gather(*runs)
        await host.close()
        return [end.problem for end in ends]

    assert run_simulated(main()) == [None] * 2
    assert arm.most == 1


def test_a_client_of_a_hosted_component_preempts_another():
    arm = Arm()
    urgent = INNER.replace("i: {", "i: {priority: 2, preempt: true, after: {seconds: 60, to: e},").replace(
        "inner}", "urgent}", 2
    )

    async def main():
        transport = LocalTransport()
        host = Host(arm, transport, LoopClock())
        library = Library([plot(INNER), plot(urgent.replace("plot: inner", "plot: urgent"))])
        one, other = [await RemoteComponent.connect("arm", transport) for _ in range(2)]
        first = asyncio.ensure_future(Sequencer(library, KnowledgeBase(Schema()), [one], LoopClock()).run("inner"))
        await asyncio.sleep(2)
        second = await Sequencer(library, KnowledgeBase(Schema()), [other], LoopClock()).run("urgent")
        ends = [await first, second]
        await host.close()
        return [end.problem for end in ends]

    assert run_simulated(main()) == [None] * 2
    assert (arm.most, order(arm)) == (1, ["inner", "inner cancelled", "urgent", "inner"])


def test_a_run_that_waits_for_a_skill_of_another_client_names_the_holder():
    records: list[Record] = []
    said = []
    waits = "{trigger: arm.move, with: {to: right}, within: 2}"
    late = f"""
        plot: late
        emits: {{late: {{why: text}}}}
        states:
          w: {{entry: {waits}, on: {{timed_out: {{to: b, emit: late, with: {{why: ?event.reason}}}}}}}}
          b: {{entry: {{trigger: arm.move, with: {{to: up}}}}, on: {{moved: e}}}}
          e: {{final: true}}
    """

    async def main():
        transport, clock = LocalTransport(), LoopClock()
        host = Host(Arm(), transport, clock)
        library = Library([plot(INNER), plot(late)])
        one, other = [await RemoteComponent.connect("arm", transport) for _ in range(2)]
        first = Sequencer(library, KnowledgeBase(Schema()), [one], clock)
        trace = Trace(clock.now)
        trace.listen(records.append)
        second = Sequencer(library, KnowledgeBase(Schema()), [other], clock, trace=trace)
        running = asyncio.ensure_future(first.run("inner"))
        await asyncio.sleep(1)
        waiting = asyncio.ensure_future(second.run("late"))
        await asyncio.sleep(1)
        said.extend(second.diagnose()["waits"])
        await running
        end = await waiting
        await host.close()
        return end

    end = run_simulated(main())
    holder = "component 'arm', which executes arm.move of another client"
    assert said == [f"arm.move of state 'w' waits for {holder}"]
    (why,) = end.emitted
    assert why.attributes["why"] == f"arm.move: no outcome within 2 s, it waited for {holder}"
    turns = [(one.t, one.data["action"], one.data.get("for")) for one in records if "action" in one.data]
    assert [one for one in turns if one[1] in {"wait", "begin"}] == [
        (1, "wait", "arm.move of another client"),
        (3, "wait", "arm.move of another client"),
        (5, "begin", None),
    ]


def test_the_trace_tells_what_waits_for_what():
    records: list[Record] = []
    executed(regions(region("a", 0), region("b", 1)), arm=Arm(), records=records)
    said = [one for one in records if one.data.get("action") in {"wait", "begin"}]
    assert [(one.t, one.data["action"], one.data["skill"], one.data.get("for")) for one in said] == [
        (1, "wait", "arm.move", "arm.move of state 'a_s'"),
        (5, "begin", "arm.move", None),
    ]


def test_a_busy_sequencer_says_what_waits():
    said = []

    async def look(sequencer):
        await asyncio.sleep(2)
        said.extend(sequencer.diagnose()["waits"])

    ran(regions(region("a", 0), region("b", 1)), Arm(), meanwhile=look)
    assert said == ["arm.move of state 'b_s' waits for component 'arm', which executes arm.move of state 'a_s'"]


def test_the_next_skill_of_the_macrostep_that_ends_one_is_compared_with_those_that_wait():
    arm = Arm()
    twice = (
        "a: {states: {a1: {priority: 1, entry: {trigger: arm.move, with: {to: a1}}, on: {moved: a2}},"
        " a2: {priority: 1, entry: {trigger: arm.move, with: {to: a2}}, on: {moved: ae}}, ae: {final: true}}}"
    )
    ran(regions(twice, region("b", 1)), arm)
    assert order(arm) == ["a1", "a2", "b"]

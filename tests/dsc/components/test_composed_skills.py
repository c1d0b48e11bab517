"""Skills that are behaviour trees, skills that are plots, and plots wrapped around skills that know nothing of it."""

from __future__ import annotations

import asyncio

import pytest
from dsc_charts import plot
from dsc_runs import SCHEMA, Arm, Ran
from py_trees.behaviour import Behaviour

from dsc.calls import SkillCall
from dsc.components.behaviour_trees import action, condition, fallback, repeat, retry, sequence, tree_skill
from dsc.components.component import Component
from dsc.dynamic.library import Library
from dsc.outcomes import Outcome
from dsc.sequencer.plot_skill import PlotComponent
from dsc.validation import validate_plot
from knowledge_base.errors import InputError
from knowledge_base.facts import Delta, fact
from knowledge_base.store import KnowledgeBase


class Served(Outcome): ...


class NotServed(Outcome): ...


class Counted(Outcome):
    count: int


class Butler(Arm):
    """`fails` outcomes of `try_it` come first; then it succeeds."""

    def __init__(self, fails=0):
        super().__init__()
        self.fails = fails
        self.open = False
        self.ticks = 0

    async def try_it(self, call, item="cup1", seconds=1.0):
        self.note(f"try {item}")
        try:
            await call.clock.sleep(seconds)
        except asyncio.CancelledError:
            self.note("cancelled")
            raise
        if self.fails:
            self.fails -= 1
            return Outcome("slipped")
        return Outcome("grasped", observed=Delta(nodes={item: "item"}, added=(fact("seen", item),)))

    def counts(self):
        self.ticks += 1
        return True

    @tree_skill(Served, NotServed)
    def retries(self, call):
        return retry(action("try", lambda: self.try_it(call), {"grasped"}), 3)

    @tree_skill(Served, NotServed, period=0.5)
    def repeats(self, call, times: int = 3):
        return repeat(action("try", lambda: self.try_it(call), {"grasped"}), times)

    @tree_skill(Served, NotServed)
    def falls_back(self, call):
        return sequence(
            fallback(
                condition("open", lambda: self.open), action("open", lambda: self.try_it(call, "door"), {"grasped"})
            ),
            action("take", lambda: self.try_it(call, "cup"), {"grasped"}),
        )

    @tree_skill(Served, NotServed, period=0.5)
    def watches(self, call):
        return fallback(
            condition("open", lambda: self.counts() and self.open),
            action("wait", lambda: self.try_it(call, "door", 1e6), {"grasped"}),
            reactive=True,
        )

    @tree_skill(Served, NotServed)
    def takes_then(self, call, then=None):
        take = action("take", lambda: self.try_it(call), {"grasped"})
        if then == "broken":
            return sequence(take, action("broken", lambda: self.breaks(call), {"ok"}))
        return sequence(take, action("wait", lambda: self.try_it(call, "cup2", 1e6), {"grasped"}))

    @tree_skill(Served, NotServed, period=0.5)
    def guards(self, call, reactive: bool):
        closed = condition("closed", lambda: not self.open)
        return sequence(closed, action("wait", lambda: self.try_it(call, "door", 10.0), {"grasped"}), reactive=reactive)

    @tree_skill(Served, NotServed)
    def says_nothing(self, call):
        return action("mute", lambda: asyncio.sleep(1), {"ok"})  # type: ignore[arg-type, return-value]

    @tree_skill(Served, NotServed)
    def raises(self, call, how: str = "raise"):
        return action("broken", lambda: self.breaks(call, how), {"ok"})


SERVE = """
    plot: p
    emits: {sorry: {}}
    states:
      a: {entry: {trigger: arm.SKILL}, after: {seconds: LIMIT, to: e}, on: {served: e, not_served: {to: e, emit: sorry}, timed_out: e, programming_error: {to: e, emit: sorry}}}
      e: {final: true}
"""


def serve(skill, butler, limit=60):
    return Ran(SERVE.replace("SKILL", skill).replace("LIMIT", str(limit)), arm=butler)


@pytest.mark.parametrize(("fails", "served", "tries"), [(0, True, 1), (2, True, 3), (3, False, 3)])
def test_a_tree_retries(fails, served, tries):
    ran = serve("retries", Butler(fails))
    assert ran.end.finished
    assert ran.end.problem is None
    assert (not ran.end.emitted) == served
    assert ran.arm.log == ["try cup1"] * tries


@pytest.mark.parametrize(("fails", "tries"), [(0, 3), (1, 1)])
def test_a_tree_repeats_until_it_fails(fails, tries):
    ran = serve("repeats", Butler(fails))
    assert ran.arm.log == ["try cup1"] * tries
    assert bool(ran.end.emitted) == bool(fails)


@pytest.mark.parametrize(("open_", "log"), [(True, ["try cup"]), (False, ["try door", "try cup"])])
def test_a_tree_falls_back_and_hands_over_what_was_observed(open_, log):
    butler = Butler()
    butler.open = open_
    ran = serve("falls_back", butler)
    assert ran.arm.log == log
    assert ran.kb.ask("(seen cup)")


def test_a_tree_is_ticked_only_while_it_is_active_and_stops_what_it_began():
    ran = serve("watches", Butler(), limit=5)
    assert ran.end.finished
    assert ran.end.problem is None
    assert ran.arm.log == ["try door", "cancelled"]
    assert 9 <= ran.arm.ticks <= 11


def test_a_reactive_tree_turns_elsewhere_and_stops_what_it_began():
    butler = Butler()

    def opens(sequencer):
        asyncio.get_running_loop().call_later(3.2, setattr, butler, "open", True)

    ran = Ran(SERVE.replace("SKILL", "watches").replace("LIMIT", "60"), arm=butler, prepare=opens)
    assert ran.at == pytest.approx(3.5)
    assert ran.arm.log == ["try door", "cancelled"]


@pytest.mark.parametrize(("then", "limit"), [("broken", 60), ("waits", 60), ("waits", 5)])
def test_an_observation_in_a_tree_is_known_at_any_end_of_the_tree(then, limit):
    ran = serve(f"takes_then, with: {{then: {then}}}, within: 20", Butler(), limit)
    assert ran.end.finished
    assert ran.kb.ask("(seen cup1)")
    (known,) = [record for record in ran.records if record.type == "knowledge"]
    assert (known.t, known.data["author"]) == (pytest.approx(1), "arm")


@pytest.mark.parametrize(("reactive", "end"), [(True, "not_served"), (False, "served")])
def test_a_sequence_asks_conditions_again_if_it_is_reactive(reactive, end):
    butler = Butler()

    def opens(_):
        asyncio.get_running_loop().call_later(3.2, setattr, butler, "open", True)

    skill = f"guards, with: {{reactive: {str(reactive).lower()}}}"
    ran = Ran(SERVE.replace("SKILL", skill).replace("LIMIT", "60"), arm=butler, prepare=opens)
    assert [event["name"] for event in ran.of_type("event")] == [end]
    assert ran.at == pytest.approx(3.5 if reactive else 10)


@pytest.mark.parametrize(("success", "why"), [
    ("served", "a tree ends with a class of an outcome, as in success=Served, not with 'served'"),
    (Counted, "a tree ends with Counted, for whose attributes it has no values"),
])  # fmt: skip
def test_a_tree_skill_refuses_an_outcome_it_cannot_make(success, why):
    with pytest.raises(InputError, match=why):
        tree_skill(success, NotServed)


def test_a_tree_has_the_types_of_its_annotations_and_the_outcomes_that_it_reports():
    class Counter(Component):
        name = "counter"

        @tree_skill(Served, NotServed, reports=[Counted])
        def count(self, call: SkillCall[Counted], times: int, names: list[str] | None = None) -> Behaviour:
            return condition("yes", lambda: True)

    skill = Counter().skills()["count"]
    assert skill.parameters == {"times": "integer", "names": "optional list of text"}
    assert skill.outcomes == {"served": {}, "not_served": {}, "counted": {"count": "integer"}}


def test_an_action_of_a_tree_that_ends_with_no_outcome_is_a_programming_error():
    ran = serve("says_nothing", Butler())
    (reason,) = [event["attributes"].get("reason") for event in ran.of_type("event")]
    assert reason == "arm.says_nothing: the action 'mute' ended with None, which is not an outcome"


@pytest.mark.parametrize(
    ("how", "reason"), [("raise", "the gripper is stuck"), ("exit", "SystemExit: the driver says no")]
)
def test_an_exception_in_a_tree_action_is_a_programming_error(how, reason):
    ran = serve(f"raises, with: {{how: {how}}}", Butler())
    assert any(reason in event["attributes"].get("reason", "") for event in ran.of_type("event"))


# -- plots as skills ---------------------------------------------------------------------------------------

FETCH = """
    plot: fetch
    parameters: {item: symbol, seconds: {type: number, default: 2}}
    emits: {fetched: {item: symbol}, lost: {}}
    states:
      grasp:
        entry: {trigger: arm.grasp, with: {item: ?item, seconds: ?seconds}}
        exit: {switch: arm, to: neutral}
        on: {grasped: {to: e, emit: fetched, with: {item: ?item}}, slipped: {to: e, emit: lost}}
      e: {final: true}
"""
PAUSE = "{plot: pause, states: {a: {after: {seconds: 3, to: e}}, e: {final: true}}}"


def helper(arm, *plots):
    return PlotComponent("helper", Library(map(plot, plots)), [arm])


def test_a_plot_can_be_a_skill():
    ran = Ran(
        """
        plot: p
        emits: {told: {item: symbol}}
        states:
          a: {entry: {trigger: helper.fetch, with: {item: cup7}}, on: {fetched: {to: b, emit: told, with: {item: ?event.item}}, lost: b, completed: b}}
          b: {entry: {trigger: helper.pause}, on: {completed: e}}
          e: {final: true}
        """,
        arm=helper(Arm(), FETCH, PAUSE),
    )
    assert ran.end.finished
    assert ran.end.emitted[0].attributes == {"item": "cup7"}
    assert ran.at == pytest.approx(5)


SEEK = """
    plot: seek
    outputs: {seen: {type: number, initial: 0}}
    emits: {glimpse: {n: number}, over: {}}
    states:
      a:
        entry: {trigger: arm.look, with: {glimpses: 2}}
        on:
          glimpse: {assign: {seen: (+ ?seen 1)}, emit: glimpse, with: {n: ?event.n}}
          found: {to: e, emit: over}
      e: {final: true}
"""


def test_a_plot_skill_emits_reports_at_once_and_outputs_at_the_end():
    ran = Ran(
        """
        plot: p
        emits: {told: {seen: number}}
        states:
          a: {entry: {trigger: helper.seek}, on: {glimpse: {}, over: {}, completed: {to: e, emit: told, with: {seen: ?event.seen}}}}
          e: {final: true}
        """,
        arm=PlotComponent("helper", Library([plot(SEEK)]), [Arm()], lambda: KnowledgeBase(SCHEMA)),
    )
    events = [(one.data["name"], one.t) for one in ran.records if one.type == "event" and "of" not in one.data]
    assert events == [("glimpse", 1), ("glimpse", 2), ("over", 3), ("completed", 3)]
    assert ran.end.emitted[0].attributes == {"seen": 2}


def test_a_plot_that_is_a_skill_is_left_when_it_is_cancelled():
    arm = Arm()
    text = "{plot: p, states: {a: {entry: {trigger: helper.fetch, with: {item: cup7, seconds: 100}}, after: {seconds: 4, to: e}}, e: {final: true}}}"
    ran = Ran(text, arm=helper(arm, FETCH))
    assert ran.end.finished
    assert arm.log == ["grasp cup7", "cancelled", "mode neutral"]


def test_a_plot_that_is_a_skill_and_gets_stuck_is_a_programming_error():
    stuck = "{plot: stuck, states: {a: {on: {never: e}}, e: {final: true}}}"
    ran = Ran(
        "{plot: p, states: {a: {entry: {trigger: helper.stuck}, on: {completed: e}}, e: {final: true}}}",
        arm=helper(Arm(), stuck),
    )
    assert "no skill, timer or event is pending" in (ran.end.problem or "")


def test_a_plot_as_a_skill_has_its_interface():
    signature = helper(Arm(), FETCH).skills()["fetch"]
    assert signature.parameters == {"item": "symbol", "seconds": "number"}
    assert signature.defaults == {"seconds": 2}
    assert signature.outcomes == {"fetched": {"item": "symbol"}, "lost": {}, "completed": {}}


# -- wrapping ----------------------------------------------------------------------------------------------

CAREFULLY = """
    plot: carefully
    parameters: {item: symbol}
    emits: {fetched: {item: symbol}, lost: {}, touched: {}}
    states:
      doing:
        use: fetch
        with: {item: ?item, seconds: 10}
        on: {fetched: {to: e, emit: fetched, with: {item: ?event.item}}, lost: {to: e, emit: lost}, done: e}
        every: {seconds: 0.5, when: (p), to: e, emit: touched}
      e: {final: true}
"""


@pytest.mark.parametrize(("touch_at", "event", "log"), [
    (3.2, "touched", ["grasp cup7", "cancelled", "mode neutral"]),
    (20.0, "fetched", ["grasp cup7", "mode neutral"]),
])  # fmt: skip
def test_a_wrapping_plot_adds_a_condition_to_a_skill_it_does_not_touch(touch_at, event, log):
    def touch(sequencer):
        sequencer.change(Delta(added=(fact("p"),)), "bumper", after=touch_at)

    ran = Ran(CAREFULLY, FETCH, prepare=touch, arguments={"item": "cup7"})
    assert [one.name for one in ran.end.emitted] == [event]
    assert ran.arm.log == log


def test_the_wrapped_plot_and_the_wrapping_one_are_sound():
    library = Library([plot(CAREFULLY), plot(FETCH)])
    for one in library:
        assert validate_plot(one, library, None, Arm().skills().values(), {"arm"}) == []


def test_no_two_actions_of_plots_that_are_skills_have_one_id():
    ids = []

    class Counting(Arm):
        def execute(self, skill_name, call, arguments):
            ids.append(call.action_id)
            return super().execute(skill_name, call, arguments)

    text = """
        plot: p
        states:
          a: {entry: {trigger: helper.fetch, with: {item: cup7}}, on: {fetched: b, lost: b, completed: b}}
          b: {entry: {trigger: helper.fetch, with: {item: cup8}}, on: {fetched: e, lost: e, completed: e}}
          e: {final: true}
    """
    assert Ran(text, arm=helper(Counting(), FETCH)).end.finished
    assert len(ids) == len(set(ids)) == 2

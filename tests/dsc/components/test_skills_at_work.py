"""What components do and do wrong, as the chart sees it."""

from __future__ import annotations

import asyncio
import math
import re
import sys
from pathlib import Path
from typing import Annotated, Never

import pytest
from dsc_runs import SLOW, Arm, Ran

from dsc import SkillCall
from dsc.components.component import Component
from dsc.components.ports import query
from dsc.outcomes import Outcome
from dsc.sequencer.clock import run_simulated
from dsc.sequencer.run_end import RunEnd
from dsc.skills import check_arguments, skill
from knowledge_base.errors import InputError, SchemaError, UnknownNameError
from knowledge_base.facts import Delta, fact

GRASP = """
    plot: p
    emits: {lost: {item: item}}
    states:
      a: {entry: {trigger: arm.grasp, with: {item: cup1}}, on: {grasped: e, slipped: {to: e, emit: lost, with: {item: ?event.item}}}}
      e: {final: true}
"""


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


def test_an_observation_is_known_even_after_its_state_is_left():
    ran = Ran(
        """
        plot: p
        states:
          o:
            regions:
              r1: {states: {x: {entry: {trigger: arm.look, with: {seconds: 2}}, on: {found: x2}}, x2: {}}}
              r2: {states: {y: {entry: {trigger: arm.grasp, with: {seconds: 2}}, on: {grasped: y2}}, y2: {}}}
            on: {out: e}
            always: {to: e, when: (seen cup1)}
          e: {final: true}
    """.replace("(seen cup1)", "(exists (?i - item) (seen ?i))")
    )
    # Both answers come at the same time; the first one leaves the state, the second is dropped.
    assert ran.end.finished
    assert ran.kb.ask("(exists (?i - item) (seen ?i))")

    late = Ran(
        """
        plot: p
        states:
          o:
            regions:
              r1: {states: {x: {entry: {trigger: arm.grasp, with: {seconds: 2}}, on: {grasped: {emit: out}}}}}
              r2: {states: {y: {entry: {trigger: arm.look, with: {seconds: 2}}, on: {found: wrong}}, wrong: {}}}
            on: {out: b}
          b: {always: {to: e, when: (exists (?i - item) (seen ?i))}}
          e: {final: true}
    """,
        arm=Arm(concurrent=True),
    )
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
        on: {ok: e, programming_error: {to: f, assign: {why: ?event.reason}}, timed_out: e}
      e: {final: true}
      f: {final: true, emit: because, with: {why: ?why}}
"""


@pytest.mark.parametrize(
    ("how", "reason"),
    [
        ("raise", "RuntimeError: the gripper is stuck"),
        ("timeout", "TimeoutError: the bus does not answer"),
        ("exit", "SystemExit: the driver says no"),
        ("base", "StoppedError: of no usual kind"),
        ("cancel", "CancelledError"),
        ("undeclared", "'splendid', which it does not declare"),
        ("nothing", "None"),
        ("no_data", "object"),
    ],
)
def test_any_fault_of_a_skill_is_a_programming_error(how, reason):
    ran = Ran(BREAKS.replace("HOW", how))
    assert ran.end.finished
    (event,) = ran.end.emitted
    assert reason in event.attributes["why"]


Symbol = Annotated[str, "symbol"]
Item = Annotated[str, "item"]


class Said(Outcome):
    n: float
    sure: bool
    why: str
    what: Symbol
    item: Item
    any: object


class Over(Outcome): ...


class Held(Outcome): ...


class Closed(Outcome): ...


class How(Outcome):
    mode: str


class Ok(Outcome): ...


class SoFar(Outcome): ...


class Grasped(Outcome): ...


class Done(Outcome): ...


@pytest.mark.parametrize(
    "observed",
    [
        Delta(added=(fact("p"), fact("nonsense", "x"))),
        Delta(added=(fact("p"), fact("seen", "nobody"))),
        Delta(added=(fact("p"), fact("q", "too", "many"))),
        Delta(added=(fact("p"), "(seen cup1)")),  # type: ignore[arg-type]
        Delta(added=fact("p")),  # type: ignore[arg-type]
        Delta(nodes=("cup9",), added=(fact("p"),)),  # type: ignore[arg-type]
        [fact("p")],
        fact("p"),
        None,
        "",
    ],
)
@pytest.mark.parametrize("skill_name", ["says", "reports"])
def test_a_skill_that_observes_what_cannot_be_has_failed_and_nothing_of_it_is_known(observed, skill_name):
    class Dreamer(Component):
        name = "arm"

        @skill
        async def says(self, call) -> Ok:
            return Ok(observed=observed)

        @skill
        async def reports(self, call: SkillCall[SoFar]) -> Ok:
            call.report(SoFar(observed=observed))
            await call.clock.sleep(5)
            return Ok()

    text = BREAKS.replace("arm.breaks, with: {how: HOW}", f"arm.{skill_name}")
    ran = Ran(text, arm=Dreamer())
    (event,) = ran.end.emitted
    assert event.attributes["why"].startswith(f"arm.{skill_name}: ")
    assert not ran.kb.ask("(p)")
    assert ran.at == 0


SAID = {"n": "number", "sure": "boolean", "why": "text", "what": "symbol", "item": "item", "any": None}


class Sayer(Component):
    """Ends, or reports and goes on, with attributes that fit what it declares or do not."""

    name = "arm"

    def __init__(self, attributes, observed=Delta()):  # noqa: B008  # a value
        super().__init__()
        self.outcome = Outcome("said", attributes, observed)

    @skill
    async def says(self, call) -> Said:
        return self.outcome  # type: ignore[return-value]

    @skill
    async def reports(self, call) -> Said | Over:
        call.report(self.outcome)
        await call.clock.sleep(5)
        return Over()


FITTING = {"n": 2, "sure": True, "why": "so", "what": "cup", "item": "cup1", "any": [{"deep": 1.5}]}
SAYS = BREAKS.replace("arm.breaks, with: {how: HOW}", "arm.SKILL").replace("ok: e", "said: e")


@pytest.mark.parametrize(("wrong", "reason"), [
    ({"n": "blue"}, "the attribute 'n' of 'said' is a finite number, not 'blue'"),
    ({"n": True}, "the attribute 'n' of 'said' is a finite number, not True"),
    ({"n": math.nan}, "the attribute 'n' of 'said' is a finite number, not nan"),
    ({"n": math.inf}, "the attribute 'n' of 'said' is a finite number, not inf"),
    ({"sure": 1}, "the attribute 'sure' of 'said' is a truth value, not 1"),
    ({"why": None}, "the attribute 'why' of 'said' is text, and has no value"),
    ({"what": 7}, "the attribute 'what' of 'said' is a name, not 7"),
    ({"item": "ghost"}, "the attribute 'item' of 'said' is of type item, and there is no object 'ghost'; valid: cup1, cup2"),
    ({"item": 3}, "the attribute 'item' of 'said' is the name of an object of type item, not 3"),
    ({"item": "fork"}, "the attribute 'item' of 'said' is of type item, and 'fork' is of type object"),
    ({"any": [math.nan]}, "the attributes of 'said': not plain data: Out of range float values"),
    ({"whi": "so"}, "the outcome 'said' has no attribute 'whi'; did you mean 'why'?"),
])  # fmt: skip
@pytest.mark.parametrize("skill_name", ["says", "reports"])
def test_attributes_that_do_not_fit_their_declaration_are_a_programming_error(wrong, reason, skill_name):
    forks = Delta(nodes={"fork": "object"}, added=(fact("p"),))
    ran = Ran(SAYS.replace("SKILL", skill_name), arm=Sayer(FITTING | wrong, forks), things=["cup1", "cup2"])
    (event,) = ran.end.emitted
    assert event.attributes["why"].startswith(f"arm.{skill_name}: {reason}")
    assert not ran.kb.ask("(p)")
    assert ran.at == 0


def test_an_attribute_that_is_missing_is_a_programming_error_that_names_it():
    ran = Ran(
        SAYS.replace("SKILL", "says"),
        arm=Sayer({name: value for name, value in FITTING.items() if name != "item"}),
        things=["cup1", "cup2"],
    )
    (event,) = ran.end.emitted
    assert event.attributes["why"].startswith("arm.says: the outcome 'said' needs its attribute 'item' of type item (")
    assert f"{Path(__file__).name}:" in event.attributes["why"]


@pytest.mark.parametrize(("item", "observed"), [
    ("cup1", Delta()),
    ("cup9", Delta(nodes={"cup9": "item"})),
    ("cup1", Delta(removed_nodes=("cup1",))),
])  # fmt: skip
def test_an_attribute_may_name_what_is_seen_for_the_first_or_the_last_time(item, observed):
    ran = Ran(SAYS.replace("SKILL", "says"), arm=Sayer(FITTING | {"item": item}, observed), things=["cup1", "cup2"])
    assert ran.end == RunEnd(finished=True)


def test_a_skill_that_reports_what_is_no_outcome_of_its_own_is_stopped():
    class Chatty(Component):
        name = "arm"

        @skill
        async def chats(self, call) -> Ok:
            call.report(Outcome("hello"))
            await call.clock.sleep(5)
            return Ok()

    ran = Ran(BREAKS.replace("arm.breaks, with: {how: HOW}", "arm.chats"), arm=Chatty())
    (event,) = ran.end.emitted
    place = Chatty().skills()["chats"].place
    assert (
        event.attributes["why"] == f"arm.chats: it ended with 'hello', which it does not declare; valid: ok ({place})"
    )
    assert ran.at == 0


@pytest.mark.parametrize(
    "what",
    [Outcome("hello"), Outcome("so_far", observed=Delta(added=(fact("nonsense", "x"),)))],
    ids=["undeclared", "untrue"],
)
@pytest.mark.parametrize("and_then", ["ends", "reports", "sleeps", "goes on"])
def test_a_skill_that_has_failed_by_what_it_reported_answers_no_more(what, and_then):
    class Chatty(Component):
        name = "arm"

        @skill
        async def chats(self, call: SkillCall[SoFar]) -> Ok:
            call.report(what)
            if and_then == "reports":
                call.report(SoFar())
                call.report(Outcome("hello"))  # type: ignore[arg-type]
            if and_then in ("sleeps", "goes on"):
                try:
                    await call.clock.sleep(5)
                except asyncio.CancelledError:
                    if and_then == "sleeps":
                        raise
            return Ok(observed=Delta(added=(fact("p"),)))

    ran = Ran(
        """
        plot: p
        variables: {failed: {type: number, initial: 0}, others: {type: number, initial: 0}}
        emits: {counted: {failed: number, others: number}}
        states:
          a:
            entry: {trigger: arm.chats, within: 100}
            on:
              programming_error: {assign: {failed: (+ ?failed 1)}}
              ok: {assign: {others: (+ ?others 1)}}
              so_far: {assign: {others: (+ ?others 1)}}
            after: {seconds: 1, to: e}
          e: {final: true, emit: counted, with: {failed: ?failed, others: ?others}}
        """,
        arm=Chatty(),
    )
    (event,) = ran.end.emitted
    assert event.attributes == {"failed": 1, "others": 0}
    assert not ran.kb.ask("(p)")


def test_an_error_in_a_nested_plot_reaches_the_holding_state():
    inner = "{plot: inner, states: {a: {entry: {trigger: arm.breaks}, on: {ok: e}}, e: {final: true}}}"
    middle = "{plot: middle, states: {a: {use: inner, on: {done: e}}, e: {final: true}}}"
    ran = Ran(
        """
        plot: p
        emits: {because: {why: text}}
        states:
          a: {use: middle, on: {done: e, programming_error: {to: e, emit: because, with: {why: ?event.reason}}}}
          e: {final: true}
        """,
        inner,
        middle,
    )
    (event,) = ran.end.emitted
    assert re.fullmatch(
        r"arm.breaks: RuntimeError: the gripper is stuck \(.*dsc_runs.py:\d+\)", event.attributes["why"]
    )


def test_a_rule_answers_what_goes_wrong_in_a_plot_inside():
    inner = """
        plot: inner
        emits: {slipped: }
        states:
          a: {entry: {trigger: arm.grasp, with: {seconds: 100}, within: 1}, on: {grasped: e, slipped: {to: f}}}
          e: {final: true}
          f: {final: true, emit: slipped}
    """
    ran = Ran(
        """
        plot: p
        states:
          a: {use: inner, on: {done: e, slipped: e}}
          b: {final: true}
          e: {final: true}
        rules:
          - {on: timed_out, when: (= ?event.skill "arm.grasp"), do: {then: retry, limit: 2}}
          - {on: timed_out, do: {then: b}}
        """,
        inner,
    )
    assert ran.end.finished
    assert ran.at == pytest.approx(3)


def test_a_skill_cannot_have_an_outcome_that_is_the_executives():
    with pytest.raises(SchemaError, match=r"skill 'Hand\.open' cannot have the outcome 'done'"):

        class Hand(Component):
            @skill
            async def open(self, call) -> Done:
                return Done()


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
    reason = event["attributes"].pop("reason")
    assert event["attributes"] == {"skill": "arm.grasp", "seconds": 3.0}
    assert re.fullmatch(r"arm\.grasp: no outcome within 3 s, it waited at .*dsc_runs\.py:\d+", reason)


def test_a_skill_has_a_bound_even_if_nobody_says_so():
    ran = Ran(GRASP.replace("{item: cup1}}, on", "{seconds: 1000000}}, on"))
    assert not ran.end.finished
    assert "no transition handles 'timed_out': arm.grasp: no outcome within 300 s" in (ran.end.problem or "")


@pytest.mark.parametrize(
    "entry", ["{trigger: arm.grap}", "{trigger: arm.grasp, with: {itm: cup1}}", "{trigger: arm.grasp}"]
)
def test_a_wrong_call_of_a_skill_is_a_programming_error_that_says_so(entry):
    class Strict(Arm):
        @skill
        async def grasp(self, call, item) -> Grasped:  # type: ignore[override]
            return Grasped()

    ran = Ran("{plot: p, states: {a: {entry: " + entry + ", on: {grasped: e}}, e: {final: true}}}", arm=Strict())
    assert not ran.end.finished
    assert (ran.end.finished, ran.end.programming_error) == (False, ran.end.problem)
    assert "grasp" in (ran.end.problem or "")


def test_a_component_that_cannot_be_configured_fails_the_skill_that_needs_it():
    ran = Ran("""
        plot: p
        states:
          a:
            entry: [{set: arm.approach, to: impossible}, {trigger: arm.grasp}]
            on: {grasped: wrong, programming_error: b}
          b: {entry: [{set: arm.approach, to: side}, {trigger: arm.grasp}], on: {grasped: e}}
          wrong:
          e: {final: true}
    """)
    assert ran.end.finished
    assert ran.arm.log == ["approach=side", "grasp cup1"]
    assert "cannot be set" in ran.of_type("event")[0]["attributes"]["reason"]


def test_a_component_that_exits_while_it_is_configured_has_a_programming_error():
    class Exits(Arm):
        async def configure(self, parameter, value):
            sys.exit("no driver")

    text = "{plot: p, states: {a: {entry: [{set: arm.speed, to: 1}, {trigger: arm.grasp}], on: {grasped: x, programming_error: e}}, x: {}, e: {final: true}}}"
    ran = Ran(text, arm=Exits())
    assert ran.end.finished
    (event,) = ran.of_type("event")
    assert event["attributes"]["skill"] == "arm.speed"
    assert event["attributes"]["reason"].startswith("arm.configure: SystemExit: no driver (")


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
    assert "did not take its last output" in (ran.end.problem or "")
    assert ran.at < 1000


@pytest.mark.parametrize(
    ("value", "slow", "why"),
    [
        ("impossible", 0.0, "arm.configure: RuntimeError: cannot be set ("),
        ("side", 1e6, "component 'arm' did not take its last output: no answer within 30 s"),
    ],
)
def test_a_component_that_cannot_be_configured_is_told_also_when_no_skill_needs_it(value, slow, why):
    ran = Ran(
        f"""
        plot: p
        states:
          a: {{entry: {{set: arm.approach, to: {value}}}, after: {{seconds: 5, to: e}}}}
          e: {{final: true}}
        """,
        arm=Arm(slow_to_configure=slow),
    )
    assert not ran.end.finished
    assert str(ran.end.problem).startswith(why)
    assert (ran.end.programming_error is None) == bool(slow)


# -- components --------------------------------------------------------------------------------------------


def test_a_component_tells_its_skills():
    signature = Arm("left").skills()["grasp"]
    assert signature.component == "left"
    assert signature.parameters == {"item": "item", "seconds": None, "ends": None}
    assert set(signature.defaults) == {"item", "seconds", "ends"}
    assert signature.outcomes == {"grasped": {}, "slipped": {"item": "item"}}
    assert set(Arm().skills()) == {"grasp", "look", "breaks", "waits_for_a_thread"}


def test_arguments_are_checked_against_the_signature():
    class Strict(Component):
        @skill
        async def go(self, call, to, speed=1) -> Never:
            raise NotImplementedError

    signature = Strict().skills()["go"]
    check_arguments(signature, {"to": 1})
    with pytest.raises(InputError, match=r"skill 'strict\.go' needs its parameter 'to'"):
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


# -- putting things in order -------------------------------------------------------------------------------


class Tidy(Arm):
    """Whose fingers take `seconds` to open when it is cancelled."""

    def __init__(self, seconds=1.0):
        super().__init__()
        self.seconds = seconds

    @skill
    async def hold(self, call) -> Held:  # type: ignore[return]
        try:
            await call.clock.sleep(SLOW)
        finally:
            await call.clock.sleep(self.seconds)
            self.note(f"open at {call.clock.now():g}")

    @skill
    async def close(self, call) -> Closed:
        self.note(f"closes at {call.clock.now():g}")
        return Closed()

    @query
    async def how(self) -> How:
        self.note("asked")
        return How(mode=self.mode)


class AllAtOnce(Tidy):
    concurrent = True


HOLD_THEN = """
    plot: p
    states:
      hold: {entry: {trigger: arm.hold}, after: {seconds: 2, to: next}, on: {held: x}}
      next: {entry: {trigger: arm.NEXT, within: WITHIN}, on: {OUTCOME: e, timed_out: e}}
      x: {}
      e: {final: true}
"""


@pytest.mark.parametrize(("arm", "next_", "within", "log", "at"), [
    (Tidy, "close", 100, ["open at 3", "closes at 3"], 3),
    (AllAtOnce, "close", 100, ["closes at 2", "open at 3"], 3),
    (Tidy, "how", 100, ["asked", "open at 3"], 3),
    (lambda: Tidy(5), "close", 3, ["open at 7"], 7),
])  # fmt: skip
def test_a_skill_waits_until_what_was_cancelled_there_has_put_things_in_order(arm, next_, within, log, at):
    text = HOLD_THEN.replace("NEXT", next_).replace("WITHIN", str(within))
    ran = Ran(text.replace("OUTCOME", "answered" if next_ == "how" else "closed"), arm=arm())
    assert (ran.end.finished, ran.end.problem) == (True, None)
    assert ran.arm.log == log
    assert ran.at == pytest.approx(at)


def test_a_skill_waits_no_longer_than_until_what_was_cancelled_there_is_given_up():
    ran = Ran(HOLD_THEN.replace("NEXT", "close").replace("WITHIN", "100").replace("OUTCOME", "closed"), arm=Tidy(SLOW))
    assert not ran.end.finished
    assert "skill 'arm.hold' ignored its cancellation for 30 s and was abandoned" in (ran.end.problem or "")
    assert ran.arm.log == ["closes at 32"]

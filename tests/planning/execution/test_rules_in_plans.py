"""Rules and handlers over plans that are really made and carried out: inserted, left out, interrupted (S1.4, S1.14)."""

from __future__ import annotations

from typing import Annotated

import pytest

from dsc import Component, Event, Outcome, SkillCall, parse_plot, skill
from dsc.errors import PlotError
from dsc.trace import Record
from knowledge_base import Delta, fact
from planning import PlanningDomain, Robot

DOMAIN = PlanningDomain.parse("""
(define (domain photographs)
  (:types thing)
  (:predicates (shown ?t - thing) (lit ?t - thing) (dirty ?t - thing) (known ?t - thing) (noticed))
  (:action light :parameters (?thing - thing) :precondition (known ?thing) :effect (lit ?thing))
  (:action show :parameters (?thing - thing) :precondition (lit ?thing) :effect (shown ?thing)))
""")
PLOTS = [
    """
plot: light_it
implements: light
parameters: {thing: thing}
states: {a: {entry: {trigger: studio.light, with: {thing: ?thing}}, on: {lit: e}}, e: {final: true}}
""",
    """
plot: show_it
implements: show
parameters: {thing: thing, zoom: {type: symbol, default: wide}}
emits: {blurred: {thing: thing}}
states:
  a:
    entry: {trigger: studio.show, with: {thing: ?thing, zoom: ?zoom}}
    on: {shown: e, blurred: {to: f, emit: blurred, with: {thing: ?thing}}}
  e: {final: true}
  f: {final: true}
""",
    """
plot: wipe
parameters: {thing: thing}
states: {a: {entry: {trigger: studio.wipe, with: {thing: ?thing}}, on: {wiped: e}}, e: {final: true}}
""",
]
HOLDER = """
plot: photograph
receives: {visitor: }
emits: {failed: {reason: text}}
states:
  all:
    goal: (forall (?t - thing) (shown ?t))
    on:
      done: over
      no_plan: {to: over, emit: failed, with: {reason: ?event.reason}}
      gave_up: {to: over, emit: failed, with: {reason: ?event.reason}}
  over: {final: true}
"""


Thing = Annotated[str, "thing"]


class Lit(Outcome): ...


class Shown(Outcome): ...


class Blurred(Outcome): ...


class Wiped(Outcome): ...


class Studio(Component):
    name = "studio"

    def __init__(self, blurred=()):
        super().__init__()
        self.done = []
        self.blurred = list(blurred)
        self.seconds = {}

    @skill
    async def light(self, call: SkillCall, thing: Thing) -> Lit:
        return await self._do(call, "light", thing, "lit", fact("lit", thing))  # type: ignore[return-value]

    @skill
    async def show(self, call: SkillCall, thing: Thing, zoom: str) -> Shown | Blurred:
        if thing in self.blurred and zoom == "wide":
            return await self._do(call, f"show {zoom}", thing, "blurred")  # type: ignore[return-value]
        return await self._do(call, f"show {zoom}", thing, "shown", fact("shown", thing))  # type: ignore[return-value]

    @skill
    async def wipe(self, call: SkillCall, thing: Thing) -> Wiped:
        await call.clock.sleep(1.0)
        self.done.append(("wipe", thing))
        return Wiped(observed=Delta(removed=(fact("dirty", thing),)))

    async def _do(self, call, what, thing, ends, *seen) -> Outcome:
        await call.clock.sleep(self.seconds.get((what, thing), 1.0))
        self.done.append((what, thing))
        return Outcome(ends, observed=Delta(added=seen))


def photographed(reactions, *facts, blurred=(), prepare=None):
    studio = Studio(blurred)
    plots = [parse_plot(text) for text in (HOLDER + reactions, *PLOTS)]
    with Robot(DOMAIN, plots, [studio], clock="simulated") as robot:
        known = [fact("known", thing) for thing in ("cup", "pot")]
        robot.knowledge.apply(Delta(nodes={"cup": "thing", "pot": "thing"}, added=(*known, *facts)), "test")
        end = robot.run("photograph", prepare=prepare)
        return end, studio.done, robot.knowledge


def test_a_step_is_inserted_before_those_that_need_it():
    rule = "rules: [{before: show, when: (dirty ?step.thing), do: {use: wipe, with: {thing: ?step.thing}}}]"
    end, done, _ = photographed(rule, fact("dirty", "pot"))
    assert (end.finished, end.emitted, end.problem) == (True, (), None)
    assert [one for one in done if one[1] == "pot"] == [("light", "pot"), ("wipe", "pot"), ("show wide", "pot")]
    assert ("wipe", "cup") not in done


def test_a_step_is_left_out_and_the_goal_is_judged_all_the_same():
    """The light that was left out is needed: the plan is made anew, and ends in giving up, not in a false success."""
    rule = "rules: [{before: light, when: (dirty ?step.thing), do: {then: continue}}]"
    end, done, knowledge = photographed(rule, fact("dirty", "pot"))
    assert ("light", "pot") not in done
    assert [event.name for event in end.emitted] == ["failed"]
    assert not knowledge.ask("(shown pot)")


def test_a_step_that_another_plot_has_done_already_is_left_out():
    rules = """
rules:
  - {before: light, when: (dirty ?step.thing), do: {tell: (lit ?step.thing), then: continue}}
"""
    end, done, knowledge = photographed(rules, fact("dirty", "pot"))
    assert end.emitted == ()
    assert [one for one in done if one[1] == "pot"] == [("show wide", "pot")]
    assert knowledge.ask("(forall (?t - thing) (shown ?t))")


def started(records):
    """The robot's skills that were started and cancelled, in order."""
    own = [one.data for one in records if one.type == "action" and str(one.data.get("skill")).startswith("studio.")]
    return [(one["action"], one["skill"]) for one in own]


@pytest.mark.parametrize("omitted", ["cup", "pot"])
@pytest.mark.parametrize("parallel", [True, False])
def test_the_step_after_an_omitted_step_begins_once(omitted, parallel):
    """The step that is left out counts as done, so that nobody thinks there are steps of no use."""
    rule = "rules: [{before: light, when: (dirty ?step.thing), do: {tell: (lit ?step.thing), then: continue}}]"
    records: list[Record] = []
    end, studio, _ = away(rule, fact("dirty", omitted), records=records, parallel=parallel)
    assert (end.finished, end.emitted) == (True, ())
    assert len(studio.done) == 3
    assert started(records) == [("start", f"studio.{what}") for what in ("light", "show", "show")]
    assert not [one for one in records if one.type in ("plan.skipped", "plan.broken")]


def test_the_step_at_work_is_not_interrupted_when_a_later_one_turns_out_to_be_of_no_use():
    """Nor does the next one of the old plan begin: the plan goes on without the steps that are left out."""

    def guest(sequencer):
        sequencer.change(Delta(added=(fact("shown", "pot"),)), "guest", after=1.5)

    studio = Studio()
    records: list[Record] = []
    plots = [parse_plot(text) for text in (HOLDER, *PLOTS)]
    with Robot(DOMAIN, plots, [studio], clock="simulated") as robot:
        robot.listen(records.append)
        known = tuple(fact("known", thing) for thing in ("cup", "pot"))
        robot.knowledge.apply(Delta(nodes={"cup": "thing", "pot": "thing"}, added=known), "test")
        end = robot.run("photograph", prepare=guest)
    assert (end.finished, end.emitted) == (True, ())
    assert started(records) == [("start", f"studio.{what}") for what in ("light", "light", "show")]
    (skipped,) = [one.data for one in records if one.type == "plan.skipped"]
    assert skipped["steps"] == ["(show pot)"]


def test_a_retry_changes_the_parameters_of_the_step():
    rule = "rules: [{on: blurred, of: show, do: {then: retry, pass: {zoom: near}}}]"
    end, done, _ = photographed(rule, blurred=["cup"])
    assert end.emitted == ()
    assert [one for one in done if one[1] == "cup"] == [("light", "cup"), ("show wide", "cup"), ("show near", "cup")]


def test_a_handler_answers_beside_a_plan_that_goes_on():
    handler = "handlers: [{on: visitor, do: {tell: (noticed)}}]"
    end, done, knowledge = photographed(handler, prepare=lambda sequencer: sequencer.post(Event("visitor")))
    assert end.finished
    assert len(done) == 4
    assert knowledge.ask("(noticed)")


def test_a_handler_interrupts_a_plan_and_a_new_one_reaches_the_goal():
    handler = "handlers: [{on: visitor, interrupt: true, do: {tell: (noticed), use: wipe, with: {thing: cup}}}]"
    end, done, knowledge = photographed(handler, prepare=lambda sequencer: sequencer.post(Event("visitor")))
    assert end.emitted == ()
    assert done[0] == ("wipe", "cup")
    assert knowledge.ask("(and (noticed) (forall (?t - thing) (shown ?t)))")


# -- rules that lead out of a plan to a state of the plot that holds its goal -----------------------------------

ASIDE = "  aside: {use: wipe, with: {thing: pot}, on: {done: all}}\n"
TOLD = "  told: {use: tell_it, on: {done: over}}\n"
TELL_IT = "plot: tell_it\nparameters: {what: {type: symbol, default: nothing}}\nstates: {a: {entry: {set: studio.told, to: ?what}, on: {done: e}}, e: {final: true}}"


def away(rules, *facts, beside="", parallel=True, holder=HOLDER, records=None, **more):
    studio = Studio(**more)
    plots = [parse_plot(text) for text in (holder + beside + rules, TELL_IT, *PLOTS)]
    with Robot(DOMAIN, plots, [studio], parallel=parallel, clock="simulated") as robot:
        if records is not None:
            robot.listen(records.append)
        known = [fact("known", thing) for thing in ("cup", "pot")]
        robot.knowledge.apply(Delta(nodes={"cup": "thing", "pot": "thing"}, added=(*known, *facts)), "test")
        return robot.run("photograph"), studio, robot.knowledge


@pytest.mark.parametrize("parallel", [True, False])
@pytest.mark.parametrize(
    "rule", ["{on: blurred, do: {then: over}}", "{on: blurred, of: show, do: {tell: (noticed), then: over}}"]
)
def test_a_rule_leads_out_of_a_plan_to_a_state_beside_its_goal(rule, parallel):
    end, studio, knowledge = away(f"rules: [{rule}]", blurred=["cup", "pot"], parallel=parallel)
    assert (end.finished, end.emitted, end.problem) == (True, (), None)
    assert sum(what == "show wide" for what, _ in studio.done) == 1  # nobody goes on with what was planned
    assert knowledge.ask("(noticed)") is ("noticed" in rule)


def test_a_step_that_would_begin_is_left_for_another_state():
    end, studio, _ = away(
        "rules: [{before: show, when: (dirty ?step.thing), do: {then: aside}}]", fact("dirty", "pot"), beside=ASIDE
    )
    assert (end.finished, end.emitted) == (True, ())
    assert [one for one in studio.done if one[1] == "pot"] == [("light", "pot"), ("wipe", "pot"), ("show wide", "pot")]


def test_a_parameter_passed_by_a_rule_reaches_the_target_state():
    rules = (
        "rules: [{on: blurred, do: {use: wipe, with: {thing: ?event.thing}, then: told, pass: {what: ?event.thing}}}]"
    )
    end, studio, _ = away(rules, blurred=["pot"], beside=TOLD)
    assert end.finished
    assert studio.parameters["told"] == "pot"
    assert studio.done[-1] == ("wipe", "pot")


def test_a_rule_that_leads_away_again_and_again_ends_with_giving_up():
    """The step is left for a state that leads back at once: as many new plans as the budget has, then the reason."""
    holder = HOLDER.replace(
        "goal: (forall (?t - thing) (shown ?t))", "goal: (forall (?t - thing) (shown ?t))\n    budget: {replans: 3}"
    )
    records: list[Record] = []
    rule, beside = "rules: [{before: light, do: {then: aside}}]", "  aside: {on: {done: all}}\n"
    end, studio, _ = away(rule, holder=holder, beside=beside, records=records)
    assert end.finished
    (failed,) = end.emitted
    assert failed.attributes["reason"] == "the budget of 3 new plans is used up: rules have led to 'aside' once more"
    assert studio.done == []
    assert sum(record.type == "rule" for record in records) == 5


AROUND = """
plot: photograph
emits: {failed: {reason: text}}
states:
  outer:
    states:
      all:
        goal: (forall (?t - thing) (shown ?t))
        budget: {replans: 3}
        on: {done: over, no_plan: {to: over, when: (noticed)}OWN}
      over: {final: true}
      aside: {on: {done: all}}
    on:
      done: end
      no_plan: {to: end, emit: failed, with: {reason: ?event.reason}}
      gave_up: {to: end, emit: failed, with: {reason: ?event.reason}}
  end: {final: true}
"""


@pytest.mark.parametrize("own", ["", ", gave_up: {to: over, when: (noticed)}"])
@pytest.mark.parametrize("parallel", [True, False])
def test_giving_up_for_being_led_away_too_often_reaches_whoever_wires_it(own, parallel):
    rule = "rules: [{before: light, do: {then: aside}}]"
    end, studio, _ = away(rule, holder=AROUND.replace("OWN", own), parallel=parallel)
    assert end.finished
    (failed,) = end.emitted
    assert failed.attributes["reason"] == "the budget of 3 new plans is used up: rules have led to 'aside' once more"
    assert studio.done == []


def test_leading_away_is_bounded_anew_when_the_goal_has_been_reached():
    """A plot that goes on for ever may be led away each time once; only what never gets anywhere is given up."""
    holder = HOLDER.replace("goal: (forall", "budget: {replans: 0}\n    goal: (forall").replace(
        "done: over\n", "done: again\n", 1
    )
    holder = holder.replace(
        "  over:",
        "  again: {always: [{to: all, when: (noticed), tell: [(not (noticed)), (not (shown cup)), (dirty cup)]}, over]}\n  over:",
    )
    rule = "rules: [{before: show, when: (dirty ?step.thing), do: {then: aside}}]"
    end, studio, _ = away(
        rule, fact("dirty", "cup"), fact("noticed"), holder=holder, beside=ASIDE.replace("pot", "cup")
    )
    assert (end.finished, end.emitted) == (True, ())
    assert [one for one in studio.done if one == ("wipe", "cup")] == [("wipe", "cup")] * 2


def test_leaving_a_plan_takes_what_runs_in_it_and_its_watching_along():
    """Exit actions of the step that goes on in another lane put its component at rest, and its skill is cancelled."""
    slow = PLOTS[0].replace(
        "a: {entry: {trigger: studio.light", "a: {exit: {switch: studio, to: dark}, entry: {trigger: studio.light"
    )
    studio = Studio(blurred=["cup"])
    records: list[Record] = []
    studio.concurrent = True
    studio.seconds = {("light", "pot"): 50.0}
    plots = [
        parse_plot(text) for text in (HOLDER + "rules: [{on: blurred, do: {then: over}}]", TELL_IT, slow, *PLOTS[1:])
    ]
    with Robot(DOMAIN, plots, [studio], clock="simulated") as robot:
        robot.listen(records.append)
        known = [fact("known", thing) for thing in ("cup", "pot")]
        robot.knowledge.apply(Delta(nodes={"cup": "thing", "pot": "thing"}, added=tuple(known)), "test")
        end = robot.run("photograph")
    assert (end.finished, end.problem, studio.mode) == (True, None, "dark")
    assert studio.done == [("light", "cup"), ("show wide", "cup")]
    assert records[-1].t < 10


def test_a_rule_whose_state_is_not_beside_the_goal_is_refused():
    around = "  around: {states: {first: {on: {done: inside}}, inside: {on: {done: last}}, last: {final: true}}, on: {done: over}}\n"
    holder = HOLDER.replace("gave_up: {to: over", "gave_up: {to: around")
    with pytest.raises(PlotError, match="the rule's way from a plan at 'all' to 'inside' crosses a border"):
        away("rules: [{on: blurred, do: {then: inside}}]", holder=holder, beside=around)


@pytest.mark.parametrize(
    "rule",
    [
        "{on: blurred, do: {tell: (not (lit ?event.thing)), then: retry}}",
        "{before: show, when: (dirty ?step.thing), do: {tell: [(not (lit ?step.thing)), (not (dirty ?step.thing))], then: enter}}",
    ],
    ids=["retry", "enter"],
)
def test_a_rule_that_breaks_the_condition_of_its_step_begins_the_step_only_when_it_holds_again(rule):
    """The lamp that the rule puts out is lit once more before the thing is shown again."""
    lit = []

    def prepare(sequencer):
        def look(record):
            said = record.data
            if record.type == "action" and (said["action"], said.get("skill")) == ("start", "studio.show"):
                lit.append(sequencer.knowledge.ask(f"(lit {said['arguments']['thing']})"))

        sequencer.trace.listen(look)

    photographed(f"rules: [{rule}]", fact("dirty", "cup"), blurred=["cup"], prepare=prepare)
    assert lit
    assert all(lit)

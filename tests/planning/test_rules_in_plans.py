"""Rules and handlers over plans that are really made and carried out: inserted, left out, interrupted (S1.4, S1.14)."""

from __future__ import annotations

from dsc import Component, Event, Outcome, SkillCall, parse_plot, skill
from knowledge_base import Delta, fact
from planning import Executive, PlanningDomain

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


class Studio(Component):
    name = "studio"

    def __init__(self, blurred=()):
        super().__init__()
        self.done = []
        self.blurred = list(blurred)

    @skill(outcomes={"lit": {}}, types={"thing": "thing"})
    async def light(self, call: SkillCall, thing: str) -> Outcome:
        return await self._do(call, "light", thing, "lit", fact("lit", thing))

    @skill(outcomes={"shown": {}, "blurred": {}}, types={"thing": "thing"})
    async def show(self, call: SkillCall, thing: str, zoom: str) -> Outcome:
        if thing in self.blurred and zoom == "wide":
            return await self._do(call, f"show {zoom}", thing, "blurred")
        return await self._do(call, f"show {zoom}", thing, "shown", fact("shown", thing))

    @skill(outcomes={"wiped": {}}, types={"thing": "thing"})
    async def wipe(self, call: SkillCall, thing: str) -> Outcome:
        await call.clock.sleep(1.0)
        self.done.append(("wipe", thing))
        return Outcome("wiped", observed=Delta(removed=(fact("dirty", thing),)))

    async def _do(self, call, what, thing, ends, *seen):
        await call.clock.sleep(1.0)
        self.done.append((what, thing))
        return Outcome(ends, observed=Delta(added=seen))


def photographed(reactions, *facts, blurred=(), prepare=None):
    studio = Studio(blurred)
    plots = [parse_plot(text) for text in (HOLDER + reactions, *PLOTS)]
    with Executive(DOMAIN, plots, [studio]) as robot:
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

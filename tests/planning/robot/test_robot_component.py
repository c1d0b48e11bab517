"""Robots as components: another robot plans with their actions, uses their plots, and learns what they learn."""

from __future__ import annotations

import asyncio

import pytest

from dsc import Component, Outcome, SkillCall, parse_plot, skill
from dsc.errors import SkillError
from dsc.profiles import configure
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.testing import LossyTransport
from dsc.text.profiles import parse_profile
from dsc.trace import Record
from dsc.wire import Host, RemoteComponent
from knowledge_base import Delta, KnowledgeBase, fact
from knowledge_base.errors import InputError, UnknownNameError
from planning import PlanningDomain, Robot
from planning.robot.robot_component import RobotComponent

DOMAIN = """
(define (domain carrying)
  (:types place item - object)
  (:predicates (robot-at ?p - place) (item-at ?i - item ?p - place) (blocked ?p - place))
  (:action drive :parameters (?from ?to - place) :precondition (robot-at ?from)
    :effect (and (robot-at ?to) (not (robot-at ?from))))
  (:action carry :parameters (?item - item ?from ?to - place)
    :precondition (and (item-at ?item ?from) (robot-at ?from))
    :effect (and (item-at ?item ?to) (not (item-at ?item ?from)) (robot-at ?to) (not (robot-at ?from)))))
"""
PLOTS = """
plot: drive_directly
when: (not (blocked ?to))
implements: drive
parameters: {from: place, to: place}
states:
  go: {entry: {trigger: base.drive, with: {start: ?from, to: ?to}}, on: {arrived: there}}
  there: {final: true}
---
plot: drive_round
implements: drive
parameters: {from: place, to: place}
states:
  go: {entry: {trigger: base.drive, with: {start: ?from, to: ?to, slowly: true}}, on: {arrived: there}}
  there: {final: true}
---
plot: bring
implements: carry
parameters: {item: item, from: place, to: place}
emits: {too_heavy: {item: item}}
states:
  go:
    entry: {trigger: base.carry, with: {item: ?item, start: ?from, to: ?to}}
    on: {carried: there, too_heavy: {to: no, emit: too_heavy, with: {item: ?item}}}
  there: {final: true}
  no: {final: true}
"""
WORLD = Delta(nodes={"hall": "place", "lab": "place", "cup": "item"}, added=(fact("robot-at", "hall"),))


class Arrived(Outcome): ...


class Carried(Outcome): ...


class TooHeavy(Outcome): ...


class Base(Component):
    name = "base"

    def __init__(self) -> None:
        super().__init__()
        self.did: list[tuple[object, ...]] = []
        self.broken = False

    @skill
    async def drive(self, call: SkillCall, start: str, to: str, slowly: bool = False) -> Arrived:
        await call.clock.sleep(10.0 if slowly else 1.0)
        if self.broken:
            raise SkillError("the motor is hot")
        self.did.append(("drive", start, to, slowly))
        return Arrived(observed=Delta(added=(fact("robot-at", to),), removed=(fact("robot-at", start),)))

    @skill
    async def carry(self, call: SkillCall, item: str, start: str, to: str) -> Carried | TooHeavy:
        await call.clock.sleep(1.0)
        if item == "piano":
            return TooHeavy()
        self.did.append(("carry", item, to))
        moved = Delta(
            added=(fact("item-at", item, to), fact("robot-at", to)),
            removed=(fact("item-at", item, start), fact("robot-at", start)),
        )
        return Carried(observed=moved)


def carrier(base, *more):
    domain = PlanningDomain.parse(DOMAIN)
    knowledge = KnowledgeBase(domain.schema)
    knowledge.apply(WORLD.then(Delta(added=(fact("item-at", "cup", "hall"), *more))), "test")
    return Robot(domain, [parse_plot(text) for text in PLOTS.split("---")], [base], knowledge)


def told(component, known=(), plots=()):
    """Return a robot without a domain and devices of its own, which knows the component."""
    boss = Robot("(define (domain nothing))", plots, [component])
    boss.knowledge.apply(WORLD.then(Delta(added=(fact("item-at", "cup", "hall"), *known))), "test")
    return boss


def ran(start, *, base=None, more=(), wired=False, private=False, plots=()):
    """Return the end of a run of the boss with its records and robots."""
    base = base or Base()
    records: list[Record] = []

    async def main():
        helper = carrier(base, *more)
        component: Component = RobotComponent("helper", helper, private=private)
        host = None
        if wired:
            transport = LossyTransport(seed=3, loss=0.05, double=0.05, delay=0.02)
            host = Host(component, transport, LoopClock())
            component = await RemoteComponent.connect("helper", transport)
        boss = told(component, plots=plots)
        boss.listen(records.append)
        end = await boss.start(start)
        if host is not None:
            await host.close()
        return end, boss, helper

    end, boss, helper = run_simulated(main())
    return end, records, boss, helper


@pytest.mark.parametrize("wired", [False, True])
def test_a_robot_without_actions_plans_with_those_of_another(wired):
    base = Base()
    end, records, boss, helper = ran("(item-at cup lab)", base=base, wired=wired)
    assert end.reached, end.reason
    assert base.did == [("carry", "cup", "lab")]
    assert boss.knowledge.ask("(and (item-at cup lab) (robot-at lab) (not (robot-at hall)))")
    assert helper.knowledge.ask("(item-at cup lab)")
    (found,) = [record for record in records if record.type == "plan.found"]
    assert found.data["steps"] == ["(carry cup hall lab)"]


@pytest.mark.parametrize(("more", "chosen"), [((), "drive_directly"), ((fact("blocked", "lab"),), "drive_round")])
def test_the_other_robot_decides_by_its_own_knowledge_and_the_trace_has_its_decision(more, chosen):
    base = Base()
    end, records, _, _ = ran("(robot-at lab)", base=base, more=more)
    assert end.reached, end.reason
    assert base.did == [("drive", "hall", "lab", chosen == "drive_round")]
    decisions = {record.data["state"]: record.data for record in records if record.type == "decision"}
    inner = [data for state, data in decisions.items() if state.endswith("/there/choose")]
    assert [one["chosen"] for one in inner] == [chosen]
    assert {one["plot"] for one in inner[0]["candidates"]} == {"drive_directly", "drive_round"}


def test_own_plots_come_before_those_of_another_robot():
    own = """
        plot: own_carry
        implements: carry
        parameters: {item: item, from: place, to: place}
        effects: assumed
        states: {a: {after: {seconds: 1, to: b}}, b: {final: true}}
    """
    base = Base()
    end, _, boss, _ = ran("(item-at cup lab)", base=base, plots=[parse_plot(own)])
    assert end.reached
    assert not base.did
    assert boss.library.plot("helper.bring").implements is None


def test_outcomes_of_the_other_plot_are_events_of_the_state():
    order = """
        plot: order
        emits: {refused: {item: item}}
        states:
          go:
            use: helper.bring
            with: {item: piano, from: hall, to: lab}
            on: {done: over, too_heavy: {to: no, emit: refused, with: {item: ?event.item}}}
          over: {final: true}
          no: {final: true}
    """

    async def main():
        helper = carrier(Base())
        helper.knowledge.apply(Delta(nodes={"piano": "item"}, added=(fact("item-at", "piano", "hall"),)), "test")
        boss = told(RobotComponent("helper", helper))
        boss.knowledge.apply(Delta(nodes={"piano": "item"}), "test")
        boss = Robot(boss.domain, [parse_plot(order)], boss.components, boss.knowledge)
        return await boss.start("order")

    end = run_simulated(main())
    assert [(one.name, dict(one.attributes)) for one in end.emitted] == [("refused", {"item": "piano"})]


def test_an_effect_that_the_other_robot_knew_before_is_confirmed():
    class Still(Base):
        @skill
        async def carry(self, call: SkillCall, item: str, start: str, to: str) -> Carried | TooHeavy:
            return Carried()  # it is there already, and the robot knows it

    async def main():
        helper = carrier(Still())
        there = Delta(
            added=(fact("item-at", "cup", "lab"), fact("robot-at", "lab")), removed=(fact("robot-at", "hall"),)
        )
        helper.knowledge.apply(there.then(Delta(removed=(fact("item-at", "cup", "hall"),))), "test")
        boss = told(RobotComponent("helper", helper))
        return await boss.start("(item-at cup lab)"), boss

    end, boss = run_simulated(main())
    assert end.reached, end.reason
    assert boss.knowledge.ask("(and (item-at cup lab) (robot-at lab) (not (item-at cup hall)) (not (robot-at hall)))")


@pytest.mark.parametrize(("known", "count"), [(None, None), (3.0, 3.0)])
def test_a_number_that_an_action_changes_is_confirmed_if_the_robot_knows_it(known, count):
    text = """
        (define (domain counting) (:predicates (done)) (:functions (count) - number)
          (:action work :effect (and (done) (increase (count) 1))))
    """
    plot = "{plot: work, implements: work, effects: assumed, states: {s: {final: true}}}"

    async def main():
        domain = PlanningDomain.parse(text)
        knowledge = KnowledgeBase(domain.schema)
        values = {} if known is None else {fact("count"): known}
        knowledge.apply(Delta(added=(fact("done"),), values=values), "test")
        helper = RobotComponent("helper", Robot(domain, [parse_plot(plot)], [], knowledge))
        call = SkillCall("a1", LoopClock(), lambda _: None)
        return await helper.execute("work", call, {})

    observed = run_simulated(main()).observed
    assert dict(observed.values) == ({} if count is None else {fact("count"): count})


def test_objects_that_the_other_robot_finds_become_known():
    class Finder(Base):
        @skill
        async def carry(self, call: SkillCall, item: str, start: str, to: str) -> Carried | TooHeavy:
            await call.clock.sleep(1.0)
            found = Delta(nodes={"spoon": "item"}, added=(fact("item-at", "spoon", to), fact("item-at", item, to)))
            return Carried(observed=found.then(Delta(removed=(fact("item-at", item, start),))))

    async def main():
        helper = carrier(Finder(), fact("robot-at", "lab"))
        helper.knowledge.apply(Delta(nodes={"attic": "place"}, added=(fact("blocked", "attic"),)), "test")
        boss = told(RobotComponent("helper", helper))
        run = boss.start("(item-at cup lab)")
        await asyncio.sleep(0.5)
        helper.knowledge.apply(Delta(removed=(fact("blocked", "attic"),), added=(fact("robot-at", "attic"),)), "test")
        return await run, boss

    end, boss = run_simulated(main())
    assert end.finished, end.reason
    assert boss.knowledge.ask("(and (item-at spoon lab) (robot-at attic))")


def test_a_private_robot_keeps_domain_and_knowledge():
    async def main():
        component = RobotComponent("helper", carrier(Base()), private=True)
        text = "{plot: order, states: {go: {use: helper.bring, on: {done: e, too_heavy: e}, with: {item: cup, from: hall, to: lab}}, e: {final: true}}}"
        domain = PlanningDomain.parse("(define (domain boss) (:types place item))")
        boss = Robot(domain, [parse_plot(text)], [component])
        boss.knowledge.apply(Delta(nodes=WORLD.nodes), "test")
        return await boss.start("order"), boss

    end, boss = run_simulated(main())
    assert end.finished, end.reason
    assert not boss.domain.actions
    assert not boss.knowledge.facts()


def test_a_failure_of_the_other_robot_is_one_of_the_step_and_leads_to_a_new_plan():
    base = Base()
    base.broken = True
    end, records, _, _ = ran("(robot-at lab)", base=base)
    assert end.reached
    assert base.did == [("carry", "cup", "lab")]  # the other way to the lab
    failed = [record.data for record in records if record.type == "event" and record.data["name"] == "skill_error"]
    assert {one["source"] for one in failed} == {"base.drive", "helper.drive"}
    assert all("the motor is hot" in one["attributes"]["reason"] for one in failed)


@pytest.mark.parametrize("which", ["helper", "other"])
def test_a_state_becomes_the_plot_of_the_robot_that_its_parameter_names(which):
    order = """
        plot: order
        parameters: {how: plot}
        states:
          go: {use: ?how, with: {from: hall, to: lab}, on: {done: over, nothing_fits: over}}
          over: {final: true}
    """
    bases = {"helper": Base(), "other": Base()}

    async def main():
        robots = [RobotComponent(name, carrier(base)) for name, base in bases.items()]
        boss = Robot("(define (domain nothing))", [parse_plot(order)], robots)
        boss.knowledge.apply(WORLD, "test")
        return await boss.start("order", {"how": f"{which}.drive"})

    assert run_simulated(main()).finished
    assert [name for name, base in bases.items() if base.did] == [which]


DRIVES = """
    plot: tour
    parameters: {slowly: {type: boolean, default: false, changed_by: operator}, rounds: {type: integer, default: 1, least: 1, most: 3}}
    states:
      go: {entry: {trigger: base.drive, with: {start: hall, to: lab, slowly: ?slowly}}, on: {arrived: over}}
      over: {final: true}
"""


def test_defaults_of_plots_are_parameters_in_the_hull():
    base = Base()

    async def main():
        helper = carrier(base)
        helper.library.add(parse_plot(DRIVES))
        transport = LossyTransport(seed=4, loss=0.05, double=0.05, delay=0.02)
        host = Host(RobotComponent("helper", helper), transport, LoopClock())
        remote = await RemoteComponent.connect("helper", transport)
        assert dict(remote.parameters) == {"tour.slowly": False, "tour.rounds": 1}
        await remote.configure("tour.slowly", True)
        with pytest.raises(InputError, match="from 1 to 3"):
            await remote.configure("tour.rounds", 4)
        with pytest.raises(UnknownNameError, match=r"tour\.rounds"):
            await remote.configure("tour.round", 2)
        order = "{plot: order, states: {go: {use: helper.tour, on: {done: e}}, e: {final: true}}}"
        boss = told(remote, plots=[parse_plot(order)])
        run = boss.start("order")
        await asyncio.sleep(5.0)
        (running,) = (await remote.diagnose())["runs"]
        assert running["active"] == ["go"]
        assert [one["skill"] for one in running["skills"]] == ["base.drive"]
        assert (await run).finished
        await remote.configure("tour.slowly", None)
        assert (await boss.start("order")).finished
        await host.close()

    run_simulated(main())
    assert [slowly for *_, slowly in base.did] == [True, False]


def test_a_profile_of_the_client_sets_the_defaults_at_the_host():
    base = Base()

    async def main():
        helper = carrier(base)
        helper.library.add(parse_plot(DRIVES))
        transport = LossyTransport(seed=5)
        host = Host(RobotComponent("helper", helper), transport, LoopClock())
        remote = await RemoteComponent.connect("helper", transport)
        profile = parse_profile("{profile: slow, components: {helper: {tour.slowly: true}}}")
        configure([remote], profile)
        order = "{plot: order, states: {go: {use: helper.tour, on: {done: e}}, e: {final: true}}}"
        assert (await told(remote, plots=[parse_plot(order)]).start("order")).finished
        await host.close()

    run_simulated(main())
    assert base.did == [("drive", "hall", "lab", True)]


def test_a_component_that_starts_again_runs_its_plots():
    async def main():
        helper = carrier(Base())
        component = RobotComponent("helper", helper)
        boss = told(component)
        assert (await boss.start("(robot-at lab)")).reached
        await component.life.restart()
        return await boss.start("(robot-at hall)")

    assert run_simulated(main()).reached


def test_a_cancelled_skill_ends_the_run_of_the_other_robot():
    base = Base()
    order = """
        plot: order
        states:
          go: {use: helper.drive, with: {from: hall, to: lab}, on: {done: over, nothing_fits: over}, after: {seconds: 0.5, to: over}}
          over: {final: true}
    """
    end, records, _boss, helper = ran("order", base=base, plots=[parse_plot(order)])
    assert end.finished
    assert not base.did
    assert not helper.runs
    assert [record.t for record in records if record.type == "end"] == [0.5]

"""Conditions on pushed values, evaluated at their component: `watch_values` (S1.8, S2.4, S2.18)."""

from __future__ import annotations

import asyncio

import pytest
from counting_transport import CountingTransport
from dsc_charts import plot
from hypothesis import given
from hypothesis import strategies as st

from dsc.calls import SkillCall
from dsc.components.checks import LIBRARY, Series, by_name
from dsc.components.component import Component
from dsc.components.streams import Push
from dsc.components.value_conditions import ValueCondition
from dsc.dynamic.library import Library
from dsc.events import Event
from dsc.outcomes import Outcome
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.sequencer.sequencer import Sequencer
from dsc.skills import skill
from dsc.wire.host import Host
from dsc.wire.remote import RemoteComponent
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema import Schema


class Played(Outcome): ...


def beyond(value: Series, limit: float) -> bool:
    return value.number > limit


class Hand(Component):
    name = "hand"
    concurrent = True
    pose = Push({"distance": "number", "xyz": "list of number"}, checks=[beyond])
    force = Push({"z": "number", "label": "text"})

    def __init__(self, script=()) -> None:
        super().__init__()
        self.script = script

    @skill(unlimited=True)
    async def play(self, call: SkillCall) -> Played:
        for at, port, values in self.script:
            await call.clock.sleep(max(0.0, at - call.clock.now()))
            getattr(self, port).put(**values)
        await call.clock.sleep(1)
        return Played()


PLOT = """
    plot: p
    emits: {flip: {truth: boolean, values: map of any}, broken: {why: text}}
    variables: {limit: {type: number, initial: 10}}
    states:
      w:
        regions:
          a: {states: {x: {entry: {trigger: hand.play}, on: {played: f}}, f: {final: true}}}
          b:
            states:
              y:
                entry: {trigger: hand.watch_values, with: %s}
                on:
                  became_true: {emit: flip, with: {truth: true, values: ?event.values}}
                  became_false: {emit: flip, with: {truth: false, values: ?event.values}}
                  programming_error: {emit: failed, with: {why: ?event.reason}}
        on: {done: e, played: e, failed: {to: e, emit: broken, with: {why: ?event.why}}}
      e: {final: true}
"""


def ran(condition, script, *, far=False, **options):
    """The flips as times and truths, the last values, and the frames; the sensor is here or hosted elsewhere."""
    written = {"condition": f'"{condition}"', **options}
    text = PLOT % (
        "{"
        + ", ".join(f"{key}: '{value}'" if key == "condition" else f"{key}: {value}" for key, value in written.items())
        + "}"
    )
    text = text.replace("on: {played: f}", "on: {played: {emit: played}}").replace(", f: {final: true}", "")

    async def main():
        clock, transport, hand = LoopClock(), CountingTransport(), Hand(script)
        host: Host | None = None
        component: Component = hand
        if far:
            host = Host(hand, transport, clock)
            component = await RemoteComponent.connect("hand", transport)
        sequencer = Sequencer(Library([plot(text)]), KnowledgeBase(Schema()), [component], clock)
        flips: list[tuple[float, Event]] = []
        sequencer.listen(lambda step: flips.extend((round(clock.now(), 3), e) for e in step.emitted))
        end = await sequencer.run("p")
        if host is not None:
            await host.close()
        return flips, end, transport.frames

    return run_simulated(main())


def truths(found):
    return [(at, one.attributes["truth"]) for at, one in found[0] if one.name == "flip"]


def distances(*values):
    return [(float(n), "pose", {"distance": value, "xyz": [value, 0, 0]}) for n, value in enumerate(values)]


@pytest.mark.parametrize("far", [False, True])
def test_only_changes_of_the_truth_arrive(far):
    found = ran("(< pose.distance ?limit)", distances(30, 20, 9, 8, 12, 3), far=far, values="{limit: ?limit}")
    assert truths(found) == [(0.0, False), (2.0, True), (4.0, False), (5.0, True)]
    assert found[0][-1][1].attributes["values"] == {"pose.distance": 3}


@pytest.mark.parametrize(
    ("condition", "options", "flips"),
    [
        ("(< pose.distance 10)", {"hysteresis": 3}, [(0.0, False), (2.0, True), (5.0, False)]),
        ("(< pose.distance 10)", {"hold": 1.5}, [(0.0, False), (3.5, True), (4.0, False)]),
        ("(< pose.distance 10)", {"times": 2, "out_of": 3}, [(0.0, False), (3.0, True), (5.0, False)]),
        ("(not (>= pose.distance 10))", {}, [(0.0, False), (2.0, True), (4.0, False)]),
        ("(in-range pose.distance 8 9)", {}, [(0.0, False), (2.0, True), (4.0, False)]),
        ("(approaches pose.distance 0)", {}, [(0.0, False), (1.0, True), (4.0, False)]),
        ("(< (rate pose.distance) -5)", {}, [(0.0, False), (1.0, True), (3.0, False)]),
        ("(< (change pose.distance) -5)", {}, [(0.0, False), (1.0, True), (3.0, False)]),
        ("(< (mean pose.distance 2) 10)", {}, [(0.0, False), (3.0, True), (4.0, False)]),
        ("(< (magnitude pose.xyz) 10)", {}, [(0.0, False), (2.0, True), (4.0, False)]),
        ("(< (distance pose.xyz (list 20 0 0)) 1)", {}, [(0.0, False), (1.0, True), (2.0, False)]),
        ("(< (distance pose.xyz (geometry 20 0 0 0 0 0 1)) 1)", {}, [(0.0, False), (1.0, True), (2.0, False)]),
        ("(< (distance pose.xyz (geometry 20 0 0)) 1)", {}, [(0.0, False), (1.0, True), (2.0, False)]),
        ("(beyond pose.distance 25)", {}, [(0.0, True), (1.0, False)]),
        ("(imply (> pose.distance 8) (< pose.distance 10))", {}, [(0.0, False), (2.0, True), (4.0, False)]),
        ("(> (- (* 2 pose.distance) 1) 30)", {}, [(0.0, True), (2.0, False)]),
    ],
)  # fmt: skip
def test_checks_and_options(condition, options, flips):
    assert truths(ran(condition, distances(30, 20, 9, 8, 12, 14), **options)) == flips


def test_a_condition_is_unknown_until_all_its_values_are_known():
    script = [*distances(5, 5), (2.5, "force", {"z": 7, "label": "up"})]
    found = ran("(or (< pose.distance 10) (> force.z 5))", script)
    assert truths(found) == [(2.5, True)]
    assert truths(ran("(= force.label up)", script)) == [(2.5, True)]


def test_a_silent_port_is_an_event():
    script = [(at, "pose", {"distance": 1, "xyz": []}) for at in (0.0, 1.0, 2.0, 6.0)]
    assert truths(ran("(silent pose 2)", script)) == [(0.0, False), (4.0, True), (6.0, False)]
    assert truths(ran("(silent force 3)", script)) == [(0.0, False), (3.0, True)]


@pytest.mark.parametrize(
    ("condition", "why"),
    [
        ("(< pose.distanc 10)", "pose.distance"),
        ("(< posee.distance 10)", "pose.distance"),
        ("(< (rat pose.distance) 10)", "did you mean 'rate'"),
        ("(silent posee 2)", "did you mean 'pose'"),
        ("(silent pose)", "(silent port seconds)"),
        ("(< pose.xyz 10)", "needs numbers, and pose.xyz is of type list"),
        ("(< (magnitude pose.distance) 10)", "list of numbers"),
        ("(< (rate pose.distance 1) 10)", "as in (rate value)"),
        ("(< (rate 3) 10)", "'value' is a value of a port, not 3"),
        ("(< (distance pose.xyz ?limit) 10)", "is a list of numbers, and ?limit is of type number"),
        ("(< (distance pose.xyz (list 1 2)) 10)", "not 3 and 2 numbers"),
        ("(= (- pose.distance 29) true)", "compares number with boolean, which are never equal"),
        ("(> (mean pose.distance ?half) 1)", "a whole number of values from 1 to 100, not 0.5"),
        ("(in-range pose.distance ?limit 1)", "(in-range pose.distance ?limit 1): the lower bound 3"),
        ("(< pose 10)", "'pose' is a port, whose values are pose.distance, pose.xyz"),
        ("(< force.label 10)", "needs numbers, and force.label is of type text"),
        ("(< (differs force.z) 10)", "needs numbers, and (differs force.z) is of type boolean"),
        ("(rate pose.distance)", "is a number and no condition"),
        ("(force.label)", "compare it, as in (= force.label true)"),
        ("(silent pose ten)", "(silent port seconds)"),
        ("(silent pose -1)", "(silent port seconds)"),
        ("(in pose.distance 1 2)", "there is no check 'in'"),
        ("(< pose.distance ?limt)", "limt"),
        ("(< (/ pose.distance 0) 1)", "divides by zero"),
        ("(exists (?x - item) (on ?x))", "no quantifiers"),
        ("(< pose.distance 10", "never closed"),
    ],
)
def test_mistakes_end_the_activation_with_their_reason(condition, why):
    _, end, _ = ran(condition, distances(30, 20), values="{limit: 3, half: 0.5}")
    assert end.emitted[-1].name == "broken"
    assert why in end.emitted[-1].attributes["why"]


def test_a_component_without_push_ports_has_no_such_skill():
    class Voice(Component):
        name = "voice"

    assert "watch_values" not in Voice().skills()
    assert "watch_values" in Hand().skills()
    with pytest.raises(UnknownNameError, match="no event 'watch_values'"):
        Hand().update("watch_values")


def test_ten_thousand_updates_cost_frames_only_for_flips():
    quiet = [(n / 100, "pose", {"distance": 50 + n % 7, "xyz": []}) for n in range(10_000)]
    none = ran("(< pose.distance 10)", quiet, far=True)
    values = [
        (at, port, {**given, "distance": 5 if n % 1000 < 10 else 50}) for n, (at, port, given) in enumerate(quiet)
    ]
    some = ran("(< pose.distance 10)", values, far=True)
    flips = len(truths(some))
    assert len(truths(none)) == 1
    assert flips == 20
    assert (some[2] - none[2]) / (flips - 1) < 2


@given(
    st.lists(st.tuples(st.sampled_from(["pose", "force"]), st.integers(0, 20)), min_size=1, max_size=30),
    st.sampled_from(
        [
            "(< pose.distance 10)",
            "(and (< pose.distance 10) (> force.z 5))",
            "(not (or (= force.z 3) (< pose.distance 4)))",
        ]
    ),
)
def test_flips_are_those_of_evaluating_each_value(puts, text):
    def reference(distance, z):
        return {
            "(< pose.distance 10)": lambda: distance < 10,
            "(and (< pose.distance 10) (> force.z 5))": lambda: distance < 10 and z > 5,
            "(not (or (= force.z 3) (< pose.distance 4)))": lambda: not (z == 3 or distance < 4),
        }[text]()

    async def main():
        hand = Hand()
        flips: list[bool] = []
        errors: list[Exception] = []
        condition = ValueCondition(text, hand.pushes, {**LIBRARY, **by_name(beyond)}, {})
        condition.listen(lambda truth, _: flips.append(truth), errors.append)
        for port, value in puts:
            given = {"distance": value, "xyz": []} if port == "pose" else {"z": value, "label": ""}
            getattr(hand, port).put(**given)
            await asyncio.sleep(0)
        condition.end()
        hand.pose.put(distance=0, xyz=[])
        return flips, errors

    flips, errors = run_simulated(main())
    expected: list[bool] = []
    distance, z = None, None
    for port, value in puts:
        distance, z = (value, z) if port == "pose" else (distance, value)
        if distance is None or (z is None and "force" in text):
            continue
        truth = reference(distance, z)
        if not expected or expected[-1] is not truth:
            expected.append(truth)
    assert (flips, errors) == (expected, [])


@pytest.mark.parametrize(("options", "why"), [({"times": 3, "out_of": 2}, "`times`"), ({"hold": -1}, "`hold`")])
def test_wrong_options_are_refused(options, why):
    with pytest.raises(InputError, match=why):
        ValueCondition("(< pose.distance 10)", Hand().pushes, LIBRARY, {}, **options)

"""Conditions over several components and the knowledge: `conditions.watch_truth` (S2.4, S2.18)."""

from __future__ import annotations

import asyncio
from itertools import pairwise

import pytest
from counting_transport import CountingTransport
from dsc_charts import plot
from hypothesis import given, settings
from hypothesis import strategies as st

from dsc.calls import SkillCall
from dsc.components.component import Component
from dsc.components.life_cycle import Life
from dsc.components.streams import Push
from dsc.dynamic.library import Library
from dsc.outcomes import Outcome
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.sequencer.sequencer import Sequencer
from dsc.skills import skill
from dsc.wire.host import Host
from dsc.wire.remote import RemoteComponent
from knowledge_base.language.syntax.text import parse_condition
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema import Schema

SCHEMA = Schema.parse("""
(define (domain hall)
  (:types cup - object)
  (:constants cup1 cup2 - cup)
  (:predicates (held ?c - cup) (wanted))
  (:functions (limit) - number (pose ?c - cup) - geometry))
""")


class Hand(Component):
    name = "hand"
    pose = Push({"position": "list of number", "x": "number"})


class Wrist(Component):
    name = "wrist"
    force = Push({"tool": "list of number", "x": "number"})


class Played(Outcome): ...


class Player(Component):
    """Puts values and changes the knowledge at the given times."""

    name = "player"

    def __init__(self, script, components, knowledge) -> None:
        super().__init__()
        self.script, self.sources, self.knowledge = script, components, knowledge

    @skill(unlimited=True)
    async def play(self, call: SkillCall) -> Played:
        for at, what, value in self.script:
            await call.clock.sleep(max(0.0, at - call.clock.now()))
            if what == "knowledge":
                self.knowledge.apply(value, author="player")
            elif what == "kill":
                self.sources[value].life.become(Life.FATAL_ERROR, "unplugged")
            else:
                put(self.sources[what], value)
        await call.clock.sleep(1)
        return Played()


def put(component, x):
    if component.name == "hand":
        component.pose.put(position=[x, 0, 0], x=x)
    else:
        component.force.put(tool=[0, 0, x], x=x)


PLOT = """
    plot: p
    parameters: {object: {type: list of number, default: [5, 0, 0]}, cup: {type: text, default: cup1}}
    emits: {flip: {truth: boolean, values: map of any, parts: map of any}, broken: {why: text}}
    states:
      w:
        entry:
          - {trigger: player.play}
          - {trigger: conditions.watch_truth, with: %s}
        on:
          became_true: {emit: flip, with: {truth: true, values: ?event.values, parts: ?event.parts}}
          became_false: {emit: flip, with: {truth: false, values: ?event.values, parts: ?event.parts}}
          programming_error: {to: e, emit: broken, with: {why: ?event.reason}}
          skill_error: {to: e, emit: broken, with: {why: ?event.reason}}
          played: e
      e: {final: true}
"""


def run(condition, script, *, far=False, **options):
    """Return the flips as times and truths, the emitted events, and the number of frames; sources may be remote."""
    written = [f"condition: '\"{condition}\"'", *(f"{key}: {value}" for key, value in options.items())]
    text = PLOT % ("{" + ", ".join(written) + "}")

    async def main():
        clock, transport, knowledge = LoopClock(), CountingTransport(), KnowledgeBase(SCHEMA)
        devices: dict[str, Component] = {"hand": Hand(), "wrist": Wrist()}
        hosts = [Host(one, transport, clock) for one in devices.values()] if far else []
        sources = [await RemoteComponent.connect(name, transport) for name in devices] if far else devices.values()
        player = Player(script, devices, knowledge)
        sequencer = Sequencer(Library([plot(text)]), knowledge, [*sources, player], clock)
        flips: list[tuple[float, bool]] = []
        sequencer.listen(
            lambda step: flips.extend(
                (round(clock.now(), 3), e.attributes["truth"]) for e in step.emitted if e.name == "flip"
            )
        )
        end = await sequencer.run("p")
        for host in hosts:
            await host.close()
        return flips, end.emitted, transport.frames

    return run_simulated(main())


BOX_1 = "(or (< (distance hand.pose.position ?object) 1) (> (magnitude wrist.force.tool) 5))"


@pytest.mark.parametrize("far", [False, True])
def test_box_1_of_armarx(far):
    script = [(1, "hand", 9), (1, "wrist", 1), (2, "hand", 4.5), (3, "wrist", 7), (4, "hand", 9), (5, "wrist", 0)]
    flips, emitted, _ = run(BOX_1, script, far=far, values="{object: ?object}")
    assert flips == [(1, False), (2, True), (5, False)]
    assert emitted[1].attributes["parts"] == {
        "(< (distance hand.pose.position ?object) 1)": True,
        "(> (magnitude wrist.force.tool) 5)": False,
    }
    assert emitted[1].attributes["values"] == {"hand.pose.position": [4.5, 0, 0], "wrist.force.tool": [0, 0, 1]}


def test_one_known_part_may_decide():
    _, emitted, _ = run(BOX_1, [(2, "wrist", 9)], values="{object: ?object}")
    assert emitted[0].attributes["parts"]["(< (distance hand.pose.position ?object) 1)"] is None
    assert run(BOX_1, [(2, "wrist", 9)], values="{object: ?object}")[0] == [(2, True)]
    both = "(and (> hand.pose.x 1) (> wrist.force.x 1))"
    assert run(both, [(2, "wrist", 0)])[0] == [(2, False)]
    assert run(both, [(2, "wrist", 2)])[0] == []


@pytest.mark.parametrize("far", [False, True])
def test_facts_beside_values(far):
    script = [
        (1, "hand", 9), (2, "knowledge", "(held cup1)"), (3, "hand", 0), (4, "hand", 9),
        (5, "knowledge", "(not (held cup1))"),
    ]  # fmt: skip
    flips, _, _ = run("(and (held ?cup) (> hand.pose.x 1))", script, far=far, values="{cup: ?cup}")
    assert flips == [(0, False), (2, True), (3, False), (4, True), (5, False)]


@pytest.mark.parametrize("far", [False, True])
def test_a_live_value(far):
    script = [
        (1, "hand", 3), (2, "knowledge", "(= (pose cup1) (geometry 9 0 0))"),
        (3, "knowledge", "(= (pose cup1) (geometry 3.5 0 0))"), (4, "hand", 8),
        (5, "knowledge", "(= (pose cup1) (geometry))"), (6, "knowledge", "(= (pose cup1) (geometry 8 0 0))"),
    ]  # fmt: skip
    flips, _, _ = run("(< (distance hand.pose.position (pose ?cup)) 1)", script, far=far, values="{cup: ?cup}")
    assert flips == [(2, False), (3, True), (4, False), (6, True)]


@pytest.mark.parametrize("far", [False, True])
def test_a_comparison_of_two_components(far):
    script = [(1, "hand", 3), (2, "wrist", 4), (3, "hand", 5), (4, "knowledge", "(= (limit) 3)"), (5, "wrist", 3)]
    assert run("(< hand.pose.x wrist.force.x)", script, far=far)[0] == [(2, True), (3, False)]
    flips = run("(< (- hand.pose.x wrist.force.x) (limit))", script, far=far)[0]
    assert flips == [(2, True), (3, False), (4, True)]  # an unset number is 0


@pytest.mark.parametrize("far", [False, True])
def test_hold_counts_for_the_whole_condition(far):
    either = "(or (> hand.pose.x 1) (> wrist.force.x 1))"
    script = [(1, "hand", 0), (1, "wrist", 0), (2, "hand", 2), (3, "wrist", 2), (4, "hand", 0), (6, "wrist", 0)]
    assert run(either, script, far=far, hold=3)[0] == [(1, False), (5, True), (6, False)]


def test_hysteresis_moves_the_bounds_of_each_part():
    script = [(1, "hand", 9), (2, "hand", 11), (3, "hand", 9), (4, "hand", 7), (5, "hand", 9)]
    flips, _, _ = run("(or (> hand.pose.x 10) (held cup1))", script, hysteresis=2)
    assert flips == [(1, False), (2, True), (4, False)]
    flips, _, _ = run("(not (and (<= hand.pose.x 10) (wanted)))", [(0, "knowledge", "(wanted)"), *script], hysteresis=2)
    assert flips[-3:] == [(1, False), (2, True), (4, False)]


def test_a_silent_port_of_one_of_two_components():
    script = [(1, "hand", 0), (2, "knowledge", "(wanted)"), (6, "hand", 0)]
    assert run("(and (wanted) (silent hand.pose 2))", script)[0] == [(0, False), (3, True), (6, False)]


def test_a_lost_source_ends_the_watch_with_its_name():
    _, emitted, _ = run("(and (wanted) (> hand.pose.x 1))", [(1, "hand", 0), (2, "kill", "hand"), (5, "hand", 0)])
    assert emitted[-1].name == "broken"
    assert "unplugged" in emitted[-1].attributes["why"]


@pytest.mark.parametrize(
    ("condition", "why"),
    [
        ("(and (wanted) (> hand.pose.y 1))", "did you mean 'hand.pose.x'"),
        ("(and (wanted) (> pose.x 1))", "no component pushes a value 'pose.x'"),
        ("(and (wanted) (> arm.pose.x 1))", "did you mean 'hand.pose.x'"),
        ("(and (wanted) (silent hand.poze 1))", "hand.poze"),
        ("(and (wantd) (> hand.pose.x 1))", "did you mean 'wanted'"),
        ("(and (wanted) (> (rat hand.pose.x) 1))", "did you mean 'rate'"),
        ("(exists (?c - cup) (> hand.pose.x 1))", "no quantifiers"),
        ("(and (wanted) (> hand.pose.x ?limt))", "limt"),
        ("(and (wanted) (> hand.pose.x 1)", "never closed"),
        ("(and (held ?list) (> hand.pose.x 1))", "'?list' is [1], which the knowledge cannot contain"),
        ("(< (distance hand.pose.position (pose ?list)) 1)", "'?list' is [1], which the knowledge cannot contain"),
    ],
)
def test_mistakes_end_the_watch_with_their_reason(condition, why):
    _, emitted, _ = run(condition, [(0, "knowledge", "(wanted)"), (1, "hand", 3)], values="{limit: 3, list: (list 1)}")
    assert emitted[-1].name == "broken"
    assert why in emitted[-1].attributes["why"]


def test_hysteresis_without_a_bound_is_refused():
    _, emitted, _ = run("(or (wanted) (differs hand.pose.x))", [], hysteresis=1)
    assert "hysteresis" in emitted[-1].attributes["why"]


def test_frames_are_two_for_each_flip_of_a_part():
    quiet = [(1 + n / 100, ("hand", "wrist")[n % 2], 50 + n % 7) for n in range(4000)]
    term = "(and (wanted) (or (< hand.pose.x 10) (< wrist.force.x 10)))"
    wanted = [(0.5, "knowledge", "(wanted)")]
    _, _, none = run(term, [*wanted, *quiet], far=True)
    busy = [(at, name, 5 if n % 400 in {0, 1} else x) for n, (at, name, x) in enumerate(quiet)]
    flips, _, some = run(term, [*wanted, *busy], far=True)
    assert len(flips) == 1 + 2 * 10
    assert (some - none) / (4 * 10) <= 2  # each of two parts becomes true and false ten times


# -- split evaluation equals central evaluation -----------------------------------------------------------

LEAVES = {
    "(< hand.pose.x 5)": lambda s: None if s["hand"] is None else s["hand"] < 5,
    "(> wrist.force.x 4)": lambda s: None if s["wrist"] is None else s["wrist"] > 4,
    "(< hand.pose.x (limit))": lambda s: None if s["hand"] is None else s["hand"] < s["limit"],
    "(< wrist.force.x hand.pose.x)": lambda s: None if None in (s["hand"], s["wrist"]) else s["wrist"] < s["hand"],
    "(held cup1)": lambda s: s["held"],
    "(wanted)": lambda s: s["wanted"],
    "(exists (?c - cup) (held ?c))": lambda s: s["held"],
}
TERMS = st.recursive(
    st.sampled_from(sorted(LEAVES)),
    lambda inner: st.one_of(
        inner.map(lambda e: f"(not {e})"),
        st.tuples(inner, inner).map(lambda both: f"(imply {both[0]} {both[1]})"),
        st.tuples(st.sampled_from(["and", "or"]), st.lists(inner, min_size=1, max_size=3)).map(
            lambda found: f"({found[0]} {' '.join(found[1])})"
        ),
    ),
    max_leaves=6,
)
CHANGES = st.lists(
    st.one_of(
        st.tuples(st.sampled_from(["hand", "wrist", "limit"]), st.integers(2, 7)),
        st.tuples(st.sampled_from(["held", "wanted"]), st.booleans()),
    ),
    max_size=12,
)


def central(e, world):
    """Return the truth of a term in three-valued logic, from all values in one place."""
    kind = type(e).__name__
    if kind == "Not":
        truth = central(e.body, world)
        return None if truth is None else not truth
    if kind == "Imply":
        premise, conclusion = central(e.premise, world), central(e.conclusion, world)
        found = [None if premise is None else not premise, conclusion]
        return True if True in found else None if None in found else False
    if kind in {"And", "Or"}:
        found = [central(part, world) for part in e.parts]
        decisive = kind == "Or"
        return decisive if decisive in found else None if None in found else not decisive
    return next(leaf(world) for text, leaf in LEAVES.items() if parse_condition(text) == e)


@settings(max_examples=60, deadline=None)
@given(TERMS, CHANGES, st.booleans())
def test_split_evaluation_equals_central_evaluation(text, changes, far):
    facts = {"held": "(held cup1)", "wanted": "(wanted)"}
    start = [("hand", 3), ("wrist", 4), ("limit", 5)]
    world = {"hand": None, "wrist": None, "limit": 0, "held": False, "wanted": False}
    e, script, expected = parse_condition(text), [], []
    for n, (what, value) in enumerate([*start, *changes]):
        world[what] = value
        at = 1 + n
        if what in facts:
            script.append((at, "knowledge", facts[what] if value else f"(not {facts[what]})"))
        elif what == "limit":
            script.append((at, "knowledge", f"(= (limit) {value})"))
        else:
            script.append((at, what, value))
        if None not in world.values():  # a part that a source evaluates is unknown until all its values are known
            expected.append((at, central(e, world)))
    flips, emitted, _ = run(text, script, far=far)
    assert [one for one in emitted if one.name == "broken"] == []
    for at, truth in expected:
        latest = [flip for when, flip in flips if when < at + 0.9]
        assert latest[-1] is truth, (at, truth, flips)
    assert all(first[1] is not second[1] for first, second in pairwise(flips))


class Listened(KnowledgeBase):
    """A knowledge base that counts its listeners."""

    def __init__(self, schema):
        super().__init__(schema)
        self.listeners = 0

    def subscribe(self, listener):
        self.listeners += 1
        end = super().subscribe(listener)

        def unsubscribe():
            self.listeners -= 1
            end()

        return unsubscribe


def test_a_left_state_leaves_no_listener():
    async def main():
        clock, knowledge = LoopClock(), Listened(SCHEMA)
        player = Player([(2, "hand", 1)], {"hand": (hand := Hand())}, knowledge)
        text = PLOT.replace("played: e", "played: f").replace(
            "      e: {final: true}", "      f: {after: {seconds: 5, to: e}}\n      e: {final: true}"
        )
        condition = "(and (wanted) (< hand.pose.x (limit)) (< (distance hand.pose.position (pose cup1)) 1))"
        sequencer = Sequencer(
            Library([plot(text % f"{{condition: '\"{condition}\"'}}")]), knowledge, [hand, player], clock
        )
        running = asyncio.ensure_future(sequencer.run("p"))
        await clock.sleep(2.5)
        during = knowledge.listeners
        await clock.sleep(3)
        after = knowledge.listeners
        await running
        return during, after, knowledge.listeners

    during, after, end = run_simulated(main())
    assert during > after
    assert end == 0
    assert after == 2  # the run's own


def test_the_watched_parts_of_the_knowledge_are_listed_with_their_truth():
    async def main():
        clock, knowledge = LoopClock(), KnowledgeBase(SCHEMA)
        player = Player([(1, "knowledge", "(wanted)")], {}, knowledge)
        text = PLOT % "{condition: '\"(or (wanted) (> hand.pose.x 1))\"'}"
        sequencer = Sequencer(Library([plot(text)]), knowledge, [Hand(), player], clock)
        running = asyncio.ensure_future(sequencer.run("p"))
        await clock.sleep(1.5)
        watched = [(one.text, one.truth) for one in knowledge.conditions()]
        await running
        return watched, knowledge.conditions()

    assert run_simulated(main()) == ([("(wanted)", True)], [])


@pytest.mark.parametrize(
    ("condition", "said"),
    [
        ("(> (limt) 1)", "condition:1:4: there is no function 'limt'; did you mean 'limit'?"),
        ("(> hand.pose.y 1)", "condition:1:4: no component pushes a value 'hand.pose.y'"),
        ("(held cup1", "condition:1:1: '(' is never closed"),
    ],
)
def test_a_mistake_in_a_condition_has_its_place_in_the_condition_and_no_traceback(condition, said, caplog):
    _, emitted, _ = run(condition, [])
    assert said in emitted[-1].attributes["why"]
    assert said in caplog.text
    assert "Traceback" not in caplog.text

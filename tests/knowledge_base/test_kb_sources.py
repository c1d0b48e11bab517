"""Sources by reference: the latest value is seen at once, and is in no version."""

from __future__ import annotations

import asyncio
import threading
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kb_worlds import PROPERTY

from knowledge_base import (
    Change,
    ConflictError,
    Delta,
    InputError,
    KnowledgeBase,
    Schema,
    SchemaError,
    UnknownNameError,
    fact,
)

SCHEMA = Schema.parse("""(define (domain d) (:types thing - object cup - thing)
  (:predicates (on ?a ?b - thing))
  (:functions (pose ?t ?frame - thing) - geometry (weight ?t - thing) (light)))""")
NODES = {"cup1": "cup", "cup2": "cup", "map": "thing"}
POSE = fact("pose", "cup1", "map")


@pytest.fixture
def kb():
    kb = KnowledgeBase(SCHEMA)
    kb.apply(Delta(nodes=NODES, values={fact("weight", "cup1"): 3}), author="test")
    return kb


@pytest.fixture
def source(kb):
    return kb.bind_source("pose", "cup1", "map", reference="tf:map/cup1")


def heard(condition) -> list[Any]:
    told = []
    condition.subscribe(lambda firing: told.append((firing.version, firing.truth)), falls=True)
    return told


def test_the_latest_value_is_what_everyone_reads(kb, source):
    assert (source.latest, kb.value("pose", ("cup1", "map"))) == (None, ())
    source.update((0.4, 0.1))
    assert (source.latest, kb.value("pose", ("cup1", "map"))) == ((0.4, 0.1), (0.4, 0.1))
    question = "(and (cup ?c) (= (pose ?c map) (geometry 0.4 0.1)))"
    assert kb.query(question) == [{"c": "cup1"}]
    assert kb.overlay().value("pose", ("cup1", "map")) == (0.4, 0.1)  # what guards see
    assert kb.explain("(= (pose cup1 map) (geometry 1))").detail == "(geometry 0.4 0.1) = (geometry 1)"
    with kb.transaction(author="test") as tx:
        assert tx.query(question) == [{"c": "cup1"}]


def test_no_version_has_it(kb, source):
    before = kb.to_json()
    told: list[Change] = []
    kb.subscribe(told.append)
    source.update((1.0,))
    assert (kb.version, kb.changes(since=1), told, kb.to_json()) == (1, [], [], before)
    assert POSE not in kb.values()
    kb.apply(Delta(added=(fact("on", "cup1", "map"),)), author="test")
    source.update((2.0,))
    for version in (1, 2):
        assert kb.at(version=version).value("pose", ("cup1", "map")) == ()
    assert KnowledgeBase.from_json(kb.to_json()).value("pose", ("cup1", "map")) == ()


def test_a_snapshot_has_it_and_keeps_it(kb, source):
    source.update((1.0,))
    snapshot = kb.snapshot()
    source.update((2.0,))
    assert snapshot.value("pose", ("cup1", "map")) == (1.0,)
    assert snapshot.values[POSE] == (1.0,)


def test_installed_conditions_fire_at_the_present_version(kb, source):
    near = kb.install("(= (pose ?c map) (geometry 0))", {"c": "cup1"})
    told = heard(near)
    source.update((1,))
    source.update((0,))
    assert (near.truth, near.version) == (True, 1)
    source.update((0,))  # nothing is different
    source.update((0.0,))
    kb.apply(Delta(added=(fact("on", "cup1", "map"),)), author="test")
    source.update((2,))
    assert told == [(1, True), (2, False)]


def test_a_source_update_wakes_a_waiting_task(kb, source):
    async def wait():
        firing = asyncio.ensure_future(kb.install("(= (pose cup1 map) (geometry 7))").wait())
        await asyncio.sleep(0)
        thread = threading.Thread(target=source.update, args=((7,),))
        thread.start()
        try:
            return (await firing).truth
        finally:
            thread.join()

    assert asyncio.run(wait())


def test_a_watch_is_not_told(kb, source):
    async def follow():
        with kb.watch("(pose ?c map)") as changes:
            source.update((1,))
            kb.apply(Delta(values={fact("pose", "cup2", "map"): (2,)}), author="test")
            return await anext(changes)

    assert asyncio.run(follow()).delta.values == {fact("pose", "cup2", "map"): (2,)}


class Clock:
    """Time that a test makes pass; timers that were cancelled may still be called, as by another thread."""

    def __init__(self) -> None:
        self.time = 0.0
        self.timers: list[Any] = []

    def now(self) -> float:
        return self.time

    def call_later(self, delay_s, callback):
        self.timers.append(callback)
        return self

    def cancel(self) -> None: ...


def test_a_hold_that_was_broken_within_a_version_does_not_count(kb):
    clock = Clock()
    with kb.bind_source("weight", "cup2", reference="scale") as scale:
        told = heard(kb.install("(> (weight cup2) 5)", hold_s=3, clock=clock))
        for weight in (6, 1, 6):
            scale.update(weight)
        late, due = clock.timers
        late()
        assert told == []
        due()
        assert told == [(1, True)]


def test_a_graph_that_is_first_looked_at_later_has_what_sources_feed(kb, source):
    source.update((1,))
    kb.bind_source("light", reference="sensor")
    assert kb.graph.edges["cup1", "map", "pose"] == {"value": (1,), "source": "tf:map/cup1", "kind": "d"}
    assert kb.graph.nodes[fact("light")] == {"relation": "light", "value": 0, "source": "sensor", "kind": "d"}
    source.close()
    assert not kb.graph.has_edge("cup1", "map", "pose")


def test_the_graph_has_the_reference_and_the_latest_value(kb, source):
    arc = kb.graph.edges["cup1", "map", "pose"]
    assert arc == {"value": (), "source": "tf:map/cup1", "kind": "d"}
    source.update((1,))
    assert kb.graph.edges["cup1", "map", "pose"] == {"value": (1,), "source": "tf:map/cup1", "kind": "d"}
    light = kb.bind_source("light", reference="sensor")
    light.update(3)
    assert kb.graph.nodes[fact("light")] == {"relation": "light", "value": 3, "source": "sensor", "kind": "d"}
    light.close()
    source.close()
    assert fact("light") not in kb.graph
    assert not kb.graph.has_edge("cup1", "map", "pose")


def test_closing_gives_back_what_was_set(kb):
    light = kb.install("(< (weight cup1) 5)")
    told = heard(light)
    with kb.bind_source("weight", "cup1", reference="scale") as scale:
        assert kb.value("weight", ("cup1",)) == 3  # until it is fed
        scale.update(7)
        assert (kb.value("weight", ("cup1",)), kb.values()) == (7, {fact("weight", "cup1"): 3})
        assert kb.sources() == [scale]
    assert (scale.closed, kb.sources(), kb.value("weight", ("cup1",))) == (True, [], 3)
    assert kb.graph.edges["cup1", "cup1", "weight"] == {"value": 3, "kind": "d"}
    assert told == [(1, False), (1, True)]
    scale.close()
    with pytest.raises(ConflictError, match=r"the source 'scale' of \(weight cup1\) is closed"):
        scale.update(1)
    kb.bind_source("weight", "cup1", reference="scale 2").update(9)


def test_a_value_from_a_source_cannot_be_set(kb, source):
    source.update((1,))
    for content in ((1,), (2,), ()):
        with pytest.raises(SchemaError, match=r"\(pose cup1 map\) is fed by 'tf:map/cup1' and cannot be set"):
            kb.apply(Delta(values={POSE: content}), author="test")
    with kb.transaction(author="test") as tx, pytest.raises(SchemaError, match="cannot be set"):
        tx.set("pose", "cup1", "map", (2,))
    with pytest.raises(SchemaError, match="cannot be set"):
        kb.overlay().apply(Delta(values={POSE: (2,)}))
    assert kb.version == 1


def test_a_thing_that_goes_closes_its_sources(kb, source):
    frame = kb.bind_source("pose", "cup2", "cup1", reference="tf:cup1/cup2")
    other = kb.bind_source("weight", "cup2", reference="scale")
    told = heard(kb.install("(exists (?c - cup) (= (pose ?c map) (geometry 1)))"))
    weighs = heard(kb.install("(= (pose ?a ?b) (geometry 1))", {"a": "cup1", "b": "map"}))
    source.update((1,))
    kb.apply(Delta(removed_nodes=("cup1",)), author="test")
    assert (source.closed, frame.closed, kb.sources()) == (True, True, [other])
    assert told == weighs == [(1, True), (2, False)]
    kb.apply(Delta(nodes={"cup1": "cup"}), author="test")
    assert kb.value("pose", ("cup1", "map")) == ()


def test_a_thing_that_begins_anew_has_no_source(kb, source):
    source.update((1,))
    kb.apply(Delta(removed_nodes=("cup1",), nodes={"cup1": "cup"}, values={POSE: (5,)}), author="test")
    assert (source.closed, kb.value("pose", ("cup1", "map"))) == (True, (5,))
    assert kb.graph.edges["cup1", "map", "pose"] == {"value": (5,), "kind": "d"}


def test_a_failed_removal_closes_nothing(kb, source):
    delta = Delta(removed_nodes=("cup1",), added=(fact("on", "cup1", "map"),))
    with pytest.raises(UnknownNameError):
        kb.apply(delta, author="test")
    assert not source.closed


@pytest.mark.parametrize(
    ("args", "reference", "kind", "message"),
    [
        (("poise", "cup1", "map"), "tf", UnknownNameError, "did you mean 'pose'"),
        (("pose", "cup1", "mop"), "tf", UnknownNameError, "did you mean 'map'"),
        (("pose", "cup1"), "tf", SchemaError, "takes 2 arguments"),
        (("pose", "cup1", 3), "tf", SchemaError, "not 3"),
        (("pose", "cup1", "map"), "tf", SchemaError, "fed by 'tf:map/cup1' already"),
        (("weight", "cup1"), "", InputError, "a source's reference is text"),
    ],
)
def test_an_invalid_binding_of_a_source_is_refused(kb, source, args, reference, kind, message):
    with pytest.raises(kind, match=message):
        kb.bind_source(*args, reference=reference)
    assert kb.sources() == [source]


def test_nothing_is_bound_inside_a_transaction(kb):
    with kb.transaction(author="test"), pytest.raises(ConflictError, match="open in this thread"):
        kb.bind_source("light", reference="sensor")


@pytest.mark.parametrize(
    ("content", "kind", "message"),
    [
        (1.0, SchemaError, r"\(pose cup1 map\) is a geometry"),
        ([1.0], SchemaError, "is a geometry"),
        ((float("inf"),), InputError, "finite"),
    ],
)
def test_an_invalid_source_update_is_refused_and_keeps_the_latest_value(kb, source, content, kind, message):
    source.update((1,))
    with pytest.raises(kind, match=message):
        source.update(content)
    assert source.latest == (1,)


def test_feeding_inside_a_transaction_is_told_after_it(kb, source):
    told = heard(kb.install("(= (pose cup1 map) (geometry 1))"))
    with kb.transaction(author="test") as tx:
        source.update((1,))
        tx.tell("on", "cup1", "map")
        assert told == []
    assert told == [(1, True)]


def test_a_file_does_not_have_it(tmp_path):
    path = tmp_path / "world.kb"
    with KnowledgeBase.open(SCHEMA, path) as kb:
        kb.apply(Delta(nodes=NODES), author="test")
        source = kb.bind_source("pose", "cup1", "map", reference="tf")
        source.update((1,))
        kb.apply(Delta(added=(fact("on", "cup1", "map"),)), author="test")
        kb.compact()
    assert source.closed
    with KnowledgeBase.open(None, path) as kb:
        assert (kb.version, kb.value("pose", ("cup1", "map")), kb.sources()) == (2, (), [])


def test_sources_are_fed_from_many_threads(kb):
    sources = [kb.bind_source("weight", name, reference=name) for name in NODES]
    total = kb.install("(= (+ (weight cup1) (weight cup2) (weight map)) 150)")
    told = heard(total)

    def feed(source):
        for weight in range(51):
            source.update(weight)

    threads = [threading.Thread(target=feed, args=(source,)) for source in sources]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert total.truth
    assert told == [(1, True)]


STEPS = st.lists(
    st.tuples(
        st.sampled_from(["feed", "close", "set", "remove"]), st.sampled_from(["cup1", "cup2"]), st.integers(0, 2)
    ),
    max_size=12,
)


@settings(PROPERTY, max_examples=100)
@given(STEPS)
def test_conditions_agree_with_asking_anew_and_the_graph_with_the_world(steps):
    kb = KnowledgeBase(SCHEMA)
    kb.apply(Delta(nodes=NODES), author="test")
    texts = [
        "(= (weight cup1) (weight cup2))",
        "(exists (?c - cup) (> (weight ?c) 1))",
        "(forall (?c - cup) (= (weight ?c) 0))",
    ]
    conditions = {text: kb.install(text) for text in texts}
    expected = {text: kb.ask(text) for text in texts}
    told = {text: heard(c) for text, c in conditions.items()}
    due: dict[str, list[Any]] = {text: [] for text in texts}
    bound: dict[str, Any] = {}
    for verb, name, number in steps:
        source = bound.get(name)
        is_fed = source is not None and not source.closed
        if verb == "feed":
            if not is_fed:
                source = bound[name] = kb.bind_source("weight", name, reference=name)
            source.update(number)
        elif verb == "close" and source is not None:
            source.close()
        elif verb == "set" and not is_fed:
            kb.apply(Delta(values={fact("weight", name): number}), author="test")
        elif verb == "remove":
            kb.apply(Delta(removed_nodes=(name,), nodes={name: "cup"}), author="test")
        for text, was in expected.items():
            truth = kb.ask(text)
            due[text] += [(kb.version, truth)] if truth != was else []
            expected[text] = truth
            assert conditions[text].truth == truth
        seen = kb.snapshot().values
        arcs = {start: data["value"] for start, _, key, data in kb.graph.edges(keys=True, data=True) if key == "weight"}
        fed = {s.fluent.args[0]: 0 for s in kb.sources()}
        assert arcs == {**fed, **{f.args[0]: content for f, content in seen.items()}}
    assert told == due

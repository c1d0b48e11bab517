"""Poses by reference: a transform tree answers and receives them, and no version has them."""

from __future__ import annotations

import threading

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kb_worlds import PROPERTY

from knowledge_base import (
    Change,
    Delta,
    InputError,
    KnowledgeBase,
    Schema,
    SchemaError,
    Stamped,
    Transform,
    TransformError,
    TransformTree,
    UnknownNameError,
    computed,
    fact,
)


@computed("(near ?a ?b - thing)", reads=["(pose ?a ?b)"])
def near(pose) -> bool:
    return bool(pose) and sum(x * x for x in pose[:3]) < 1


SCHEMA = Schema.parse("""(define (domain d) (:types thing - object cup - thing)
  (:predicates (on ?a ?b - thing))
  (:functions (pose ?t ?frame - thing) - geometry (place ?t - thing) - geometry
              (tagged ?t - thing ?n - number) - geometry (weight ?t - thing)))""").with_computed(near)
NODES = {"cup1": "cup", "cup2": "cup", "map": "thing", "base": "thing"}
POSE = fact("pose", "cup1", "map")


def at(x: float, y: float = 0.0) -> Transform:
    return Transform((x, y, 0))


@pytest.fixture
def kb():
    kb = KnowledgeBase(SCHEMA)
    kb.apply(Delta(nodes=NODES), author="test")
    return kb


@pytest.fixture
def tree(kb):
    """The base is at 1 m in the map, and `cup1` 2 m in front of the base."""
    tree = TransformTree()
    kb.bind_transforms("pose", tree)
    tree.update("map", "base", at(1), 0)
    tree.update("base", "cup1", at(2), 0)
    return tree


def heard(condition):
    told = []
    condition.subscribe(lambda firing: told.append((firing.version, firing.truth)), falls=True)
    return told


def test_every_pair_of_frames_has_its_latest_pose(kb, tree):
    assert kb.value("pose", ("cup1", "map")) == (3, 0, 0, 0, 0, 0, 1)
    assert kb.value("pose", ("map", "cup1"))[:3] == (-3, 0, 0)
    tree.update("map", "base", at(5), 1)  # the cup was not seen since
    assert kb.value("pose", ("cup1", "map"))[:3] == (3, 0, 0)
    tree.update("base", "cup1", at(2), 0.5)
    assert kb.value("pose", ("cup1", "map"))[:3] == (5, 0, 0)
    question = "(and (cup ?c) (= (pose ?c base) (geometry 2 0 0 0 0 0 1)))"
    assert kb.query(question) == [{"c": "cup1"}]
    assert kb.overlay().value("pose", ("cup1", "base"))[:3] == (2, 0, 0)  # guards read this
    with kb.transaction(author="test") as tx:
        assert tx.query(question) == [{"c": "cup1"}]


def test_an_object_without_a_transform_has_no_pose(kb, tree):
    tree.fix("map", "lamp", at(1))
    assert kb.value("pose", ("cup2", "map")) == ()
    assert kb.value("pose", ("lamp", "map")) == ()  # a frame, and no object
    assert not kb.ask("(near cup2 map)")
    for time in range(1, 20):
        tree.update("map", "base", at(1), time)
    assert kb.value("pose", ("cup1", "map")) == ()  # the readings of the cup are too old


def test_no_version_has_a_pose(kb, tree):
    before = kb.to_json()
    told: list[Change] = []
    kb.subscribe(told.append)
    kb.apply(Delta(values={fact("pose", "cup2", "map"): at(7).numbers}), author="test")
    assert kb.value("pose", ("cup2", "map")) == at(7).numbers
    assert (kb.version, told, kb.to_json(), kb.values()) == (1, [], before, {})
    change = kb.apply("(on cup2 map) (= (pose cup2 map) (geometry 8 0 0 0 0 0 1)) (= (weight cup2) 2)", author="test")
    assert change.delta == Delta(added=(fact("on", "cup2", "map"),), values={fact("weight", "cup2"): 2})
    assert kb.at(version=2).value("pose", ("cup2", "map")) == ()
    assert KnowledgeBase.from_json(kb.to_json()).value("pose", ("cup2", "map")) == ()


def test_a_file_does_not_have_a_pose(tmp_path):
    with KnowledgeBase.open(SCHEMA, tmp_path / "world.kb") as kb:
        kb.apply(Delta(nodes=NODES), author="test")
        kb.bind_transforms("pose", TransformTree())
        kb.apply(Delta(values={POSE: at(1).numbers}), author="test", key="once")
        assert (kb.version, kb.value("pose", POSE.args)) == (1, at(1).numbers)
    with KnowledgeBase.open(None, tmp_path / "world.kb") as kb:
        assert (kb.version, kb.value("pose", POSE.args)) == (1, ())


def test_a_set_pose_is_static_and_stays_where_it_is(kb, tree):
    with kb.transaction(author="test") as tx:
        tx.set("pose", "cup2", "base", at(1).numbers)
        assert tx.ask("(= (pose cup2 base) (geometry 1 0 0 0 0 0 1))")
        assert tree.parent("cup2") is None
    for time in range(1, 20):
        tree.update("map", "base", at(time), time)
    assert kb.value("pose", ("cup2", "map"))[:3] == (20, 0, 0)
    kb.apply("(= (pose cup2 base) (geometry))", author="test")
    assert kb.value("pose", ("cup2", "map")) == ()


def test_a_grasp_moves_an_object_to_another_frame(kb, tree):
    grasped = Delta(values={fact("pose", "cup1", "base"): (), fact("pose", "cup1", "cup2"): at(0).numbers})
    kb.apply(Delta(values={fact("pose", "cup2", "base"): at(2).numbers}), author="test")
    assert kb.value("pose", ("cup1", "cup2")) == at(0).numbers  # already there, but not yet by an arc of its own
    kb.apply(grasped, author="test")
    assert tree.parent("cup1") == "cup2"


@pytest.mark.parametrize(
    ("statements", "message"),
    [
        ("(= (pose cup1 map) (geometry 0 0 0 0 0 0 1))", "'cup1' has the parent 'base'"),
        ("(= (pose map cup1) (geometry 0 0 0 0 0 0 1))", "closes a cycle: map -> cup1 -> base -> map"),
        ("(= (pose cup2 map) (geometry 1 2 3))", r"\(pose cup2 map\): a transform is 7 numbers"),
        ("(= (pose cup2 map) (geometry 1 2 3 0 0 0 2))", "quaternion is 1, not 2"),
    ],
)
def test_an_impossible_arc_is_refused_and_nothing_is_changed(kb, tree, statements, message):
    with pytest.raises(TransformError, match=message):
        kb.apply(f"(on cup1 map) (= (pose cup2 base) (geometry 0 0 0 0 0 0 1)) {statements}", author="test")
    with pytest.raises(TransformError, match=message):
        kb.overlay().apply(kb_delta(statements))
    assert (kb.version, tree.parent("cup2"), kb.ask("(on cup1 map)")) == (1, None, False)


def kb_delta(statements: str) -> Delta:
    other = KnowledgeBase(SCHEMA)
    other.apply(Delta(nodes=NODES), author="test")
    return other.apply(statements, author="test").delta


def test_a_condition_wakes_when_its_chain_changes(kb, tree):
    told = heard(kb.install("(near cup1 map)"))
    other = heard(kb.install("(exists (?c - cup) (near ?c cup2))"))
    tree.update("base", "cup1", at(-0.5), 1)  # the time in common stays
    assert told == []
    tree.update("map", "base", at(1), 1)
    tree.update("map", "base", at(1), 2)
    tree.update("base", "cup1", at(3), 2)
    assert told == [(1, True), (1, False)]
    assert other == []
    tree.fix("cup2", "map", at(3.5))  # connects two trees
    assert other == [(1, True)]
    tree.remove("map")
    assert other == [(1, True), (1, False)]


def test_a_late_or_replaced_reading_wakes_too(kb, tree):
    told = heard(kb.install("(near cup1 base)"))
    tree.update("base", "cup1", at(0.1), 0)
    tree.fix("base", "cup1", at(9))
    assert told == [(1, True), (1, False)]


def test_a_change_of_facts_and_poses_is_one_for_conditions(kb, tree):
    told = heard(kb.install("(and (on cup1 map) (near cup1 base))"))
    never = heard(
        kb.install("(or (and (on cup1 map) (not (near cup1 base))) (and (near cup1 base) (not (on cup1 map))))")
    )
    kb.apply("(on cup1 map) (= (pose cup1 base) (geometry 0 0 0 0 0 0 1))", author="test")
    assert told == [(2, True)]
    assert never == []


def test_an_object_that_goes_and_returns_wakes_conditions(kb, tree):
    tree.update("base", "cup1", at(0.5), 0)
    told = heard(kb.install("(exists (?c - cup) (near ?c base))"))
    kb.apply(Delta(removed_nodes=("cup1",)), author="test")
    assert kb.value("pose", ("cup1", "base")) == ()
    kb.apply(Delta(nodes={"cup1": "cup"}), author="test")
    assert told == [(2, False), (3, True)]


def test_an_update_that_nothing_reads_evaluates_nothing(kb, tree):
    calls = []

    @computed("(counted ?a ?b - thing)", reads=["(pose ?a ?b)"])
    def counted(pose) -> bool:
        calls.append(pose)
        return False

    kb = KnowledgeBase(SCHEMA.with_computed(counted))
    kb.apply(Delta(nodes=NODES), author="test")
    kb.bind_transforms("pose", tree)
    kb.install("(counted cup1 base)")
    woken = []
    kb.subscribe_to_relations(lambda: woken.append(1))
    before = len(calls)
    for time in range(1, 101):
        tree.update("map", "base", at(time), time)
    assert (len(calls), woken) == (before, [])
    tree.update("base", "cup1", at(9), 1)
    assert (len(calls), woken) == (before + 1, [1])


def test_waiting_readers_are_told_once_until_they_read_again(kb, tree):
    woken = []
    kb.subscribe_to_relations(lambda: woken.append(1))
    assert kb.value("pose", ("cup1", "base"))
    for time in range(1, 101):
        tree.update("base", "cup1", at(time), time)
    assert woken == [1]
    assert kb.value("pose", ("cup1", "base"))[0] == 100


def test_the_readings_of_a_message_wake_once(kb, tree):
    woken = []
    told = heard(kb.install("(near cup1 map)"))
    kb.subscribe_to_relations(lambda: woken.append(1))
    tree.update_all([Stamped("map", "base", at(9), 1), Stamped("base", "cup1", at(-9), 1)])
    assert (told, woken) == ([(1, True)], [1])


def test_a_snapshot_keeps_its_poses(kb, tree):
    snapshot = kb.snapshot()
    tree.update("base", "cup1", at(7), 5)
    kb.apply("(= (pose cup2 map) (geometry 0 0 0 0 0 0 1))", author="test")
    assert snapshot.value("pose", ("cup1", "base"))[0] == 2
    assert snapshot.value("pose", ("cup2", "map")) == ()
    assert snapshot.copy(fed=True).value("pose", ("cup1", "map"))[0] == 3


def test_the_end_of_a_binding_gives_back_stored_values(kb):
    kb.apply(Delta(values={POSE: (1.0,)}), author="test")
    told = heard(kb.install("(= (pose cup1 map) (geometry 1))"))
    tree = TransformTree()
    end = kb.bind_transforms("pose", tree)
    assert kb.value("pose", POSE.args) == ()
    end()
    assert told == [(2, False), (2, True)]
    tree.fix("map", "cup1", at(1))
    assert kb.value("pose", POSE.args) == (1.0,)
    kb.bind_transforms("pose", tree)
    assert kb.value("pose", POSE.args) == at(1).numbers


@pytest.mark.parametrize(
    ("function", "kind", "message"),
    [
        ("poise", UnknownNameError, "did you mean 'pose'"),
        ("weight", SchemaError, r"a transform tree answers a function of two objects, \(weight \?frame \?reference\)"),
        ("place", SchemaError, "a function of two objects"),
        ("tagged", SchemaError, "a function of two objects"),
        ("pose", SchemaError, "'pose' has a transform tree or a source already"),
    ],
)
def test_an_unfit_function_is_not_bound(kb, tree, function, kind, message):
    with pytest.raises(kind, match=message):
        kb.bind_transforms(function, TransformTree())


def test_a_source_and_a_tree_exclude_each_other(kb, tree):
    with pytest.raises(SchemaError, match=r"\(pose cup1 map\) is answered by a transform tree already"):
        kb.bind_source("pose", "cup1", "map", reference="tf")
    other = KnowledgeBase(SCHEMA)
    other.apply(Delta(nodes=NODES), author="test")
    other.bind_source("pose", "cup1", "map", reference="tf")
    with pytest.raises(SchemaError, match="already"):
        other.bind_transforms("pose", tree)


def test_a_closed_knowledge_base_binds_nothing(kb, tree):
    kb.close()
    assert (tree._listeners, kb.value("pose", ("cup1", "base"))) == ((), ())
    with pytest.raises(InputError, match="closed"):
        kb.bind_transforms("pose", TransformTree())


def test_sensors_update_from_many_threads(kb, tree):
    condition = kb.install("(near cup1 map)")
    told = heard(condition)

    def publish(parent, child, goal):
        for number in range(1, 101):
            tree.update(parent, child, at(goal * number / 100), number)

    jobs = [("map", "base", -4.0), ("base", "cup1", 4.5)]
    threads = [threading.Thread(target=publish, args=job) for job in jobs]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        kb.ask("(near cup1 base)")
    assert condition.truth
    assert told[-1] == (1, True)


FRAMES = ["cup1", "cup2", "map", "base"]
STEPS = st.lists(
    st.tuples(
        st.sampled_from(["update", "set", "unset", "remove", "read"]),
        st.sampled_from(FRAMES), st.sampled_from(FRAMES), st.integers(0, 3), st.integers(0, 12),
    ),
    max_size=25,
)  # fmt: skip


@settings(PROPERTY, max_examples=150)
@given(STEPS)
def test_conditions_agree_with_asking_anew(steps):
    kb = KnowledgeBase(SCHEMA)
    kb.apply(Delta(nodes=NODES), author="test")
    tree = TransformTree()
    kb.bind_transforms("pose", tree)
    texts = ["(near cup1 map)", "(exists (?c - cup) (near ?c base))", "(forall (?c - cup) (near ?c map))"]
    conditions = {text: kb.install(text) for text in texts}
    for verb, frame, reference, x, time in steps:
        try:
            if verb == "update":
                tree.update(reference, frame, at(x / 2), time)
            elif verb == "read":
                kb.value("pose", (frame, reference))
            elif verb == "remove":
                kb.apply(Delta(removed_nodes=(frame,), nodes={frame: NODES[frame]}), author="test")
            else:
                numbers = at(x / 2).numbers if verb == "set" else ()
                kb.apply(Delta(values={fact("pose", frame, reference): numbers}), author="test")
        except TransformError:
            continue
        for text, condition in conditions.items():
            assert condition.truth is kb.ask(text)
        for one in FRAMES:
            for other in FRAMES:
                try:
                    expected = tree.look_up(one, other).numbers
                except TransformError:
                    expected = ()
                assert kb.value("pose", (one, other)) == expected

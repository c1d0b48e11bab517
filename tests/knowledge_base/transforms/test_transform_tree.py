"""The transform tree: look-ups agree with products of matrices, and nothing is extrapolated."""

from __future__ import annotations

import math
import threading
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kb_worlds import PROPERTY
from scipy.spatial.transform import Rotation, Slerp

from knowledge_base import InputError, Stamped, Transform, TransformError, TransformTree

UNTYPED: Any = Transform
HALF = math.sqrt(0.5)
NUMBER = st.floats(-10, 10)
ROTATION = st.integers(0, 2**32 - 1).map(
    lambda seed: tuple(map(float, Rotation.random(random_state=seed).as_quat()))  # uniform, and of length 1
)
TRANSFORM = st.builds(Transform, st.tuples(NUMBER, NUMBER, NUMBER), ROTATION)


def matrix(transform: Transform):
    found = np.eye(4)
    found[:3, :3] = Rotation.from_quat(transform.rotation).as_matrix()
    found[:3, 3] = transform.translation
    return found


def agree(found: Transform, expected) -> None:
    np.testing.assert_allclose(matrix(found), expected, atol=1e-9)


@pytest.fixture
def tree():
    """A robot at 2 m in the map that looks at a cup; the base drives from 0 s to 10 s, the cup is seen from 4 s to 8 s."""
    tree = TransformTree()
    for time in range(11):
        tree.update("map", "base", Transform((time / 5, 0, 0)), time)
    tree.fix("base", "camera", Transform((0, 0, 1), (0, 0, HALF, HALF)))
    tree.update("camera", "cup1", Transform((1, 0, 0)), 4)
    tree.update("camera", "cup1", Transform((3, 0, 0)), 8)
    return tree


def test_a_chain_is_composed_at_the_latest_common_time(tree):
    assert tree.look_up("cup1", "map").translation == pytest.approx((1.6, 3, 1))
    assert tree.look_up("cup1", "map", 6).translation == pytest.approx((1.2, 2, 1))
    assert tree.look_up("cup1", "base").rotation == pytest.approx((0, 0, HALF, HALF))
    assert tree.look_up("map", "cup1").translation == pytest.approx((-3, 1.6, -1))
    assert tree.look_up("base", "base") == Transform()
    assert tree.frames == ("base", "camera", "cup1", "map")
    assert (tree.parent("cup1"), tree.parent("map")) == ("camera", None)


def test_a_reading_is_returned_as_it_was_published(tree):
    exact = Transform((0.1, 0.2, 0.3), (0.1, 0.7, 0.7, 0.1))
    tree.update("camera", "cup1", exact, 9)
    assert tree.look_up("cup1", "camera") == exact


def test_siblings_see_each_other(tree):
    tree.fix("camera", "cup2", Transform((0, 1, 0)))
    assert tree.look_up("cup1", "cup2").translation == pytest.approx((3, -1, 0))


@given(TRANSFORM, TRANSFORM)
@settings(PROPERTY)
def test_algebra_agrees_with_matrices(one, other):
    agree(one.compose(other), matrix(one) @ matrix(other))
    agree(one.inverse(), np.linalg.inv(matrix(one)))
    agree(one.compose(one.inverse()), np.eye(4))
    assert Transform.of(one.numbers) == one


@st.composite
def trees(draw):
    """A random tree of up to 8 frames whose arcs are static, or have readings from 0 s to 10 s."""
    parents = [draw(st.integers(0, i)) for i in range(draw(st.integers(1, 7)))]
    arcs = []
    for parent in parents:
        times = draw(st.none() | st.lists(st.floats(0.1, 9.9), max_size=3, unique=True))
        readings = {} if times is None else {time: draw(TRANSFORM) for time in [0.0, *times, 10.0]}
        arcs.append((parent, readings or draw(TRANSFORM)))
    return arcs


def in_parent(arc, time: float):
    """The matrix of an arc at a time, by scipy's own interpolation."""
    if isinstance(arc, Transform):
        return matrix(arc)
    times = sorted(arc)
    found = np.eye(4)
    found[:3, :3] = Slerp(times, Rotation.from_quat([arc[t].rotation for t in times]))(time).as_matrix()
    found[:3, 3] = [np.interp(time, times, [arc[t].translation[i] for t in times]) for i in range(3)]
    return found


@given(trees(), st.data())
@settings(PROPERTY, max_examples=300)
def test_every_pair_of_frames_agrees_with_the_product_of_matrices(arcs, data):
    tree = TransformTree()
    for number, (parent, arc) in enumerate(arcs, 1):
        if isinstance(arc, Transform):
            tree.fix(str(parent), str(number), arc)
        else:
            for time in data.draw(st.permutations(list(arc))):
                tree.update(str(parent), str(number), arc[time], time)
    time = data.draw(st.floats(0, 10))
    in_root = {0: np.eye(4)}
    for number, (parent, arc) in enumerate(arcs, 1):
        in_root[number] = in_root[parent] @ in_parent(arc, time)
    one, other = (data.draw(st.integers(0, len(arcs))) for _ in range(2))
    agree(tree.look_up(str(one), str(other), time), np.linalg.inv(in_root[other]) @ in_root[one])
    agree(tree.copy().look_up(str(other), str(one), time), np.linalg.inv(in_root[one]) @ in_root[other])


def test_rotations_are_interpolated_at_a_constant_rate():
    tree = TransformTree()
    tree.update("map", "fan", Transform(), 0)
    tree.update("map", "fan", Transform((0, 0, 2), (0, 0, 1, 0)), 2)
    half = tree.look_up("fan", "map", 1)
    assert half.translation == (0, 0, 1)
    assert Rotation.from_quat(half.rotation).magnitude() == pytest.approx(math.pi / 2)


@pytest.mark.parametrize(
    ("frame", "reference", "time", "message"),
    [
        (
            "cup1",
            "map",
            9,
            r"9 s is after the readings of 'cup1' in 'camera' \(4 s to 8 s\), which are not extrapolated",
        ),
        ("cup1", "map", 9, "; ask for a time from 4 s to 8 s"),
        ("map", "cup1", 3, r"3 s is before .*; ask for a time from 4 s to 8 s"),
        ("base", "map", math.nan, "not extrapolated"),
        ("cup", "map", None, "there is no frame 'cup'; did you mean 'cup1'"),
        ("base", "mop", None, "there is no frame 'mop'; did you mean 'map'"),
        ("base", "lamp", None, "'base' and 'lamp' are in different trees: base -> map and lamp -> ceiling; publish"),
    ],
)
def test_an_impossible_look_up_is_refused_with_a_remedy(tree, frame, reference, time, message):
    tree.fix("ceiling", "lamp", Transform())
    with pytest.raises(TransformError, match=message):
        tree.look_up(frame, reference, time)


def test_an_empty_tree_knows_no_frame():
    with pytest.raises(InputError, match="there is no frame 'a'; publish a transform first"):
        TransformTree().look_up("a", "a")


def test_readings_that_end_too_early_have_no_time_in_common(tree):
    for time in range(11, 25):
        tree.update("map", "base", Transform(), time)
    message = (
        r"'base' in 'map' \(14 s to 24 s\) and 'cup1' in 'camera' \(4 s to 8 s\) have no time in common; publish 'cup1'"
    )
    with pytest.raises(TransformError, match=message):
        tree.look_up("cup1", "map")
    with pytest.raises(TransformError, match=r"8 s is before .* not extrapolated; publish 'base' again"):
        tree.look_up("cup1", "map", 8)


def test_a_second_parent_and_a_cycle_are_refused_with_the_chain(tree):
    with pytest.raises(
        TransformError, match=r"'cup1' has the parent 'camera' \(cup1 -> camera -> base -> map\).*'table'"
    ):
        tree.update("table", "cup1", Transform(), 9)
    with pytest.raises(TransformError, match="'map' to 'cup1' closes a cycle: map -> cup1 -> camera -> base -> map"):
        tree.fix("cup1", "map", Transform())
    with pytest.raises(TransformError, match="closes a cycle: map -> map"):
        tree.update("map", "map", Transform(), 0)
    assert tree.parent("map") is None
    tree.remove("cup1")
    tree.update("table", "cup1", Transform(), 9)
    assert tree.look_up("cup1", "table", 9) == Transform()
    tree.remove("nobody")


def test_a_change_of_several_arcs_is_made_as_a_whole(tree):
    grasped = {("cup1", "camera"): None, ("cup1", "gripper"): Transform(), ("gripper", "base"): Transform((1, 0, 0))}
    with pytest.raises(TransformError, match="has the parent 'base'"):
        tree.change({**grasped, ("camera", "map"): Transform()})
    assert tree.parent("cup1") == "camera"
    tree.change({**grasped, ("camera", "map"): None})
    assert tree.look_up("cup1", "base") == Transform((1, 0, 0))


def test_a_reading_of_the_same_time_is_replaced(tree):
    tree.update("camera", "cup1", Transform((5, 0, 0)), 8)
    assert tree.look_up("cup1", "camera").translation == (5, 0, 0)
    tree.update("camera", "cup1", Transform((7, 0, 0)), 6)  # late
    assert tree.look_up("cup1", "camera", 7).translation == pytest.approx((6, 0, 0))


def test_a_static_arc_and_readings_replace_each_other(tree):
    tree.fix("camera", "cup1", Transform((9, 0, 0)))
    assert tree.look_up("cup1", "camera", 1e9).translation == (9, 0, 0)
    tree.update("camera", "cup1", Transform((1, 0, 0)), 2)
    with pytest.raises(TransformError, match="not extrapolated"):
        tree.look_up("cup1", "camera", 3)


def test_the_horizon_bounds_the_memory():
    tree = TransformTree(horizon=2)
    for number in range(1000):
        tree.update("map", "base", Transform((number, 0, 0)), number / 10)
    assert len(tree._arcs["base"]._times) == 21
    with pytest.raises(TransformError, match=r"at 97\.8 s is more than 2 s older than the newest one at 99\.9 s"):
        tree.update("map", "base", Transform(), 97.8)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: UNTYPED((0, 0)), "a translation is x y z in metres: 3 finite numbers"),
        (lambda: UNTYPED(("a", 0, 0)), "a translation is x y z in metres, not"),
        (lambda: Transform((0, 0, math.inf)), "finite"),
        (lambda: Transform(rotation=(0, 0, 0, 2)), "the length of a rotation's quaternion is 1, not 2"),
        (lambda: Transform.of((1, 2, 3)), "a transform is 7 numbers, x y z qx qy qz qw; found 3"),
        (lambda: TransformTree(0), "a horizon is a positive time"),
        (lambda: TransformTree().update("a", "b", Transform(), math.nan), "finite number of seconds"),
        (lambda: TransformTree().fix("", "b", Transform()), "the name of a frame is text"),
    ],
)
def test_invalid_input_is_refused(make, message):
    with pytest.raises(TransformError, match=message):
        make()


def test_arrays_are_numbers_too():
    assert UNTYPED(np.array([1, 2, 3]), np.array([0, 0, 0, 1])) == Transform((1, 2, 3))


def test_listeners_hear_each_change_until_they_leave(tree):
    heard: list[Any] = []
    leave = tree.subscribe(heard.append)
    tree.update("map", "base", Transform(), 11)
    tree.update("map", "base", Transform(), 10.5)
    tree.fix("base", "gripper", Transform())
    tree.fix("base", "gripper", Transform((1, 0, 0)))
    tree.remove("gripper")
    leave()
    tree.update("map", "base", Transform(), 12)
    assert heard == [
        {"base": "newer"},
        {"base": "other"},
        {"gripper": "linked"},
        {"gripper": "other"},
        {"gripper": "linked"},
    ]


def test_the_readings_of_a_message_are_heard_at_once(tree):
    heard: list[Any] = []
    tree.subscribe(heard.append)
    message = [("camera", "cup2", 9), ("camera", "cup2", 10), ("camera", "cup1", 9), ("camera", "cup1", 8.5)]
    tree.update_all(Stamped(parent, child, Transform(), time) for parent, child, time in message)
    tree.update_all([])
    with pytest.raises(TransformError, match="finite"):
        tree.update_all([Stamped("map", "base", Transform(), 11), Stamped("map", "base", Transform(), math.inf)])
    assert heard == [{"cup2": "linked", "cup1": "other"}, {"base": "newer"}]
    assert tree.look_up("cup1", "cup2", 9) == Transform()


def test_threads_update_and_look_up_at_the_same_time():
    tree = TransformTree(horizon=0.5)
    frames = ["map", "base", "arm", "cup"]
    for parent, child in pairwise(frames):
        tree.update(parent, child, Transform(), 0)
    failures = []

    def publish(parent, child):
        for number in range(1, 401):
            tree.update(parent, child, Transform((number, 0, 0)), number / 1000)

    def read():
        for _ in range(100):
            try:
                tree.look_up("cup", "map")
            except TransformError as error:
                failures.append(error)

    jobs = [(publish, pair) for pair in pairwise(frames)] + [(read, ())] * 2
    threads = [threading.Thread(target=job, args=args) for job, args in jobs]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failures == []
    assert tree.look_up("cup", "map").translation == pytest.approx((1200, 0, 0))

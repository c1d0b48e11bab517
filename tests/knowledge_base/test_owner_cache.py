"""Results that hang on their owner: computed once, again for other arguments, and gone with the owner."""

import copy
import gc
import pickle
import threading
import weakref
from dataclasses import dataclass, replace

import pytest

from knowledge_base.owner_cache import Owner, cache_on_owner


@dataclass(frozen=True)
class Shape(Owner):
    sides: int


class Result(list[int]):
    """A value with weak references."""


@pytest.fixture
def calls():
    return []


@pytest.fixture
def angles(calls):
    @cache_on_owner
    def angles(shape, *units):
        calls.append((shape.sides, *units))
        return Result([shape.sides])

    return angles


def test_an_owner_computes_once(angles, calls):
    shape = Shape(3)
    assert angles(shape) is angles(shape)
    assert calls == [(3,)]


def test_equal_owners_compute_for_themselves_and_stay_equal(angles, calls):
    one, other = Shape(3), Shape(3)
    angles(one)
    assert one == other
    assert hash(one) == hash(other)
    assert repr(one) == "Shape(sides=3)"
    angles(other)
    angles(replace(one, sides=4))
    assert calls == [(3,), (3,), (4,)]


def test_other_arguments_compute_again(angles, calls):
    shape = Shape(3)
    for unit in ("degree", "degree", "radian", "degree"):
        angles(shape, unit)
    assert calls == [(3, "degree"), (3, "radian"), (3, "degree")]


def test_an_error_is_no_result(calls):
    @cache_on_owner
    def fail(shape):
        calls.append(shape.sides)
        raise ValueError("no angle")

    shape = Shape(2)
    for _ in range(2):
        with pytest.raises(ValueError, match="no angle"):
            fail(shape)
    assert calls == [2, 2]


def test_a_result_ends_with_its_owner(angles):
    shape = Shape(3)
    result = weakref.ref(angles(shape))
    assert result() is not None
    del shape
    gc.collect()
    assert result() is None


def test_copies_of_an_owner_do_not_have_its_results(calls):
    @cache_on_owner
    def lock(shape):
        calls.append(shape.sides)
        return threading.Lock()

    shape = Shape(3)
    lock(shape)
    for twin in (pickle.loads(pickle.dumps(shape)), copy.deepcopy(shape), copy.copy(shape)):  # noqa: S301
        assert twin == shape
        lock(twin)
    assert calls == [3, 3, 3, 3]

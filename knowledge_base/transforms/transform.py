"""Transform: the position and orientation of a frame in another one, with its algebra by `scipy.spatial.transform`."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any, NamedTuple, Self

import numpy as np
from scipy.spatial.transform import Rotation

from knowledge_base.errors import InputError
from knowledge_base.facts import Geometry

NUMBERS = 7
"""Length of a transform as a geometry: x y z in metres, then the quaternion qx qy qz qw."""
_UNIT = 1e-3
"""Largest difference of a quaternion's length from 1: sensors round their numbers."""


class TransformError(InputError):
    """A transform that is not valid, does not fit the tree, or cannot be looked up; the tree stays unchanged."""


@dataclass(frozen=True, slots=True)
class Transform:
    """The position and orientation of a frame in its reference.

    The transform converts coordinates of the frame to coordinates of the reference: rotation first, then translation.

    Attributes:
        translation: the origin of the frame, x y z in metres.
        rotation: the orientation of the frame as a unit quaternion x y z w, in the order of
            `scipy.spatial.transform.Rotation`. The opposite quaternion is the same orientation.

    Raises:
        TransformError: a wrong number of numbers, a number that is not finite, or a quaternion whose length is not 1.
    """

    translation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "translation", _finite(self.translation, 3, "a translation is x y z in metres"))
        object.__setattr__(self, "rotation", _finite(self.rotation, 4, "a rotation is a unit quaternion x y z w"))
        length = math.hypot(*self.rotation)
        if abs(length - 1) > _UNIT:
            raise TransformError(f"the length of a rotation's quaternion is 1, not {length:.4g}; divide by its length")

    @classmethod
    def of(cls, numbers: Geometry) -> Self:
        """Return the transform with these 7 numbers: x y z qx qy qz qw.

        Raises:
            TransformError: as for the constructor.
        """
        if len(numbers) != NUMBERS:
            raise TransformError(f"a transform is 7 numbers, x y z qx qy qz qw; found {len(numbers)}")
        x, y, z, *rotation = numbers
        return cls((x, y, z), tuple(rotation))  # type: ignore[arg-type]  # four numbers, as `_finite` checks

    @property
    def numbers(self) -> Geometry:
        """The 7 numbers of the transform, as a geometry: x y z qx qy qz qw."""
        return (*self.translation, *self.rotation)

    def compose(self, inner: Transform) -> Transform:
        """Return the transform of the frame of `inner` in the reference of this transform.

        The reference of `inner` is the frame of this transform: `base_in_map.compose(camera_in_base)`.
        """
        return multiply([Sample(self, self), Sample(inner, inner)], ())

    def inverse(self) -> Transform:
        """Return the transform of the reference in the frame."""
        return multiply((), [Sample(self, self)])


class Stamped(NamedTuple):
    """One reading for `TransformTree.update_all`; its fields are the arguments of `update`."""

    parent: str
    child: str
    transform: Transform
    time: float


class Sample(NamedTuple):
    """A transform between two readings.

    Attributes:
        before: the earlier reading.
        after: the later reading.
        fraction: the part of the way from `before` to `after`, at least 0 and below 1.
    """

    before: Transform
    after: Transform
    fraction: float = 0.0


class _Motion(NamedTuple):
    """A transform as scipy computes with it; the translation has the shape (3,)."""

    rotation: Any
    translation: Any


def multiply(downwards: Sequence[Sample], upwards: Sequence[Sample]) -> Transform:
    """Return the transform of the last frame of `downwards` in the last frame of `upwards`.

    Both chains begin at a common frame, and are in the order from there.
    """
    if len(downwards) <= 1 and not upwards and not any(one.fraction for one in downwards):
        return downwards[0].before if downwards else Transform()
    parts = [_motion(one) for one in downwards]
    if upwards:
        parts.insert(0, _inverse(reduce(_product, map(_motion, upwards))))
    rotation, translation = reduce(_product, parts)
    return Transform(tuple(translation.tolist()), tuple(rotation.as_quat(canonical=True).tolist()))


def _motion(sample: Sample) -> _Motion:
    before, after, fraction = sample
    rotation, translation = Rotation.from_quat(before.rotation), np.array(before.translation)
    if fraction:  # `Slerp` finds the same rotation, at five times the cost
        rotation *= (rotation.inv() * Rotation.from_quat(after.rotation)) ** fraction
        translation += (after.translation - translation) * fraction
    return _Motion(rotation, translation)


def _product(outer: _Motion, inner: _Motion) -> _Motion:
    turned = outer.rotation.as_matrix() @ inner.translation  # `apply` costs eight times as much
    return _Motion(outer.rotation * inner.rotation, outer.translation + turned)


def _inverse(motion: _Motion) -> _Motion:
    back = motion.rotation.inv()
    return _Motion(back, -(back.as_matrix() @ motion.translation))


def _finite(numbers: Iterable[float], count: int, rule: str) -> tuple[float, ...]:
    """Return these numbers as floats, also those of an array."""
    try:
        found = tuple(map(float, numbers))
    except (TypeError, ValueError):
        raise TransformError(f"{rule}, not {numbers!r}") from None
    if len(found) != count or not all(map(math.isfinite, found)):
        raise TransformError(f"{rule}: {count} finite numbers, not {numbers!r}")
    return found

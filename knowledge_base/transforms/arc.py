"""Arc of a transform tree: the readings of one frame in its parent."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable
from typing import Self

from knowledge_base.transforms.transform import Sample, Transform, TransformError


class Arc:
    """The readings of a frame in its parent, in order of time; a static arc has one for all times.

    Args:
        parent: the frame in which the readings are.
        times: times of the readings in seconds, ascending; none for a static arc.
        transforms: the readings.
    """

    __slots__ = ("_times", "_transforms", "parent")

    def __init__(self, parent: str, times: Iterable[float] = (), transforms: Iterable[Transform] = ()) -> None:
        self.parent = parent
        self._times = [*times]
        self._transforms = [*transforms]

    @property
    def first(self) -> float:
        """Time of the oldest reading in seconds; minus infinity for a static arc."""
        return self._times[0] if self._times else -math.inf

    @property
    def last(self) -> float:
        """Time of the newest reading in seconds; infinity for a static arc."""
        return self._times[-1] if self._times else math.inf

    def fix(self, transform: Transform) -> None:
        """Replace all readings by a transform for all times."""
        self._times, self._transforms = [], [transform]

    def require_recent(self, child: str, time: float, horizon: float) -> None:
        """Raise `TransformError` for a reading that is older than the horizon."""
        if self._times and time < self._times[-1] - horizon:
            raise TransformError(
                f"the reading of '{child}' at {time:g} s is more than {horizon:g} s older than the newest one at "
                f"{self.last:g} s; make the horizon longer"
            )

    def add(self, time: float, transform: Transform, horizon: float) -> bool:
        """Add a reading, discard those before the horizon, and return whether the reading is the newest one.

        A reading of the same time, and a static transform, are replaced.
        """
        if not self._times:
            self._times, self._transforms = [time], [transform]
            return False
        at = bisect_left(self._times, time)
        is_newest = at == len(self._times)
        if not is_newest and self._times[at] == time:
            self._transforms[at] = transform
        else:
            self._times.insert(at, time)
            self._transforms.insert(at, transform)
        old = bisect_left(self._times, self._times[-1] - horizon)
        if old:
            del self._times[:old], self._transforms[:old]
        return is_newest

    def sample(self, time: float) -> Sample:
        """Return the transform at a time from `first` to `last`."""
        if not self._times:
            return Sample(self._transforms[0], self._transforms[0])
        at = bisect_right(self._times, time) - 1
        before = self._transforms[at]
        if self._times[at] == time:
            return Sample(before, before)
        begin, end = self._times[at], self._times[at + 1]
        return Sample(before, self._transforms[at + 1], (time - begin) / (end - begin))

    def copy(self) -> Self:
        """Return an independent arc with the same readings."""
        return type(self)(self.parent, self._times, self._transforms)

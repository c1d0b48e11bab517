"""Poses: the values of a binary function that a transform tree answers for every pair of frames (S4.9, S4.16)."""

from __future__ import annotations

from collections.abc import Mapping
from threading import Lock

from knowledge_base.facts import Content, Fact, Geometry
from knowledge_base.transforms.chain import Links, Reading
from knowledge_base.transforms.transform import Transform, TransformError
from knowledge_base.transforms.tree import News, TransformTree

Pair = tuple[str, str]
"""A frame and its reference."""


class Poses:
    """The latest poses of frames in each other, as geometries of 7 numbers; `()` where the tree has none.

    A pose that was read is kept until it changes. An update therefore costs almost nothing while nothing has read a
    pose that depends on the update.

    Args:
        function: the name of the function; its arguments are the frame and the reference.
        tree: the tree that is asked, and that receives new values.
    """

    def __init__(self, function: str, tree: TransformTree) -> None:
        self.function = function
        self._tree = tree
        self._lock = Lock()
        self._read: dict[Pair, tuple[Reading, Geometry]] = {}
        self._pairs: dict[str, dict[Pair, None]] = {}

    def value(self, pair: Pair) -> Geometry:
        """Return the pose at the latest time for which all arcs between the frames have readings, or `()`."""
        with self._lock:
            found = self._read.get(pair)
            if found is not None:
                return found[1]
            try:
                reading = self._tree.latest(*pair)
            except TransformError:  # no frames, or not in one tree
                return ()
            numbers = () if reading.transform is None else reading.transform.numbers
            self._read[pair] = reading, numbers
            for child in reading.chain.arcs:
                self._pairs.setdefault(child, {})[pair] = None
            return numbers

    def expire(self, news: Mapping[str, News]) -> list[Fact]:
        """Forget the poses that these changes of arcs may change; return those that were read since their last change.

        After a "linked" arc, also other frames may have poses.
        """
        is_linked = "linked" in news.values()
        with self._lock:  # also without pairs: a look-up may be in progress
            gone = list(self._read) if is_linked else self._old_pairs(news)
            for pair in gone:
                for frame in self._read.pop(pair)[0].chain.arcs:
                    del self._pairs[frame][pair]
        return [Fact(self.function, pair) for pair in gone]

    def require_publishable(self, values: Mapping[Fact, Content]) -> None:
        """Raise `TransformError` unless `publish` can set these values."""
        self._tree.require_change(self._links(values))

    def publish(self, values: Mapping[Fact, Content]) -> None:
        """Set static transforms in the tree, all or none; the value `()` removes the arc.

        Raises:
            TransformError: a value is not a transform, or an arc does not fit the tree.
        """
        self._tree.change(self._links(values))

    def copy(self) -> Poses:
        """Return the same poses, which later changes of the tree do not affect."""
        return Poses(self.function, self._tree.copy())

    def _old_pairs(self, news: Mapping[str, News]) -> list[Pair]:
        old: dict[Pair, None] = {}
        for child, kind in news.items():
            for pair in self._pairs.get(child, ()):
                reading, _ = self._read[pair]
                if kind == "other" or self._tree.latest_time(reading.chain) != reading.time:
                    old[pair] = None
        return list(old)

    def _links(self, values: Mapping[Fact, Content]) -> Links:
        found: dict[Pair, Transform | None] = {}
        for fluent, content in values.items():
            if fluent.predicate == self.function and isinstance(content, tuple):
                frame, reference = map(str, fluent.args)
                found[frame, reference] = _transform(fluent, content)
        return found


def _transform(fluent: Fact, content: Geometry) -> Transform | None:
    try:
        return Transform.of(content) if content else None
    except TransformError as error:
        raise TransformError(f"{fluent}: {error.message}") from None

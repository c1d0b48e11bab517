"""Transform tree: looks up any frame in any other one at a time, as the transform system of ROS (tf2) does (S4.9)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from threading import RLock
from typing import Literal, Self, get_args

from knowledge_base.transforms.arc import Arc
from knowledge_base.transforms.chain import (
    Arcs,
    Chain,
    Links,
    Reading,
    arcs_after,
    chain_between,
    names_of,
    parent_of,
    require_link,
)
from knowledge_base.transforms.transform import Stamped, Transform, TransformError, multiply

HORIZON_S = 10.0
"""Default time in seconds for which an arc keeps its readings, as in tf2."""

News = Literal["newer", "other", "linked"]
"""A change of an arc: a newer reading; other readings or a static transform; a new, moved or removed arc."""
_NEWS = get_args(News)
TreeListener = Callable[[Mapping[str, News]], None]
"""Function that is called with the changes of arcs, by child, in the thread of the changes."""


class TransformTree:
    """A tree of frames: each arc has the readings of a frame in its parent; usable from any thread.

    A look-up composes the arcs of a chain of any length, at one time. Between two readings of an arc, it interpolates:
    the translation linearly, the rotation at a constant rate. The tree never extrapolates. The callers give all times.

    Args:
        horizon: time in seconds for which an arc keeps readings before its newest one; this bounds the memory.
        arcs: the first arcs, which the tree copies.

    Raises:
        TransformError: the horizon is not a positive number.
    """

    def __init__(self, horizon: float = HORIZON_S, arcs: Arcs | None = None) -> None:
        if not horizon > 0:
            raise TransformError(f"a horizon is a positive time in seconds, not {horizon!r}")
        self._horizon = horizon
        self._lock = RLock()
        self._arcs = {child: arc.copy() for child, arc in (arcs or {}).items()}
        self._listeners: tuple[TreeListener, ...] = ()

    @property
    def frames(self) -> tuple[str, ...]:
        """The names of all frames, in alphabetical order."""
        with self._lock:
            return tuple(sorted(names_of(self._arcs)))

    def parent(self, frame: str) -> str | None:
        """Return the parent of a frame; `None` for the root of a tree and for an unknown frame."""
        return parent_of(frame, self._arcs)

    def update(self, parent: str, child: str, transform: Transform, time: float) -> None:
        """Add a reading of `child` in `parent`; the first one connects both frames.

        Readings may arrive in any order. A new reading replaces one of the same time, and a static transform.

        Args:
            parent: the frame of reference.
            child: the frame that is measured.
            transform: the position and orientation of `child` in `parent`.
            time: the time of the measurement in seconds.

        Raises:
            TransformError: `child` has another parent, the arc would close a cycle, the time is not finite, or the
                time is older than the horizon.
        """
        self.update_all([Stamped(parent, child, transform, time)])

    def update_all(self, readings: Iterable[Stamped]) -> None:
        """Add several readings, e.g. of one message, and call the listeners once.

        Raises:
            TransformError: as for `update`; the readings before the refused one are added.
        """
        message = [*readings]  # without the lock, as the caller's generator may wait for other locks
        news: dict[str, News] = {}
        try:
            with self._lock:
                for one in message:
                    latest = self._add(*one)
                    news[one.child] = max(latest, news.get(one.child, latest), key=_NEWS.index)
        finally:
            self._tell(news)

    def fix(self, parent: str, child: str, transform: Transform) -> None:
        """Set a static transform of `child` in `parent`, for all times; earlier readings are discarded.

        Raises:
            TransformError: `child` has another parent, or the arc would close a cycle.
        """
        self.change({(child, parent): transform})

    def remove(self, child: str) -> None:
        """Remove the arc from `child` to its parent, e.g. before `child` gets another parent.

        The removal of a frame without a parent has no effect.
        """
        parent = self.parent(child)
        if parent is not None:
            self.change({(child, parent): None})

    def change(self, links: Links) -> None:
        """Set or remove static transforms, all or none; the removals come first.

        Raises:
            TransformError: as for `fix`, after the removals.
        """
        with self._lock:
            before, self._arcs = self._arcs, arcs_after(links, self._arcs)
            children = dict.fromkeys(child for child, _ in links)
            linked = {child for child in children if parent_of(child, before) != parent_of(child, self._arcs)}
        self._tell({child: "linked" if child in linked else "other" for child in children})

    def require_change(self, links: Links) -> None:
        """Raise the errors of `change`, without a change."""
        with self._lock:
            arcs_after(links, self._arcs)

    def look_up(self, frame: str, reference: str, time: float | None = None) -> Transform:
        """Return the transform of `frame` in `reference`: the position and orientation of `frame` there.

        Args:
            frame: the frame to look up.
            reference: the frame in which the result is.
            time: time in seconds; `None` is the latest time for which all arcs between the frames have readings.

        Raises:
            TransformError: an unknown frame, frames in different trees, or a time that would need extrapolation.
        """
        with self._lock:
            chain = chain_between(frame, reference, self._arcs)
            down, up = chain.samples(chain.latest() if time is None else time)
        return multiply(down, up)

    def latest(self, frame: str, reference: str) -> Reading:
        """Return the latest transform of `frame` in `reference`, with its time and its arcs.

        Raises:
            TransformError: an unknown frame, or frames in different trees.
        """
        with self._lock:
            chain = chain_between(frame, reference, self._arcs)
            time = self.latest_time(chain)
            if time is None:
                return Reading(chain, None, None)
            down, up = chain.samples(time)
        return Reading(chain, time, multiply(down, up))

    def latest_time(self, chain: Chain) -> float | None:
        """Return the latest time for which all arcs have readings, or `None`; infinity if all are static."""
        with self._lock:
            first, last = chain.limits()
        return last if first <= last else None

    def subscribe(self, listener: TreeListener) -> Callable[[], None]:
        """Call `listener` after each change of arcs; return a function that ends the subscription."""
        with self._lock:
            self._listeners = (*self._listeners, listener)

        def unsubscribe() -> None:
            with self._lock:
                self._listeners = tuple(one for one in self._listeners if one is not listener)

        return unsubscribe

    def copy(self) -> Self:
        """Return an independent tree with the same readings, without listeners."""
        with self._lock:
            return type(self)(self._horizon, self._arcs)

    def _add(self, parent: str, child: str, transform: Transform, time: float) -> News:
        if not math.isfinite(time):
            raise TransformError(f"the time of a transform is a finite number of seconds, not {time!r}")
        arc = self._arcs.get(child)
        is_new = arc is None
        if arc is None or arc.parent != parent:
            require_link(parent, child, self._arcs)
            arc = self._arcs[child] = Arc(parent)
        arc.require_recent(child, time, self._horizon)
        is_newer = arc.add(time, transform, self._horizon)
        return "linked" if is_new else "newer" if is_newer else "other"

    def _tell(self, news: Mapping[str, News]) -> None:
        """Call the listeners, without the lock."""
        for listener in self._listeners if news else ():
            listener(news)

"""Chain of arcs between two frames, and the rules that keep the arcs a forest of trees."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from knowledge_base.transforms.arc import Arc
from knowledge_base.transforms.transform import Sample, Transform, TransformError

Arcs = Mapping[str, Arc]
"""The arcs by the name of the child."""
Links = Mapping[tuple[str, str], Transform | None]
"""Static transforms by child and parent; `None` removes the arc between them, if there is one."""


class Chain(NamedTuple):
    """The arcs that connect a frame with its reference, by the child of each.

    Attributes:
        downwards: the arcs from the common ancestor to the frame.
        upwards: the arcs from the common ancestor to the reference, whose transforms are inverted.
    """

    downwards: Arcs
    upwards: Arcs

    @property
    def arcs(self) -> Arcs:
        """All arcs of the chain."""
        return {**self.downwards, **self.upwards}

    def limits(self) -> tuple[float, float]:
        """Return the first and the last time for which all arcs have readings; the first is later if there is none."""
        arcs = self.arcs.values()
        return max((arc.first for arc in arcs), default=-math.inf), min((arc.last for arc in arcs), default=math.inf)

    def latest(self) -> float:
        """Return the latest time for which all arcs have readings; infinity if all are static.

        Raises:
            TransformError: there is no such time.
        """
        first, last = self.limits()
        if first > last:
            late = max(self.arcs, key=lambda child: self.arcs[child].first)
            old = min(self.arcs, key=lambda child: self.arcs[child].last)
            raise TransformError(
                f"{self._readings(late)} and {self._readings(old)} have no time in common; "
                f"publish '{old}' again, or make the horizon longer"
            )
        return last

    def samples(self, time: float) -> tuple[list[Sample], list[Sample]]:
        """Return the transforms at a time, as `multiply` composes them.

        Raises:
            TransformError: an arc has no readings at this time.
        """
        for child, arc in self.arcs.items():
            if not arc.first <= time <= arc.last:
                raise self._extrapolation(child, time)
        down, up = ([arc.sample(time) for arc in arcs.values()] for arcs in self)
        return down, up

    def _extrapolation(self, child: str, time: float) -> TransformError:
        first, last = self.limits()
        side = "after" if time > self.arcs[child].last else "before"
        remedy = f"; ask for a time from {first:g} s to {last:g} s" if first <= last else f"; publish '{child}' again"
        return TransformError(
            f"{time:g} s is {side} the readings of {self._readings(child)}, which are not extrapolated{remedy}"
        )

    def _readings(self, child: str) -> str:
        arc = self.arcs[child]
        return f"'{child}' in '{arc.parent}' ({arc.first:g} s to {arc.last:g} s)"


class Reading(NamedTuple):
    """The latest transform between two frames.

    Attributes:
        chain: the arcs between the frames.
        time: time of the transform in seconds; infinity if all arcs are static, `None` without a transform.
        transform: the transform; `None` if the arcs have no time in common.
    """

    chain: Chain
    time: float | None
    transform: Transform | None


def chain_between(frame: str, reference: str, arcs: Arcs) -> Chain:
    """Return the chain from a frame to its reference.

    Raises:
        TransformError: an unknown frame, or frames in different trees.
    """
    down, up = path_of(frame, arcs), path_of(reference, arcs)
    for name, path in ((frame, down), (reference, up)):
        if len(path) == 1 and name not in (names := names_of(arcs)):
            remedy = "" if names else "; publish a transform first"
            raise TransformError(f"there is no frame '{name}'{remedy}", found=name, valid=names)
    if down[-1] != up[-1]:
        trees = f"{_arrows(down)} and {_arrows(up)}"
        raise TransformError(
            f"'{frame}' and '{reference}' are in different trees: {trees}; publish a transform between the trees"
        )
    while down and up and down[-1] == up[-1]:
        del down[-1], up[-1]
    return Chain({one: arcs[one] for one in reversed(down)}, {one: arcs[one] for one in reversed(up)})


def names_of(arcs: Arcs) -> set[str]:
    """Return the names of all frames."""
    return {*arcs, *(arc.parent for arc in arcs.values())}


def parent_of(child: str, arcs: Arcs) -> str | None:
    """Return the parent of a frame, or `None`."""
    arc = arcs.get(child)
    return None if arc is None else arc.parent


def path_of(frame: str, arcs: Arcs) -> list[str]:
    """Return the frame with all its ancestors, up to the root."""
    found = [frame]
    while (arc := arcs.get(found[-1])) is not None:
        found.append(arc.parent)
    return found


def require_link(parent: str, child: str, arcs: Arcs) -> None:
    """Raise an error unless an arc from `child` to `parent` keeps the arcs a forest.

    Raises:
        TransformError: a name is empty, `child` has another parent, or the arc closes a cycle.
    """
    for name in (parent, child):
        if not isinstance(name, str) or not name:
            raise TransformError(f"the name of a frame is text that is not empty, not {name!r}")
    path = path_of(child, arcs)
    if len(path) > 1 and path[1] != parent:
        raise TransformError(
            f"'{child}' has the parent '{path[1]}' ({_arrows(path)}) and cannot get the parent '{parent}'; "
            f"remove the arc of '{child}' first"
        )
    above = path_of(parent, arcs)
    if child in above:
        cycle = _arrows([child, *above[: above.index(child) + 1]])
        raise TransformError(f"the arc from '{child}' to '{parent}' closes a cycle: {cycle}; omit this arc")


def arcs_after(links: Links, arcs: Arcs) -> dict[str, Arc]:
    """Return the arcs after a change of static transforms; the removals come first.

    Raises:
        TransformError: as for `require_link`, after the removals.
    """
    found = {**arcs}
    for (child, parent), transform in links.items():
        if transform is None and parent_of(child, found) == parent:
            del found[child]
    for (child, parent), transform in links.items():
        if transform is not None:
            require_link(parent, child, found)
            found[child] = Arc(parent)
            found[child].fix(transform)
    return found


def _arrows(path: Sequence[str]) -> str:
    return " -> ".join(path)

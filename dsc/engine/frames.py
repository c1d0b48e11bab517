"""Frames: running plots during a step, the mutable counterparts of `FrameState`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from operator import is_

from dsc.engine.machine_state import FrameState


class Frame:
    """One running plot during a step; see `FrameState`.

    A step replaces the mappings of a frame and never changes them, because the frozen states share these mappings.

    Args:
        was: the plot before the step; inner plots stay frozen until the step uses them.
        parent: the next outer frame; `None` for the outermost plot.
        host: name of the state of `parent` that contains this plot.

    Attributes:
        children: inner plots that this step uses, by the name of their host state.
        resting: all other inner plots, unchanged and frozen, by the name of their host state.
        prefix: common beginning of the paths of this plot's states.
        depth: number of outer plots; 0 for the outermost plot.
        gone: whether the host state was exited.
    """

    __slots__ = (
        "activations", "children", "compiled", "configuration", "depth", "gone", "host", "kept", "parent",
        "prefix", "resting", "serial", "variables", "was",
    )  # fmt: skip

    def __init__(self, was: FrameState, parent: Frame | None = None, host: str = "") -> None:
        self.was = was
        self.serial, self.compiled, self.configuration, self.variables, self.activations, resting, self.kept = was
        self.resting: Mapping[str, FrameState] = resting
        self.children: dict[str, Frame] = {}
        self.parent = parent
        self.host = host
        self.prefix = ""
        self.depth = 0
        self.gone = False
        if parent is not None:
            self.prefix = f"{parent.prefix}{host}/"
            self.depth = parent.depth + 1
            parent.children[host] = self

    def take_out(self) -> None:
        """Remove this frame from its parent after the exit of the host state."""
        self.gone = True
        if self.parent is not None:
            del self.parent.children[self.host]

    def forget(self, host: str) -> None:
        """Drop the frozen plot inside the state `host`; the step executed no action of this plot."""
        resting = {**self.resting}
        del resting[host]
        self.resting = resting

    def child(self, host: str) -> Frame | None:
        """Return the plot inside the state `host`, thawed for this step; `None` if the state contains no plot."""
        if host in self.resting:
            inside = self.resting[host]
            self.forget(host)
            return Frame(inside, self, host)
        return self.children.get(host)

    def inner(self) -> list[Frame]:
        """Return the frames of the plots directly inside this plot, thawed, in document order."""
        for host in self.resting:
            self.child(host)
        return sorted(self.children.values(), key=lambda frame: self.compiled.index[frame.host])

    def frames(self) -> list[Frame]:
        """Return this frame and all inner frames, thawed, in document order."""
        return [self, *(frame for child in self.inner() for frame in child.frames())]

    def position(self, index: int) -> tuple[int, ...]:
        """Return a node's position in document order across all plots; nodes of inner plots have longer tuples."""
        if self.parent is None:
            return (index,)
        return (*self.parent.position(self.parent.compiled.index[self.host]), index)

    def that(self, wanted: Callable[[Frame | FrameState], object]) -> list[Frame]:
        """Return this frame and all inner frames that satisfy `wanted`; other inner plots stay frozen."""
        found = [self] if wanted(self) else []
        for child in self.children.values():
            found += child.that(wanted)
        for host, state in self.resting.items():
            if any(map(wanted, state.frames() if state.children else (state,))):
                self.forget(host)
                found += Frame(state, self, host).that(wanted)
        return found

    def frozen(self) -> FrameState:
        """End the frame and return it as an immutable value: the original object if no part has changed."""
        now = (
            self.serial, self.compiled, self.configuration, self.variables, self.activations,
            self._frozen_children() if self.children else self.resting, self.kept,
        )  # fmt: skip
        self.children = {}  # otherwise each step leaves circles of frames to the garbage collection
        return self.was if all(map(is_, now, self.was)) else FrameState(*now)

    def _frozen_children(self) -> Mapping[str, FrameState]:
        """Return the inner plots, frozen, in document order: the original mapping if none has changed."""
        children = {**self.resting, **{host: child.frozen() for host, child in self.children.items()}}
        if len(children) > 1:
            children = {host: children[host] for host in sorted(children, key=self.compiled.index.__getitem__)}
        was = self.was.children
        return was if children.keys() == was.keys() and all(map(is_, children.values(), was.values())) else children

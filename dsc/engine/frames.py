"""Frames: running plots during a step, as the mutable counterpart of `FrameState`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from operator import is_

from dsc.engine.machine_state import FrameState


class Frame:
    """One running plot; see `FrameState`. Its mappings are replaced, never changed, because the state shares them.

    Args:
        was: the plot before the step; the plots inside it stay frozen until they are used.
        parent: the frame around it.
        host: the name of the state there that holds it.

    Attributes:
        children: the plots inside that this step uses, by the name of their host state.
        resting: the other plots inside, unchanged and frozen.
        prefix: the beginning of its states' paths.
        depth: the number of plots around it.
        gone: whether its host state was exited.
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
        """Remove this frame after the exit of its host state."""
        self.gone = True
        if self.parent is not None:
            del self.parent.children[self.host]

    def forget(self, host: str) -> None:
        """Drop an idle plot inside; this step executed nothing in it."""
        resting = {**self.resting}
        del resting[host]
        self.resting = resting

    def child(self, host: str) -> Frame | None:
        """Return the plot inside that state, or `None`."""
        if host in self.resting:
            inside = self.resting[host]
            self.forget(host)
            return Frame(inside, self, host)
        return self.children.get(host)

    def inner(self) -> list[Frame]:
        """Return the frames directly inside, in document order."""
        for host in self.resting:
            self.child(host)
        return sorted(self.children.values(), key=lambda frame: self.compiled.index[frame.host])

    def frames(self) -> list[Frame]:
        """Return this frame and all frames inside it, in document order."""
        return [self, *(frame for child in self.inner() for frame in child.frames())]

    def position(self, index: int) -> tuple[int, ...]:
        """Return a node's position in document order through all plots; nodes of inner plots have longer tuples."""
        if self.parent is None:
            return (index,)
        return (*self.parent.position(self.parent.compiled.index[self.host]), index)

    def that(self, wanted: Callable[[Frame | FrameState], object]) -> list[Frame]:
        """Return this frame and those inside it that satisfy `wanted`; thaw only these."""
        found = [self] if wanted(self) else []
        for child in self.children.values():
            found += child.that(wanted)
        for host, state in self.resting.items():
            if any(map(wanted, state.frames() if state.children else (state,))):
                self.forget(host)
                found += Frame(state, self, host).that(wanted)
        return found

    def frozen(self) -> FrameState:
        """Return the frame as a value: the original object if nothing has changed."""
        now = (
            self.serial, self.compiled, self.configuration, self.variables, self.activations,
            self._frozen_children() if self.children else self.resting, self.kept,
        )  # fmt: skip
        return self.was if all(map(is_, now, self.was)) else FrameState(*now)

    def _frozen_children(self) -> Mapping[str, FrameState]:
        """Return the plots inside, in document order: the original mapping if none has changed."""
        children = {**self.resting, **{host: child.frozen() for host, child in self.children.items()}}
        if len(children) > 1:
            children = {host: children[host] for host in sorted(children, key=self.compiled.index.__getitem__)}
        was = self.was.children
        return was if children.keys() == was.keys() and all(map(is_, children.values(), was.values())) else children

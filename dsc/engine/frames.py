"""Running plots while a step works on them: the mutable counterpart of `FrameState`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dsc.engine.configuration import Configuration
from dsc.engine.state import NOTHING, FrameState
from dsc.engine.tables import CompiledPlot
from dsc.events import Event


class Frame:
    """One running plot; see `FrameState`. Mappings are replaced, not changed: the state keeps the old ones.

    Attributes:
        parent, host: the frame around it and the name of the state there that holds it.
        prefix: what its states' paths begin with.
        gone: whether the state that holds it was left.
    """

    __slots__ = (
        "activations", "children", "compiled", "configuration", "depth", "gone", "host", "kept", "parent",
        "prefix", "serial", "variables", "was",
    )  # fmt: skip

    def __init__(
        self, serial: int, compiled: CompiledPlot, configuration: Configuration, variables: Mapping[str, Any]
    ) -> None:
        self.serial = serial
        self.compiled = compiled
        self.configuration = configuration
        self.variables = variables
        self.activations: Mapping[str, int] = NOTHING
        self.children: dict[str, Frame] = {}
        self.kept: tuple[tuple[str, Event], ...] = ()
        self.parent: Frame | None = None
        self.host = ""
        self.prefix = ""
        self.depth = 0
        self.gone = False
        self.was: FrameState | None = None

    def put_into(self, parent: Frame, host: str) -> None:
        """Make it the content of a state of another frame."""
        self.parent, self.host = parent, host
        self.prefix = f"{parent.prefix}{host}/"
        self.depth = parent.depth + 1
        parent.children[host] = self

    def take_out(self) -> None:
        """Its state was left, and with it everything inside."""
        for frame in self.frames():
            frame.gone = True
        if self.parent is not None:
            del self.parent.children[self.host]

    def position(self, index: int) -> tuple[int, ...]:
        """Its place in document order through all plots: what is inside comes after, with a longer tuple."""
        if self.parent is None:
            return (index,)
        return (*self.parent.position(self.parent.compiled.index[self.host]), index)

    def inner(self) -> list[Frame]:
        """The frames directly inside, in document order."""
        found = list(self.children.values())
        if len(found) > 1:
            found.sort(key=lambda frame: self.compiled.index[frame.host])
        return found

    def frames(self) -> list[Frame]:
        """This frame and all inside it, in document order."""
        found = [self]
        if self.children:
            for child in self.inner():
                found += child.frames()
        return found


def thaw(state: FrameState, parent: Frame | None = None, host: str = "") -> Frame:
    """A frame to work on."""
    frame = Frame(state.serial, state.compiled, state.configuration, state.variables)
    if parent is not None:
        frame.put_into(parent, host)
    frame.activations = state.activations
    frame.kept = state.kept
    frame.was = state
    for name, child in state.children.items():
        thaw(child, frame, name)
    return frame


def freeze(frame: Frame) -> FrameState:
    """The frame as a value: the very one it was made from, if nothing has changed."""
    children: Mapping[str, FrameState] = NOTHING
    if frame.children:
        children = {child.host: freeze(child) for child in frame.inner()}
    was = frame.was
    if (
        was is not None
        and frame.configuration is was.configuration
        and frame.variables is was.variables
        and frame.activations is was.activations
        and frame.kept is was.kept
        and _same(children, was.children)
    ):
        return was
    return FrameState(
        frame.serial, frame.compiled, frame.configuration, frame.variables, frame.activations, children, frame.kept
    )


def _same(one: Mapping[str, FrameState], other: Mapping[str, FrameState]) -> bool:
    return len(one) == len(other) and all(child is other.get(name) for name, child in one.items())

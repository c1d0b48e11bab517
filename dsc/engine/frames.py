"""Frames: running plots during a step, as the mutable counterpart of `FrameState`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from dsc.engine.configuration import Configuration
from dsc.engine.machine_state import NOTHING, FrameState
from dsc.engine.tables import CompiledPlot
from dsc.events import Event


class Frame:
    """One running plot; see `FrameState`. Its mappings are replaced, never changed, because the state shares them.

    Attributes:
        children: the plots inside that this step uses, by the name of their host state.
        resting: the other plots inside, unchanged and frozen.
        parent, host: the frame around it, and the name of the state there that holds it.
        prefix: the beginning of its states' paths.
        depth: the number of plots around it.
        gone: whether its host state was exited.
    """

    __slots__ = (
        "activations", "children", "compiled", "configuration", "depth", "gone", "host", "kept", "parent",
        "prefix", "resting", "serial", "variables", "was",
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
        self.resting: Mapping[str, FrameState] = NOTHING
        self.kept: tuple[tuple[str, Event], ...] = ()
        self.parent: Frame | None = None
        self.host = ""
        self.prefix = ""
        self.depth = 0
        self.gone = False
        self.was: FrameState | None = None

    def put_into(self, parent: Frame, host: str) -> None:
        """Put this frame into a state of another frame."""
        self.parent, self.host = parent, host
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
        self.resting = {name: state for name, state in self.resting.items() if name != host}

    def child(self, host: str) -> Frame | None:
        """Return the plot inside that state, or `None`."""
        found = self.children.get(host)
        if found is None and host in self.resting:
            found = thaw(self.resting[host], self, host)
            self.forget(host)
        return found

    def inner(self) -> list[Frame]:
        """Return the frames directly inside, in document order."""
        for host in self.resting:
            self.child(host)
        found = list(self.children.values())
        if len(found) > 1:
            found.sort(key=lambda frame: self.compiled.index[frame.host])
        return found

    def frames(self) -> list[Frame]:
        """Return this frame and all frames inside it, in document order."""
        return [self, *(frame for child in self.inner() for frame in child.frames())]

    def position(self, index: int) -> tuple[int, ...]:
        """Return a node's position in document order through all plots; nodes of inner plots have longer tuples."""
        if self.parent is None:
            return (index,)
        return (*self.parent.position(self.parent.compiled.index[self.host]), index)

    def that(self, wanted: Callable[[Frame | FrameState], bool]) -> list[Frame]:
        """Return this frame and those inside it that satisfy `wanted`; thaw only these."""
        found = [self] if wanted(self) else []
        if self.children:
            for child in self.children.values():
                found += child.that(wanted)
        for host, state in self.resting.items():
            if wanted(state) or (state.children and any(map(wanted, state.frames()))):
                self.forget(host)
                found += thaw(state, self, host).that(wanted)
        return found


def thaw(state: FrameState, parent: Frame | None = None, host: str = "") -> Frame:
    """Return a mutable frame; its inner plots stay frozen until they are used."""
    frame = Frame(state.serial, state.compiled, state.configuration, state.variables)
    if parent is not None:
        frame.put_into(parent, host)
    frame.activations = state.activations
    frame.resting = state.children
    frame.kept = state.kept
    frame.was = state
    return frame


def freeze(frame: Frame) -> FrameState:
    """Return the frame as a value: the original object if nothing has changed."""
    children = _frozen(frame) if frame.children else frame.resting
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


def _frozen(frame: Frame) -> Mapping[str, FrameState]:
    """Return the plots inside, in document order."""
    children = {**frame.resting, **{host: freeze(child) for host, child in frame.children.items()}}
    if len(children) > 1:
        index = frame.compiled.index
        return {host: children[host] for host in sorted(children, key=lambda host: index[host])}
    return children


def _same(one: Mapping[str, FrameState], other: Mapping[str, FrameState]) -> bool:
    return one is other or (len(one) == len(other) and all(child is other.get(name) for name, child in one.items()))

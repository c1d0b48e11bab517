"""Running plots while a step works on them: the mutable counterpart of `FrameState`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from dsc.engine.configuration import Configuration
from dsc.engine.machine_state import NOTHING, FrameState
from dsc.engine.tables import CompiledPlot
from dsc.events import Event


class Frame:
    """One running plot; see `FrameState`. Mappings are replaced, not changed: the state keeps the old ones.

    Attributes:
        children: the plots inside that this step has to do with, by the name of the state that holds each.
        resting: the other plots inside, as they were.
        parent, host: the frame around it and the name of the state there that holds it.
        prefix: what its states' paths begin with.
        depth: how many plots it is inside of.
        gone: whether the state that holds it was left.
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
        """Make it the content of a state of another frame."""
        self.parent, self.host = parent, host
        self.prefix = f"{parent.prefix}{host}/"
        self.depth = parent.depth + 1
        parent.children[host] = self

    def take_out(self) -> None:
        """Its state was left."""
        self.gone = True
        if self.parent is not None:
            del self.parent.children[self.host]

    def forget(self, host: str) -> None:
        """A plot inside at rest was left, without this step having to do anything in it."""
        self.resting = {name: state for name, state in self.resting.items() if name != host}

    def child(self, host: str) -> Frame | None:
        """The plot inside that state, if there is one."""
        found = self.children.get(host)
        if found is None and host in self.resting:
            found = thaw(self.resting[host], self, host)
            self.forget(host)
        return found

    def inner(self) -> list[Frame]:
        """The frames directly inside, in document order."""
        for host in self.resting:
            self.child(host)
        found = list(self.children.values())
        if len(found) > 1:
            found.sort(key=lambda frame: self.compiled.index[frame.host])
        return found

    def frames(self) -> list[Frame]:
        """This frame and all inside it, in document order."""
        return [self, *(frame for child in self.inner() for frame in child.frames())]

    def position(self, index: int) -> tuple[int, ...]:
        """Its place in document order through all plots: what is inside comes after, with a longer tuple."""
        if self.parent is None:
            return (index,)
        return (*self.parent.position(self.parent.compiled.index[self.host]), index)

    def that(self, wanted: Callable[[Frame | FrameState], bool]) -> list[Frame]:
        """This frame and those inside it, as far as they are wanted; only these are thawed."""
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
    """A frame to work on; what runs inside it stays at rest until it is asked for."""
    frame = Frame(state.serial, state.compiled, state.configuration, state.variables)
    if parent is not None:
        frame.put_into(parent, host)
    frame.activations = state.activations
    frame.resting = state.children
    frame.kept = state.kept
    frame.was = state
    return frame


def freeze(frame: Frame) -> FrameState:
    """The frame as a value: the very one it was made from, if nothing has changed."""
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
    """The plots inside, in document order."""
    children = {**frame.resting, **{host: freeze(child) for host, child in frame.children.items()}}
    if len(children) > 1:
        index = frame.compiled.index
        return {host: children[host] for host in sorted(children, key=lambda host: index[host])}
    return children


def _same(one: Mapping[str, FrameState], other: Mapping[str, FrameState]) -> bool:
    return one is other or (len(one) == len(other) and all(child is other.get(name) for name, child in one.items()))

"""Machine state: the configurations and data of all running plots, as an immutable value with an exact JSON form."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from dsc.engine.automaton import Configuration
from dsc.engine.tables import CompiledPlot
from dsc.events import Event
from dsc.model.plot import ActionPlot

NOTHING: Mapping[str, Any] = MappingProxyType({})


class FrameState(NamedTuple):
    """One running plot between two steps.

    It is a named tuple because steps create many frames: a frozen dataclass takes four times as long to create.

    Attributes:
        serial: number of this plot instance, unique in the run.
        compiled: the plot.
        configuration: the plot's configuration.
        variables: values of parameters, variables and outputs, by name.
        activations: serial numbers of the active states that receive addressed events, by the state's name.
        children: inner plots, by the name of their submachine or dynamic state.
        kept: pairs of a state's name and an event that waits until this state's least time has passed.
    """

    serial: int
    compiled: CompiledPlot
    configuration: Configuration
    variables: Mapping[str, Any] = NOTHING
    activations: Mapping[str, int] = NOTHING
    children: Mapping[str, FrameState] = NOTHING
    kept: tuple[tuple[str, Event], ...] = ()

    @property
    def active(self) -> Mapping[str, int]:
        """Serial numbers of all active states by name, in document order; 0 for a state without addressed events."""
        return {name: self.activations.get(name, 0) for name in self.configuration.names}

    def frames(self) -> Iterator[FrameState]:
        """Yield this plot and all its inner plots."""
        yield self
        for child in self.children.values():
            yield from child.frames()

    def to_json(self) -> dict[str, Any]:
        """Return the frame as plain data."""
        return {
            "serial": self.serial,
            "plot": self.compiled.plot.name,
            "form": self.compiled.form,
            **self.configuration.form,
            "variables": dict(self.variables),
            "activations": dict(self.activations),
            "children": {name: child.to_json() for name, child in self.children.items()},
            "kept": self.kept_form(),
        }

    def kept_form(self) -> list[list[Any]]:
        """Return the kept events as plain data: pairs of a state's name and an event."""
        return [[name, {**event._asdict(), "attributes": dict(event.attributes)}] for name, event in self.kept]


class MachineState(NamedTuple):
    """The complete state of a machine between two events.

    Attributes:
        root: the outermost plot; `None` before the start and after the end of the run.
        serials: the last assigned serial number.
        finished: whether the outermost plot has reached its final state.
    """

    root: FrameState | None = None
    serials: int = 0
    finished: bool = False

    def to_json(self) -> dict[str, Any]:
        """Return the state as plain data, from which `machine_forms.read_state` makes it again."""
        root = self.root.to_json() if self.root else None
        return {"root": root, "serials": self.serials, "finished": self.finished}

    def configuration(self) -> tuple[str, ...]:
        """Return the paths of all active states, in document order; empty before the start and after the end."""
        if self.root is None or not self.root.children:
            return () if self.root is None else self.root.configuration.names
        return tuple(_paths(self.root, ""))

    def state_of(self, serial: int) -> tuple[str, ActionPlot] | None:
        """Return path and plot of the state with this serial number; `None` if the state is no longer active."""
        found = [] if self.root is None else _find_activation(self.root, "", serial)
        return next(iter(found), None)

    def plot_of(self, path: str) -> ActionPlot | None:
        """Return the plot of the state with this path; `None` if no such plot is running."""
        frame = self.root
        for host in path.split("/")[:-1]:
            frame = None if frame is None else frame.children.get(host)
        return None if frame is None else frame.compiled.plot

    def activations_inside(self, serial: int) -> frozenset[int]:
        """Return `serial` and the serial numbers of activations inside its state; empty if the state is not active."""
        for frame in self.root.frames() if self.root else ():
            for name, own in frame.activations.items():
                if own == serial:
                    content = frame.children[name].frames() if name in frame.children else ()
                    return frozenset({own, *(inner for one in content for inner in one.activations.values())})
        return frozenset()

    def is_active(self, state: str) -> bool:
        """Return whether a state with this name, path or end of a path is active."""
        return any(path == state or path.endswith("/" + state) for path in self.configuration())


def _find_activation(frame: FrameState, prefix: str, serial: int) -> Iterator[tuple[str, ActionPlot]]:
    for name, own in frame.activations.items():
        if own == serial:
            yield prefix + name, frame.compiled.plot
    for name, inner in frame.children.items():
        yield from _find_activation(inner, f"{prefix}{name}/", serial)


def _paths(frame: FrameState, prefix: str) -> Iterator[str]:
    for name in frame.configuration.names:
        yield prefix + name
        if name in frame.children:
            yield from _paths(frame.children[name], f"{prefix}{name}/")

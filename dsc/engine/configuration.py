"""The machine's state as a frozen value that goes to JSON and back exactly."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True)
class FrameState:
    """One running plot.

    Attributes:
        serial: number of this instance, never used again in the same run.
        plot: name of the plot in the library.
        form: the plot itself, if it was bound as a value (a generated plot); `None` otherwise.
        variables: parameters and variables with their values.
        active: the configuration, state name -> activation serial, in document order.
        children: plots inside active submachine and dynamic states, by the state's name.
        history: what the plot's history states remember: names of the states (or regions) that were active.
    """

    serial: int
    plot: str
    form: Mapping[str, Any] | None
    variables: Mapping[str, Any]
    active: Mapping[str, int]
    children: Mapping[str, FrameState] = field(default_factory=dict)
    history: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "serial": self.serial,
            "plot": self.plot,
            "form": self.form,
            "variables": dict(self.variables),
            "active": dict(self.active),
            "children": {name: child.to_json() for name, child in self.children.items()},
            "history": {name: list(remembered) for name, remembered in self.history.items()},
        }

    @staticmethod
    def from_json(data: Mapping[str, Any]) -> FrameState:
        """The inverse of `to_json`."""
        children = {name: FrameState.from_json(child) for name, child in data["children"].items()}
        history = {name: tuple(remembered) for name, remembered in data["history"].items()}
        return FrameState(
            data["serial"], data["plot"], data["form"], data["variables"], data["active"], children, history
        )


@dataclass(frozen=True, slots=True)
class MachineState:
    """Everything a machine has to remember between two events.

    Attributes:
        root: the outermost plot; `None` before the start and after the end.
        serials: the last serial number given out.
        finished: whether the outermost plot has reached its final state.
    """

    root: FrameState | None = None
    serials: int = 0
    finished: bool = False

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        return {
            "root": self.root.to_json() if self.root else None,
            "serials": self.serials,
            "finished": self.finished,
        }

    @staticmethod
    def from_json(data: Mapping[str, Any]) -> MachineState:
        """The inverse of `to_json`."""
        root = FrameState.from_json(data["root"]) if data["root"] else None
        return MachineState(root, data["serials"], data["finished"])

    def configuration(self) -> tuple[str, ...]:
        """Paths of all active states, outermost first."""
        return tuple(_paths(self.root, "")) if self.root else ()

    def has_activation(self, serial: int) -> bool:
        """Whether the state that was entered with this serial number is still active."""
        return self.root is not None and any(serial in frame.active.values() for frame in _frames(self.root))

    def activations_inside(self, serial: int) -> frozenset[int]:
        """The serial numbers of everything active inside that activation's content, and its own."""
        for frame in _frames(self.root) if self.root else ():
            for name, own in frame.active.items():
                if own == serial:
                    content = _frames(frame.children[name]) if name in frame.children else ()
                    return frozenset({own, *(inner for one in content for inner in one.active.values())})
        return frozenset()

    def is_active(self, state: str) -> bool:
        """Whether a state of that name or path is active."""
        return any(path == state or path.endswith("/" + state) for path in self.configuration())


def _frames(frame: FrameState) -> Iterator[FrameState]:
    yield frame
    for child in frame.children.values():
        yield from _frames(child)


def _paths(frame: FrameState, prefix: str) -> Iterator[str]:
    for name in frame.active:
        if not name.startswith("#"):  # a region
            yield prefix + name
        if name in frame.children:
            yield from _paths(frame.children[name], f"{prefix}{name}/")

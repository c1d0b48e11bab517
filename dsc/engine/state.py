"""The machine's state as a value that goes to JSON and back exactly."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from dsc.engine.configuration import Configuration, configuration_of
from dsc.engine.tables import Chart, CompiledPlot
from dsc.events import Event
from knowledge_base.errors import UnknownNameError

NOTHING: Mapping[str, Any] = MappingProxyType({})


class FrameState(NamedTuple):
    """One running plot; a named tuple, since steps make many and a frozen dataclass takes four times as long.

    Attributes:
        serial: number of this instance, never used again in the same run.
        compiled: the plot.
        configuration: its active states.
        variables: parameters, variables and outputs with their values.
        activations: serial numbers of the states that somebody may send events to, by name.
        children: plots inside active submachine and dynamic states, by the state's name.
        kept: events that wait until a state's least time has passed, with its name.
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
        """The active states by name, in document order, with their serial numbers; 0 where nobody needs one."""
        return {name: self.activations.get(name, 0) for name in self.configuration.names}

    def frames(self) -> Iterator[FrameState]:
        """This plot and all inside it."""
        yield self
        for child in self.children.values():
            yield from child.frames()

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
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
        """The events that wait, as plain data."""
        return [[name, {**event._asdict(), "attributes": dict(event.attributes)}] for name, event in self.kept]

    @staticmethod
    def from_json(data: Mapping[str, Any], chart: Chart) -> FrameState:
        """The inverse of `to_json`; raises `UnknownNameError` if the chart lacks the plot, or the plot the state."""
        form = data["form"]
        compiled = chart.compiled(data["plot"]) if form is None else chart.bind(form)
        index = _Index(compiled)
        configuration = configuration_of(
            compiled,
            tuple(map(index, data["active"])),
            frozenset(map(index, data["waiting"])),
            tuple([(index(at), tuple(map(index, kept))) for at, kept in data["history"].items()]),
        )
        children = {name: FrameState.from_json(child, chart) for name, child in data["children"].items()}
        kept = tuple([(name, Event(**event)) for name, event in data["kept"]])
        return FrameState(
            data["serial"], compiled, configuration, data["variables"], data["activations"], children, kept
        )


class _Index:
    """The node of that name; regions, which have none, are stored by their place."""

    def __init__(self, compiled: CompiledPlot) -> None:
        self._plot = compiled.plot.name
        self._index = {node.name: node.index for node in compiled.nodes[1:]}

    def __call__(self, name: str) -> int:
        found = self._index.get(name)
        if found is None:
            raise UnknownNameError(
                f"plot '{self._plot}' no longer has the state '{name}'", found=name, valid=self._index
            )
        return found


class MachineState(NamedTuple):
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
        root = self.root.to_json() if self.root else None
        return {"root": root, "serials": self.serials, "finished": self.finished}

    @staticmethod
    def from_json(data: Mapping[str, Any], chart: Chart) -> MachineState:
        """The inverse of `to_json`, with the plots of a chart.

        Raises:
            UnknownNameError: the chart lacks one of the plots, or a plot one of the states.
        """
        root = FrameState.from_json(data["root"], chart) if data["root"] else None
        return MachineState(root, data["serials"], data["finished"])

    def configuration(self) -> tuple[str, ...]:
        """Paths of all active states, outermost first."""
        if self.root is None or not self.root.children:
            return () if self.root is None else self.root.configuration.names
        return tuple(_paths(self.root, ""))

    def has_activation(self, serial: int) -> bool:
        """Whether the state that was entered with this serial number is still active."""
        return self.root is not None and any(serial in one.activations.values() for one in self.root.frames())

    def activations_inside(self, serial: int) -> frozenset[int]:
        """The serial numbers of everything active inside that activation's content, and its own."""
        for frame in self.root.frames() if self.root else ():
            for name, own in frame.activations.items():
                if own == serial:
                    content = frame.children[name].frames() if name in frame.children else ()
                    return frozenset({own, *(inner for one in content for inner in one.activations.values())})
        return frozenset()

    def is_active(self, state: str) -> bool:
        """Whether a state of that name or path is active."""
        return any(path == state or path.endswith("/" + state) for path in self.configuration())


def at_rest(root: FrameState, serials: int) -> MachineState:
    """The state of a machine that waits for events; one and the same wherever a configuration is all there is."""
    frame_serial = 1  # the outermost plot has the first number
    if serials > frame_serial or root.variables or root.children:
        return MachineState(root, serials)
    kept: MachineState | None = root.configuration.bare
    if kept is None:
        kept = root.configuration.bare = MachineState(root, serials)
    return kept


def _paths(frame: FrameState, prefix: str) -> Iterator[str]:
    for name in frame.configuration.names:
        yield prefix + name
        if name in frame.children:
            yield from _paths(frame.children[name], f"{prefix}{name}/")

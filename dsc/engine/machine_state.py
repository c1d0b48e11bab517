"""Machine state: an immutable value with an exact JSON form."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from dsc.engine.configuration import Configuration, configuration_of
from dsc.engine.tables import Chart, CompiledPlot
from dsc.events import Event
from knowledge_base.errors import ParseError, UnknownNameError

NOTHING: Mapping[str, Any] = MappingProxyType({})


class _Form(BaseModel):
    model_config = ConfigDict(extra="forbid")


class _EventForm(_Form):
    name: str
    attributes: dict[str, Any]
    to: int | None
    exact: bool
    frame: int | None
    number: int | None


class _FrameForm(_Form):
    serial: int
    plot: str
    form: Any  # the text of a plot that was bound as data; `None` for a plot of the chart
    active: list[str]
    waiting: list[str]
    history: dict[str, list[str]]
    variables: dict[str, Any]
    activations: dict[str, int]
    children: dict[str, _FrameForm]
    kept: list[tuple[str, _EventForm]]


class _MachineForm(_Form):
    root: _FrameForm | None
    serials: int
    finished: bool


_F = TypeVar("_F", bound=_Form)


class FrameState(NamedTuple):
    """One running plot. Steps make many of them: a frozen dataclass takes four times as long as a named tuple.

    Attributes:
        serial: number of this instance, never used again in the same run.
        compiled: the plot.
        configuration: its active states.
        variables: parameters, variables and outputs with their values.
        activations: serial numbers of the states that receive addressed events, by name.
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
        """Serial numbers of the active states by name, in document order; 0 for states without addressed events."""
        return {name: self.activations.get(name, 0) for name in self.configuration.names}

    def frames(self) -> Iterator[FrameState]:
        """Yield this plot and all plots inside it."""
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
        """Return the waiting events as plain data."""
        return [[name, {**event._asdict(), "attributes": dict(event.attributes)}] for name, event in self.kept]

    @staticmethod
    def from_json(data: Mapping[str, Any], chart: Chart) -> FrameState:
        """Return the frame of such data, the inverse of `to_json`; errors as for `MachineState.from_json`."""
        return _frame_of(_read(_FrameForm, data), chart)


class _Index:
    """Maps a name to its node; regions have no name and are stored by their place."""

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
    """The complete state of a machine between two events.

    Attributes:
        root: the outermost plot; `None` before the start and after the end.
        serials: the last serial number given out.
        finished: whether the outermost plot has reached its final state.
    """

    root: FrameState | None = None
    serials: int = 0
    finished: bool = False

    def to_json(self) -> dict[str, Any]:
        """Return the state as plain data."""
        root = self.root.to_json() if self.root else None
        return {"root": root, "serials": self.serials, "finished": self.finished}

    @staticmethod
    def from_json(data: Mapping[str, Any], chart: Chart) -> MachineState:
        """Return the state of such data with the plots of a chart, the inverse of `to_json`.

        Raises:
            ParseError: the data do not have that form.
            InputError: the data of a bound plot are not a plot.
            UnknownNameError: the chart lacks one of the plots, or a plot one of the states.
        """
        form = _read(_MachineForm, data)
        return MachineState(None if form.root is None else _frame_of(form.root, chart), form.serials, form.finished)

    def configuration(self) -> tuple[str, ...]:
        """Return the paths of all active states, outermost first."""
        if self.root is None or not self.root.children:
            return () if self.root is None else self.root.configuration.names
        return tuple(_paths(self.root, ""))

    def has_activation(self, serial: int) -> bool:
        """Return whether the state that was entered with this serial number is still active."""
        return self.root is not None and any(serial in one.activations.values() for one in self.root.frames())

    def activations_inside(self, serial: int) -> frozenset[int]:
        """Return the serial numbers of that activation and of all activations inside it."""
        for frame in self.root.frames() if self.root else ():
            for name, own in frame.activations.items():
                if own == serial:
                    content = frame.children[name].frames() if name in frame.children else ()
                    return frozenset({own, *(inner for one in content for inner in one.activations.values())})
        return frozenset()

    def is_active(self, state: str) -> bool:
        """Return whether a state of that name or path is active."""
        return any(path == state or path.endswith("/" + state) for path in self.configuration())


def at_rest(root: FrameState, serials: int) -> MachineState:
    """Return the state of a machine that waits for events; equal configurations without other data share one object."""
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


def _read(form: type[_F], data: object) -> _F:
    try:
        return form.model_validate(data)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        path = ".".join(map(str, first["loc"])) or "the whole"
        raise ParseError(f"this is not a state of a machine: {path}: {first['msg']}") from None


def _frame_of(form: _FrameForm, chart: Chart) -> FrameState:
    compiled = chart.compiled(form.plot) if form.form is None else chart.bind(form.form)
    index = _Index(compiled)
    configuration = configuration_of(
        compiled,
        tuple(map(index, form.active)),
        frozenset(map(index, form.waiting)),
        tuple([(index(at), tuple(map(index, kept))) for at, kept in form.history.items()]),
    )
    children = {name: _frame_of(child, chart) for name, child in form.children.items()}
    kept = tuple([(name, Event(**dict(event))) for name, event in form.kept])
    return FrameState(form.serial, compiled, configuration, form.variables, form.activations, children, kept)

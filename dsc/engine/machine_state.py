"""Machine state: the configurations and data of all running plots, as an immutable value with an exact JSON form.

All instances of a plot share its configurations and the reactions computed for them. A configuration computes each
reaction on first use and caches it (lazy determinisation), so that a later step only looks up the reaction. The number
of cached reactions is bounded.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from types import MappingProxyType
from typing import Any, NamedTuple

from pydantic import BaseModel, ConfigDict, ValidationError

from dsc.engine.situation import Chart
from dsc.engine.tables import CompiledPlot
from dsc.events import Event
from dsc.model.plot import ActionPlot
from knowledge_base.errors import ParseError, UnknownNameError

NOTHING: Mapping[str, Any] = MappingProxyType({})
Remembered = tuple[tuple[int, tuple[int, ...]], ...]
"""Pairs of a history node and the nodes that were active at the last exit of the history's parent, in order."""

MOST_CONFIGURATIONS = 4096
"""Upper bound of cached configurations of one plot: those of four regions with eight states each.

A configuration occupies a few KiB.
"""
MOST_TRIGGERS = 256
"""Upper bound of triggers with a cached choice in one configuration; events from outside may have any name."""


class Configuration:
    """The active nodes of a plot, and all other state that determines which transitions are enabled.

    The modules `reaction_choice`, `reaction` and `machine` cache their results in the configuration.

    Attributes:
        active: indices of the active nodes, in document order, without the plot itself.
        waiting: active nodes whose `at_least` time has not passed; their transitions are disabled.
        history: the nodes that each history node remembers.
        choices: by trigger, the reaction or the first guard to evaluate (see `reaction_choice`).
        reactions: by the transitions taken together, their reaction (see `reaction`).
        questions: the number of `Question` objects in `choices`.
        bare: the shared `MachineState` that contains only this configuration; `None` until a machine reaches it.
        steps: by event name, the last `Step` from `bare`, for events that only change the configuration.
    """

    def __init__(
        self, compiled: CompiledPlot, active: tuple[int, ...], waiting: frozenset[int], history: Remembered
    ) -> None:
        self.compiled = compiled
        self.active = active
        self.waiting = waiting
        self.history = history
        self.choices: dict[Any, Any] = {}
        self.reactions: dict[Any, Any] = {}
        self.questions = 0
        self.bare: Any = None
        self.steps: dict[str, Any] = {}

    def __eq__(self, other: object) -> bool:
        """Compare the active nodes, waiting nodes and history; `FrameState` compares the plots."""
        return self is other or (isinstance(other, Configuration) and self._key == other._key)

    def __hash__(self) -> int:
        return hash(self._key)

    def __repr__(self) -> str:
        return f"Configuration({', '.join(self.names)})"

    @property
    def _key(self) -> tuple[tuple[int, ...], frozenset[int], Remembered]:
        return self.active, self.waiting, self.history

    @cached_property
    def members(self) -> frozenset[int]:
        """Indices of the active nodes, as a set."""
        return frozenset(self.active)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the active states, in document order; active regions have no name here."""
        nodes = self.compiled.nodes
        return tuple([nodes[index].name for index in self.active if nodes[index].state is not None])

    @cached_property
    def form(self) -> Mapping[str, Any]:
        """The configuration as plain data: names instead of indices. The caller must not change the result."""
        names = [node.name for node in self.compiled.nodes]
        return {
            "active": [names[index] for index in self.active],
            "waiting": [names[index] for index in sorted(self.waiting)],
            "history": {names[at]: [names[index] for index in kept] for at, kept in self.history},
        }

    @cached_property
    def leaves(self) -> tuple[int, ...]:
        """Indices of the innermost active nodes, in document order."""
        inner = {self.compiled.nodes[index].parent for index in self.active}
        return tuple([index for index in self.active if index not in inner])

    @cached_property
    def spontaneous(self) -> bool:
        """Whether an active node has a transition without trigger."""
        return any(self.compiled.nodes[index].always for index in self.active)

    def forget(self) -> None:
        """Drop all cached results; later steps compute the dropped results again."""
        self.choices.clear()
        self.reactions.clear()
        self.steps.clear()
        self.questions = 0

    def is_active(self, state: str) -> bool:
        """Return whether the state of that name is active; `False` for an unknown name."""
        return self.compiled.index.get(state) in self.members


def configuration_of(
    compiled: CompiledPlot, active: tuple[int, ...], waiting: frozenset[int] = frozenset(), history: Remembered = ()
) -> Configuration:
    """Return the plot's configuration with these contents; one object is shared while the plot caches it."""
    key = (active, waiting, history)
    found: Configuration | None = compiled.cache.get(key)
    if found is None:
        if len(compiled.cache) >= MOST_CONFIGURATIONS:
            compiled.cache.clear()
        found = compiled.cache[key] = Configuration(compiled, active, waiting, history)
    return found


class _Form(BaseModel):
    model_config = ConfigDict(extra="forbid")


class _EventForm(_Form):
    name: str
    attributes: dict[str, Any]
    to: int | None
    exact: bool
    frame: int | None
    number: int | None
    inside: bool


class _FrameForm(_Form):
    serial: int
    plot: str
    form: Any  # the data of a plot that was bound as data; `None` for a plot of the chart
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
        """Return the state as plain data."""
        root = self.root.to_json() if self.root else None
        return {"root": root, "serials": self.serials, "finished": self.finished}

    @staticmethod
    def from_json(data: Mapping[str, Any], chart: Chart) -> MachineState:
        """Return the state that `to_json` wrote as `data`; the chart provides the plots.

        Raises:
            ParseError: the data do not have the form that `to_json` writes.
            InputError: the data of a bound plot are not a plot.
            UnknownNameError: the chart has no plot of a name in the data, or a plot no longer has a state.
        """
        try:
            form = _MachineForm.model_validate(data)
        except ValidationError as error:
            first = error.errors(include_url=False, include_input=False)[0]
            path = ".".join(map(str, first["loc"])) or "the whole"
            raise ParseError(f"this is not a state of a machine: {path}: {first['msg']}") from None
        return MachineState(None if form.root is None else _frame_of(form.root, chart), form.serials, form.finished)

    def configuration(self) -> tuple[str, ...]:
        """Return the paths of all active states, in document order; empty before the start and after the end."""
        if self.root is None or not self.root.children:
            return () if self.root is None else self.root.configuration.names
        return tuple(_paths(self.root, ""))

    def has_activation(self, serial: int) -> bool:
        """Return whether the state with this serial number is still active."""
        return self.root is not None and any(serial in one.activations.values() for one in self.root.frames())

    def state_of(self, serial: int) -> tuple[str, ActionPlot] | None:
        """Return path and plot of the state with this serial number; `None` if the state is no longer active."""
        found = [] if self.root is None else _activated(self.root, "", serial)
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


def idle_state(root: FrameState, serials: int) -> MachineState:
    """Return a machine's state between two steps; without data besides the configuration, it is a shared object."""
    frame_serial = 1  # serial number of the outermost plot
    if serials > frame_serial or root.variables or root.children:
        return MachineState(root, serials)
    kept: MachineState | None = root.configuration.bare
    if kept is None:
        kept = root.configuration.bare = MachineState(root, serials)
    return kept


def _activated(frame: FrameState, prefix: str, serial: int) -> Iterator[tuple[str, ActionPlot]]:
    for name, own in frame.activations.items():
        if own == serial:
            yield prefix + name, frame.compiled.plot
    for name, inner in frame.children.items():
        yield from _activated(inner, f"{prefix}{name}/", serial)


def _paths(frame: FrameState, prefix: str) -> Iterator[str]:
    for name in frame.configuration.names:
        yield prefix + name
        if name in frame.children:
            yield from _paths(frame.children[name], f"{prefix}{name}/")


def _frame_of(form: _FrameForm, chart: Chart) -> FrameState:
    compiled = chart.compiled(form.plot) if form.form is None else chart.bind(form.form)
    index = {node.name: node.index for node in compiled.nodes[1:]}
    index.update({f"#{node.index}": node.index for node in compiled.nodes if node.state is None})  # in older stores

    def placed(names: Iterable[str]) -> tuple[int, ...]:
        unknown = next((name for name in names if name not in index), None)
        if unknown is not None:
            message = f"plot '{compiled.plot.name}' no longer has the state '{unknown}'"
            raise UnknownNameError(message, found=unknown, valid=index)
        return tuple([index[name] for name in names])

    histories = zip(placed(form.history), map(placed, form.history.values()), strict=True)
    configuration = configuration_of(compiled, placed(form.active), frozenset(placed(form.waiting)), tuple(histories))
    children = {name: _frame_of(child, chart) for name, child in form.children.items()}
    kept = tuple([(name, Event(**dict(event))) for name, event in form.kept])
    return FrameState(form.serial, compiled, configuration, form.variables, form.activations, children, kept)

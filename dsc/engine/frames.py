"""Running plots while a step works on them: the mutable counterpart of `FrameState`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from dsc.engine.compiler import Chart, CompiledPlot, Node
from dsc.engine.configuration import FrameState
from dsc.model.states import HistoryState
from knowledge_base.errors import UnknownNameError


@dataclass(slots=True, eq=False)
class Frame:
    """One running plot; `active` maps node index to activation serial."""

    serial: int
    compiled: CompiledPlot
    variables: dict[str, Any]
    parent: Frame | None = None
    host: int = -1
    active: dict[int, int] = field(default_factory=dict)
    children: dict[int, Frame] = field(default_factory=dict)
    history: dict[int, tuple[int, ...]] = field(default_factory=dict)

    def node(self, index: int) -> Node:
        """The node of that index."""
        return self.compiled.nodes[index]

    def path(self, index: int) -> str:
        """The state's path from the outermost plot."""
        name = self.node(index).name
        return f"{self.parent.path(self.host)}/{name}" if self.parent else name

    def position(self, index: int) -> tuple[int, ...]:
        """Its place in document order through all plots: what is inside comes after, with a longer tuple."""
        return (*self.parent.position(self.host), index) if self.parent else (index,)

    @property
    def depth(self) -> int:
        """How many plots it is inside of."""
        return 1 + self.parent.depth if self.parent else 0

    def around(self, index: int) -> list[int]:
        """The node and the nodes around it in this plot, innermost first, without the plot itself."""
        return [index, *self.compiled.ancestors(index)[:-1]]

    def is_active(self, state: str) -> bool:
        """Whether the state of that name is active in this plot."""
        return self.compiled.index.get(state) in self.active

    def remember(self, index: int) -> None:
        """Record what is active inside a node that is about to be left, for its histories (SCXML 3.10)."""
        for history in self.node(index).histories:
            state = self.node(history).state
            if isinstance(state, HistoryState) and state.history == "deep":
                holders = {self.node(active).parent for active in self.active}
                kept = [at for at in self.active if at not in holders and self.compiled.inside(at, index)]
            else:
                kept = [child for child in self.node(index).children if child in self.active]
            self.history[history] = tuple(sorted(kept))

    def leaves(self) -> Iterator[tuple[Frame, int]]:
        """All active states, here and in plots inside, that have no active state inside; document order."""
        inner = {self.node(index).parent for index in self.active}
        for index in sorted(self.active):
            if index in self.children:
                yield from self.children[index].leaves()
            elif index not in inner:
                yield self, index

    def frames(self) -> Iterator[Frame]:
        """This frame and all inside it."""
        yield self
        for child in self.children.values():
            yield from child.frames()


def thaw(state: FrameState, chart: Chart, parent: Frame | None = None, host: int = -1) -> Frame:
    """A frame to work on; raises `UnknownNameError` if the chart no longer has the plot or the state."""
    compiled = chart.compiled(state.plot) if state.form is None else chart.bind(state.form)
    index = compiled.index
    frame = Frame(state.serial, compiled, dict(state.variables), parent, host)
    frame.active = {_index(index, name, compiled): serial for name, serial in state.active.items()}
    for name, remembered in state.history.items():
        frame.history[_index(index, name, compiled)] = tuple(_index(index, one, compiled) for one in remembered)
    for name, child in state.children.items():
        at = _index(index, name, compiled)
        frame.children[at] = thaw(child, chart, frame, at)
    return frame


def _index(index: Mapping[str, int], name: str, compiled: CompiledPlot) -> int:
    # Regions have no name of their own in the table: they are stored as `#index`.
    found = int(name[1:]) if name.startswith("#") else index.get(name)
    if found is None:
        raise UnknownNameError(
            f"plot '{compiled.plot.name}' no longer has the state '{name}'", found=name, valid=index
        )
    return found


def freeze(frame: Frame) -> FrameState:
    """The frame as a value."""
    return FrameState(
        serial=frame.serial,
        plot=frame.compiled.plot.name,
        form=frame.compiled.form,
        variables=dict(frame.variables),
        active={_name(frame, index): frame.active[index] for index in sorted(frame.active)},
        children={frame.node(index).name: freeze(frame.children[index]) for index in sorted(frame.children)},
        history={
            frame.node(index).name: tuple(_name(frame, one) for one in frame.history[index])
            for index in sorted(frame.history)
        },
    )


def _name(frame: Frame, index: int) -> str:
    node = frame.node(index)
    return node.name if node.state is not None else f"#{index}"

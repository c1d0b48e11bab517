"""Reading of machine states from plain data, for a resumed run and for changed plots."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from dsc.engine.automaton import configuration_of
from dsc.engine.machine_state import FrameState, MachineState
from dsc.engine.situation import Chart
from dsc.events import Event
from knowledge_base.errors import ParseError, UnknownNameError


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


def read_state(data: Mapping[str, Any], chart: Chart) -> MachineState:
    """Return the state that `MachineState.to_json` wrote as `data`; the chart provides the plots.

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


def _frame_of(form: _FrameForm, chart: Chart) -> FrameState:
    compiled = chart.compiled(form.plot) if form.form is None else chart.bind(form.form)
    index = {node.name: node.index for node in compiled.nodes[1:]}
    index.update({f"#{node.index}": node.index for node in compiled.nodes if node.state is None})  # in older stores

    def indices_of(names: Iterable[str]) -> tuple[int, ...]:
        unknown = next((name for name in names if name not in index), None)
        if unknown is not None:
            message = f"plot '{compiled.plot.name}' no longer has the state '{unknown}'"
            raise UnknownNameError(message, found=unknown, valid=index)
        return tuple([index[name] for name in names])

    histories = zip(indices_of(form.history), map(indices_of, form.history.values()), strict=True)
    configuration = configuration_of(
        compiled, indices_of(form.active), frozenset(indices_of(form.waiting)), tuple(histories)
    )
    children = {name: _frame_of(child, chart) for name, child in form.children.items()}
    kept = tuple([(name, Event(**dict(event))) for name, event in form.kept])
    return FrameState(form.serial, compiled, configuration, form.variables, form.activations, children, kept)

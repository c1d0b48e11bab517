"""Change of the plots of a running machine: its frames keep their plots, or continue in the changed ones (S2.8)."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, Literal

from dsc.engine.execution import Execution
from dsc.engine.frames import Frame
from dsc.engine.tables import CompiledPlot, StateNode
from dsc.model.states import SubmachineState

ActivePlots = Literal["at_next_entry", "keep", "restart"]
"""Treatment of running plots that are replaced.

- `at_next_entry`: they run to their end; the next entry uses the new plot.
- `keep`: they continue in the new plot. An active state that both plots have with equal entry actions, timers and
  content stays active; any other one is exited. A plot without such a state starts again.
- `restart`: they are exited and start again, with the same arguments.
"""


def keep_plots(form: Mapping[str, Any], before: Mapping[str, Any]) -> dict[str, Any]:
    """Return the data of a frame, in which each plot of the library that has changed is a plot given as data.

    Args:
        form: the frame as `FrameState.to_json` writes it.
        before: the written forms of the changed plots before the change, by name.
    """
    children = {host: keep_plots(child, before) for host, child in form["children"].items()}
    own = before.get(form["plot"]) if form["form"] is None else form["form"]
    return {**form, "form": own, "children": children}


def replace_plots(frame: Frame, execution: Execution, names: Collection[str], active: ActivePlots) -> Frame:
    """Replace the running plots of these names by those of the chart, and return the frame that replaces `frame`.

    Raises:
        InputError: a parameter of a new plot has no value.
    """
    compiled = frame.compiled
    if compiled.plot.name in names and compiled.form is not None and _is_named(frame):
        new = execution.chart.compiled(compiled.plot.name)
        arguments = {name: frame.variables[name] for name in new.plot.parameters if name in compiled.plot.parameters}
        shared = _common_states(frame, new) if active == "keep" else []
        if shared:
            frame = execution.replace_plot(frame, new, arguments, shared, frame.serial)
        else:
            frame = execution.restart_plot(frame, new, arguments)
    for inner in frame.inner():
        replace_plots(inner, execution, names, active)
    return frame


def _is_named(frame: Frame) -> bool:
    """Return whether the state around a plot names it, or chooses it by name."""
    if frame.parent is None:
        return True
    state = frame.parent.compiled.nodes[frame.parent.compiled.index[frame.host]].state
    return not (isinstance(state, SubmachineState) and state.use.startswith("?"))


def _common_states(before: Frame, compiled: CompiledPlot) -> list[str]:
    """Return the names of the active states that continue in another plot."""
    known = before.compiled
    names = [name for name in before.configuration.names if name in compiled.index]
    return [
        name for name in names if _begins_alike(known.nodes[known.index[name]], compiled.nodes[compiled.index[name]])
    ]


def _begins_alike(one: StateNode, other: StateNode) -> bool:
    """Return whether an entry of two states starts the same skills, timers and content."""
    return one.addressed == other.addressed and _entry(one.state) == _entry(other.state)


def _entry(state: object) -> tuple[Any, ...]:
    parts = [getattr(state, key, None) for key in ("entry", "at_least", "use", "goal", "arguments", "emit")]
    timers = [[timed.seconds for timed in getattr(state, key, ())] for key in ("after", "every")]
    return (type(state), *parts, *timers)

"""Watch over coordination phases: guards, entries, choices and bindings must not compute for long (S2.23)."""

from __future__ import annotations

import time
from collections.abc import Callable

from dsc.engine.machine_state import MachineState
from dsc.engine.steps import Step
from dsc.model.plot import ActionPlot
from dsc.run_log import run_logger

_LOG = run_logger(__package__)
LONGEST_PHASE = 0.5
"""Real seconds after which a coordination phase is reported; meanwhile no event is handled and no skill continues."""
_MOST_REPORTED = 20
"""Number of places that one run reports."""


class PhaseWatch:
    """Observer of the real time that macrosteps take.

    Args:
        limit: seconds after which a macrostep is reported, one time for each place.
        timer: returns the present second.

    Attributes:
        limit, timer: see above.
    """

    def __init__(self, limit: float = LONGEST_PHASE, timer: Callable[[], float] = time.perf_counter) -> None:
        self.limit = limit
        self.timer = timer
        self._reported: set[str] = set()

    def report(self, step: Step, seconds: float) -> None:
        """Log a warning about a macrostep that has taken longer than the limit."""
        place = _place(step)
        if place in self._reported or len(self._reported) >= _MOST_REPORTED:
            return
        self._reported.add(place)
        _LOG.warning(
            "the coordination phase of %s took %.2g s, more than %g s; move long computations into a skill",
            place, seconds, self.limit,
        )  # fmt: skip


def _place(step: Step) -> str:
    """Return, as text, the last choice or entry of a macrostep, or the event whose guards were evaluated."""
    if step.decisions:
        made = step.decisions[-1]
        candidates = ", ".join(verdict.plot for verdict in made.decision.verdicts)
        return f"{located(step.state, made.state)}, which chose among {candidates or 'no candidates'},"
    entered = [path for micro in step.microsteps for path in micro.entered]
    if entered:
        return located(step.state, entered[-1])
    return "the guards of a change of knowledge" if step.event is None else f"the guards of event '{step.event.name}'"


def located(state: MachineState, path: str) -> str:
    """Return a state by its path, with the plot, and file and line if they are known."""
    plot = state.plot_of(path)
    return f"state '{path}'" if plot is None else described(path, plot)


def described(path: str, plot: ActionPlot) -> str:
    """Return a state of a plot, with file and line if they are known."""
    name = path.rsplit("/", 1)[-1]
    form = next((form for one, _, form in plot.walk() if one == name), ())
    place = plot.place(form)
    where = f" ({place})" if place is not None and place.source else ""
    return f"state '{path}' of plot '{plot.name}'{where}"

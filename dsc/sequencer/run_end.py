"""The end of a run: its outcome, its problem and its reason."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Generic, cast

from dsc.calls import Outputs
from dsc.events import GAVE_UP, NO_PLAN, Event
from knowledge_base.notebook import table
from knowledge_base.spelling import brief_repr

SUSPENDED = "the run is suspended and can be resumed"
"""Problem of the end of a suspended run."""


@dataclass(frozen=True, slots=True)
class RunEnd(Generic[Outputs]):
    """The end of a run; the run of a `PlotCall` has typed outputs.

    An end is true if it is `reached`; a reached end is `finished`, and a finished end has no `problem`.

    Attributes:
        finished: whether the plot reached its final state, and neither its last step nor a component's stop failed.
        emitted: the latest 100 outcome events of the plot, and the latest of each name, in order.
        problem: the reason if the run ended before the final state, or the error of its last step
            or of a component's stop; else `None`.
        outputs: the outputs of the plot by name; empty unless `finished`.
        programming_error: the first undeclared exception of user code to which the plot did not respond, with file and
            line; else `None`. The run may have finished nevertheless, e.g. if only a listener failed.
        failure: the last outcome event of the plot if it is one of the sequencer's `failures`; else `None`.
    """

    finished: bool
    emitted: tuple[Event, ...] = ()
    problem: str | None = None
    outputs: Outputs = field(default_factory=lambda: cast(Outputs, {}))
    programming_error: str | None = None
    failure: str | None = None

    def __repr__(self) -> str:
        """Return the constructor's call without empty parts."""
        return brief_repr(self)

    def __bool__(self) -> bool:
        """Return `reached`."""
        return self.reached

    @property
    def reason(self) -> str:
        """The reason why the run ended as it did, as one sentence without a full stop."""
        if self.programming_error is not None and not self.reached:
            return f"programming error in {self.programming_error}"
        if self.problem is not None:
            return self.problem
        for event in reversed(self.emitted):
            if event.name in {NO_PLAN, GAVE_UP}:
                return f"{event.name}: {event.attributes.get('reason', 'no reason')}"
        if not self.emitted:
            return "the plot reached its end"
        last = self.emitted[-1]
        said, reason = f"the plot ended with '{last.name}'", last.attributes.get("reason")
        return f"{said}: {reason}" if reason else said

    @property
    def reached(self) -> bool:
        """Whether the run finished without a failure, and none of its goals ended with `no_plan` or `gave_up`."""
        without_plan = any(event.name in {NO_PLAN, GAVE_UP} for event in self.emitted)
        return self.finished and self.failure is None and not without_plan

    def _repr_html_(self) -> str:
        title = f"{'reached' if self.reached else 'not reached'}: {self.reason}"
        return table(title, ("output", "value"), cast("Mapping[str, object]", self.outputs).items())

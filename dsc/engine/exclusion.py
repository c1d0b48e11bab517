"""Exclusion of failed candidates: a dynamic state with `exclude` does not choose them for a time (S0.14).

The failures are data of the plot that contains the state, in a variable that no condition can name. So a run keeps them
like other variables.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from dsc.events import DONE, FAILURES
from dsc.model.plot import ActionPlot
from dsc.model.states import DynamicState

MOST_FAILURES = 100
"""Number of failed candidates, each with other arguments, that one state remembers; the latest are kept."""
_TIMEOUT = "after"
"""Trigger of the transition of a state whose candidate has not ended in time."""


class FailedCandidate(NamedTuple):
    """The successive failures of a candidate with these arguments.

    Attributes:
        plot: name of the candidate.
        arguments: values of its parameters.
        failures: number of failures since it was last done.
        until: second of run time until which it is excluded; 0 if it was not excluded.
    """

    plot: str
    arguments: Mapping[str, Any]
    failures: int
    until: float

    def fits(self, plot: str, arguments: Mapping[str, Any]) -> bool:
        """Return whether the candidate with these arguments has failed."""
        return self.plot == plot and all(self.arguments.get(name) == value for name, value in arguments.items())


def failures_of(state: str, variables: Mapping[str, Any]) -> tuple[FailedCandidate, ...]:
    """Return the remembered failures of a state's candidates, the latest last."""
    return tuple([FailedCandidate(*one) for one in variables.get(_variable(state), ())])


class Excluded(NamedTuple):
    """The failures of a state's candidates at a second of run time."""

    failed: Sequence[FailedCandidate]
    now: float

    def reason(self, plot: str, arguments: Mapping[str, Any]) -> str:
        """Return the reason why a candidate with these arguments is excluded now; empty if it is not."""
        for one in self.failed:
            if one.fits(plot, arguments) and one.until > self.now:
                times = "once" if one.failures == 1 else f"{one.failures} times"
                return f"it has failed {times}, and is excluded for {one.until - self.now:.4g} s"
        return ""


def with_end(
    variables: Mapping[str, Any], name: str, state: DynamicState, ended: ActionPlot, values: Mapping[str, Any],
    trigger: str, now: float,
) -> Mapping[str, Any]:  # fmt: skip
    """Return the variables of a plot after the end of a candidate in one of its states.

    Args:
        variables: the variables of the plot.
        name: name of the state.
        state: the state, with an exclusion.
        ended: the plot of the candidate.
        values: the variables of that plot.
        trigger: trigger of the transition that leaves the state.
        now: second of run time.
    """
    is_failure = trigger in ended.emits or trigger in FAILURES or trigger == _TIMEOUT
    if state.exclude is None or not state.admits(ended.name, ended.offers) or not (is_failure or trigger == DONE):
        return variables
    arguments = {parameter: values[parameter] for parameter in ended.parameters if parameter in values}
    before = failures_of(name, variables)
    others = [one for one in before if not one.fits(ended.name, arguments)]
    if is_failure:
        failures = 1 + next((one.failures for one in before if one.fits(ended.name, arguments)), 0)
        until = round(now + state.exclude.seconds, 6) if failures >= state.exclude.failures else 0.0
        others.append(FailedCandidate(ended.name, arguments, failures, until))
    remembered = [list(one) for one in others[-MOST_FAILURES:]]
    return {**variables, _variable(name): remembered} if remembered or before else variables


def _variable(state: str) -> str:
    return f"failures in {state}"

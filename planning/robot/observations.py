"""Records of a run that a monitoring profile asks for (S1.19, S2.20)."""

from __future__ import annotations

from collections.abc import Mapping

from dsc.components.component import Component
from dsc.monitoring.monitor import PROBLEM, Monitor, Observation
from dsc.monitoring.profile import MonitoringProfile
from dsc.run_log import run_logger
from dsc.sequencer.sequencer import Sequencer
from knowledge_base.errors import InputError

_LOG = run_logger(__package__)
MOST_BETWEEN_STEPS = 10_000
"""Number of observations that are recorded between two macrosteps.

An idle run omits later ones, as the store writes records with the next macrostep.
"""


def require_observable(profile: MonitoringProfile, components: Mapping[str, Component]) -> None:
    """Raise `UnknownNameError` if a component or a push port of the profile does not exist."""
    Monitor(profile, components, lambda _: None)


async def record_observations(profile: MonitoringProfile, sequencer: Sequencer) -> None:
    """Record the observations of a profile in the trace of a run, until cancelled.

    An entry that a diagnosis does not have ends the observation; the last record has the reason.
    """
    count = 0

    def record(one: Observation) -> None:
        nonlocal count
        count += 1
        if count <= MOST_BETWEEN_STEPS:
            _record(sequencer, one.component, one.entry, one.value)
        elif count == MOST_BETWEEN_STEPS + 1:
            _LOG.warning("the run omits observations until its next step: it has %d", MOST_BETWEEN_STEPS)

    def reset(_: object) -> None:
        nonlocal count
        count = 0

    sequencer.listen(reset)
    components, sleep = sequencer.dispatcher.components, sequencer.clock.sleep_in_background
    try:
        await Monitor(profile, components, record, sleep).run()
    except InputError as error:
        _LOG.warning("monitoring profile '%s': %s", profile.name, error)
        _record(sequencer, profile.name, PROBLEM, str(error))


def _record(sequencer: Sequencer, component: str, entry: str, value: object) -> None:
    """Record an observation; no record has led to it."""
    trace = sequencer.trace
    before, trace.cause = trace.cause, None
    trace.record("observation", component=component, entry=entry, value=value)
    trace.cause = before

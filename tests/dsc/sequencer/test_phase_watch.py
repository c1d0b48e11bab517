"""A coordination phase that takes long is reported with its place (S2.23)."""

from __future__ import annotations

import logging

import pytest
from dsc_charts import plot

from dsc import Event, Library, LoopClock, Sequencer, run_simulated
from dsc.sequencer.phase_watch import PhaseWatch
from knowledge_base import KnowledgeBase, Schema, computed

TEXTS = {
    "entry": "plot: p\nreceives: {go: , stop: }\nstates: {a: {on: {go: b, stop: c}}, b: {always: {to: c, when: (slow)}, on: {stop: c}}, c: {final: true}}",
    "choice": """
        plot: p
        receives: {go: , stop: }
        states:
          a: {on: {go: b, stop: c}}
          b: {dynamic: [one], on: {done: c, no_candidate: d, stop: c}}
          d: {on: {stop: c}}
          c: {final: true}
    """,
    "guard": "plot: p\nreceives: {go: , stop: }\nstates: {a: {on: {go: {to: b, when: (slow)}, stop: b}}, b: {final: true}}",
}
PLACES = {
    "entry": "state 'b' of plot 'p'",
    "choice": "state 'b' of plot 'p', which chose among one,",
    "guard": "the guards of event 'go'",
}


class Timer:
    """A stopwatch that only the slow predicate advances."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


def warnings_of(text, caplog, limit=0.5, events=("go", "go")):
    timer = Timer()

    @computed("(slow)", reads=[])
    def slow():
        timer.now += 0.7
        return False

    async def main():
        kb = KnowledgeBase(Schema().with_computed(slow))
        library = Library([plot(text), plot("{plot: one, when: (slow), states: {x: {final: true}}}")])
        sequencer = Sequencer(library, kb, [], LoopClock(), phases=PhaseWatch(limit, timer))
        for n, name in enumerate((*events, "stop"), start=1):
            sequencer.post(Event(name), after=n)
        return await sequencer.run("p")

    with caplog.at_level(logging.WARNING):
        run_simulated(main())
    return [one.getMessage() for one in caplog.records]


@pytest.mark.parametrize("phase", TEXTS)
def test_a_long_coordination_phase_is_reported_with_its_place(phase, caplog):
    first, *_ = warnings_of(TEXTS[phase], caplog)
    assert first == (
        f"the coordination phase of {PLACES[phase]} took 0.7 s, more than 0.5 s; move long computations into a skill"
    )


def test_a_place_is_reported_once_and_a_short_phase_never(caplog):
    assert len(warnings_of(TEXTS["guard"], caplog, events=["go"] * 5)) == 1
    caplog.clear()
    assert warnings_of(TEXTS["guard"], caplog, limit=2.0) == []

"""The engine does what the written semantics say, event by event: it is compared with a naive interpreter of them."""

from __future__ import annotations

import random

import pytest
import reference
from dsc_charts import PROPERTY, Run, activations, modes, plot
from hypothesis import given, settings
from random_charts import Grower, happenings, libraries, some_happenings
from reference import GoesRoundError, Reference

from dsc.engine import macrostep
from dsc.engine.steps import StartTimer
from dsc.errors import RunawayError
from dsc.events import EVERY
from knowledge_base.facts import Fact

SOON = 60
"""Microsteps after which a chart goes round: these charts are small."""


@pytest.fixture(autouse=True, scope="module")
def _goes_round_soon():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(macrostep, "MAX_MICROSTEPS", SOON)
        patch.setattr(reference, "MOST_MICROSTEPS", SOON)
        yield


class DiffersError(AssertionError):
    """The engine and the reference do not agree."""


class Pair:
    """The engine and the reference in the same world; every step is compared.

    Attributes:
        timers: what the engine asked for and did not cancel: (activation, event, number) -> path of the state.
    """

    def __init__(self, plots, by, library=None):
        self.engine, self.reference = Run(*plots), by(*plots)
        self.engine.machine.chart = self.library = library or self.engine.library
        self.timers = {}

    def start(self):
        return self._both(self.engine.start, self.reference.start)

    def do(self, what, which, attributes):
        """One thing that happens; `which` of the states that somebody may send something to."""
        if what == "time":
            self._for_one_of([*self.timers], which, self._time_passes)
        elif what == "to":
            root = self.engine.machine.state.root
            listening = [path for path, serial in activations(root) if serial] if root else []
            self._for_one_of(listening, which, lambda path: self._send_to(path, attributes))
        else:
            self._both(lambda: self.engine.send(what, **attributes), lambda: self.reference.send(what, attributes))

    def _for_one_of(self, options, which, act):
        if options:
            act(options[which % len(options)])

    def _send_to(self, path, attributes):
        self._both(
            lambda: self.engine.send("e", to=path, **attributes),
            lambda: self.reference.send_to(path, "e", attributes),
        )

    def _time_passes(self, timer):
        _, event, number = timer
        path = self.timers[timer] if event == EVERY else self.timers.pop(timer)
        self._both(
            lambda: self.engine.send(event, to=path, exact=True, number=number),
            lambda: self.reference.time_passes(path, event, number),
        )

    def _both(self, act, expect):
        try:
            step = act()
        except RunawayError:
            with pytest.raises(GoesRoundError):
                expect()
            raise
        self._compare(step, expect())
        self._keep_timers(step)

    def _compare(self, step, report):
        knowledge = step.knowledge
        told = [(fact, True) for fact in knowledge.added] + [(fact, False) for fact in knowledge.removed]
        seen = {
            "active": (self.engine.active, self.reference.configuration),
            "order of actions": (modes(step), report.modes),
            "microsteps": ([([*m.exited], [*m.entered]) for m in step.microsteps], report.microsteps),
            "handled": (step.handled, report.handled or step.event is None),
            "told": (dict(told), {Fact(*fact): is_added for fact, is_added in report.told.items()}),
            "facts": (self.engine.facts, {Fact(*fact) for fact in self.reference.facts}),
            "variables": (self.engine.machine.state.root and self.engine.variables(), self.reference.variables),
            "outcomes": ([event.name for event in step.emitted], report.emitted),
            "errors": (len(step.errors), report.errors),
        }
        for what, (found, expected) in seen.items():
            if found != expected:
                raise DiffersError(f"{what}: found {found}, expected {expected}, after {step.event}")

    def _keep_timers(self, step):
        root = step.state.root
        paths = {serial: path for path, serial in activations(root)} if root else {}
        asked = [one for one in step.output if isinstance(one, StartTimer)]
        self.timers |= {(one.activation, one.event, one.index): "" for one in asked}
        self.timers = {timer: paths[timer[0]] for timer in self.timers if timer[0] in paths}


def play(plots, happened, by=Reference):
    """Compares twice: the second time the engine has worked out before what it needs."""
    library = None
    for _ in range(2):
        pair = Pair(plots, by, library)
        library = pair.library
        try:
            pair.start()
            for one in happened:
                pair.do(*one)
        except RunawayError:
            return "goes round"
    return "rests"


@settings(PROPERTY, max_examples=15)
@given(libraries(depth=2), happenings())
def test_a_chart_runs_as_the_semantics_are_written(plots, happened):
    assert play(plots, happened) == "rests"


@settings(PROPERTY, max_examples=15)
@given(libraries(scxml=True, depth=2), happenings(scxml=True))
def test_an_scxml_chart_runs_as_appendix_d_says(plots, happened):
    assert play(plots, happened) in ("rests", "goes round")


@pytest.mark.parametrize("scxml", [False, True])
@pytest.mark.parametrize("first", [0, 30])
def test_large_charts_run_as_the_semantics_are_written(first, scxml):
    """Hypothesis begins with small charts; these are of full size, one for each seed."""
    for seed in range(first, first + 30):
        pick = random.Random(seed).choice  # noqa: S311  # a chart, no secret
        plots = Grower(pick, scxml=scxml).library()
        try:
            play(plots, some_happenings(pick, scxml))
        except DiffersError as error:
            raise DiffersError(f"seed {seed}: {error}") from error


@pytest.mark.parametrize(
    ("text", "happened"),
    [
        pytest.param(
            """
            plot: p
            states:
              o:
                regions:
                  r: {states: {a: {exit: {switch: log, to: -a}, on_break: {switch: log, to: "!a"}, on: {e: {}}}}}
                  s: {states: {b: {}}}
                on: {e: away}
              away: {}
            """,
            [("e", 0, {})],
            id="breaks",
        ),
        pytest.param(
            """
            plot: p
            states:
              c:
                at_least: 1
                on: {e: away}
                regions:
                  r: {states: {a: {on: {e: {}}}}}
                  s: {states: {b: {}}}
              away: {}
            """,
            [("e", 0, {}), ("time", 0, {})],
            id="keeps",
        ),
        pytest.param(
            """
            plot: p
            dialect: scxml
            states:
              o:
                on: {done.state.o: away}
                regions:
                  a: {states: {a: {states: {a1: {on: {e: a2}}, a2: {final: true}}}}}
                  b: {states: {b: {states: {b1: {on: {e: b2}}, b2: {final: true}}}}}
              away: {}
            """,
            [("e", 0, {})],
            id="completes",
        ),
        pytest.param(
            """
            plot: p
            dialect: scxml
            states:
              c:
                initial: a
                states:
                  h: {history: deep, to: b}
                  a: {states: {x: {on: {e: {to: h, clear: c}}}}}
                  b: {}
                on: {out: away}
              away: {on: {in: h}}
            """,
            [("out", 0, {}), ("in", 0, {}), ("e", 0, {})],
            id="forgets",
        ),
        pytest.param(
            """
            plot: p
            dialect: scxml
            states:
              o:
                states:
                  c:
                    entry: {switch: log, to: +c}
                    on: {e: {to: h, internal: true}}
                    states: {x: {}}
                  h: {history: deep, to: c}
                on: {out: away}
              away: {on: {in: h}}
            """,
            [("out", 0, {}), ("in", 0, {}), ("e", 0, {})],
            id="stays",
        ),
    ],
)
def test_the_engine_equals_the_reference_on_plots_with_former_faults(text, happened):
    play([plot(text)], happened)

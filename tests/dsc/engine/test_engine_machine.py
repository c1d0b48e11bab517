"""Whatever happens to a machine, in whatever order, its books are in order: states, activations, timers, skills."""

from __future__ import annotations

import json

from dsc_charts import PROPERTY, Run, modes
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule
from legality import check_legal, check_serials
from random_charts import EVENTS, SENT_IN_SCXML, libraries

from dsc.dynamic.library import Library
from dsc.engine.machine import Machine
from dsc.engine.machine_forms import read_state
from dsc.engine.steps import Cancel, Start, StartTimer
from dsc.errors import RunawayError
from dsc.events import AFTER, AT_LEAST, EVERY
from knowledge_base.facts import Fact

CHARTS = st.one_of(libraries(depth=2), libraries(scxml=True, depth=2))
ATTRIBUTES = st.sampled_from(({}, {"n": 1}, {"n": 2}))


class Books(RuleBasedStateMachine):
    """A running chart, and what must be true of it whatever was done.

    Attributes:
        active: paths of the states that were entered and not left since.
        shown: names of the states whose entry action came and whose exit action did not.
        timers: what was asked for, not cancelled and not yet fired, as (activation, event, number).
        skills: activations that started a skill and did not cancel it.
        fired: the timers of active states that have come, and were not asked for again.
        ids: all action ids so far.
    """

    @initialize(plots=CHARTS)
    def set_up(self, plots):
        self.plots = plots
        self.run = Run(*plots)
        self.active, self.shown, self.timers, self.skills, self.fired = set(), set(), set(), set(), set()
        self.ids, self.serials = set(), 0
        self._do(self.run.start)

    # -- what may happen ---------------------------------------------------------------------------------

    @rule(name=st.sampled_from((*EVENTS, *SENT_IN_SCXML, "leave")), attributes=ATTRIBUTES)
    def something_happens(self, name, attributes):
        self._do(lambda: self.run.send(name, **attributes))

    @precondition(lambda self: self.timers)
    @rule(data=st.data())
    def time_passes(self, data):
        timer = data.draw(st.sampled_from(sorted(self.timers)))
        activation, event, number = timer
        path = next(path for path, serial in self._activations() if serial == activation)
        self.timers.discard(timer)
        self.fired.add(timer)
        if not self._do(lambda: self.run.send(event, to=path, exact=True, number=number)):
            self.timers.add(timer)
            self.fired.discard(timer)

    @rule(fact=st.sampled_from((Fact("p"), Fact("q"))), holds=st.booleans())
    def the_world_changes(self, fact, holds):
        (self.run.facts.add if holds else self.run.facts.discard)(fact)
        self._do(self.run.look)

    @rule()
    def it_is_stored_and_read_by_another_program(self):
        stored = json.dumps(self.run.machine.state.to_json())
        self.run.library = Library(self.plots)
        restored = read_state(json.loads(stored), self.run.library)
        assert restored == self.run.machine.state
        assert json.dumps(restored.to_json()) == stored
        self.run.machine = Machine(self.run.library, restored)

    @rule()
    def it_is_left_and_starts_again(self):
        self._do(lambda: self.run.machine.leave(self.run.situation()))
        assert self.run.machine.state.root is None
        assert not self.run.machine.send(None, self.run.situation()).moved
        self.ids, self.serials = set(), 0
        self._do(self.run.start)

    # -- what is then true -------------------------------------------------------------------------------

    def _do(self, act):
        """Whether the chart came to rest; if it goes round, nothing has happened."""
        before = self.run.machine.state
        try:
            step = act()
        except RunawayError:
            assert self.run.machine.state is before
            return False
        self._follow_states(step)
        self._follow_output(step)
        assert step.state.serials >= self.serials
        self.serials = step.state.serials
        return True

    def _follow_states(self, step):
        for micro in step.microsteps:
            assert self.active >= set(micro.exited)
            self.active -= set(micro.exited)
            assert not self.active & set(micro.entered)
            self.active |= set(micro.entered)
        for mode in modes(step):
            assert (mode[1:] in self.shown) == (mode[0] != "+")
            (self.shown.add if mode[0] == "+" else self.shown.remove)(mode[1:])

    def _follow_output(self, step):
        for one in step.output:
            if isinstance(one, Start):
                assert one.action_id not in self.ids
                self.ids.add(one.action_id)
                self.skills.add(one.activation)
            elif isinstance(one, StartTimer):
                timer = one.activation, one.event, one.index
                assert timer not in self.timers
                assert timer not in self.fired or one.event == EVERY
                self.timers.add(timer)
                self.fired.discard(timer)
            elif isinstance(one, Cancel):
                assert self._has_something_to_stop(one.activation)
                self.skills.discard(one.activation)
                self.timers = {timer for timer in self.timers if timer[0] != one.activation}
                self.fired = {timer for timer in self.fired if timer[0] != one.activation}

    def _has_something_to_stop(self, activation):
        return activation in self.skills or activation in {one for one, _, _ in self.timers | self.fired}

    def _activations(self, frame=None, prefix=""):
        """Path and number of every activation."""
        frame = frame or self.run.machine.state.root
        for name, serial in frame.activations.items() if frame else ():
            yield prefix + name, serial
        for name, child in frame.children.items() if frame else ():
            yield from self._activations(child, f"{prefix}{name}/")

    def _frames(self):
        root = self.run.machine.state.root
        return root.frames() if root else ()

    def _shown(self):
        """The active states that show themselves; final states and connectors do not."""
        for frame in self._frames():
            yield from (
                name for name in frame.configuration.names if getattr(frame.compiled.plot.state(name), "exit", ())
            )

    def _timed(self):
        """All timers that the active states have according to the plots."""
        for frame in self._frames():
            for name, serial in frame.activations.items():
                state = frame.compiled.plot.state(name)
                yield from ((serial, AFTER, number) for number, _ in enumerate(state.after))
                yield from ((serial, EVERY, number) for number, _ in enumerate(state.every))
                yield from [(serial, AT_LEAST, 0)] if state.at_least is not None else []

    @invariant()
    def the_states_are_those_that_were_entered(self):
        assert self.active == set(self.run.machine.state.configuration())
        assert self.shown == set(self._shown())

    @invariant()
    def the_configuration_is_legal(self):
        if self.run.machine.state.root is not None:
            check_legal(self.run.machine.state.root)
            check_serials(self.run.machine.state)

    @invariant()
    def every_timer_is_due_or_has_come(self):
        assert self.timers | self.fired == set(self._timed())

    @invariant()
    def skills_run_for_active_states_alone(self):
        assert self.skills <= {serial for _, serial in self._activations()}


Books.TestCase.settings = settings(PROPERTY, max_examples=30, stateful_step_count=12)
TestBooks = Books.TestCase

"""What holds of every chart and of everything that happens to it."""

from __future__ import annotations

import json
import random

import pytest
from dsc_charts import PROPERTY, modes
from hypothesis import given, settings
from hypothesis import strategies as st
from legality import check_legal, check_serials
from random_charts import Grower, Played, happenings, in_place, libraries

from dsc.engine import automaton, macrostep
from dsc.engine.machine_forms import read_state
from dsc.events import Event

SMALL = {"depth": 2}
EVERY_KIND = st.one_of(libraries(**SMALL), libraries(scxml=True, **SMALL))
PUBLIC = st.one_of(libraries(private=False, **SMALL), libraries(private=False, scxml=True, **SMALL))
"""Without what depends on the plot that it is in, and without transitions that read the last event without it."""
SOME = settings(PROPERTY, max_examples=25)


@pytest.fixture(autouse=True, scope="module")
def _goes_round_soon():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(macrostep, "MAX_MICROSTEPS", 60)
        yield


@SOME
@given(EVERY_KIND, happenings())
def test_the_configuration_is_legal_after_every_step(plots, happened):
    for step in Played(*plots).steps(happened):
        assert (step.state.root is None) == step.state.finished
        if step.state.root is not None:
            check_legal(step.state.root)
            check_serials(step.state)


@SOME
@given(EVERY_KIND, happenings())
def test_a_microstep_enters_only_inactive_states_and_exits_only_active_states(plots, happened):
    active: set[str] = set()
    running: set[str] = set()
    for step in Played(*plots).steps(happened):
        for micro in step.microsteps:
            assert active >= set(micro.exited)
            active -= set(micro.exited)
            assert not active & set(micro.entered)
            active |= set(micro.entered)
            assert len(micro.entered) == len(set(micro.entered))
        assert active == set(step.state.configuration())
        for mode in modes(step):
            (running.add if mode[0] == "+" else running.remove)(mode[1:])


@SOME
@given(
    PUBLIC,
    happenings().map(lambda happened: [one for one in happened if one[0] != "to"]),
)
def test_a_plot_acts_alike_bound_as_content_and_written_in_place(plots, happened):
    one, other = Played(*plots), Played(in_place(plots))
    for a, b in zip(one.steps(happened), other.steps(happened), strict=True):
        assert modes(a) == modes(b)
        assert a.handled == b.handled
        assert a.knowledge == b.knowledge
        assert [[_name(path) for path in micro.entered] for micro in a.microsteps] == [
            [*map(_name, m.entered)] for m in b.microsteps
        ]
        assert [_name(path) for path in one.active] == [_name(path) for path in other.active]


def _name(path):
    """Of the final states that plots have in common, only one name is unique in one plot."""
    return path.rsplit("/")[-1].split("_")[0]


@SOME
@given(EVERY_KIND, happenings())
def test_the_same_input_gives_the_same_output_also_after_being_stored(plots, happened):
    one, other = Played(*plots), Played(*plots)
    for a, b in zip(one.steps(happened), other.steps(happened), strict=True):
        assert a == b
        stored = json.loads(json.dumps(other.machine.state.to_json()))
        other.machine.state = read_state(stored, other.library)


@SOME
@given(PUBLIC, happenings())
def test_without_trigger_a_chart_at_rest_stays_at_rest(plots, happened):
    run = Played(*plots)
    for step in run.steps(happened):
        assert not run.look().moved
        assert step.state == run.machine.state


# -- what the engine keeps for speed does not show --------------------------------------------------------------


class Forgetful(Played):
    """A run that has to work out everything anew for each event."""

    def event(self, what, which, attributes):
        for frame in self.machine.state.root.frames() if self.machine.state.root else ():
            frame.compiled.cache.clear()
            frame.configuration.reactions = automaton.ReactionCache()
            frame.configuration.idle = None
        return super().event(what, which, attributes)


class Warm(Played):
    """A run with plots that have already run in the same way, and with the very same events."""

    def __init__(self, *plots, happened):
        super().__init__(*plots)
        self.events = {}
        before = Played(*plots)
        before.library, before.machine.chart = self.library, self.library
        before.made = self.made  # type: ignore[method-assign]
        assert all(step.state.serials for step in before.steps(happened))

    def made(self, what, attributes):
        return self.events.setdefault((what, *attributes.items()), Event(what, attributes))


@SOME
@given(EVERY_KIND, happenings())
def test_a_step_does_not_depend_on_what_was_kept_from_earlier_ones(plots, happened):
    kept, forgotten = Warm(*plots, happened=happened), Forgetful(*plots)
    for a, b in zip(kept.steps(happened), forgotten.steps(happened), strict=True):
        assert a == b
        assert kept.machine.state == forgotten.machine.state


@pytest.mark.parametrize("seed", range(40))
def test_a_mere_move_is_looked_up_as_it_would_be_worked_out(seed):
    """The same events come again and again, while the world changes in between."""
    pick = random.Random(seed).choice  # noqa: S311  # a chart, no secret
    plots = Grower(pick, bare=True, depth=2).library()
    kinds = ("e", "f", "g", "e", "f", "g", "leave", "p", "q")
    attributes: tuple[dict[str, int], ...] = ({}, {"n": 1})
    happened = [(pick(kinds), 0, pick(attributes)) for _ in range(60)]
    kept, forgotten = Warm(*plots, happened=happened), Forgetful(*plots)
    for a, b in zip(kept.steps(happened), forgotten.steps(happened), strict=True):
        assert a == b


@SOME
@given(EVERY_KIND, happenings(), st.sampled_from((1, 2, 3)))
def test_a_step_does_not_depend_on_how_much_is_kept(plots, happened, most):
    plain = [*Played(*plots).steps(happened)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(automaton, "MOST_CONFIGURATIONS", most)
        patch.setattr(automaton, "MOST_TRIGGERS", most)
        patch.setattr(automaton, "MOST_QUESTIONS", most)
        patch.setattr(automaton, "MOST_REPORTS", most)
        assert [*Played(*plots).steps(happened)] == plain

"""Changes of a run's state add up to the whole state at every macrostep."""

from __future__ import annotations

import json
from types import SimpleNamespace

import pytest
from dsc_charts import PROPERTY
from hypothesis import given, settings
from hypothesis import strategies as st
from random_charts import Played, happenings, libraries

from dsc.engine.machine_forms import read_state
from dsc.engine.machine_state import MachineState
from dsc.engine.steps import Cancel, Revoke, SendLater, SetParameter, Start, StartTimer
from dsc.events import Event
from dsc.messages import ParameterMessage, SkillMessage, TimerMessage
from dsc.outcomes import Outcome
from dsc.runs.encoding import frame_form
from dsc.runs.hashed_forms import Shortener
from dsc.runs.state import RunState
from dsc.runs.tables import RunSnapshot, SnapshotRow, latest_snapshot

EVERY_KIND = st.one_of(libraries(depth=2), libraries(scxml=True, depth=2))


@settings(PROPERTY, max_examples=40)
@given(EVERY_KIND, happenings(), st.integers(min_value=2, max_value=5))
def test_the_changes_are_enough_to_have_all_frames(plots, happened, whole_every):
    played, changes = Played(*plots), []
    forms: dict[str, str] = {}
    kept = RunState(Shortener(forms.__setitem__))
    for number, _ in enumerate(played.steps(happened)):
        state = played.machine.state
        kept.update(reactor_of(played.machine))
        changes.append(kept.change(whole=number % whole_every == 0))
        found = latest_snapshot(reversed(changes))
        assert (
            found.frames.keys() == {frame.serial for frame in state.root.frames()} if state.root else not found.frames
        )
        root = None
        if state.root is not None:
            root = frame_form(found.reactor["root"], found.frames, lambda digest: json.loads(forms[digest]))
        form = {"root": root, "serials": state.serials, "finished": found.reactor["finished"]}
        assert read_state(form, played.library) == state


def reactor_of(machine):
    return SimpleNamespace(
        machine=machine,
        emitted=(),
        in_vain=set(),
        problem=None,
        programming_error=None,
        outputs={},
        settings={},
        plots={},
        caused_by={},
    )


WORK = Start("r-2", 2, "robot", "work", {})
LATER = SendLater(Event("go"), 5.0, id="x")
TIMEOUT = StartTimer(2, 0, 9.0)
NOBODY = SimpleNamespace(caused_by={})


@pytest.mark.parametrize(
    "happens",
    [
        lambda state: state.take(SkillMessage(WORK, Outcome("did"), final=True)),
        lambda state: state.take(SkillMessage(WORK, Outcome("progress"), final=False)),
        lambda state: state.take(TimerMessage(TIMEOUT)),
        lambda state: state.take(LATER),
        lambda state: state.ask([Cancel(2)], 2, 1.0, NOBODY),
        lambda state: (state.ask([Cancel(2)], 2, 1.0, NOBODY), state.dispatched(())),
        lambda state: state.ask([Revoke(LATER.event.frame, "x")], 2, 1.0, NOBODY),  # type: ignore[arg-type]
        lambda state: (state.dispatched(()), state.ask([SetParameter("robot", "speed", 2)], 2, 1.0, NOBODY)),
        lambda state: state.ask([StartTimer(3, 0, 1.0), Cancel(3)], 2, 1.0, NOBODY),
    ],
    ids=["answer", "report", "timer", "event sent later", "cancelled", "left", "revoked", "overtaken", "come and gone"],
)
def test_pending_items_by_changes_equal_those_of_the_whole_state(happens):
    state, found = RunState(Shortener(lambda *_: None)), RunSnapshot()
    state.ask([WORK, TIMEOUT, LATER, SetParameter("robot", "speed", 1)], 1, 0.0, NOBODY)
    found.apply(json.loads(state.change()))
    happens(state)
    change = state.change()
    found.apply(json.loads(change))
    assert found.pending == latest_snapshot([state.change(whole=True)]).pending


def test_another_kind_of_number_is_another_setting():
    """1 and 1.0 are equal, and not the same; nor are 1 and true."""
    machine, found = SimpleNamespace(state=MachineState()), RunSnapshot()
    state, reactor = RunState(Shortener(lambda *_: None)), reactor_of(machine)
    for value in (1, 1.0, True):
        reactor.settings["p", "n"] = ParameterMessage("p", "n", value, of_plot=True)
        state.update(reactor)
        found.apply(json.loads(state.change() or "{}"))
        assert repr(found.reactor["settings"][0]["value"]) == repr(value)


def pending(state):
    return {int(place): row for place, row in json.loads(state.change(whole=True))["pending"].items()}


def test_of_events_that_are_sent_alike_one_is_awaited_no_longer_when_one_comes():
    state = RunState(Shortener(lambda *_: None))
    state.ask([LATER, LATER, LATER], 1, 0.0, NOBODY)
    assert list(pending(state)) == [1, 2, 3]
    state.take(LATER)
    assert list(pending(state)) == [2, 3]
    state.ask([Revoke(LATER.event.frame, "x")], 2, 1.0, NOBODY)  # type: ignore[arg-type]
    assert pending(state) == {}


def test_a_parameter_is_in_force_when_it_was_taken_and_forgotten_when_it_was_refused():
    state = RunState(Shortener(lambda *_: None))
    first, second = (SetParameter("robot", "speed", speed) for speed in (1, 2))
    state.ask([first], 1, 0.0, NOBODY)
    assert [SnapshotRow(*row).reports for row in pending(state).values()] == [0]
    state.dispatched([first])
    assert [SnapshotRow(*row).reports for row in pending(state).values()] == [0]
    state.dispatched(())
    assert [SnapshotRow(*row).reports for row in pending(state).values()] == [1]
    state.ask([second], 2, 1.0, NOBODY)
    state.dispatched((), refused=[second])
    assert list(pending(state)) == [1]
    state.ask([second], 3, 2.0, NOBODY)
    state.dispatched(())
    assert list(pending(state)) == [3]

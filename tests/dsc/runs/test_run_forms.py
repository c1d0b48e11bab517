"""Messages and what is awaited, as plain data and back, with plots put away under their hashes."""

from __future__ import annotations

import hashlib
import json

import pytest

from dsc.engine.steps import SendLater, SendMessage, SetParameter, Start, StartTimer, SwitchMode
from dsc.events import Event
from dsc.messages import (
    KnowledgeMessage,
    LateMessage,
    ParameterMessage,
    PlotsMessage,
    SkillMessage,
    TimerMessage,
    WireMessage,
)
from dsc.model.plot import ActionPlot
from dsc.outcomes import Outcome
from dsc.runs.encoding import (
    awaited_form,
    awaited_of,
    events_form,
    events_of,
    message_form,
    message_of,
)
from dsc.runs.hashed_forms import Shortener, full
from knowledge_base.facts import Delta, fact

PLOT = {"plot": "made", "states": {}}
HASH = hashlib.sha256(json.dumps(PLOT).encode()).hexdigest()
WITH_PLOT = {"plan": PLOT, "items": 2, "place": {"plot": "of land"}}
TOLD = Delta(added=(fact("on", "cup", "table"),))
START = Start("r-2", 2, "robot", "work", WITH_PLOT)


@pytest.fixture
def forms():
    return {}


@pytest.fixture
def short(forms):
    return Shortener(forms.__setitem__)


def written(form):
    return json.loads(json.dumps(form))


def test_a_plot_among_values_is_put_away_once_and_found_again(forms, short):
    form = short(WITH_PLOT)
    assert short(WITH_PLOT) == form
    assert forms == {HASH: json.dumps(PLOT)}
    assert form["items"] == 2
    assert form["place"] == {"plot": "of land"}
    assert HASH in json.dumps(form["plan"])
    assert full(written(form), lambda digest: json.loads(forms[digest])) == WITH_PLOT


@pytest.mark.parametrize(
    "message",
    [
        Event("go"),
        Event("go", WITH_PLOT, to=3, exact=True, number=1, frame=2),
        KnowledgeMessage(TOLD, "eve"),
        PlotsMessage({"made": ActionPlot.model_validate({"plot": "made", "states": {"s": {}}}), "gone": None}, "keep"),
        PlotsMessage({}, "keep", {"arm": {"skills": {"move": {}}}}),
        WireMessage("robot.source", None),
        ParameterMessage("robot", "speed", 2.5, of_plot=False),
        SkillMessage(START, Outcome("did", WITH_PLOT, TOLD), final=True),
        SkillMessage(START, Outcome("progress"), final=False, conflated=4),
        SkillMessage(START, Outcome("low"), final=False, activated=True),
        TimerMessage(StartTimer(2, 1, 9.0)),
        LateMessage(Event("go", WITH_PLOT), 7),
        LateMessage(KnowledgeMessage(TOLD, "eve"), 8),
        SendLater(Event("go", WITH_PLOT, frame=2), 5.0, id="x"),
    ],
    ids=lambda message: type(message).__name__,
)
def test_a_message_comes_back(message, forms, short):
    form = written(message_form(message, short))
    assert json.dumps(PLOT) not in json.dumps(form)
    assert message_of(form, {"r-2": START}.__getitem__, lambda digest: json.loads(forms[digest])) == message


@pytest.mark.parametrize(
    "what",
    [
        START,
        SendLater(Event("go", WITH_PLOT, frame=2), 5.0, id="x"),
        SetParameter("robot", "plan", PLOT),
        StartTimer(2, 1, 9.0),
        SwitchMode("robot", "neutral"),
        SendMessage("robot", "port", WITH_PLOT),
        LateMessage(Event("go", WITH_PLOT), 7),
    ],
    ids=lambda what: type(what).__name__,
)
def test_an_awaited_item_survives_writing_and_reading(what, forms, short):
    form = written(awaited_form(what, short))
    assert json.dumps(PLOT) not in json.dumps(form)
    assert awaited_of(type(what).__name__, form, lambda digest: json.loads(forms[digest])) == what


def test_events_with_plots_come_back(forms, short):
    events = (Event("found", WITH_PLOT), Event("over"))
    form = written(events_form(events, short))
    assert events_of(form, lambda digest: json.loads(forms[digest])) == events

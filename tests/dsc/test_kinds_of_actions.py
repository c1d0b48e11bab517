"""Kinds of actions and outputs: a new one is read, written, drawn, executed, kept and documented, or a test names it."""

from __future__ import annotations

import json
import random
import re
from pathlib import Path
from typing import Any, get_args

import pytest
from random_charts import Grower

from dsc.drawing.captions import action_text
from dsc.engine import steps
from dsc.errors import NotExpressibleError
from dsc.events import Event
from dsc.messages import LateMessage
from dsc.model.actions import ExternalAction, WrittenAction
from dsc.model.language import first_key
from dsc.model.plot import ActionPlot
from dsc.runs.encoding import Awaited, awaited_form, awaited_of
from dsc.runs.hashed_forms import Shortener
from dsc.scxml.writer import to_scxml
from dsc.text.plot_files import parse_plot, plot_to_yaml

DOCS = Path(__file__).parents[2] / "docs"
FORMS = {
    "trigger": {"trigger": "arm.grasp", "with": {"item": "cup"}},
    "set": {"set": "arm.approach", "to": "side"},
    "switch": {"switch": "arm", "to": "neutral"},
    "wire": {"wire": "map.scan", "to": "rear.scan"},
    "unwire": {"unwire": "map.scan"},
    "send": {"send": "arm.say", "with": {"text": "hello"}},
    "assign": {"assign": {"tries": 1}},
    "perform": {"perform": "straight"},
    "start": {"start": "blink"},
    "stop": {"stop": "blink"},
    "tell": {"tell": "(dirty cup)"},
    "emit": {"emit": "full"},
    "withdraw": {"withdraw": "later"},
    "log": {"log": ["?tries"]},
    "if": {"if": "(> ?tries 1)", "then": [{"assign": {"tries": 2}}]},
    "block": {"block": [{"assign": {"tries": 3}}]},
}
OF_ROBOTS = {"perform", "start", "stop"}
"""Actions on motors; the charts of tests/support/cycle_charts.py have them."""
EXTERNAL = {first_key(kind) for kind in get_args(ExternalAction)}
INTERNAL = {first_key(kind) for kind in get_args(WrittenAction)}


def plot_with(key: str) -> ActionPlot:
    where = {"entry": FORMS[key]} if key in EXTERNAL else {"on": {"go": {"to": "start", "do": [FORMS[key]]}}}
    variables = {"tries": {"type": "number", "initial": 1}}
    form = {"plot": "p", "dialect": "scxml", "variables": variables, "states": {"start": where}}
    return ActionPlot.model_validate(form)


def kind_of(key: str) -> str:
    return next(
        str(kind.__name__).lower() for kind in get_args(ExternalAction | WrittenAction) if first_key(kind) == key
    )


@pytest.fixture(params=sorted(EXTERNAL | INTERNAL))
def key(request):
    return request.param


def test_each_kind_of_action_has_an_example_with_its_own_key():
    assert set(FORMS) == EXTERNAL | INTERNAL
    assert len(FORMS) == len(get_args(ExternalAction | WrittenAction))


def test_a_written_action_is_read_back(key):
    plot = plot_with(key)
    assert parse_plot(plot_to_yaml(plot)) == plot


def test_each_action_has_a_caption_in_pictures(key):
    start = plot_with(key).states["start"]
    (action,) = start.entry if key in EXTERNAL else start.on["go"][0].do
    assert action_text(action)


def test_each_action_is_exported_as_scxml_or_refused(key):
    if key in {*EXTERNAL, "tell", "block", *OF_ROBOTS}:
        with pytest.raises(NotExpressibleError, match=kind_of(key)):
            to_scxml(plot_with(key))
    else:
        assert "<transition" in to_scxml(plot_with(key))


def test_each_action_is_described(key):
    assert re.search(rf"`{key}`", (DOCS / "plots.md").read_text("utf-8"))


def keys_in(form: Any) -> set[str]:
    parts = [*form.values()] if isinstance(form, dict) else form if isinstance(form, list) else []
    return {*(form if isinstance(form, dict) else ()), *(key for part in parts for key in keys_in(part))}


def test_random_charts_contain_each_internal_action_that_changes_the_chart():
    picks = [random.Random(seed).choice for seed in range(30)]  # noqa: S311
    plots = [plot for n, pick in enumerate(picks) for plot in Grower(pick, scxml=n % 2 == 0).library()]
    written = keys_in([plot if isinstance(plot, dict) else plot.to_form() for plot in plots])
    assert written & set(FORMS) >= INTERNAL - {"log", "withdraw", *OF_ROBOTS}


def test_each_output_that_a_restart_needs_is_read_back():
    event = Event("e", {"n": 1}, frame=2)
    examples: list[Awaited] = [
        steps.Start("1.1", 1, "arm", "grasp", {"item": "cup"}, {"done": "held"}, 3.0),
        steps.StartTimer(1, 0, 2.0, "e"),
        steps.SendLater(event, 2.0, "later"),
        LateMessage(event, 3),
        steps.SetParameter("arm", "approach", "side", 1),
        steps.SwitchMode("arm", "neutral", 1),
        steps.SendMessage("arm", "say", {"text": "hello"}, 1),
        steps.SetWire("map", "scan", "rear.scan", 1),
    ]
    assert [type(one) for one in examples] == list(get_args(Awaited))
    for one in examples:
        form = json.loads(json.dumps(awaited_form(one, Shortener(lambda *_: None))))
        assert awaited_of(type(one).__name__, form, lambda _: None) == one

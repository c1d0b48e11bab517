"""The JSON Schema of plot files says what the reader says."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from dsc_charts import EVERYTHING
from jsonschema import Draft202012Validator

from dsc.text.plot_files import json_schema, plot_to_yaml
from dsc.text.yaml import load_document

ROOT = Path(__file__).parents[3]
SHIPPED = sorted(file for room in ("domains", "planning") for file in (ROOT / room).glob("**/plots/*.yaml"))
SCHEMA = Draft202012Validator(json_schema())


def complaints(data):
    return [error.message for error in SCHEMA.iter_errors(data)]


def test_the_schema_is_one():
    Draft202012Validator.check_schema(json_schema())
    assert json.loads(json.dumps(json_schema())) == json_schema()
    assert set(json_schema()["required"]) == {"plot", "states"}


@pytest.mark.parametrize("file", SHIPPED, ids=lambda file: file.stem)
def test_shipped_plots_fit(file):
    assert complaints(load_document(file.read_text()).data) == []


def test_both_spellings_of_every_kind_fit():
    assert complaints(EVERYTHING.to_form()) == []
    assert complaints(load_document(plot_to_yaml(EVERYTHING)).data) == []


@pytest.mark.parametrize(
    "state",
    [
        "{colour: red}",
        "{on: {e: 3}}",
        "{on: {e: {too: b}}}",
        "{every: {to: b}}",
        "{entry: {switch: arm}}",
        "{choice: b, on: {e: b}}",
        "{choice: {when: 3}}",
        "{select: ?x, cases: {a: b}}",
        "{select: ?x, cases: {}, else: b}",
        "{select: ?x, cases: [b], else: b}",
        "{final: false}",
    ],
)
def test_an_invalid_state_does_not_fit_the_schema(state):
    data = load_document(f"plot: p\nstates:\n  a: {state}\n  b: {{final: true}}\n").data
    assert complaints(data) != []

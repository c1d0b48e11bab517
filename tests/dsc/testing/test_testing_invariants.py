"""Invariants hold of what is right, and each says what is wrong."""

from __future__ import annotations

import sqlite3
from contextlib import closing

import pytest
from dsc_crashes import Run, forged

from dsc.testing import (
    claims_nothing_false,
    comes_to_an_end,
    executed_once,
    kept_run,
    knows,
    one_history,
    replays,
    violations,
)
from knowledge_base import InputError, StoreError, fact

CHART = """
    plot: chart
    states:
      a: {entry: [{trigger: robot.work}], on: {did: {to: b, tell: (q)}}}
      b: {entry: [{trigger: robot.work}], on: {did: over}}
      over: {final: true}
"""


@pytest.fixture
def run(tmp_path):
    return Run(tmp_path, [CHART])


def changed(store, *statements):
    with closing(sqlite3.connect(store)) as connection, connection:
        for statement in statements:
            connection.execute(statement)


def test_all_hold_of_a_run_that_went_well(run):
    facts = [fact("p"), fact("q")]
    invariants = [
        comes_to_an_end(4), executed_once(list(run.robot.done)), knows(facts, ["p", "q"]), one_history, replays(),
        claims_nothing_false(lambda _: True, reached=True), claims_nothing_false(lambda _: False, reached=False),
    ]  # fmt: skip
    assert violations(run.path, invariants) == []


def test_a_run_is_looked_at_as_it_is(run):
    with kept_run(run.path) as kept:
        assert kept.ended == {"finished": True, "problem": None, "programming_error": None, "outputs": {}}
        assert [step.configuration for step in kept.steps] == [("a",), ("b",), ()]
        assert kept.started == list(run.robot.done)
        assert [record.type for record in kept.records][-1] == "end"


@pytest.mark.parametrize(
    ("invariant", "wrong"),
    [
        (comes_to_an_end(3), "the run has lasted 4 s, more than 3 s"),
        (executed_once(["a1.0", "a1.0"]), "executed 2 times"),
        (executed_once(["x"]), "the action x was executed, and nothing is kept of its start"),
        (knows([fact("q")], ["p", "q"]), "it is known that (p), which is not so"),
        (knows([fact("p"), fact("q"), fact("told")], ["p", "q", "told"]), "it is not known that (told), which is so"),
        (
            claims_nothing_false(lambda run: bool(run.ended and run.ended["finished"]), reached=False),
            "the goal is claimed, and not reached",
        ),
    ],
)
def test_a_violated_invariant_has_its_reason(run, invariant, wrong):
    assert any(wrong in one for one in violations(run.path, [invariant]))


@pytest.mark.parametrize("executed", [{"a1.0": "cup1"}, {"a1.0": "cup1"}.keys(), {"a1.0"}])
def test_executed_once_refuses_a_collection_that_cannot_hold_an_id_twice(executed):
    with pytest.raises(InputError, match="has an id once"):
        executed_once(executed)


def test_a_run_that_has_not_ended_is_told_from_one_that_has(run):
    forged(run.path, "UPDATE runs SET ended = NULL")
    assert violations(run.path, [comes_to_an_end(100)]) == ["the run has not come to its end at second 4"]


def test_macrosteps_that_somebody_else_has_written_are_seen(run):
    changed(
        run.path,
        "CREATE TEMP TABLE again AS SELECT * FROM steps WHERE number = 2",
        "UPDATE again SET place = NULL",
        "INSERT INTO steps SELECT * FROM again",
    )
    (wrong,) = violations(run.path, [one_history])
    assert "the run of macrosteps after place 3 of the table 'steps' is missing" in wrong


def test_an_action_that_was_given_out_twice_is_seen(run):
    forged(run.path, "UPDATE steps SET records = records || records WHERE number = 2")
    assert any("given out 2 times" in one for one in violations(run.path, [executed_once([])]))


def test_a_history_that_leads_elsewhere_is_seen(run):
    forged(run.path, """UPDATE steps SET configuration = '["over"]' WHERE number = 2""")
    (wrong,) = violations(run.path, [replays()])
    assert wrong.startswith("its replay: step 2:")


def test_a_store_without_a_run_is_an_error(tmp_path):
    with pytest.raises(StoreError):
        violations(tmp_path / "none.kb", [one_history])

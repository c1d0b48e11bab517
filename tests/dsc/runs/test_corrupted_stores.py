"""Damaged stores are refused, or answer as they did at an earlier moment; the full number: `make corrupt-stores`."""

from __future__ import annotations

import sqlite3
from contextlib import closing

import pytest
from dsc_charts import plot
from dsc_crashes import Crashes, Run, copied
from dsc_kept_charts import CHARTS
from stores_soak import Judge, originals
from typer.testing import CliRunner

from dsc.cli.runs import app
from dsc.dynamic.library import Library
from dsc.runs.archive import archive, records_of
from dsc.runs.store import RunStore
from dsc.sequencer.replay import replay
from knowledge_base.errors import DamagedStoreError
from knowledge_base.store import KnowledgeBase

CHART = CHARTS["variables, tells and guards"]
CORRUPTIONS = 40


def test_no_reader_of_a_damaged_store_answers_what_never_was(tmp_path):
    judge = Judge(originals(tmp_path), tmp_path)
    for seed in range(CORRUPTIONS):
        judge.damage(seed)
    assert judge.wrong == []
    assert len(judge.verdicts) > 1


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("finished")
    for _ in range(2):
        Run(folder, [CHART])
    return folder


def edited(folder, to, statement):
    path = copied(folder, to) / "run.kb"
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.execute(statement)
    return path


@pytest.mark.parametrize(
    ("statement", "named"),
    [
        ("DELETE FROM steps WHERE run = 2 AND number >= 4", "run 2 has ended, and its last macrostep is missing"),
        ("DELETE FROM steps WHERE run = 2 AND number = 3", "macrostep 3 of run 2 is missing"),
        ("DELETE FROM runs WHERE run = 2", "the run of macrosteps after place 5"),
        ("UPDATE runs SET ended = NULL, steps = NULL, seal = NULL WHERE run = 2", "the table 'steps' does not end"),
        ("UPDATE runs SET header = '[' WHERE run = 2", "run 2 is not what was written"),
        ("UPDATE runs SET ended = '{\"finished\":false}' WHERE run = 2", "the end of run 2 is not what was written"),
        ("UPDATE steps SET records = '{' WHERE run = 2 AND number = 3", "macrostep 3 of run 2 is not what was written"),
        (
            "UPDATE steps SET message = x'ff' WHERE run = 2 AND number = 3",
            "macrostep 3 of run 2 is not what was written",
        ),
        ("UPDATE steps SET time = 1 WHERE run = 2 AND number = 1", "macrostep 1 of run 2 is not what was written"),
        ("UPDATE forms SET form = form || ' '", "is missing, or not what was written"),
        ("UPDATE changes SET digest = x'00' WHERE version = 1", "the change to version 1 is not what was written"),
        ("DROP TABLE forms", "the table 'forms' is missing"),
        ("DELETE FROM fence", "the table 'fence' is empty"),
    ],
)
def test_a_damaged_run_is_refused_with_its_place(finished, tmp_path, statement, named):
    path = edited(finished, tmp_path / "copy", statement)
    with pytest.raises(DamagedStoreError, match=named) as caught:
        replay(path)
    assert "run.kb: the store is damaged" in str(caught.value)
    assert "\n" not in str(caught.value)
    with pytest.raises(DamagedStoreError):
        CliRunner().invoke(app, ["check", str(path)], catch_exceptions=False)


def test_a_run_whose_end_is_missing_is_not_replayed(finished, tmp_path):
    path = edited(finished, tmp_path / "copy", "DELETE FROM steps WHERE place = (SELECT max(place) FROM steps)")
    for look in (replay, records_of):
        with pytest.raises(DamagedStoreError, match="run 2 has ended, and its last macrostep is missing"):
            look(path)


def test_a_whole_store_is_checked(finished):
    done = CliRunner().invoke(app, ["check", str(finished / "run.kb")])
    assert (
        done.output == "run 1: 5 steps as they were written, finished\nrun 2: 5 steps as they were written, finished\n"
    )


def test_an_interrupted_run_with_a_damaged_macrostep_is_not_resumed(tmp_path):
    crashes = Crashes(tmp_path, CHART)
    path = edited(crashes.copies[-1][2], tmp_path / "damaged", "UPDATE steps SET change = '' WHERE number = 1")
    with KnowledgeBase.open(None, path) as kb, pytest.raises(DamagedStoreError, match="macrostep 1 of run 1"):
        RunStore(kb, path).load_unfinished(Library([plot(CHART)]))


def test_the_chain_goes_on_over_restarts_and_what_is_added_to_a_macrostep(tmp_path):
    for _, run in Crashes(tmp_path, CHARTS["reports on the way"]).resumed():
        with archive(run.path) as runs:
            assert [one.ended and one.ended["finished"] for one in runs.require_all()] == [True]


def test_runs_do_not_go_with_the_knowledge_of_another_store(finished, tmp_path):
    other = tmp_path / "other"
    other.mkdir()
    for _ in range(2):
        Run(other, [CHART])
    path = copied(finished, tmp_path / "copy") / "run.kb"
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.execute("ATTACH ? AS other", (str(other / "run.kb"),))
        for table in ("changes", "snapshots", "schemas", "ends"):
            connection.execute(f"DELETE FROM {table}")  # noqa: S608
            connection.execute(f"INSERT INTO {table} SELECT * FROM other.{table}")  # noqa: S608
    with pytest.raises(DamagedStoreError):
        replay(path)

"""The relations of a run from its records: on the page, and in `dsc kb` on a store (S1.13, S1.17)."""

from __future__ import annotations

import asyncio
import json

import pytest
from typer.testing import CliRunner

from domains.clean_up_table.bringup import deploy
from dsc import run_simulated
from dsc.model.relations import CONFIGURATION
from dsc.trace import Record
from dsc.viewer.queries import PageQueries
from dsc.viewer.recorded_run import TYPES, RecordedRun
from dsc.viewer.records import RecordLog
from knowledge_base.errors import InputError
from planning.cli.command import app


def test_records_describe_the_states_and_plots_of_each_macrostep():
    recorded, events, different, compared = RecordedRun(), [], [], 0  # a listener must not raise
    with deploy(faults=0.3, seed=3) as robot:
        asked = {
            name: f"({name} {' '.join(f'?{word}' for word in CONFIGURATION[name].split())})" for name in CONFIGURATION
        }

        def compare(record: Record) -> None:
            nonlocal compared
            if record.type in TYPES:
                recorded.take({"type": record.type, **record.data})
            if record.type == "event":  # all records of the macrostep before it were taken
                events.append(record.seq)
            if record.type == "event" and len(events) % 5 == 0:
                rows = recorded.rows()
                for name, query in asked.items():
                    live = {tuple(one.values()) for one in robot.knowledge.query(query)}
                    shown = set(rows[name]())
                    if shown != live if name != "dsc:step" else not shown <= live:  # of plots that have run
                        different.append((record.seq, name, live ^ shown))
                compared += 1

        robot.listen(compare)
        robot.run("clean_up_table")
    assert different == []
    assert compared > 5


def test_the_page_answers_queries_of_the_run_at_a_record():
    lines: list[str] = []
    with deploy() as robot:
        robot.listen(lambda record: lines.append(record.to_line()))
        robot.run("clean_up_table")
    page = PageQueries(RecordLog(None, lines))
    answers = [page.query({"seq": seq, "expression": "(dsc:active ?state)"}) for seq in range(10, len(lines) + 1, 20)]
    assert {"state": "look_at_table/approach/drive"} in answers[0]["answers"]
    assert len({json.dumps(one["answers"]) for one in answers}) > 5
    assert page.query({"seq": len(lines), "expression": "(dsc:implements ?plot pick-up)"})["holds"]
    with pytest.raises(InputError, match="only the running program has its rows"):
        page.query({"seq": 5, "expression": "(dsc:waits ?who arm)"})


def test_dsc_kb_reads_the_last_run_of_a_store(tmp_path):
    store = tmp_path / "run.kb"

    async def stopped() -> None:
        robot.start("clean_up_table")
        await asyncio.sleep(25)
        raise KeyboardInterrupt

    with deploy(store=store) as robot, pytest.raises(KeyboardInterrupt):
        run_simulated(stopped())
    question = "(and (dsc:active ?step) (dsc:step ?step stack) (dsc:step-argument ?step item ?item))"
    answered = CliRunner().invoke(app, ["kb", "query", str(store), question, "--json"])
    assert '"step": "clear/execute/step_' in answered.stdout
    with deploy(store=tmp_path / "ended.kb") as robot:
        assert robot.run("clean_up_table").reached
    ended = CliRunner().invoke(app, ["kb", "ask", str(tmp_path / "ended.kb"), "(exists (?state) (dsc:active ?state))"])
    assert ended.stdout == "no\n"

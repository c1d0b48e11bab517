"""Conditions that states watch and have watched, from records (S2.19)."""

import json

from typer.testing import CliRunner

from dsc import Component, Outcome, Push, SkillCall, parse_plot, skill
from dsc.monitoring.watched import conditions_in
from dsc.trace import Record, header
from planning import Robot
from planning.cli.command import app

PLOT = """
plot: main
states:
  go:
    entry:
      - {trigger: hand.go}
      - {trigger: hand.watch_values, with: {condition: '"(< way.left 3)"'}, as: {became_true: near, became_false: far}}
      - {trigger: conditions.watch_truth, with: {condition: '"(and (wanted) (< hand.way.left 4))"'}}
    on: {near: {}, far: {}, became_true: {}, became_false: {}, gone: rest}
  rest:
    entry: {trigger: hand.watch_values, with: {condition: '"(> way.left (/ 1 0))"'}}
    on: {programming_error: end, became_true: end, became_false: end}
  end: {final: true}
"""


class Gone(Outcome): ...


class Hand(Component):
    name = "hand"
    way = Push({"left": "number"})

    @skill
    async def go(self, call: SkillCall) -> Gone:
        for left in (5, 4, 3, 2):
            self.way.put(left=left)
            await call.clock.sleep(1)
        return Gone()


def record() -> list[Record]:
    records: list[Record] = []
    domain = "(define (domain d) (:predicates (wanted)))"
    with Robot(domain, [parse_plot(PLOT)], [Hand()], clock="simulated") as robot:
        robot.listen(records.append)
        robot.run("main")
    return records


def test_the_conditions_of_a_run():
    whole, term, failed = conditions_in(record())
    assert (whole.text, whole.truth, whole.since, whole.last, whole.ended) == ("(< way.left 3)", True, 0, 3, 4)
    assert (whole.reports, whole.values) == (2, {"way.left": 2})
    assert (term.truth, term.reports, term.ended) == (False, 1, 4)
    assert term.parts == {"(wanted)": False, "(< hand.way.left 4)": None}
    assert (failed.truth, failed.reports, failed.ended) == (None, 0, 4)


def test_conditions_that_are_still_watched():
    records = [one for one in record() if one.t < 3.5]
    assert [(one.truth, one.ended) for one in conditions_in(records)] == [(True, None), (False, None)]


def test_the_command_prints_a_trace(tmp_path):
    file = tmp_path / "run.jsonl"
    file.write_text("\n".join([header(), *(one.to_line() for one in record())]) + "\n")
    result = CliRunner().invoke(app, ["runs", "conditions", str(file)])
    assert result.exit_code == 0, result.output
    assert "true    (< way.left 3)\n" in result.output
    assert (
        "false   (and (wanted) (< hand.way.left 4))\n  false   (wanted)\n  unknown (< hand.way.left 4)\n"
        in result.output
    )
    assert "hand.watch_values since 0.0 s until 4.0 s; 2 reports, the last at 3.0 s" in result.output
    lines = CliRunner().invoke(app, ["runs", "conditions", str(file), "--json"]).output.splitlines()
    assert [json.loads(line)["truth"] for line in lines] == [True, False, None]


def test_a_run_without_conditions(tmp_path):
    file = tmp_path / "run.jsonl"
    file.write_text(header() + "\n" + record()[0].to_line() + "\n")
    assert "no state has watched a condition" in CliRunner().invoke(app, ["runs", "conditions", str(file)]).output

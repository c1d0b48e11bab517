"""A failed evaluation of a run is told with its state, file and line."""

from __future__ import annotations

import pytest

from dsc import Library, LoopClock, Sequencer, load_plot, parse_plot, run_simulated
from knowledge_base import KnowledgeBase, Schema

PLOT = """
plot: wrong
receives: {go: }
variables: {x: {type: number}}
states:
  a: {after: {seconds: 1, to: b}}
  b:
    PART
  c: {final: true}
"""
SCHEMA = Schema.parse("(define (domain d) (:predicates (p)))")
INNER = parse_plot("{plot: inner, parameters: {n: number}, states: {e: {final: true}}}")
PARTS = {
    "guard": ("always: {to: c, when: (> ?x 3)}", "guard of 'always' in b (wrong.yaml:7): "),
    "guard in a list": (
        "on:\n      go: c\n    always:\n      - {to: c, when: (p)}\n      - {to: c, when: (> ?x 3)}",
        "guard of 'always' in b (wrong.yaml:11): ",
    ),
    "delay": ("on: {go: c}\n    after: {seconds: ?x, to: c}", "b (wrong.yaml:8): "),
    "assigned value": ("on: {go: c}\n    always: {to: c, assign: {x: (+ ?x 1)}}", "b (wrong.yaml:8): "),
    "argument of a plot": ("use: inner\n    with: {n: (+ ?x 1)}\n    on: {done: c}", "b (wrong.yaml:6): "),
}


def end_of(plot):
    async def main():
        return await Sequencer(Library([plot, INNER]), KnowledgeBase(SCHEMA), (), LoopClock()).run("wrong")

    return run_simulated(main())


@pytest.mark.parametrize("part", PARTS)
def test_a_failed_evaluation_has_its_file_and_line_in_every_folder(tmp_path, part):
    text, said = PARTS[part]
    problems = []
    for folder in ("one", "other"):
        file = tmp_path / folder / "wrong.yaml"
        file.parent.mkdir()
        file.write_text(PLOT.replace("PART", text).lstrip())
        problems.append(end_of(load_plot(file)).problem)
    assert problems[0].startswith(said)
    assert problems[0] == problems[1]
    assert "<text>" not in problems[0]


@pytest.mark.parametrize(
    ("states", "said"),
    [
        ("a: {always: a}", "(round.yaml:4): a -> a"),
        ("a: {always: b}\n  b: {always: c}\n  c: {always: a}", "goes round (round.yaml:"),
        ("a: {use: again, on: {done: e}}\n  e: {final: true}", "goes round (test_places_of_failures.py:"),
    ],
)
def test_a_chart_that_goes_round_is_told_with_one_round_and_its_line(tmp_path, states, said):
    file = tmp_path / "round.yaml"
    file.write_text(f"plot: wrong\nstates:\n  s: {{after: {{seconds: 1, to: a}}}}\n  {states}\n")
    again = parse_plot("{plot: again, states: {x: {always: y}, y: {always: x}}}")

    async def main():
        return await Sequencer(Library([load_plot(file), again]), KnowledgeBase(SCHEMA), (), LoopClock()).run("wrong")

    problem = run_simulated(main()).problem
    assert said in problem
    *_, trail = problem.split(": ")
    names = trail.split(" -> ")
    assert names[0] == names[-1]
    assert len(set(names)) == len(names) - 1

"""The end of a run: `finished`, `reached`, `problem` and truth never contradict each other."""

from __future__ import annotations

import pytest

from dsc import Component, Library, Outcome, RunEnd, Sequencer, SkillCall, parse_plot, skill
from dsc.events import Event
from dsc.sequencer.clock import LoopClock, run_simulated
from knowledge_base import KnowledgeBase, Schema


class Ok(Outcome): ...


class Wheel(Component):
    """A wheel whose mode cannot be reached."""

    name = "wheel"
    modes = ("drive",)

    @skill
    async def turn(self, call: SkillCall) -> Ok:
        return Ok()

    async def switch(self, mode: str) -> None:
        raise OSError("no power")


INNER = "{plot: inner, emits: {stuck: {}}, states: {a: {entry: {trigger: wheel.turn}, on: {ok: {to: e, emit: stuck}}}, e: {final: true}}}"
PLOTS = {
    "reached": "{plot: p, states: {a: {entry: {trigger: wheel.turn}, on: {ok: e}}, e: {final: true}}}",
    "an outcome that no state handles": "{plot: p, states: {a: {use: inner, on: {done: e}}, e: {final: true}}}",
    "a mode that fails": "{plot: p, states: {a: {entry: {switch: wheel, to: drive}, after: {seconds: 5, to: e}}, e: {final: true}}}",
    "a deadlock": "{plot: p, states: {a: {on: {go: e}}, e: {final: true}}}",
    "a failure": "{plot: p, emits: {stuck: {}}, states: {a: {entry: {trigger: wheel.turn}, on: {ok: {to: e, emit: stuck}}}, e: {final: true}}}",
    "no plan": "{plot: p, emits: {no_plan: {reason: text}}, states: {a: {entry: {trigger: wheel.turn}, on: {ok: {to: e, emit: no_plan, with: {reason: none}}}}, e: {final: true}}}",
}


def end_of(text: str) -> RunEnd:
    """Run the plot with `stuck` as a failure."""

    async def main() -> RunEnd:
        library = Library([parse_plot(text), parse_plot(INNER)])
        knowledge = KnowledgeBase(Schema())
        return await Sequencer(library, knowledge, [Wheel()], LoopClock(), failures={"stuck"}).run("p")

    return run_simulated(main())


@pytest.mark.parametrize("case", PLOTS)
def test_an_end_is_reached_or_names_the_reason(case: str) -> None:
    end = end_of(PLOTS[case])
    assert bool(end) == end.reached == (case == "reached")
    assert end.finished or end.problem
    assert not (end.finished and end.problem)
    if not end:
        assert end.reason != "the plot reached its end"


def test_the_failure_of_an_end_is_its_last_outcome() -> None:
    end = end_of(PLOTS["a failure"])
    assert (end.finished, end.failure, end.reason) == (True, "stuck", "the plot ended with 'stuck'")


def test_the_reason_of_an_outcome() -> None:
    said = Event("stuck", {"reason": "a wheel is blocked"})
    assert RunEnd(finished=True, emitted=(said,)).reason == "the plot ended with 'stuck': a wheel is blocked"
    assert RunEnd(finished=True, emitted=(Event("stuck", {"reason": ""}),)).reason == "the plot ended with 'stuck'"

"""Plots given as data, in a deployed robot: the same checks as for plots of the library, as an error of the state."""

from __future__ import annotations

from enum import Enum

import pytest
from dsc_charts import plot

from dsc.components.component import Component
from dsc.components.ports import takes
from dsc.outcomes import Outcome
from dsc.sequencer.replay import replay
from dsc.skills import skill
from planning.robot.robot import Robot

RUNS = plot("""
    plot: p
    parameters: {plan: plot}
    emits: {failed: {reason: text}}
    states:
      run: {use: ?plan, on: {done: e, error: {to: e, emit: failed, with: {reason: ?event.reason}}}}
      e: {final: true}
""")


class Speed(Enum):
    SLOW = "slow"
    FAST = "fast"


class Went(Outcome):
    far: float


class Arm(Component):
    @skill
    async def go(self, call, to: float = 1.0, speed: Speed = Speed.SLOW, tool: object = frozenset()) -> Went:
        return Went(far=to)

    @takes
    async def say(self, text: str) -> None: ...


def given(states):
    return plot(f"plot: made\nstates: {{s: {states}, e: {{final: true}}}}").to_form()


@pytest.mark.parametrize(
    ("states", "said"),
    [
        ("{entry: {trigger: amr.go}, on: {went: e}}", "did you mean 'arm.go'"),
        ("{entry: {trigger: arm.og}, on: {went: e}}", "did you mean 'arm.go'"),
        ("{entry: {trigger: arm.go, with: {too: 1}}, on: {went: e}}", "did you mean"),
        ("{entry: {trigger: arm.go, with: {to: far}}, on: {went: e}}", "'to' is of type number"),
        ("{entry: {trigger: arm.go, with: {speed: medium}}, on: {went: e}}", "'speed' is one of slow, fast"),
        ("{entry: {trigger: arm.go}, on: {done: e}}", "outcome 'went'"),
        ("{entry: {trigger: arm.go}, on: {went: {to: e, when: (= ?event.fra 1)}}}", "fra"),
        ("{entry: {trigger: arm.go}, on: {went: e}}", None),
    ],
)
def test_a_mistake_about_a_skill_is_an_error_of_the_state_and_repeats(tmp_path, states, said):
    store = tmp_path / "run.kb"
    robot = Robot("(define (domain d))", [RUNS], [Arm()], clock="simulated", store=store)
    end = robot.run("p", {"plan": given(states)})
    assert end.finished, end.problem
    assert [one.attributes["reason"] for one in end.emitted if said not in one.attributes["reason"]] == []
    assert len(end.emitted) == (said is not None)
    assert replay(store).divergence is None
    robot.prune(1)
    assert replay(store).divergence is None


@pytest.mark.parametrize("command", ["{send: amr.say}", "{switch: amr, to: open}", "{set: amr.speed, to: 1}"])
def test_a_command_to_a_missing_component_fails_at_once(command):
    robot = Robot("(define (domain d))", [RUNS], [Arm()], clock="simulated")
    made = f"{{entry: [{command}, {{trigger: arm.go}}], on: {{went: e, skill_error: e}}}}"
    end = robot.run("p", {"plan": given(made)})
    assert end.finished, end.problem


NAMED = """
    plot: p
    parameters: {which: {type: plot, default: walk}, far: {type: number, default: 2}}
    outputs: {went: {type: number, initial: 0}}
    emits: {failed: {reason: text}}
    states:
      run: {use: ?which, with: {far: ?far}, on: {done: {to: e, assign: {went: ?event.went}}, error: {to: e, emit: failed, with: {reason: ?event.reason}}}}
      e: {final: true}
"""
WALK = """
    plot: walk
    parameters: {far: number}
    outputs: {went: {type: number, initial: 0}}
    states: {s: {entry: {trigger: arm.go, with: {to: ?far}}, on: {went: {to: e, assign: {went: ?event.far}}}}, e: {final: true}}
"""
RUN = WALK.replace("plot: walk", "plot: run").replace("with: {to: ?far}", "with: {to: (* 2 ?far)}")
LOSES = "{plot: loses, parameters: {far: number}, emits: {lost: {}}, states: {s: {always: e}, e: {final: true, emit: lost}}}"


@pytest.mark.parametrize(
    ("which", "went", "said"),
    [
        ("walk", 2, None),
        ("run", 4, None),
        (None, 2, None),
        ("wolk", 0, "did you mean 'walk'"),
        ("loses", 0, "does not handle 'lost'"),
        ("stays", 0, "has no parameter 'far'"),
    ],
)
def test_the_value_may_be_the_name_of_a_plot_which_the_state_becomes_when_it_is_entered(tmp_path, which, went, said):
    store = tmp_path / "run.kb"
    plots = [plot(text) for text in (NAMED, WALK, RUN, LOSES, "{plot: stays, states: {e: {final: true}}}")]
    with Robot("(define (domain d))", plots, [Arm()], clock="simulated", store=store) as robot:
        end = robot.run("p", {} if which is None else {"which": which})
    assert end.finished, end.problem
    assert end.outputs == {"went": went}
    assert [said in one.attributes["reason"] for one in end.emitted] == [True] * (said is not None)
    assert replay(store).divergence is None

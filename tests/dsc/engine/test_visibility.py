"""Visibility of events: tests for the rows of the table in docs/semantics.md (S0.6)."""

from __future__ import annotations

import asyncio

import pytest
from dsc_charts import Run, plot
from dsc_runs import ran

from dsc import Component, Library, LoopClock, Outcome, Sequencer, SkillCall, event, skill, validate_plot
from dsc.drawing.drawing import draw
from dsc.events import Event
from dsc.sequencer.clock import run_simulated
from knowledge_base import KnowledgeBase, Schema


class Low(Outcome):
    level: float


class Moved(Outcome): ...


class Robot(Component):
    """A robot with a battery that can be low, and a skill."""

    name = "robot"

    @event
    def low(self, level: float, below: float = 20) -> Low | None:
        return Low(level=level) if level < below else None

    @skill
    async def move(self, call: SkillCall, seconds: float) -> Moved:
        await call.clock.sleep(seconds)
        return Moved()


async def drain(sequencer):
    await asyncio.sleep(2)
    sequencer.dispatcher.component("robot").update("low", 10)


def seen(text, *inner):
    """Who saw an event: the value `by` of the outcome `seen`, in order."""
    robot = Robot()
    plots = [plot(text), *map(plot, inner)]
    findings = [
        str(one) for each in plots for one in validate_plot(each, Library(plots), Schema(), robot.skills().values())
    ]

    async def main():
        sequencer = Sequencer(Library(plots), KnowledgeBase(Schema()), [robot], LoopClock(), open_ended=True)
        asyncio.get_running_loop().call_later(5, sequencer.post, Event("stop"))
        running = asyncio.ensure_future(drain(sequencer))
        end = await sequencer.run("p")
        await running
        return end

    end = run_simulated(main())
    assert end.finished, end
    return [one.attributes.get("by", one.name) for one in end.emitted], findings


HERE = """
    plot: p
    receives: {{stop: }}
    emits: {{seen: {{by: symbol}}}}
    states:
      top:
        on: {{stop: e, {top}}}
        states:
          outer:
            entry: {{trigger: robot.{what}}}
            on: {{{outer}}}
            states:
              in1: {{on: {{{inner}}}}}
          {other}
      e: {{final: true}}
"""
EVENT = "low, with: {below: 20}, as: {low: low_bat}"
SKILL = "move, with: {seconds: 2}, as: {moved: low_bat}"


def listens(by):
    return "low_bat: {emit: seen, with: {by: " + by + "}}"


def here(what, **who):
    who = {"top": "", "outer": "", "inner": "", "other": "", **who}
    return HERE.format(
        what=what, **{at: text and (listens(text) if at != "other" else text) for at, text in who.items()}
    )


@pytest.mark.parametrize(
    ("who", "by"),
    [
        ({"inner": "inner"}, ["inner"]),
        ({"outer": "outer"}, ["outer"]),
        ({"top": "top"}, ["top"]),
        ({"inner": "inner", "outer": "outer", "top": "top"}, ["inner"]),  # the innermost state handles it
        ({"outer": "outer", "top": "top"}, ["outer"]),
    ],
)
def test_states_inside_and_around_see_an_event_that_a_composite_activates(who, by):
    assert seen(here(EVENT, **who)) == (by, [])


def test_states_inside_do_not_see_the_end_of_the_skill_of_a_composite():
    assert seen(here(SKILL, inner="inner", outer="outer"))[0] == ["outer"]
    _, findings = seen(here(SKILL, inner="inner", outer="outer"))
    assert any("nothing here fires the event 'low_bat'" in one for one in findings)


def test_sibling_states_do_not_see_it():
    text = """
        plot: p
        receives: {stop: }
        emits: {seen: {by: symbol}}
        states:
          top:
            on: {stop: e}
            regions:
              one: {states: {a: {entry: {trigger: robot.low, with: {below: 20}}, on: {low: {emit: seen, with: {by: own}}}}}}
              two: {states: {b: {on: {low: {emit: seen, with: {by: sibling}}}}}}
          e: {final: true}
    """
    by, findings = seen(text)
    assert by == ["own"]
    assert any("nothing here fires the event 'low'" in one for one in findings)


USING = """
    plot: p
    receives: {stop: }
    emits: {seen: {by: symbol}}
    states:
      use: {use: inner, on: {ON stop: e, done: e}}
      e: {final: true}
"""
INNER = """
    plot: inner
    EMITS
    states:
      a: {entry: {trigger: robot.low, with: {below: 20}, as: {low: low_bat}}, on: {ON}, after: {seconds: 9, to: b}}
      b: {final: true}
"""


def test_states_around_the_plot_do_not_see_a_local_event():
    inner = INNER.replace("EMITS", "").replace("ON", listens("inner"))
    by, findings = seen(USING.replace("ON", listens("host") + ","), inner)
    assert by == []  # `seen` of the inner plot is local, too
    assert any("nothing here fires the event 'low_bat'" in one for one in findings)


def test_the_host_sees_an_event_that_the_plot_declares_under_emits():
    inner = INNER.replace("EMITS", "emits: {low_bat: {level: number}}").replace("ON", "")
    assert seen(USING.replace("ON", listens("host") + ","), inner) == (["host"], [])


def test_the_run_sees_an_event_that_the_outermost_plot_declares_under_emits():
    text = """
        plot: p
        receives: {stop: }
        emits: {low_bat: {level: number}}
        states:
          a: {entry: {trigger: robot.low, with: {below: 20}, as: {low: low_bat}}, on: {stop: e}}
          e: {final: true}
    """
    assert seen(text) == (["low_bat"], [])


def test_a_state_of_the_plot_handles_a_declared_event_first():
    inner = INNER.replace("EMITS", "emits: {low_bat: {level: number}}").replace("ON", "low_bat: b")
    by, _ = seen(USING.replace("ON", listens("host") + ","), inner)
    assert by == []


def test_the_attributes_of_a_declared_event_are_checked():
    inner = INNER.replace("EMITS", "emits: {low_bat: {volts: number}}").replace("ON", "")
    _, findings = seen(USING.replace("ON", listens("host") + ","), inner)
    assert [one for one in findings if "attribute 'volts' of the outcome 'low_bat' is missing" in one]
    assert [one for one in findings if "attribute 'level' of the outcome 'low_bat' is not declared" in one]


def test_all_plots_see_an_event_from_outside():
    inner = "{plot: inner, receives: {stop: }, states: {a: {on: {stop: b}}, b: {final: true}}}"
    end, at = ran("{plot: p, states: {a: {after: {seconds: 1, to: e}}, e: {final: true}}}")
    assert (end.finished, at) == (True, 1)
    by, _ = seen(USING.replace("ON", "").replace("stop: e, ", ""), inner)
    assert by == []


def test_the_picture_shows_the_new_name_of_an_event_and_whether_it_is_visible_outside():
    inner = plot(INNER.replace("EMITS", "emits: {low_bat: {level: number}}").replace("ON", ""))
    assert "robot.low(20) as ^low_bat" in draw(inner)
    assert "robot.low(20) as low_bat" in draw(plot(here(EVENT)))


EMITTING = """
    plot: inner
    EMITS
    states:
      both:
        regions:
          one: {states: {a: {after: {seconds: 1, to: a2, emit: told}}, a2: {final: true}}}
          two: {states: {b: {on: {told: b2}}, b2: {final: true}}}
        on: {done: c}
      c: {final: true}
"""


def test_all_states_of_the_plot_see_an_emitted_event_and_the_host_does_not():
    by, findings = seen(USING.replace("ON", "told: {emit: seen, with: {by: host}},"), EMITTING.replace("EMITS", ""))
    assert by == []  # the plot has ended, as its other region has seen the event
    assert any("nothing here fires the event 'told'" in one for one in findings)


def test_only_the_host_sees_an_emitted_outcome():
    by, _ = seen(
        USING.replace("ON", "told: {emit: seen, with: {by: host}},"), EMITTING.replace("EMITS", "emits: {told: }")
    )
    assert by == ["host"]  # the other region waits until the event `stop`


def test_only_the_state_itself_sees_its_timeout():
    text = """
        plot: p
        receives: {stop: }
        emits: {seen: {by: symbol}}
        states:
          outer:
            after: {seconds: 3, to: e, emit: seen, with: {by: outer}}
            on: {stop: e}
            states:
              in1: {after: {seconds: 1, to: in2, emit: seen, with: {by: inner}}}
              in2: {}
          e: {final: true}
    """
    assert seen(text) == (["inner", "outer"], [])


def test_an_outcome_with_the_name_of_a_declared_event_is_not_that_event():
    chart = Run(plot("{plot: p, emits: {moved: {}}, states: {a: {entry: {trigger: robot.move}}}}"))
    chart.start()
    step = chart.send("moved", to="a")
    assert not step.handled
    assert step.emitted == ()

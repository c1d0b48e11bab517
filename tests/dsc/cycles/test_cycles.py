"""Cycles: sensors in, motors out, timers between them, and the errors of the program that drives a robot."""

from __future__ import annotations

from math import inf, nan

import pytest
from dsc_charts import plot
from hypothesis import given
from hypothesis import strategies as st

from dsc import CycleController, Event, LoopClock, Machine, Sequencer, run_simulated
from dsc.drawing import draw
from dsc.drawing.captions import action_text
from dsc.dynamic.knowledge_situation import KnowledgeSituation
from dsc.dynamic.library import Library
from dsc.errors import PlotError, RunawayError
from dsc.text.plot_files import parse_plot
from dsc.text.profiles import parse_profile
from dsc.validation import review_plot
from knowledge_base import InputError, KnowledgeBase, Schema

FOLLOWER = """
plot: follower
robot:
  sensors: {left: number from 0 to 1023, right: {type: number from 0 to 1023, rate: 50}}
  motors: {wheel: number from -6 to 6 in rad/s, lamp: boolean, gear: {type: integer from 1 to 5, initial: 2}}
  constants: {speed: 1.5, white: 950}
  operations: {straight: {wheel: ?speed, lamp: false}}
states:
  drive:
    entry: {perform: straight}
    on: {cycle: {to: turn, when: (> ?left ?white)}}
  turn:
    entry: {assign: {wheel: (* -1 ?speed)}}
    exit: {assign: {lamp: true}}
    on:
      cycle:
        - {to: drive, when: (<= ?left ?white), do: [{perform: straight}], assign: {gear: (+ ?gear 1)}}
        - {assign: {wheel: (- ?wheel 2)}}
    after: {seconds: 0.1, to: over}
  over: {final: true}
"""


def follower():
    return CycleController(plot(FOLLOWER))


def test_sensors_in_and_motors_out():
    robot = follower()
    assert robot.motors == {"wheel": 1.5, "lamp": False, "gear": 2}
    assert robot.step({"left": 900, "right": 0}, 0.0)["wheel"] == 1.5
    assert robot.step({"left": 1000, "right": 0}, 0.02)["wheel"] == -1.5
    assert robot.step({"left": 1000, "right": 0}, 0.04) == {"wheel": -3.5, "lamp": False, "gear": 2}
    assert robot.step({"left": 0, "right": 0}, 0.06) == {"wheel": 1.5, "lamp": False, "gear": 3}
    assert robot.active == ["drive"]


def test_a_motor_beyond_its_range_has_the_bound():
    robot = follower()
    found = [robot.step({"left": 1000, "right": 0}, 0.01 * number)["wheel"] for number in range(5)]
    assert found == [-1.5, -3.5, -5.5, -6, -6]


def test_a_timer_between_cycles_and_the_end():
    robot = follower()
    robot.step({"left": 1000, "right": 0}, 1.0)
    robot.step({"left": 1000, "right": 0}, 1.09)
    assert not robot.ended
    assert robot.step({"left": 0, "right": 0}, 1.11) == {"wheel": 0, "lamp": False, "gear": 2}
    assert (robot.ended, robot.active) == (True, [])
    assert robot.step({"left": 0, "right": 0}, 1.2)["gear"] == 2


@pytest.mark.parametrize(
    ("sensors", "now", "message"),
    [
        ({"left": 2000, "right": 0}, 1, "the sensor 'left' is a number from 0 to 1023, not 2000"),
        ({"left": "x", "right": 0}, 1, "the sensor 'left' is a number"),
        ({"left": True, "right": 0}, 1, "the sensor 'left' is a number"),
        ({"lefft": 1, "right": 0}, 1, "no sensor 'lefft'; did you mean 'left'?"),
        ({"right": 0}, 1, "the sensor 'left' has no value in this cycle; it is of type number from 0 to 1023"),
        ({"left": 1}, 1, "the sensor 'right' has no value in this cycle; its last value is older than 0.02 s"),
        ({"left": 1, "right": 0}, 0.5, "does not decrease: 0.5 s follows 0.9 s"),
    ],
)
def test_wrong_values_of_sensors(sensors, now, message):
    robot = follower()
    robot.step({"left": 900, "right": 0}, 0.9)
    with pytest.raises(InputError, match=message.replace("?", r"\?")):
        robot.step(sensors, now)
    assert robot.step({"left": 1000, "right": 0}, 1)["wheel"] == -1.5


@pytest.mark.parametrize(
    ("sensors", "now", "message"),
    [
        ({"left": 1}, 1, "'right' has no value in this cycle; it has had no value before"),
        (None, 1, r"a map by name, not None: pass a map, e\.g\. {'left': ..., 'right': ...}"),
        ([("left", 1)], 1, "a map by name"),
        ({1: 2}, 1, "no sensor '1'; valid: left, right"),
        ({"left": 10**400, "right": 0}, 1, "the sensor 'left' is a number from 0 to 1023"),
        *(
            ({"left": 1, "right": 0}, now, "the time of a cycle is a number")
            for now in (nan, inf, "1", None, True, 1e10)
        ),
    ],
)
def test_wrong_arguments_of_the_first_step(sensors, now, message):
    robot = follower()
    with pytest.raises(InputError, match=message):
        robot.step(sensors, now)
    assert robot.step({"left": 1000, "right": 0}, -5)["wheel"] == -1.5


def test_a_sensor_with_a_rate_keeps_its_value_for_the_time_of_a_reading():
    robot = follower()
    robot.step({"left": 900, "right": 7}, 0.0)
    assert robot.step({"left": 1000}, 0.02)["wheel"] == -1.5
    with pytest.raises(InputError, match="'right' has no value"):
        robot.step({"left": 1000}, 0.021)


@given(st.lists(st.tuples(st.integers(0, 1023), st.integers(1, 40)), max_size=20))
def test_an_event_driven_run_sets_the_same_motors(cycles):
    """The engine alone, without timers: an event `cycle` for each step."""
    chart = plot(FOLLOWER.replace("seconds: 0.1", "seconds: 1000"))
    robot, library = CycleController(chart), Library([chart])
    machine, knowledge = Machine(library), KnowledgeBase(Schema())
    machine.start("follower", {}, KnowledgeSituation(knowledge, library))
    now = 0.0
    for left, passed in cycles:
        now += passed / 1000
        machine.send(Event("cycle", {"left": left, "right": 0}), KnowledgeSituation(knowledge, library))
        motors = robot.step({"left": left, "right": 0}, now)
        values = machine.state.root.variables
        assert motors == {"wheel": max(-6, values["wheel"]), "lamp": values["lamp"], "gear": min(5, values["gear"])}


def test_a_failed_evaluation_ends_the_cycles():
    text = """
    plot: p
    robot: {sensors: {s: number}, motors: {m: {type: number, initial: 0.5}}}
    states: {a: {on: {cycle: {assign: {m: (/ 1 ?s)}}}}}
    """
    robot = CycleController(plot(text))
    assert robot.step({"s": 4}, 0) == {"m": 0.25}
    with pytest.raises(InputError, match=r"a: .*division by zero"):
        robot.step({"s": 0}, 1)
    assert (robot.ended, robot.motors) == (True, {"m": 0.5})


@pytest.mark.parametrize("begin", [-7.0, 0.0, 1000.0, 1.7e9])
def test_timers_of_the_initial_state_from_the_first_cycle_on(begin):
    text = """
    plot: p
    robot: {sensors: {}, motors: {m: integer}}
    states:
      a: {after: {seconds: 0.5, to: b}, every: {seconds: 0.2, assign: {m: (+ ?m 1)}}}
      b: {entry: {assign: {m: 10}}, on: {cycle: {}}}
    """
    robot = CycleController(plot(text))
    found = [robot.step({}, begin + tenths / 10 + 0.01)["m"] for tenths in (0, 1, 3, 4, 6)]
    assert found == [0, 0, 1, 2, 10]


def test_a_chart_that_goes_round_ends_with_the_initial_values_of_the_motors():
    text = """
    plot: p
    robot: {sensors: {s: boolean}, motors: {m: {type: number, initial: 0.5}}}
    emits: {left: }
    states:
      a: {entry: {assign: {m: 3}}, exit: {assign: {m: 4}}, on: {cycle: {to: b, when: (= ?s true)}}, after: {seconds: 9, to: a}}
      b: {always: c}
      c: {always: b}
    """
    robot = CycleController(plot(text))
    assert robot.step({"s": False}, 0) == {"m": 3}
    with pytest.raises(RunawayError, match="goes round"):
        robot.step({"s": True}, 1)
    assert (robot.ended, robot.motors, robot.active) == (True, {"m": 0.5}, [])
    assert robot.step({"s": True}, 20) == {"m": 0.5}


def test_timers_that_are_due_again_at_once():
    text = """
    plot: p
    robot: {sensors: {}, motors: {m: {type: integer, initial: 7}}}
    states: {a: {entry: {assign: {m: 1}}, after: {seconds: 1, to: b}}, b: {after: {seconds: 0, to: c}}, c: {after: {seconds: 0, to: b}}}
    """
    robot = CycleController(plot(text))
    assert robot.step({}, 0) == {"m": 1}
    with pytest.raises(RunawayError, match="1000 timers are due at the same time"):
        robot.step({}, 1)
    assert (robot.ended, robot.motors) == (True, {"m": 7})


def test_many_timers_in_one_cycle():
    text = "{plot: p, robot: {motors: {m: integer}}, states: {a: {every: {seconds: 0.001, assign: {m: (+ ?m 1)}}}}}"
    robot = CycleController(plot(text))
    robot.step({}, 0)
    assert robot.step({}, 3) == {"m": 3000}


@pytest.mark.parametrize(
    ("term", "line"),
    [("?s", 5), ("(/ ?n 2)", 5), ("(* ?half ?n)", 5), ("(+ 0.5 ?n)", 5), ("(+ ?two ?n)", 0), ("(* 2 ?n)", 0), (3, 0)],
)
@pytest.mark.parametrize("where", ["on: {cycle: {assign: {m: @}}}", "{entry: {assign: {m: @}}, on: {cycle: {}}}"])
def test_fractions_for_an_integer_motor(term, line, where):
    text = (
        "plot: p\nrobot: {sensors: {s: number, n: integer}, motors: {m: integer, x: number},\n"
        "  constants: {half: 0.5, two: 2}, operations: {go: {x: ?s}}}\nstates:\n  a: "
    )
    made = parse_plot(text + (where if where[0] == "{" else f"{{{where}}}").replace("@", str(term)) + "\n", "p.yaml")
    found = [str(one) for one in review_plot(made, Library([made])) if one.code == "robot"]
    assert len(found) == bool(line)
    for one in found:
        assert one.startswith("p.yaml:5:")
        assert f"'m' is an integer, and {term} may be a fraction" in one


def test_a_fraction_for_an_integer_motor_in_a_cycle():
    text = (
        "{plot: p, robot: {sensors: {s: number}, motors: {m: integer}}, states: {a: {on: {cycle: {assign: {m: ?s}}}}}}"
    )
    robot = CycleController(plot(text))
    assert robot.step({"s": 2.0}, 0) == {"m": 2}
    with pytest.raises(InputError, match=r"a: 'p.m' is an integer, not 2.5: no state handles the `error`"):
        robot.step({"s": 2.5}, 1)


@pytest.mark.parametrize("value", ["hello", ".nan", ".inf", "[1]", ""])
def test_constants_that_are_no_numbers(value):
    with pytest.raises(InputError, match=r"p.yaml:3:\d+: a finite number, true or false was expected; found"):
        parse_plot(f"plot: p\nrobot:\n  constants: {{c: {value}}}\nstates: {{a: {{on: {{cycle: a}}}}}}\n", "p.yaml")


def test_emitted_outcomes_and_parameters():
    text = """
    plot: p
    parameters: {limit: number}
    robot: {sensors: {s: number}, motors: {m: number}}
    emits: {high: {s: number}}
    states: {a: {on: {cycle: {to: a, when: (> ?s ?limit), emit: high, with: {s: ?s}}}}}
    """
    robot = CycleController(plot(text), {"limit": 3})
    robot.step({"s": 2}, 0)
    robot.step({"s": 4}, 1)
    assert [(one.name, dict(one.attributes)) for one in robot.emitted] == [("high", {"s": 4})]


def test_plots_that_drive_nothing_in_cycles():
    with pytest.raises(InputError, match="'p' has no robot section"):
        CycleController(plot("{plot: p, states: {a: {after: {seconds: 1, to: a}}}}"))
    text = "{plot: p, robot: {}, states: {a: {entry: {trigger: base.drive}, on: {arrived: a}}}}"
    with pytest.raises(InputError, match="'p' uses the component 'base'"):
        CycleController(plot(text))


def test_the_time_since_the_last_event_of_a_name():
    """Harel's timeout(event, n): a region with one state, which each event enters again."""
    text = """
    plot: p
    robot: {sensors: {seen: boolean}, motors: {stop: boolean}}
    states:
      all:
        regions:
          drive: {states: {go: {on: {lost: halt}}, halt: {entry: {assign: {stop: true}}, on: {cycle: {}}}}}
          watch:
            states:
              waiting:
                on: {cycle: {to: waiting, when: (= ?seen true)}}
                after: {seconds: 1, to: waiting, emit: lost}
        on: {never: all}
    receives: {never: }
    """
    robot = CycleController(plot(text))
    found = {now: robot.step({"seen": now == 0.5}, now)["stop"] for now in (0.4, 0.5, 1.4, 1.5)}
    assert found == {0.4: False, 0.5: False, 1.4: False, 1.5: True}


def test_an_event_cycle_from_outside_in_a_run():
    """The sequencer checks the values of an event-driven cycle, and the run ends by the plot."""

    async def run():
        sequencer = Sequencer(Library([chart]), KnowledgeBase(Schema()), [], LoopClock(), open_ended=True)
        with pytest.raises(InputError, match=r"'s' .*number from 0 to 5"):
            sequencer.post(Event("cycle", {"s": 7}))
        sequencer.post(Event("cycle", {"s": 2}), after=1)
        sequencer.post(Event("cycle", {"s": 4}), after=2)
        return await sequencer.run("p")

    chart = plot("""
        plot: p
        robot: {sensors: {s: number from 0 to 5}, motors: {m: number}}
        emits: {high: {m: number}}
        states:
          a: {on: {cycle: {to: over, when: (> ?s 3), assign: {m: (* 2 ?s)}}}}
          over: {final: true, emit: high, with: {m: ?m}}
    """)
    end = run_simulated(run())
    assert [(one.name, dict(one.attributes)) for one in end.emitted] == [("high", {"m": 8})]


PAIR = """profile: pair
plots: {follower: {white: 500}}
devices:
  follower: {left: "ground sensor 0", right: left, wheel: wheel_l}
  other: {left: lidar}
"""


def adjustable(text):
    limit = "parameters: {white: {type: number, default: 950}}"
    return plot(text.replace(", white: 950", "").replace("plot: follower", f"plot: follower\n{limit}"))


def test_one_chart_for_two_robots_with_other_devices():
    robot = CycleController(adjustable(FOLLOWER), profile=parse_profile(PAIR))
    other = CycleController(adjustable(FOLLOWER), {"white": 500})
    assert robot.motors == {"wheel_l": 1.5, "lamp": False, "gear": 2}
    for number, left in enumerate((400, 600, 700, 300, 800)):
        found = robot.step({"ground sensor 0": left, "left": 7}, number / 100)
        expected = other.step({"left": left, "right": 7}, number / 100)
        assert found == {"wheel_l": expected["wheel"], "lamp": expected["lamp"], "gear": expected["gear"]}
    assert robot.step({"ground sensor 0": 0, "left": 0}, 1) == {"wheel_l": 0, "lamp": False, "gear": 2}


@pytest.mark.parametrize(
    ("sensors", "message"),
    [
        ({"right": 1, "left": 0}, "the robot has no sensor 'right'; valid: ground sensor 0, left"),
        ({"ground sensor 0": 2000, "left": 0}, "the sensor 'ground sensor 0' is a number from 0 to 1023, not 2000"),
        ({"ground sensor 0": 1}, "the sensor 'left' has no value in this cycle"),
        (None, "pass a map, e.g. {'ground sensor 0': ..., 'left': ...}"),
    ],
)
def test_errors_about_values_with_the_names_of_devices(sensors, message):
    robot = CycleController(adjustable(FOLLOWER), profile=parse_profile(PAIR))
    with pytest.raises(InputError) as error:
        robot.step(sensors, 0)
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("devices", "column", "message"),
    [
        ("{lefft: a}", 14, "plot 'follower' has no sensor or motor 'lefft'; did you mean 'left'?"),
        ("{speed: a}", 14, "plot 'follower' has no sensor or motor 'speed'; valid: gear, lamp, left, right, wheel"),
        ("{left: a, right: a}", 23, "'left' and 'right' are both the device 'a': give them separate devices"),
        ("{left: right}", 14, "'right' and 'left' are both the device 'right'"),
        ("{lamp: gear}", 14, "'gear' and 'lamp' are both the device 'gear'"),
        ('{left: ""}', 14, "at least 1 character; found ''"),
    ],
)
def test_devices_that_do_not_fit_the_robot_section(devices, column, message):
    text = f"profile: p\ndevices:\n  follower: {devices}\n"
    with pytest.raises(InputError) as error:
        CycleController(plot(FOLLOWER), profile=parse_profile(text, "p.yaml"))
    assert str(error.value).startswith(f"p.yaml:3:{column}: ")
    assert message in str(error.value)


def test_a_sensor_and_a_motor_on_one_device():
    profile = parse_profile("{profile: p, devices: {follower: {left: axle, wheel: axle}}}")
    robot = CycleController(plot(FOLLOWER), profile=profile)
    assert robot.step({"axle": 3, "right": 0}, 0)["axle"] == 1.5


BLINKER = """
plot: p
robot:
  sensors: {s: number}
  motors: {lamp: {type: boolean, initial: true}, count: number}
  activities: {blink: {start: {lamp: true, count: (+ ?count 1)}, stop: {lamp: false, count: (/ 1 ?s)}}}
states:
  a:
    entry: {start: blink}
    exit: {stop: blink}
    on:
      error: {}
      cycle:
        - {when: (= ?s 1), do: [{start: blink}]}
        - {when: (= ?s 2), do: [{stop: blink}, {stop: blink}]}
        - {when: (= ?s 3), do: [{stop: blink}, {start: blink}]}
        - {when: (and (= ?s 4) (= ?blink true)), assign: {count: 40}}
        - {when: (= ?s 0), do: [{stop: blink}]}
        - {when: (= ?s 5), to: b}
  b: {on: {cycle: {to: over, when: (= ?blink false)}}}
  over: {final: true}
"""


@pytest.mark.parametrize(
    ("sensors", "lamp", "count"),
    [
        ([1], True, 1),  # it is active since the entry
        ([2], False, 0.5),
        ([2, 2], False, 0.5),  # the second stop does nothing
        ([2, 1], True, 1.5),
        ([3], True, 1 / 3 + 1),
        ([4], True, 40),
        ([2, 4], False, 0.5),
        ([0], True, 1),  # a failed stop
        ([0, 4], True, 40),
        ([5], False, 0.2),  # by the exit
        ([5, 5], True, 0),  # the initial values after the end
    ],
)
def test_activities_by_name(sensors, lamp, count):
    robot = CycleController(plot(BLINKER))
    for number, value in enumerate(sensors):
        found = robot.step({"s": value}, number / 100)
    assert found == {"lamp": lamp, "count": pytest.approx(count)}


def test_the_captions_of_activities():
    (entry,) = plot(BLINKER).state("a").entry
    (stop, _) = plot(BLINKER).state("a").on["cycle"][1].do
    assert [action_text(entry), action_text(stop)] == ["start(blink)", "stop(blink)"]
    drawn = draw(plot(BLINKER))
    assert "activity blink start" in drawn
    assert "stop(blink)" in drawn


def test_a_variable_that_an_entry_assigns():
    text = "{plot: p, robot: {motors: {w: number}}, variables: {n: {type: number, initial: 0}}, states: {a: {entry: {assign: {n: 1}}}}}"
    with pytest.raises(PlotError, match=r"assign only motors here; move the rest to a transition, e\.g\. under `do`"):
        CycleController(parse_plot(text))

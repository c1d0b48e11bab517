"""Controllers in cycles: the interpreter, the Python and the C controller set equal motors on random sensors."""

from __future__ import annotations

import shutil
from typing import Any

import pytest
from controller_players import RUNAWAY
from controllers_soak import NOT_IN_CYCLES, compare
from cycle_charts import draw_cycles, grow_robot
from cycle_players import CCycles, as_raised, play_engine, play_python
from dsc_charts import plot

from dsc.controllers import build_controller

CC = shutil.which("cc")
CHARTS, CYCLES = 12, 150
ROUND = """
    plot: robot
    robot:
      sensors: {light: number, bumper: boolean, steps: integer}
      motors: {wheel: {type: number, initial: 0.5}, gear: integer, lamp: boolean}
    states:
      a: {entry: {assign: {wheel: 3}}, on: {cycle: {to: b, when: (= ?bumper true)}}}
      b: {always: c}
      c: {always: b}
"""
WAITING = """
    plot: robot
    robot:
      sensors: {light: number, bumper: boolean, steps: integer}
      motors: {wheel: number, gear: integer, lamp: boolean}
    states:
      a: {after: {seconds: 0.5, to: b}, every: {seconds: 0.2, assign: {gear: (+ ?gear 1)}}}
      b: {entry: {assign: {lamp: true}}, on: {cycle: {}}}
"""


def python_controller(chart):
    names: dict[str, Any] = {}
    exec(build_controller(chart, "python"), names)  # noqa: S102  what is tested
    controller = names["Controller"]()
    controller.init(names["Host"](), 0)
    return controller, names


def play(chart, cycles, folder):
    """The records of the Python and of the C controller, which are equal."""
    records = play_python(chart, cycles)
    if CC is not None:
        compare(records, CCycles(folder, [chart], CC).play([(0, cycles[: len(records)])])[0], "Python and C")
    return records


@pytest.mark.parametrize("seed", range(CHARTS))
def test_random_charts_in_cycles_by_all_players(seed, tmp_path):
    chart, cycles = grow_robot(seed), draw_cycles(seed, CYCLES)
    records, expected = play(chart, cycles, tmp_path), play_engine(chart, cycles)
    compared = next((number for number, one in enumerate(records) if one.status & NOT_IN_CYCLES), len(records))
    compare(expected[:compared], as_raised(records[:compared]), "engine and Python")


def test_a_chart_that_goes_round_ends_with_initial_values_in_all_players(tmp_path):
    chart = plot(ROUND)
    cycles = [(now, {"light": 1.0, "bumper": now > 0, "steps": 1}) for now in range(3)]
    found = play(chart, cycles, tmp_path)
    assert [(one.status, one.ended, one.motors["wheel"]) for one in found] == [
        (0, False, 3),
        (RUNAWAY, True, 0.5),
        (0, True, 0.5),
    ]
    compare(play_engine(chart, cycles), found, "engine and Python")


@pytest.mark.parametrize("begin", [-7, 0, 1000, 1_700_000_000])
def test_timers_from_the_first_cycle_on_in_all_players(begin, tmp_path):
    chart, sensors = plot(WAITING), {"light": 1.0, "bumper": False, "steps": 1}
    cycles = [(begin * 10**9 + tenths * 10**8 + 10**7, sensors) for tenths in (0, 1, 3, 4, 6)]
    found = play(chart, cycles, tmp_path)
    assert [(one.motors["gear"], one.motors["lamp"]) for one in found] == [(0, 0), (0, 0), (1, 0), (2, 0), (2, 1)]
    compare(play_engine(chart, cycles), found, "engine and Python")


def test_wrong_values_of_sensors_of_a_generated_controller():
    controller, names = python_controller(grow_robot(1))
    good = {"light": 0.5, "bumper": False, "steps": 1}
    for wrong in ({"light": 2}, {"light": True}, {"steps": 1.5}, {"bumper": 1}, {"light": None}, {"lite": 1}):
        with pytest.raises(ValueError, match=r"'light'|'steps'|'bumper'"):
            controller.cycle({**good, **wrong}, 5)
    for no_map in (None, [("light", 1)]):
        with pytest.raises(ValueError, match="a map by name"):
            controller.cycle(no_map, 5)
    for no_time in (None, 0.5, True, 2**63):
        with pytest.raises(ValueError, match="an integer of nanoseconds"):
            controller.cycle(good, no_time)
    assert controller.post(names["Events"].CYCLE) == names["Status"].UNKNOWN
    assert controller.cycle(good, 5).keys() == {"wheel", "gear", "lamp"}
    with pytest.raises(ValueError, match="does not decrease: 4 follows 5"):
        controller.cycle(good, 4)

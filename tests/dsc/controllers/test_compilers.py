"""Compilers: the C files of small charts compile without warnings at all levels of optimization, also with sanitizers."""

from __future__ import annotations

import pytest
from controller_players import COMPILERS, compile_at_levels

from dsc.controllers import build_controller
from dsc.text.plot_files import parse_plot

SMALL = {
    "no_timer": "robot: {motors: {m: number}}\nstates: {a: {on: {cycle: {assign: {m: 1}}}}}",
    "a_timer": "robot: {motors: {m: number}}\nstates: {a: {on: {cycle: b}}, b: {after: {seconds: 1, to: a}}}",
    "two_timers": "robot: {sensors: {s: number from 0 to 9, n: integer from 0 to 3, f: boolean}, motors: {m: number, k: "
    "integer from 0 to 3}}\nstates:\n  a: {on: {cycle: [{to: b, when: (and (< ?s 2) (= ?f false))}, {to: c, when: (> ?s 9)}]}}\n"
    "  b: {on: {cycle: {assign: {m: (* 7.5 ?s), k: (+ ?k 1)}}}, after: {seconds: 3, to: c}}\n"
    "  c: {entry: {assign: {m: (/ 10 ?s)}}, every: {seconds: 0.7, assign: {m: (+ ?m 1)}}, on: {cycle: {to: a, when: (< ?s 1)}}}",
    "a_skill": "receives: {go: }\nstates: {a: {on: {go: b}}, b: {entry: {trigger: arm.move, within: 2}, on: {moved: a, timed_out: a}}}",
    "skills_and_timers": "receives: {go: }\nstates:\n  a: {on: {go: b}, after: {seconds: 5, to: b}, every: {seconds: 1}}\n"
    "  b: {entry: {trigger: arm.move, within: 2}, on: {moved: a, timed_out: a}, at_least: 1}",
    "contradiction": "variables: {i: {type: integer, initial: 0}}\nreceives: {go: }\n"
    "states: {a: {on: {go: {to: a, when: (and (< ?i 2) (= ?i 2))}}}}",
}  # fmt: skip


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("name", SMALL)
def test_compilation_of_small_charts_without_warnings(name, compiler, tmp_path):
    compile_at_levels(tmp_path, build_controller(parse_plot(f"plot: {name}\n{SMALL[name]}\n"), "c99"), [compiler])

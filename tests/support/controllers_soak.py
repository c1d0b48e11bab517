"""Random charts and plays: do the engine, the Python controller and the C controller do the same, call by call?

`make controllers` runs it. Each chart gets several plays; the record of each call has the status, the configuration,
the skills started and stopped, the commands, the outcomes and the variables. Every fourth chart has a robot section and
is driven in cycles. After an overflow of 64 bits, which the engine does not have, only the two controllers are compared.
One chart of a batch compiles at all levels of optimization. At the end, a table has the sizes and times of the line
follower of the page.
"""

from __future__ import annotations

import argparse
import math
import random
import shutil
import sys
import tempfile
import time
from collections import Counter
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

from controller_charts import draw_play, grow
from controller_players import (
    BUSY,
    LOST,
    NOT_OF_THE_ENGINE,
    OVERFLOW,
    QUEUE,
    CPlayers,
    EnginePlayer,
    PythonPlayer,
    compile_at_levels,
)
from controller_times import LINE_FOLLOWER, time_c, time_engine, time_python
from cycle_charts import draw_cycles, grow_robot
from cycle_players import CCycles, as_raised, play_engine, play_python

from dsc.controllers import build_controller
from dsc.controllers.building import compile_controller
from dsc.controllers.c_text import c_text
from dsc.text.plot_files import load_plot

BATCH = 20
"""Charts that are compiled to one program."""
CYCLES = 60
"""Cycles of one play of a chart with a robot section."""
NOT_IN_CYCLES = LOST | OVERFLOW | BUSY


class DiffersError(AssertionError):
    """Two players do not agree."""


def compare(first, second, where):
    """Raise `DiffersError` for the first call about which two players have different records."""
    for number, (one, other) in enumerate(zip(first, second, strict=True)):
        if one != other:
            raise DiffersError(f"{where}, call {number}:\n  {one}\n  {other}")


def visible(records):
    """Return the records of a controller without the data after its end, which the engine does not have."""
    return [replace(one, data={}) if one.ended else one for one in records]


class Chart:
    """A random chart with its plays by the engine and by the Python controller."""

    def __init__(self, seed, plays, counts):
        self.seed, scxml = seed, seed % 2 == 1
        pick = random.Random(seed).choice
        self.plot = grow(pick, scxml).model_copy(update={"name": f"c{seed}"})
        self.plays = []
        seen: Counter[str] = Counter()
        controller = PythonPlayer(self.plot)
        for _ in range(plays):
            engine = EnginePlayer(self.plot)
            engine.play(draw_play(pick, scxml))
            records = [*controller.play(engine.calls)]
            compared = self._compared(records)
            compare(engine.records[:compared], visible(records[:compared]), f"seed {seed}, engine and Python")
            self.plays.append((engine.calls, records))
            seen.update(calls=len(records), compared=compared, transitions=engine.taken, dropped=engine.dropped)
            seen.update(timers=engine.timed, plays=1, overflows=int(compared < len(records)))
            seen.update(starts=engine.runs, failed=int(bool(records[-1].status & 16)))
        text = self.plot.text
        seen.update(charts=1, regions=int('"regions"' in text), with_timers=int(seen["timers"] > 0))
        seen.update(with_overflow=int(seen["dropped"] > 0), with_history=int('"history"' in text))
        counts.update(seen)

    @staticmethod
    def _compared(records):
        ends = (number for number, one in enumerate(records) if one.status & NOT_OF_THE_ENGINE)
        return next(ends, len(records))

    C = CPlayers


class RobotChart:
    """A random chart with a robot section, with its cycles by `CycleController` and by the Python controller."""

    C = CCycles

    def __init__(self, seed, plays, counts):
        self.seed, self.plot, self.plays = seed, grow_robot(seed), []
        seen: Counter[str] = Counter()
        for number in range(plays):
            cycles = draw_cycles(seed * 100 + number, CYCLES)
            engine, records = play_engine(self.plot, cycles), play_python(self.plot, cycles)
            ends = (n for n, one in enumerate(records) if one.status & NOT_IN_CYCLES)
            compared = min(next(ends, len(records)), len(engine))
            compare(engine[:compared], as_raised(records[:compared]), f"seed {seed}, cycles by the engine and Python")
            self.plays.append((cycles[: len(records)], records))
            entered = sum(one.active != other.active for one, other in pairwise(records))
            seen.update(cycles=len(records), cycles_compared=compared, configurations_in_cycles=entered)
            seen.update(robot_plays=1, robots_that_end=int(records[-1].ended))
        counts.update(seen, charts=1, robots=1, regions=1)


def run(seeds, plays, cc, counts, batch=BATCH):
    """Compare the charts of these seeds; with a compiler, also with C."""
    left = [*seeds]
    while left:
        some, left = left[:batch], left[batch:]
        charts = [(RobotChart if seed % 4 == 3 else Chart)(seed, plays, counts) for seed in some]
        for kind in (Chart, RobotChart) if cc is not None else ():
            _compare_with_c([one for one in charts if type(one) is kind], cc, counts)


def _compare_with_c(charts, cc, counts):
    if not charts:
        return
    with tempfile.TemporaryDirectory() as folder:
        compile_at_levels(Path(folder), c_text(compile_controller(charts[0].plot), QUEUE))
        program = charts[0].C(Path(folder), [chart.plot for chart in charts], cc)
        found = program.play([(n, calls) for n, chart in enumerate(charts) for calls, _ in chart.plays])
    expected = [(chart, records) for chart in charts for _, records in chart.plays]
    for (chart, records), own in zip(expected, found, strict=True):
        compare(records, own, f"seed {chart.seed}, Python and C")
        counts.update(c_calls=len(own))


def print_table(cc):
    """Print the sizes and the times of a step of the line follower, relative to the Python controller."""
    plot = load_plot(LINE_FOLLOWER)
    python, c = build_controller(plot, "python"), build_controller(plot, "c99")
    rows = [("engine", "", time_engine(plot)), ("python", python, time_python(python))]
    if cc is not None:
        with tempfile.TemporaryDirectory() as folder:
            rows.append(("c99", c, time_c(Path(folder), c, cc)))
    unit = rows[1][2]
    print(f"{'player':8} {'lines':>6} {'bytes':>7} {'us a step':>10} {'ratio':>8}")
    for name, text, seconds in rows:
        print(f"{name:8} {text.count(chr(10)):6} {len(text):7} {seconds * 1e6:10.3f} {seconds / unit:8.3f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--charts", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--plays", type=int, default=4)
    parser.add_argument("--seconds", type=float, default=math.inf, help="no further charts after this time")
    options = parser.parse_args()
    counts: Counter[str] = Counter()
    cc, began = shutil.which("cc"), time.monotonic()
    if cc is None:
        print("there is no C compiler `cc`: only Python controllers are compared")
    end = options.first + options.charts
    for first in range(options.first, end, BATCH):
        if time.monotonic() - began < options.seconds:
            run(range(first, min(first + BATCH, end)), options.plays, cc, counts)
    for name, count in counts.items():
        print(f"{name:24} {count}")
    print(f"{time.monotonic() - began:.0f} s: all players agree")
    print_table(cc)


if __name__ == "__main__":
    sys.exit(main())

"""The time from an edit of a plot with 1,000 lines to its diagnostics, and the time of the first check."""

import statistics
import time
from pathlib import Path

from dsc.editing.diagnostics import FileFinding, diagnostics
from dsc.editing.project_facts import ProjectFacts
from dsc.editing.quick_check import QuickCheck

STATES, EDITS = 249, 15
FILE = Path("long.yaml")
STATE = """  s{0}:
    about: a step of a long plot
    entry: {{trigger: arm.grasp, with: {{item: ?item}}}}
    on: {{grasped: {1}, slipped: {{to: s{0}, when: (= ?item cup)}}, other: {1}}}
"""


def long_plot():
    states = "".join(STATE.format(n, f"s{n + 1}" if n + 1 < STATES else "over") for n in range(STATES))
    return f"plot: long\nparameters: {{item: object}}\nstates:\n{states}  over: {{final: true}}\n"


def milliseconds(check, text):
    start = time.perf_counter()
    found = diagnostics([FileFinding.of(one, FILE) for one in check.findings(FILE, text, ProjectFacts())], text)
    return 1000 * (time.perf_counter() - start), len(found)


def main():
    check, text = QuickCheck(), long_plot()
    first, _ = milliseconds(check, text)
    edited = [milliseconds(check, text.replace(f"to: s{n}, when", f"to: s{n}x, when")) for n in range(EDITS)]
    after = statistics.median(time for time, _ in edited)
    print(f"lines of the plot  {len(text.splitlines()):6d}")
    print(f"first check        {first:6.0f} ms")
    print(f"after an edit      {after:6.0f} ms   median of {EDITS}; {first / after:.1f} times faster")


if __name__ == "__main__":
    main()

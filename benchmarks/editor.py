"""The times from an edit of a plot with 1,000 lines to its diagnostics, and of reading a project again."""

import os
import statistics
import tempfile
import time
from pathlib import Path

from dsc.editing.diagnostics import FileFinding, diagnostics
from dsc.editing.name_index import LatestIndex
from dsc.editing.project_facts import ProjectFacts
from dsc.editing.quick_check import QuickCheck
from dsc.editing.workspace import Workspace

STATES, EDITS, PLOTS, OTHERS = 249, 15, 200, 2000
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


def answers():
    """Return the milliseconds for the names in a project, first and again; an answer of the server needs them."""
    with tempfile.TemporaryDirectory() as name:
        root, text = Path(name), "\n".join(long_plot().splitlines()[:40]) + "\n  over: {final: true}\n"
        for number in range(PLOTS + OTHERS):
            folder = root / f"part_{number % 20}"
            folder.mkdir(exist_ok=True)
            file = folder / (f"p{number}.yaml" if number < PLOTS else f"m{number}.py")
            file.write_text(text if number < PLOTS else "pass\n")
            os.utime(file, (1e9, 1e9))
        for folder in (root, *root.iterdir()):
            os.utime(folder, (1e9, 1e9))
        workspace, latest, times = Workspace(), LatestIndex(), []
        for _ in range(EDITS):
            start = time.perf_counter()
            pages = workspace.pages(root, {})
            assert len(pages) == PLOTS
            latest.of(pages)
            times.append(1000 * (time.perf_counter() - start))
    return times[0], statistics.median(times[1:])


def main():
    check, text = QuickCheck(), long_plot()
    first, _ = milliseconds(check, text)
    edited = [milliseconds(check, text.replace(f"to: s{n}, when", f"to: s{n}x, when")) for n in range(EDITS)]
    after = statistics.median(time for time, _ in edited)
    print(f"lines of the plot  {len(text.splitlines()):6d}")
    print(f"first check        {first:6.0f} ms")
    print(f"after an edit      {after:6.0f} ms   median of {EDITS}; {first / after:.1f} times faster")
    first, again = answers()
    print(f"first answer       {first:6.0f} ms   {PLOTS} plots among {PLOTS + OTHERS} files")
    print(f"next answer        {again:6.1f} ms   median of {EDITS - 1}")


if __name__ == "__main__":
    main()

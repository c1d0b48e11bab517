"""The cost of `dsc --help` next to a bare interpreter, as the median ratio of runs taken in turn."""

import statistics
import subprocess
import sys
import time
from pathlib import Path

RUNS = 15
BARE = [sys.executable, "-c", "pass"]
HELP = [str(Path(sys.executable).with_name("dsc")), "--help"]


def seconds(command):
    start = time.perf_counter()
    subprocess.run(command, stdout=subprocess.DEVNULL, check=True)
    return time.perf_counter() - start


def main():
    for command in (BARE, HELP):
        seconds(command)  # warms the file cache
    pairs = [(seconds(BARE), seconds(HELP)) for _ in range(RUNS)]
    bare, helped = (statistics.median(column) for column in zip(*pairs, strict=True))
    ratio = statistics.median(h / b for b, h in pairs)
    print(f"python -c pass  {1000 * bare:6.1f} ms")
    print(f"dsc --help      {1000 * helped:6.1f} ms   {ratio:.1f} times (median of {RUNS} pairs)")


if __name__ == "__main__":
    main()

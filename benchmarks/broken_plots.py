"""Time until the command reports the error in a broken plot: median and longest time over the files.

`python benchmarks/broken_plots.py [--runs N]` runs the corpus and the bombs of `tests/support`, slowest first.
"""

import argparse
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

TESTS = Path(__file__).parents[1] / "tests" / "support"
DSC = Path(sys.executable).with_name("dsc")
SHOWN = 15

sys.path.insert(0, str(TESTS))
from dsc_bombs import BOMBS, HEAD  # noqa: E402  # a helper of the tests, found by its bare name

HUGE = {"scalar.yaml": 100_000_000, "line.yaml": 10_000_000, "chart.scxml": 10_000_000}


def bombs(folder):
    for name, (text, *_) in BOMBS.items():
        (folder / name).write_text(text)
    for name, size in HUGE.items():
        with (folder / f"huge_{name}").open("wb") as stream:
            stream.truncate(size)
    (folder / "huge_states.yaml").write_text(HEAD + "".join(f"  s{n}: {{}}\n" for n in range(200_000)))
    return sorted(folder.iterdir())


def seconds(file):
    command = [DSC, "plot", "import" if file.suffix == ".scxml" else "check", file]
    start = time.perf_counter()
    status = subprocess.run(command, capture_output=True, check=False).returncode
    assert status == 2, f"{file}: {status}"
    return time.perf_counter() - start


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=3)
    runs = parser.parse_args().runs
    with tempfile.TemporaryDirectory() as folder:
        kept = [file for file in TESTS.glob("broken/*/*") if file.suffix in {".yaml", ".scxml"}]
        files = [file for file in kept if file.name not in {"grasp.yaml", "wait.yaml"}] + bombs(Path(folder))
        seconds(files[0])  # warms the file cache
        times = {file.name: [seconds(file) for _ in range(runs)] for file in files}
    medians = {name: statistics.median(each) for name, each in times.items()}
    for name in sorted(medians, key=medians.get, reverse=True)[:SHOWN]:
        print(f"{1000 * medians[name]:7.0f} ms   {1000 * max(times[name]):7.0f} ms   {name}")
    middle, largest, longest = statistics.median(medians.values()), max(medians.values()), max(map(max, times.values()))
    print(
        f"{len(files)} files, {runs} runs of each: median {1000 * middle:.0f} ms, "
        f"largest median {1000 * largest:.0f} ms, longest {1000 * longest:.0f} ms"
    )


if __name__ == "__main__":
    main()

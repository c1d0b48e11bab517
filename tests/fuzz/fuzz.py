"""Mutated inputs for every reader and command: no traceback, no hang over 5 s, no growth over 1 GB.

`python tests/fuzz/fuzz.py --seconds S --seed N` makes inputs 0, 1, 2, … of the seed, on all cores. An input depends
on the seed and its number alone, so that a run is repeated whatever the number of processes. What was found is written
to `.fuzz/`, as small as it could be made; exit status 1 if there is anything. `--reproduce FILE` takes one of these, or
a file of the corpus, once more.
"""

from __future__ import annotations

import argparse
import base64
import hashlib
import json
import multiprocessing
import os
import resource
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from multiprocessing.connection import Connection, wait
from pathlib import Path
from random import Random
from typing import Any, NamedTuple, TypeVar

HERE = Path(__file__).parent
FOUND = HERE.parents[1] / ".fuzz"
HANG_S = 5.0
"""Seconds that an input may take of a processor, or three times as many on the wall, of which others have a part."""
GROWTH = 1 << 30
"""Bytes that a process may grow by, with one input or all of them."""
SHRINKING_S = 4.0
"""Seconds for making one finding smaller."""
MEMORY = Path("/dev/shm")  # noqa: S108  files in memory where there are such: no input waits for a disk
OURS = ("/dsc/", "/knowledge_base/", "/planning/", "/domains/", "/fuzz_readers.py", "/fuzz_commands.py")


T = TypeVar("T", bytes, str)


class Case(NamedTuple):
    """One input."""

    target: str
    data: bytes


class Finding(NamedTuple):
    """An input that did what none may do; `where` tells different ones apart."""

    case: Case
    where: str
    said: str


def main() -> None:
    """See the top."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="how long")
    parser.add_argument("--inputs", type=int, default=None, help="how many at most")
    parser.add_argument("--seed", type=int, default=0, help="of all inputs")
    parser.add_argument("--only", default=None, help="names of targets, with commas between them")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1, help="how many at once")
    parser.add_argument("--reproduce", type=Path, default=None, help="a finding, or a file of the corpus")
    options = parser.parse_args()
    if options.reproduce is not None:
        sys.exit(reproduced(options.reproduce))
    only = tuple(options.only.split(",")) if options.only else ()
    sys.exit(Campaign(options.seed, options.seconds, options.inputs, options.processes, only).run())


def targets() -> tuple[Any, ...]:
    """All readers, and the commands."""
    from fuzz_commands import TARGETS

    return TARGETS


def fine() -> tuple[type[Exception], ...]:
    """How a reader may end besides returning."""
    from fuzz_readers import FINE

    return FINE


def prepare() -> None:
    """What a process has for all its inputs is there before its growth is measured."""
    from fuzz_commands import commands
    from fuzz_readers import stores

    commands()
    stores()


def case_of(seed: int, number: int, only: tuple[str, ...] = ()) -> Case:
    """The input of that number."""
    random = Random(f"{seed} {number}")
    possible = [target for target in targets() if not only or target.name in only]
    target = random.choices(possible, [target.share for target in possible])[0]
    return Case(target.name, target.vary(random))


def tried(case: Case) -> Finding | None:
    """Use the input in this process."""
    (target,) = [target for target in targets() if target.name == case.target]
    with tempfile.TemporaryDirectory(dir=MEMORY if MEMORY.is_dir() else None) as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            target.read(case.data, Path(folder))
        except fine() as error:
            return _unsaid(case, error)
        except (Exception, SystemExit, KeyboardInterrupt, GeneratorExit) as error:  # noqa: BLE001  what is looked for
            return Finding(
                case,
                f"{case.target}: {type(error).__name__}, {_where(error)}",
                "".join(traceback.format_exception(error)),
            )
    return None


def _unsaid(case: Case, error: Exception) -> Finding | None:
    """An error that cannot say itself is a finding, too."""
    try:
        str(error).encode("utf-8", "backslashreplace")
    except Exception as second:  # noqa: BLE001  as above
        return Finding(case, f"{case.target}: message, {_where(second)}", "".join(traceback.format_exception(second)))
    return None


def _where(error: BaseException) -> str:
    """The last place of our own code, and what the error says if it is one of the judge's own."""
    frames = [
        frame for frame in traceback.extract_tb(error.__traceback__) if any(part in frame.filename for part in OURS)
    ]
    last = f"{Path(frames[-1].filename).name}:{frames[-1].name}" if frames else "elsewhere"
    return f"{last}: {str(error)[:40]}" if isinstance(error, AssertionError) else last


# -- a process that tries inputs -------------------------------------------------------------------------


def work(pipe: Connection, seed: int, only: tuple[str, ...]) -> None:
    """Try the inputs whose numbers come, until none does; say what became of each."""
    sys.path.insert(0, str(HERE))
    prepare()
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    start = _resident()
    room = _virtual() + 3 * GROWTH // 2
    resource.setrlimit(resource.RLIMIT_AS, (room, room))
    pipe.send(("ready", None, None))
    while (number := pipe.recv()) is not None:
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
        case = number if isinstance(number, Case) else case_of(seed, number, only)
        finding = tried(case)
        after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
        if finding is None and after > before and after - max(start, before) > GROWTH:
            finding = Finding(case, f"{case.target}: growth", f"it grew by {(after - before) >> 20} MB")
        pipe.send((case.target, finding, _resident() - start))


def _resident() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


def _virtual() -> int:
    return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()


class Worker:
    """A process, and the input it is at."""

    def __init__(self, seed: int, only: tuple[str, ...]) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=work, args=(theirs, seed, only), daemon=True)
        self.process.start()
        theirs.close()
        self.pipe.recv()
        self.number: int | Case | None = None
        self.since, self._spent = 0.0, 0.0

    def give(self, number: int | Case) -> None:
        """Let it try that input."""
        self.number, self.since, self._spent = number, time.monotonic(), self._computed()
        self.pipe.send(number)

    @property
    def hangs(self) -> bool:
        """Whether its input takes too long."""
        seconds = time.monotonic() - self.since
        if self.number is None or seconds < HANG_S:
            return False
        return seconds > 3 * HANG_S or self._computed() - self._spent > HANG_S

    def _computed(self) -> float:
        """Seconds of a processor that it has had."""
        try:
            fields = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        except OSError:
            return 0.0
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def end(self) -> None:
        """Kill it, if it does not end by itself."""
        if self.process.is_alive() and self.number is None:
            self.pipe.send(None)
            self.process.join(2)
        self.process.kill()
        self.process.join()


# -- the whole -------------------------------------------------------------------------------------------


class Campaign:
    """Inputs of a seed, until the time is over."""

    def __init__(self, seed: int, seconds: float, inputs: int | None, processes: int, only: tuple[str, ...]) -> None:
        self._seed, self._seconds, self._inputs, self._only = seed, seconds, inputs, only
        self._found: dict[str, Finding] = {}
        self._times: Counter[str] = Counter()
        self._tried: Counter[str] = Counter()
        self._growth = 0
        self._workers = [Worker(seed, only) for _ in range(processes)]
        self._next = 0

    def run(self) -> int:
        """Try, report, and say whether anything was found."""
        begun = time.monotonic()
        end = begun + self._seconds
        while (left := end - time.monotonic()) > 0 or any(one.number is not None for one in self._workers):
            for worker in self._workers:
                if worker.number is None and left > 0 and (self._inputs is None or self._next < self._inputs):
                    worker.give(self._next)
                    self._next += 1
            busy = [one for one in self._workers if one.number is not None]
            if not busy:
                break
            ready = wait([one.pipe for one in busy], timeout=0.2)
            for worker in busy:
                if worker.pipe in ready:
                    self._received(worker)
                elif worker.hangs:
                    self._lost(worker, "hang", f"it took more than {HANG_S:g} s")
        seconds = time.monotonic() - begun
        for one in self._workers:
            one.end()
        return self._report(seconds)

    def _received(self, worker: Worker) -> None:
        try:
            target, finding, growth = worker.pipe.recv()
        except EOFError:
            self._lost(worker, "death", "the process died")
            return
        worker.number = None
        self._tried[target] += 1
        self._growth = max(self._growth, growth)
        if finding is not None:
            self._note(finding)

    def _lost(self, worker: Worker, how: str, said: str) -> None:
        """It hangs, or is dead: its input is found out from here, and another one goes on."""
        number = worker.number
        worker.end()
        self._workers[self._workers.index(worker)] = Worker(self._seed, self._only)
        assert isinstance(number, int)
        case = case_of(self._seed, number, self._only)
        self._tried[case.target] += 1
        self._note(Finding(case, f"{case.target}: {how} ({_shape(case)})", said))

    def _note(self, finding: Finding) -> None:
        self._times[finding.where] += 1
        if finding.where not in self._found:
            self._found[finding.where] = finding
            print(f"found {finding.where}", file=sys.stderr, flush=True)

    def _report(self, seconds: float) -> int:
        tried_ = sum(self._tried.values())
        each = ", ".join(f"{name} {times}" for name, times in sorted(self._tried.items()))
        print(f"{tried_} inputs of seed {self._seed} in {seconds:.0f} s, {tried_ / seconds:.0f} a second: {each}")
        print(f"the process that grew most grew by {self._growth >> 20} MB")
        if self._growth > GROWTH:
            self._note(Finding(Case("all", b""), "growth of all inputs together", f"{self._growth >> 20} MB"))
        for where, finding in sorted(self._found.items()):
            print(f"{self._times[where]:6}  {where}\n        again: make fuzz REPRODUCE={kept(smaller(finding))}")
        print(f"{len(self._found)} findings")
        return 1 if self._found else 0


def _shape(case: Case) -> str:
    """What tells the hang of one command from another's."""
    return " ".join(json.loads(case.data)["argv"][:2])[:40] if case.target == "command" else "reader"


def kept(finding: Finding) -> Path:
    """Write it; the name is of its place and content."""
    FOUND.mkdir(exist_ok=True)
    name = hashlib.sha256(finding.where.encode()).hexdigest()[:8]
    file = FOUND / f"{finding.case.target}-{name}.json"
    form = {
        "target": finding.case.target, "where": finding.where, "said": finding.said[-6000:],
        "text": finding.case.data.decode("utf-8", "replace")[:2000], "data": base64.b64encode(finding.case.data).decode(),
    }  # fmt: skip
    file.write_text(json.dumps(form, indent=1))
    return file.relative_to(HERE.parents[1])


def reproduced(file: Path) -> int:
    """Try one input again; a hang is left to Ctrl-C."""
    sys.path.insert(0, str(HERE))
    if file.parent.parent.name == "corpus":
        case = Case(file.parent.name, file.read_bytes())
    else:
        form = json.loads(file.read_text())
        case = Case(form["target"], base64.b64decode(form["data"]))
    finding = tried(case)
    print(case.data[:4000].decode("utf-8", "replace"))
    print(finding.said if finding else "nothing is wrong with it")
    return 1 if finding else 0


# -- making it smaller -----------------------------------------------------------------------------------


def smaller(finding: Finding) -> Finding:
    """The same finding with as little of the input as can be found in a while; one that hangs stays as it is."""
    if finding.said.startswith("it ") or finding.case.target == "all":
        return finding
    worker = Worker(0, ())
    end = time.monotonic() + SHRINKING_S

    def still(data: bytes) -> Finding | None:
        nonlocal worker
        if time.monotonic() > end:
            return None
        worker.give(Case(finding.case.target, data))
        if not worker.pipe.poll(HANG_S):
            worker.end()
            worker = Worker(0, ())
            return None
        try:
            _, found, _ = worker.pipe.recv()
        except EOFError:
            worker = Worker(0, ())
            return None
        worker.number = None
        return found if found is not None and found.where == finding.where else None

    try:
        shrink = _fewer_arguments if finding.case.target == "command" else _shorter
        data = shrink(finding.case.data, lambda data: still(data) is not None)
        return finding._replace(case=Case(finding.case.target, data))
    finally:
        worker.end()


def _shorter(data: T, fails: Callable[[T], bool], least: int = 1) -> T:
    """What is left when parts are taken away as long as it still fails; of bytes or of text."""
    size = max(least, len(data) // 2)
    while size >= least:
        at = 0
        while at < len(data):
            less = data[:at] + data[at + size :]
            if fails(less):
                data = less
            else:
                at += size
        size //= 2
    return data


def _fewer_arguments(data: bytes, fails: Callable[[bytes], bool]) -> bytes:
    """`_shorter` for a call: arguments and files are taken away, then parts of files."""
    call: dict[str, Any] = json.loads(data)
    for part in ("argv", "files"):
        for key in sorted(range(len(call[part])) if part == "argv" else list(call[part]), reverse=True):
            less = json.loads(json.dumps(call))
            del less[part][key]
            call = less if fails(json.dumps(less).encode()) else call
    for name, content in list(call["files"].items()):
        if content.startswith("seed "):
            continue

        def with_content(text: str, name: str = name) -> bytes:
            return json.dumps({**call, "files": {**call["files"], name: text}}).encode()

        call["files"][name] = _shorter(content, lambda text: fails(with_content(text)), 8)
    return json.dumps(call).encode()


if __name__ == "__main__":
    sys.path.insert(0, str(HERE))
    # Spawned processes import this file under its own name, so that what they send is of the same classes.
    import fuzz

    fuzz.main()

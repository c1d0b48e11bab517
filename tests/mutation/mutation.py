"""Mutation test: mutmut changes the functions of a room, one at a time, and the room's tests have to notice.

`make mutation ROOM=engine SAMPLE=200 SEED=1` runs it. rooms.toml names the rooms, excluded.toml the kinds of mutants that do
not count, and accepted.toml the survivors that have a reason.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import sys
import time
from collections import Counter
from collections.abc import Sequence

from judgement import exclusion, read_accepted, read_excluded
from mutants import Mutant, mutants_of
from mutmut.configuration import reset_config
from rooms import Room, read_rooms
from verdicts import Verdict, forget_survivors, run_mutmut, verdicts
from workspace import workspace

KILLED, EXCLUDED = 0.90, 0.05
"""At least this share of tested mutants is killed; at most this share of all is excluded."""


def main() -> None:
    """Test the chosen rooms; exit with 1 if one is outside the bounds or a survivor has no reason."""
    rooms = read_rooms()
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rooms", nargs="*", metavar="ROOM", help=f"of {', '.join(rooms)}; all without")
    parser.add_argument("--sample", type=int, help="test so many mutants of each room")
    parser.add_argument("--seed", type=int, default=0, help="draw another sample")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="test so many mutants at once")
    said = parser.parse_args()
    unknown = sorted(set(said.rooms) - set(rooms))
    if unknown:
        parser.error(f"no room {', '.join(unknown)}; there are {', '.join(rooms)}")
    try:
        problems = [
            problem for name in said.rooms or rooms for problem in judge(rooms[name], said.sample, said.seed, said.jobs)
        ]
    except KeyboardInterrupt:
        sys.exit("interrupted; the next run goes on here")
    for problem in problems:
        print(f"FAILED: {problem}")
    sys.exit(1 if problems else 0)


def judge(room: Room, size: int | None, seed: int, jobs: int) -> list[str]:
    """Test a room, print its figures and survivors, and return what is wrong."""
    started = time.monotonic()
    folder = workspace(room)
    os.chdir(folder)
    reset_config()  # mutmut keeps the settings of the folder in which it read them
    forget_survivors(room)
    every = [mutant for module in room.modules for mutant in mutants_of(module, folder)]
    chosen = every if size is None else sample(every, size, seed)
    kinds = read_excluded()
    excluded = {mutant.name: reason for mutant in chosen if (reason := exclusion(mutant.change, kinds))}
    tested = [mutant for mutant in chosen if mutant.name not in excluded]
    known = verdicts(tested)
    pending = [mutant for mutant in tested if mutant.name not in known]
    print(f"{room.name}: {len(every)} mutants, {len(chosen)} chosen, {len(pending)} to test", flush=True)
    if pending:
        run_mutmut(pending, jobs)
        known = verdicts(tested)
    problems = report(room.name, tested, known, Counter(excluded.values()))
    spent = sum(seconds for _, seconds in known.values())
    print(
        f"  time       {_minutes(time.monotonic() - started)} for this run, {_minutes(spent)} of tests for all verdicts\n"
    )
    return problems


def sample(mutants: Sequence[Mutant], size: int, seed: int) -> list[Mutant]:
    """Draw mutants by the digest of seed and name: a larger sample contains a smaller one."""
    drawn = sorted(mutants, key=lambda mutant: hashlib.sha256(f"{seed} {mutant.name}".encode()).digest())
    return drawn[:size]


def report(
    name: str, tested: Sequence[Mutant], known: dict[str, tuple[Verdict, float]], excluded: Counter[str]
) -> list[str]:
    """Print figures and survivors, and return what is wrong."""
    counts = Counter(known[mutant.name][0] for mutant in tested if mutant.name in known)
    total, omitted = counts.total(), excluded.total()
    killed = counts[Verdict.KILLED] + counts[Verdict.TIMEOUT]
    accepted = read_accepted()
    survivors = [mutant for mutant in tested if known.get(mutant.name, (None,))[0] is Verdict.SURVIVED]
    bare = [mutant for mutant in survivors if (mutant.function, mutant.change) not in accepted]
    for verdict in Verdict:
        print(f"  {verdict:<9} {counts[verdict]:6} {_percent(counts[verdict], total)}")
    print(f"  excluded  {omitted:6} {_percent(omitted, total + omitted)} of all")
    for reason, number in excluded.most_common():
        print(f"            {number:6} {reason}")
    for mutant in sorted(survivors, key=lambda one: (one.path, one.line)):
        print(f"  {mutant.path}:{mutant.line} {mutant.function}")
        print("\n".join(f"      {line}" for line in mutant.change.splitlines()))
        print(f"      # {accepted.get((mutant.function, mutant.change), 'no reason')}")
    checks = {
        f"{name}: {len(tested) - total} mutants are not decided": total < len(tested),
        f"{name}: {_percent(killed, total)} killed, at least {KILLED:.0%} needed": killed < KILLED * total,
        f"{name}: {_percent(omitted, total + omitted)} excluded, at most {EXCLUDED:.0%} allowed": omitted > EXCLUDED * (total + omitted),
        f"{name}: {len(bare)} of {len(survivors)} survivors have no reason in accepted.toml": bool(bare),
    }  # fmt: skip
    return [text for text, failed in checks.items() if failed]


def _percent(part: int, whole: int) -> str:
    return f"{100 * part / whole:5.1f} %" if whole else "    - %"


def _minutes(seconds: float) -> str:
    return f"{int(seconds) // 60} min {int(seconds) % 60} s"


if __name__ == "__main__":
    main()

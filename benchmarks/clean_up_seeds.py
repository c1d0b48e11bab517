"""Many seeds of the clean-up table: is every report true, and how often was each fault, rule and candidate seen?"""

import argparse
import asyncio
import sys
import time
from collections import Counter

from domains.clean_up_table import deploy
from planning import PlannerProcess


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=200, help="seeds 0 to N-1")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--faults", type=float, default=0.2)
    options = parser.parse_args()
    counts = {name: Counter() for name in ("runs", "faults", "skill failures", "recoveries", "candidates")}
    planner = PlannerProcess()
    started = time.perf_counter()
    untrue = []
    for seed in range(options.first, options.first + options.seeds):
        table = deploy(seed=seed, faults=options.faults, planner=planner)
        report = table.run()
        if not is_true(table.world, report):
            untrue.append(seed)
        add(counts, table.world, report)
        if sys.stderr.isatty():
            print(f"\rseed {seed}", end="", file=sys.stderr)
    asyncio.run(planner.close())
    for name, counter in counts.items():
        print(f"{name}: " + ", ".join(f"{key} {count}" for key, count in counter.most_common()))
    print(f"{options.seeds} runs in {time.perf_counter() - started:.0f} s, untrue reports: {untrue or 'none'}")
    sys.exit(1 if untrue else 0)


def is_true(world, report):
    """The report against the world: `left` is exactly what permanent faults touched, and nothing is claimed falsely."""
    left = {one.item for one in report.left}
    permanent = any(fault.permanent for fault in world.fired)
    return (
        report.problem is None
        and left == world.touched()
        and report.goal_reached == world.goal_reached == (not left)
        and (permanent or report.goal_reached)
    )


def add(counts, world, report):
    permanent = any(fault.permanent for fault in world.fired)
    kinds = ("all", "goal reached" if report.goal_reached else "something left")
    counts["runs"].update([*kinds, *(["permanent fault"] if permanent else [])])
    counts["runs"].update(plans=report.plans, replans=report.replans, trips=report.trips)
    counts["faults"].update(f"{fault.kind}{' (permanent)' if fault.permanent else ''}" for fault in world.fired)
    counts["skill failures"].update(report.skill_failures)
    counts["recoveries"].update(report.recoveries)
    counts["candidates"].update(report.candidates_chosen)


if __name__ == "__main__":
    main()

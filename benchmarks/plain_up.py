"""One engine through plain unified-planning, with its reader and defaults: `plain_up.py ENGINE DOMAIN PROBLEM`.

The program prints the seconds of the search alone and the plan's steps, as JSON. It is a separate process, since
engines ignore time limits.
"""

import json
import sys
import time
import warnings

from unified_planning.io import PDDLReader
from unified_planning.shortcuts import OneshotPlanner, get_environment


def main() -> None:
    warnings.simplefilter("ignore")
    get_environment().credits_stream = None
    name, domain, problem = sys.argv[1:]
    read = PDDLReader().parse_problem(domain, problem)
    started = time.perf_counter()
    with OneshotPlanner(name=name) as planner:
        result = planner.solve(read)
    seconds = time.perf_counter() - started
    steps = [step.action.name for step in result.plan.actions] if result.plan else None
    print(json.dumps({"seconds": seconds, "steps": steps}))


if __name__ == "__main__":
    main()

"""Workers that misbehave, as scripts for `python -c`; they speak as `planning.engines.worker` does."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

from knowledge_base.facts import Fact
from planning.engines.planner import PlannerProcess
from planning.model.ground_action import GroundAction
from planning.model.plan import PlanStep
from planning.model.problem import Problem

READY = "import json, sys, time, os, signal\nprint('{\"ready\": true}', flush=True)\n"
HANGING = READY + "time.sleep(600)\n"

START, MIDDLE, ASIDE, GOAL = Fact("start"), Fact("middle"), Fact("aside"), Fact("goal")
FIRST = GroundAction(PlanStep("first", ("a",)), (START,), (MIDDLE,), (START,))
SECOND = GroundAction(PlanStep("second", ("b",)), (MIDDLE,), (GOAL,), ())
DETOUR = GroundAction(PlanStep("detour"), (MIDDLE,), (ASIDE,), (MIDDLE,))
ARRIVAL = GroundAction(PlanStep("arrival"), (ASIDE,), (GOAL,), ())
PROBLEM = Problem("d", {}, (START,), (GOAL,), (FIRST, SECOND, DETOUR, ARRIVAL))
SOLVED = '{"actions": [0, 1]}'
LONGER = '{"actions": [0, 2, 3]}'


def answering(*answers):
    """A worker that gives these answers, in this order, to every problem."""
    said = [*answers, '{"ended": 0}']
    return READY + f"for line in sys.stdin: print(*{said!r}, sep='\\n', flush=True)\n"


def planner(script, engine="fake", **options):
    """A planner whose worker is the script."""
    return PlannerProcess(engine, command=(sys.executable, "-c", script), **options)


def lights_out(size):
    """A puzzle in which h_FF is lost: each switch turns three lights; far too much for a second or two."""
    on = [Fact("on", (f"l{i}",)) for i in range(size)]
    off = [Fact("off", (f"l{i}",)) for i in range(size)]
    actions = []
    for i in range(size):
        near = [i - 1, i, (i + 1) % size]
        for mask in range(8):
            now = [(on if mask >> k & 1 else off)[n] for k, n in enumerate(near)]
            then = [(off if mask >> k & 1 else on)[n] for k, n in enumerate(near)]
            actions.append(GroundAction(PlanStep("press", (f"l{i}",)), tuple(now), tuple(then), tuple(now)))
    return Problem("lights", {}, (*on[::2], *off[1::2]), tuple(off), tuple(actions))


def descendants(pid):
    """All processes that it has started, and those that they have, by what Linux tells; zombies are dead."""
    children: dict[int, list[int]] = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            _, _, rest = stat.read_text().rpartition(")")
        except OSError:
            continue
        state, parent = rest.split()[:2]
        if state not in "ZX":
            children.setdefault(int(parent), []).append(int(stat.parent.name))
    found, agenda = set(), [pid]
    while agenda:
        for child in children.get(agenda.pop(), ()):
            found.add(child)
            agenda.append(child)
    return found


def session(pid, dead=""):
    """All processes of the session that this one leads or led, also those whose parents are gone.

    `dead` is the states of those that do not count: `ZX` for all that are not alive.
    """
    found = set()
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, _, leader = stat.read_text().rpartition(")")[2].split()[:4]
        except OSError:
            continue
        if int(leader) == pid and state not in dead:
            found.add(int(stat.parent.name))
    return found


def gone(pids, seconds=20.0):
    """Whether none of these processes lives; waits for it, since the dead are buried by others."""
    limit = time.monotonic() + seconds
    while alive := {pid for pid in pids if _lives(pid)}:
        if time.monotonic() > limit:
            return False
        os.sched_yield()
    return not alive


def _lives(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False

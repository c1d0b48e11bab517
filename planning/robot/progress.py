"""Progress of a run, computed from its records: lines of text, and a status line on a terminal."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Self

from rich.console import Console
from rich.live import Live
from rich.text import Text

from dsc.dynamic.knowledge_situation import ACHIEVE
from dsc.model.rules import REPLAN
from dsc.trace import Record
from knowledge_base.spelling import number_text
from planning.robot.tally import Tally

_SAYS: Mapping[str, Callable[[Mapping[str, Any]], str]] = {
    "plan.found": lambda data: f"plan with {number_text(len(data['steps']), 'step')} ({data['engine']})",
    "plan.none": lambda data: f"no plan, {data['kind']}: {data['reason']}",
    "plan.broken": lambda data: f"the plan no longer holds: {data['reason']}",
    "plan.failed": lambda data: f"failed: {' or '.join(data['steps'])}: {data['why']}",
    "plan.resumed": lambda data: f"the plan resumes at {data['step']}: {data['why']}",
    "plan.overtaken": lambda data: f"the world has overtaken {data['searches']} searches: {data['why']}",
    "plan.waits": lambda data: f"the plan waits for component '{data['component']}', {data['seconds']:g} s at most",
    "plan.skipped": lambda data: f"skipped {', '.join(data['steps']) or 'no step'}: {data['why']}",
    "plan.excluded": lambda data: f"{data['step']} is excluded for {data['seconds']:g} s: {data['why']}",
    "plan.readmitted": lambda data: f"{', '.join(data['steps'])} may be planned again: there is no plan without",
    "plan.rejected": lambda data: f"a plan fails in the simulation: {data['reason']}",
    "plan.compared": lambda data: f"a plan without {data['without']} costs {data['cost']:g}, the best {data['best']:g}",
    "plan.wrong": lambda data: f"a plan of {data['engine']} does not lead to the goal: {data['reason']}",
    "plan.gave_up": lambda data: f"gave up: {data['reason']}",
}
_STEP = re.compile(r"step_\d+")


def _working(scope: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the states whose content is a plot or a goal, also those inside composites and regions."""
    found: dict[str, dict[str, Any]] = {}
    for name, state in scope["states"].items():
        inner = [state] if "states" in state else state.get("regions", {}).values()
        for one in inner:
            found |= _working(one)
        if state.keys() & {"use", "dynamic", "goal"}:
            found[name] = state
    return found


def _rule_labels(form: Any) -> Iterator[str]:
    """Yield the labels of rules and handlers on transitions; a state that such a response added is about its label."""
    parts = form.values() if isinstance(form, Mapping) else form if isinstance(form, list | tuple) else ()
    for part in parts:
        yield from _rule_labels(part)
    if isinstance(form, Mapping) and isinstance(form.get("rule"), str):
        yield form["rule"]


class PlainProgress:
    """A trace listener that writes one line for each notable record."""

    def __init__(self, write: Callable[[str], None]) -> None:
        self._write = write
        self._steps: dict[str, str] = {}
        self._stages: set[str] = set()
        self._replans = False  # whether the last rule needs a new plan
        self._entered: list[str] = []  # the lines of the last macrostep; its rules come next, and are written first

    def __call__(self, record: Record) -> None:
        """Write the lines of text for one record, if there are any."""
        if record.type == "plot":
            self._learn_steps(record.data["plot"])
        if record.type != "rule":
            self._write_all(self._entered)
            self._entered = []
        lines = [f"{record.t:8.1f} s  {line}" for line in self.lines(record)]
        if record.type == "step":
            self._entered = lines
        else:
            self._write_all(lines)

    def _write_all(self, lines: Iterable[str]) -> None:
        for line in lines:
            self._write(line)

    def _learn_steps(self, plot: dict[str, Any]) -> None:
        working = {} if plot["plot"] == ACHIEVE else _working(plot)  # progress shows the plan, not its execution state
        responses = set(_rule_labels(plot))
        self._stages |= {name for name, state in working.items() if state.get("about") not in responses}
        if plot.get("generated"):
            self._steps = {name: state["about"] for name, state in working.items() if _STEP.fullmatch(name)}

    def lines(self, record: Record) -> list[str]:
        """Return the lines of text for a record; empty for most record types."""
        if record.type == "rule":
            self._replans = record.data["rule"].endswith(f" {REPLAN}")
            step = self._steps.get(record.data["state"].rsplit("/", 1)[-1])
            return [f"rule  {record.data['rule']}" + (f"  at {step}" if step else "")]
        if record.type == "plan.failed" and self._replans:  # the line of the rule has said so
            return []
        if record.type in _SAYS:
            return [_SAYS[record.type](record.data)]
        if record.type == "end" and record.data["problem"]:
            return [f"ended early: {record.data['problem']}"]
        if record.type == "step":
            return [line for micro in record.data["microsteps"] for line in self._microstep(micro)]
        return []

    def _microstep(self, micro: dict[str, Any]) -> list[str]:
        lines = []
        for path in micro["entered"]:
            name = path.rsplit("/", 1)[-1]
            if name in self._steps and path.endswith(f"execute/{name}"):
                self._replans = False
                lines.append(f"step {name.removeprefix('step_'):>3}  {self._steps[name]}")
            elif "/" not in path and name in self._stages:
                lines.append(name.replace("_", " "))
        return lines


class LiveProgress(PlainProgress):
    """A listener that writes the lines of `PlainProgress` on a terminal, above a status line.

    The status line contains the run time and the running skill. It counts the parts of the goal that are left, plans
    and replans.

    Args:
        console: the console of the terminal.
        left: returns the number of parts of the goal that are left, or `None`.
        tally: the counts of the run; it must receive each record before this listener does.
    """

    def __init__(self, console: Console, left: Callable[[], int | None], tally: Tally) -> None:
        super().__init__(lambda line: console.print(line, highlight=False))
        self._live: Live = Live(console=console, refresh_per_second=8, transient=True)
        self._left = left
        self._tally = tally
        self._doing = ""

    def __enter__(self) -> Self:
        """Show the status line."""
        self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Remove the status line."""
        self._live.stop()

    def __call__(self, record: Record) -> None:
        """Write the lines of text for one record, and update the status line."""
        super().__call__(record)
        if record.type == "plan.asked":
            self._doing = "planning"
        elif record.type == "action" and record.data["action"] == "start":
            skill = record.data["skill"]
            arguments = ", ".join(str(value) for value in record.data["arguments"].values())
            self._doing = self._doing if skill.startswith("planner.") else f"{skill}({arguments})"
        left = self._left()
        counts = "" if left is None else f"left {left}  "
        counts += f"plans {self._tally.plans}  replans {self._tally.replans}"
        self._live.update(Text.assemble((f"{record.t:8.1f} s  ", "bold"), self._doing, "  ", (counts, "dim")))

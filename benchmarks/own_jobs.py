"""Plots and jobs for the cases of this engine alone, each with a check of its transitions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import islice, pairwise
from typing import Any

from peers.dsc import KNOWLEDGE, Ready, ready
from timing import Job

from dsc.dynamic.knowledge_situation import KnowledgeSituation
from dsc.dynamic.library import Library
from dsc.engine.machine import Machine
from dsc.events import Event
from dsc.model.plot import ActionPlot
from dsc.validation import raise_findings, validate_plot

Form = dict[str, Any]
PING = Event("ping")


def ping_pong(name: str = "bench", *, others: int = 0, entry: Any = (), exit: Any = (), **more: Any) -> Form:  # noqa: A002
    """Return a plot of two states, among others, with the given content for them and their transitions."""
    states: Form = {
        one: {"on": {"ping": {"to": other, **more}}, "entry": entry, "exit": exit} for one, other in ("ab", "ba")
    }
    way = ["a", *(f"s{n}" for n in range(others)), "a"]
    for one, other in pairwise(way) if others else ():  # cycles that no event takes
        states.setdefault(one, {"on": {}})["on"]["away"] = other
    variables = {"n": {"type": "number", "initial": 1}}
    return {"plot": name, "variables": variables, "receives": {"ping": None, "away": None}, "states": states}


def holder(use: str) -> Form:
    """Return a plot with a submachine that every event leaves and enters again."""
    again = {"to": "host", **({"assign": {"plan": "?event.plan"}} if use == "?plan" else {})}
    return {
        "plot": "holder", "variables": {"plan": "plot"}, "receives": {"again": {"plan": "plot"}},
        "states": {
            "idle": {"on": {"again": again}},
            "host": {"use": use, "on": {"again": again, **({"done": "idle"} if use == "?plan" else {})}},
        },
    }  # fmt: skip


def plan(number: int) -> Form:
    """Return a plot of ten steps in sequence; plots of different numbers differ."""
    steps: Form = {f"s{n}": {"on": {"ping": f"s{n + 1}"}} for n in range(9)} | {"s9": {"final": True}}
    return {"plot": "plan", "about": f"plan {number}", "receives": {"ping": None}, "states": steps}


def stepping(form: Form, *, situated: bool = False) -> Job:
    """Return a job of ping-pong in the plot; with `situated` in a new situation for every event, as in a run."""
    at, machine = _started(form)

    def run(times: int) -> None:
        send, situation = machine.send, at.situation
        for _ in range(times):
            send(PING, situation)

    def run_situated(times: int) -> None:
        send, library = machine.send, at.library
        for _ in range(times):
            send(PING, KnowledgeSituation(KNOWLEDGE, library))

    job = Job(run_situated if situated else run)
    job.run(1)
    assert machine.state.is_active("b")
    return job


def attributes() -> Job:
    """Return a job of ping-pong with a new event each time, as one with data is."""
    at, machine = _started(ping_pong())

    def run(times: int) -> None:
        send, situation = machine.send, at.situation
        for number in range(times):
            send(Event("ping", {"level": number}), situation)

    run(1)
    assert machine.state.is_active("b")
    return Job(run)


def binding(*forms: Form, plans: Iterator[Form | None]) -> Job:
    """Return a job of a submachine that every event leaves and enters; the event carries the plot to bind."""
    at, machine = _started(*forms)

    def events(times: int) -> list[Event]:
        return [Event("again", {"plan": plan}) for plan in islice(plans, times)]

    def run(happening: list[Event]) -> None:
        send, situation = machine.send, at.situation
        for event in happening:
            send(event, situation)

    job = Job(run, prepare=events)
    job.run(events(2))
    state = machine.state
    assert any(state.is_active(first) for first in ("host/a", "host/s0")), state.configuration()
    return job


def _started(*forms: Form) -> tuple[Ready, Machine]:
    at = ready(*forms)
    machine = Machine(at.library)
    machine.start(at.plot, {}, at.situation)
    return at, machine


def read(form: Form) -> ActionPlot:
    """Return the plot read by pydantic alone."""
    return ActionPlot.model_validate(form)


def validated(form: Form) -> Library:
    """Return a library with the plot, after validation."""
    library = Library([read(form)])
    raise_findings([finding for plot in library for finding in validate_plot(plot, library)])
    return library


def compiled(form: Form) -> Library:
    """Return the validated library, compiled."""
    library = validated(form)
    library.compiled(form["plot"])
    return library


def started(form: Form) -> Machine:
    """Return a machine after its first step."""
    library = compiled(form)
    machine = Machine(library)
    machine.start(form["plot"], {}, KnowledgeSituation(KNOWLEDGE, library))
    return machine


def stage(build: Callable[[Form], object], form: Form) -> Job:
    """Return a job of building a plot from data up to a stage."""

    def run(times: int) -> None:
        for _ in range(times):
            build(form)

    return Job(run)

"""Steps, decisions, changes and actions as records of the trace."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from dsc.engine.machine_state import FrameState
from dsc.engine.steps import (
    Cancel,
    Microstep,
    Note,
    Output,
    Revoke,
    SendLater,
    SendMessage,
    SetParameter,
    Start,
    StartTimer,
    Step,
    SwitchMode,
)
from dsc.events import Event
from dsc.messages import ParameterMessage
from dsc.trace import Trace
from knowledge_base.exchange import delta_form, schema_form, world_form
from knowledge_base.facts import Change
from knowledge_base.store import KnowledgeBase


class StepTracer:
    """Writes what the sequencer does into a trace.

    Attributes:
        known_plots: digests of the plots that it has in full already.
    """

    def __init__(self, trace: Trace) -> None:
        self._trace = trace
        self.known_plots: set[str] = set()
        self._frames: dict[str, FrameState] = {}
        self._at_work: dict[int, dict[str, str]] = {}  # activation -> action id -> skill

    def world(self, knowledge: KnowledgeBase) -> None:
        """All that is known at the start; what follows are changes of it. Left out while nobody listens."""
        if self._trace.heard:
            known = {"schema": schema_form(knowledge.schema), **world_form(knowledge.snapshot())}
            self._trace.record("world", version=knowledge.version, **known)

    def event(self, event: Event, source: str, original: str | None = None, conflated: int = 0) -> int:
        """An event that came in; `original` is the skill's own name for it where the chart uses another.

        `conflated` older reports were dropped in favour of it.
        """
        if not self._trace.heard:
            return self._trace.record("event")
        attributes = {name: _told_once(value) for name, value in event.attributes.items()}
        data: dict[str, Any] = {"name": event.name, "source": source, "attributes": attributes}
        if original not in (None, event.name):
            data["original"] = original
        if conflated:
            data["conflated"] = conflated
        return self._trace.record("event", **data)

    def begun(self, start: Start) -> str:
        """A skill has been started, here or before a crash; its name with its component's."""
        skill = f"{start.component}.{start.skill}"
        self._at_work.setdefault(start.activation, {})[start.action_id] = skill
        return skill

    def at_work(self, activation: int) -> Iterable[str]:
        """The ids of the skills that were started for an activation and have not ended."""
        return self._at_work.get(activation, ())

    def answered(self, start: Start) -> None:
        """A skill has ended by itself: it cannot be cancelled any more."""
        self._at_work.get(start.activation, {}).pop(start.action_id, None)

    def step(self, step: Step) -> int | None:
        """A macrostep in which something happened: new plots before it, the rules that answered after it."""
        if not step.microsteps:
            return None
        said: dict[str, Any] = {}
        if self._trace.heard:  # else nobody wants to know what plots look like, or what happened, which takes a while
            self._plots(step)
            said["microsteps"] = [_micro(micro) for micro in step.microsteps]
            if variables := self._changed_variables(step):
                said["variables"] = variables
        seq = self._trace.record("step", **said)
        self._trace.cause = seq
        for micro in step.microsteps:
            for taken in micro.taken:
                if taken.rule:
                    self._trace.record("rule", rule=taken.rule, state=taken.source)
        return seq

    def decisions(self, step: Step) -> None:
        """What dynamic states chose in this macrostep, and why."""
        for made in step.decisions if self._trace.heard else ():
            decision = made.decision
            self._trace.record(
                "decision",
                state=made.state,
                chosen=decision.chosen,
                satisfied=decision.satisfied,
                arguments=dict(decision.arguments),
                version=decision.version,
                candidates=[
                    {"plot": v.plot, "fits": v.fits, "reason": v.reason, "condition": dict(v.explanation)}
                    for v in decision.verdicts
                ],
            )

    def knowledge(self, change: Change) -> None:
        """A committed change of the knowledge base, if any; what nothing else led to is itself a cause."""
        if not (change.delta and self._trace.heard):
            return
        said = delta_form(change.delta)
        seq = self._trace.record("knowledge", version=change.version, author=change.author, **said)
        self._trace.cause = self._trace.cause or seq

    def set_default(self, setting: ParameterMessage) -> int:
        """An operator has said what a plot's parameter is worth."""
        return self._trace.record("action", action="set", port=f"{setting.owner}.{setting.name}", value=setting.value)

    def output(self, output: Output) -> int | None:
        """An action that leaves; timers do not."""
        if isinstance(output, Start):
            skill, arguments = self.begun(output), dict(output.arguments)
            return self._trace.record("action", action="start", id=output.action_id, skill=skill, arguments=arguments)
        if isinstance(output, Cancel):
            for action_id, skill in self._at_work.pop(output.activation, {}).items():
                self._trace.record("action", action="cancel", id=action_id, skill=skill)
        if isinstance(output, SetParameter):
            port = f"{output.component}.{output.parameter}"
            return self._trace.record("action", action="set", port=port, value=output.value)
        if isinstance(output, SwitchMode):
            return self._trace.record("action", action="switch", component=output.component, mode=output.mode)
        if isinstance(output, SendMessage):
            port = f"{output.component}.{output.port}"
            return self._trace.record("action", action="send", port=port, arguments=dict(output.arguments))
        if isinstance(output, Note):
            return self._trace.record("log", label=output.label, text=output.text)
        assert isinstance(output, Cancel | StartTimer | SendLater | Revoke)  # noqa: S101
        return None

    def _changed_variables(self, step: Step) -> dict[str, Any]:
        """Parameters and variables that are new or have another value than before, by path of the plot's holder."""
        before, self._frames = self._frames, _frames(step.state.root)
        said = {}
        for path, frame in self._frames.items():
            known = before.get(path)
            if (known is None or known.variables is not frame.variables) and (news := _news(known, frame)):
                said[path] = news
        return said

    def _plots(self, step: Step) -> None:
        for micro in step.microsteps:
            for bound in micro.bound:
                digest = bound.plot.digest
                if digest not in self.known_plots:
                    self.known_plots.add(digest)
                    self._trace.record("plot", name=bound.plot.name, hash=digest, plot=bound.plot.to_form())


def _micro(micro: Microstep) -> dict[str, Any]:
    event, taken, exited, entered, bound = micro
    said: dict[str, Any] = {
        "event": None if event is None else event.name,
        "taken": [{"from": one.source, "on": one.trigger, "to": one.target} for one in taken],
        "exited": list(exited),
        "entered": list(entered),
    }
    if bound:  # the texts of the plots are records of their own
        said["bound"] = [{"state": one.state, "plot": one.plot.name, "hash": one.plot.digest} for one in bound]
    return said


def _frames(root: FrameState | None) -> dict[str, FrameState]:
    """The plots that run, by the path of the state that holds each."""
    if root is None or not root.children:
        return {} if root is None else {"": root}
    return dict(_inside(root, ""))


def _inside(frame: FrameState, path: str) -> Iterator[tuple[str, FrameState]]:
    yield path, frame
    for name, child in frame.children.items():
        yield from _inside(child, f"{path}/{name}" if path else name)


def _news(before: FrameState | None, frame: FrameState) -> dict[str, Any]:
    """The values of a plot that were not there before; another instance of it begins anew."""
    known = before.variables if before is not None and before.serial == frame.serial else {}
    return {
        name: _told_once(value) for name, value in frame.variables.items() if name not in known or known[name] != value
    }


def _told_once(value: Any) -> Any:
    """A plot that an event carries, by name only: its full text is written when it is bound."""
    is_plot = isinstance(value, dict) and {"plot", "states"} <= value.keys()
    return {"plot": value["plot"]} if is_plot else value

"""Trace records of steps, decisions, changes and actions."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from dsc.engine import steps
from dsc.engine.machine_state import FrameState
from dsc.events import Event
from dsc.messages import ParameterMessage, PlotsMessage
from dsc.model.plot import ActionPlot
from dsc.sequencer.relay import InnerRun
from dsc.trace import Record, Trace
from knowledge_base.exchange import delta_form, schema_form, world_form
from knowledge_base.facts import Change
from knowledge_base.store import KnowledgeBase


class StepTracer:
    """Recorder of the sequencer's events, steps and actions in a trace.

    Attributes:
        known_plots: digests of the plots whose full text the trace already has.
    """

    def __init__(self, trace: Trace) -> None:
        self._trace = trace
        self.known_plots: set[str] = set()
        self._frames: dict[str, FrameState] = {}
        self._active: dict[int, dict[str, str]] = {}  # skills by activation and action id
        self._inner: dict[str, InnerRun] = {}  # by action id

    def world(self, knowledge: KnowledgeBase, **names: str) -> None:
        """Record the world at the start and `names`, unless the trace has no listener; later records are changes."""
        if self._trace.heard:
            known = {"schema": schema_form(knowledge.schema), **world_form(knowledge.snapshot())}
            self._trace.record("world", version=knowledge.version, **names, **known)

    def event(self, event: Event, source: str, original: str | None = None, conflated: int = 0) -> int:
        """Record an incoming event; return the number of the record.

        Args:
            event: the event, by its name in the chart.
            source: the skill, the component or its port, `timer` or `outside`.
            original: the skill's own name for the event.
            conflated: the number of older reports that the event replaces.
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

    def begun(self, start: steps.Start) -> str:
        """Register a skill that was started, here or before a crash; return its name as `component.skill`."""
        skill = f"{start.component}.{start.skill}"
        self._active.setdefault(start.activation, {})[start.action_id] = skill
        return skill

    def answered(self, start: steps.Start) -> None:
        """Register the end of a skill, after which the skill cannot be cancelled."""
        self._active.get(start.activation, {}).pop(start.action_id, None)
        if self._inner:
            self._leave(start.action_id)

    def relay(self, start: steps.Start, state: str, lines: Iterable[str]) -> None:
        """Record what a plot that runs as a skill has recorded, below the path of the state that has started it."""
        if self._trace.heard:
            inner = self._inner.get(start.action_id) or self._begin_inner(start.action_id, state)
            for line in lines:
                inner.receive(line, self._trace, self.known_plots)

    def _begin_inner(self, action: str, state: str) -> InnerRun:
        shown = not any(one.at == state and one.is_shown for one in self._inner.values())
        begun = self._inner[action] = InnerRun(action, state, self._trace.cause, shown=shown)
        return begun

    def _leave(self, action: str) -> None:
        """Record that the states of an inner run are left, since its skill has ended or is cancelled."""
        if inner := self._inner.pop(action, None):
            inner.leave(self._trace)

    def restore(self, records: Iterable[Record], states: Mapping[str, str]) -> None:
        """Restore what the records of an interrupted run have said.

        Args:
            records: the records.
            states: paths of the states whose skills are pending, by action id.
        """
        for record in records:
            if record.type == "plot":
                self.known_plots.add(record.data["hash"])
            elif record.type == "step" and (of := record.data.get("of", "")) in states:
                inner = self._inner.get(of) or self._begin_inner(of, states[of])
                inner.note(record.type, record.data)

    def step(self, step: steps.Step) -> int | None:
        """Record a macrostep that has microsteps; return the number of the record, or `None` without microsteps.

        New plots are recorded before the macrostep, and the rules that handled a failure after it.
        """
        if not step.microsteps:
            return None
        said: dict[str, Any] = {}
        for output in step.output if self._inner else ():
            if isinstance(output, steps.Cancel):
                for action in self._active.get(output.activation, ()):
                    self._leave(action)
        if self._trace.heard:  # the texts of plots and microsteps take long to create
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

    def decisions(self, step: steps.Step) -> None:
        """Record the decisions of dynamic states in this macrostep, with their reasons."""
        for made in step.decisions if self._trace.heard else ():
            decision = made.decision
            how: dict[str, Any] = {} if decision.by == "order" else {"by": decision.by}
            if decision.by == "learned" or decision.situation:
                how |= {"plot": decision.holder, "situation": dict(decision.situation)}
            if decision.explored:
                how["explored"] = True
            self._trace.record(
                "decision",
                state=made.state,
                chosen=decision.chosen,
                satisfied=decision.satisfied,
                arguments=dict(decision.arguments),
                version=decision.version,
                candidates=[
                    {"plot": v.plot, "fits": v.fits, "reason": v.reason, "condition": dict(v.explanation)}
                    | ({} if v.score is None else {"score": v.score})
                    | ({"learned": v.learned} if v.learned else {})
                    for v in decision.verdicts
                ],
                **how,
            )

    def knowledge(self, change: Change) -> None:
        """Record a committed change of the knowledge base. Without another cause, the change becomes the cause."""
        if not (change.delta and self._trace.heard):
            return
        said = delta_form(change.delta)
        seq = self._trace.record("knowledge", version=change.version, author=change.author, **said)
        self._trace.cause = self._trace.cause or seq

    def set_default(self, setting: ParameterMessage) -> int:
        """Record an operator's setting of a plot's parameter; return the number of the record."""
        return self._trace.record("action", action="set", port=f"{setting.owner}.{setting.name}", value=setting.value)

    def plots(self, message: PlotsMessage, before: Mapping[str, ActionPlot | None], refused: str | None = None) -> int:
        """Record a change of plots, whose former versions are `before`; return the number of the record."""
        changed: dict[str, list[str]] = {
            "installed": [], "replaced": [], "removed": [], "components": [*message.components],
        }  # fmt: skip
        for name, plot in message.plots.items():
            kind = "removed" if plot is None else "installed" if before[name] is None else "replaced"
            changed[kind].append(name)
        how = {} if refused is None else {"refused": refused}
        return self._trace.record("plots", **{k: v for k, v in changed.items() if v}, active=message.active, **how)

    def started(self, start: steps.Start) -> int:
        """Record the start of a skill; return the number of the record."""
        skill, arguments = self.begun(start), dict(start.arguments)
        return self._trace.record("action", action="start", id=start.action_id, skill=skill, arguments=arguments)

    def waits(self, start: steps.Start, holder: str) -> None:
        """Record that a skill waits for its component, and the skill that the component executes, with its state."""
        skill = f"{start.component}.{start.skill}"
        self._trace.record("action", action="wait", id=start.action_id, skill=skill, **{"for": holder})

    def turn(self, start: steps.Start) -> None:
        """Record that a skill that has waited begins, unless it was cancelled."""
        skill = self._active.get(start.activation, {}).get(start.action_id)
        if skill is not None:
            self._trace.record("action", action="begin", id=start.action_id, skill=skill)

    def cancelled(self, activation: int) -> Iterable[str]:
        """Record the cancellation of an activation's skills; return their action ids."""
        skills = self._active.pop(activation, {})
        for action_id, skill in skills.items():
            self._trace.record("action", action="cancel", id=action_id, skill=skill)
        return skills

    def told(self, output: steps.Output) -> None:
        """Record a one-way action or a note; other outputs, e.g. timers, have no record."""
        match output:
            case steps.SetParameter(component, parameter, value):
                self._trace.record("action", action="set", port=f"{component}.{parameter}", value=value)
            case steps.SwitchMode(component, mode):
                self._trace.record("action", action="switch", component=component, mode=mode)
            case steps.SendMessage(component, port, arguments):
                self._trace.record("action", action="send", port=f"{component}.{port}", arguments=dict(arguments))
            case steps.SetWire(component, port, to):
                self._trace.record("action", action="wire", port=f"{component}.{port}", to=to)
            case steps.Note(label, text):
                self._trace.record("log", label=label, text=text)
            case steps.Start() | steps.Cancel() | steps.StartTimer() | steps.SendLater() | steps.Revoke():
                pass  # skills and events have separate records

    def _changed_variables(self, step: steps.Step) -> dict[str, Any]:
        """Return new and changed values of parameters and variables, by the path of the plot's host state."""
        before, self._frames = self._frames, _frames(step.state.root)
        said = {}
        for path, frame in self._frames.items():
            known = before.get(path)
            if (known is None or known.variables is not frame.variables) and (news := _news(known, frame)):
                said[path] = news
        return said

    def _plots(self, step: steps.Step) -> None:
        for micro in step.microsteps:
            for bound in micro.bound:
                digest = bound.plot.digest
                if digest not in self.known_plots:
                    self.known_plots.add(digest)
                    words = {"words": bound.plot.words._asdict()} if any(bound.plot.words) else {}
                    self._trace.record("plot", name=bound.plot.name, hash=digest, plot=bound.plot.to_form(), **words)


def _micro(micro: steps.Microstep) -> dict[str, Any]:
    event, taken, exited, entered, bound = micro
    said: dict[str, Any] = {
        "event": None if event is None else event.name,
        "taken": [{"from": one.source, "on": one.trigger, "to": one.target} for one in taken],
        "exited": list(exited),
        "entered": list(entered),
    }
    if bound:  # separate records have the texts of the plots
        said["bound"] = [{"state": one.state, "plot": one.plot.name, "hash": one.plot.digest} for one in bound]
    return said


def _frames(root: FrameState | None) -> dict[str, FrameState]:
    """Return the running plots by the paths of their host states."""
    if root is None or not root.children:
        return {} if root is None else {"": root}
    return dict(_inside(root, ""))


def _inside(frame: FrameState, path: str) -> Iterator[tuple[str, FrameState]]:
    yield path, frame
    for name, child in frame.children.items():
        yield from _inside(child, f"{path}/{name}" if path else name)


def _news(before: FrameState | None, frame: FrameState) -> dict[str, Any]:
    """Return the new and changed values of a plot; in a new instance of the plot, all values are new."""
    known = before.variables if before is not None and before.serial == frame.serial else {}
    return {
        name: _told_once(value) for name, value in frame.variables.items() if name not in known or known[name] != value
    }


def _told_once(value: Any) -> Any:
    """Replace a plot that is an event's attribute by its name, as the record of its binding has the text."""
    is_plot = isinstance(value, dict) and {"plot", "states"} <= value.keys()
    return {"plot": value["plot"]} if is_plot else value

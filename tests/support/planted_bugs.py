"""Bugs that a durable executive must not have, planted one at a time: what the soak is good for is seen by these."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

from domains.clean_up_table.bringup import bundle
from dsc.dynamic.library import Library
from dsc.messages import SkillMessage
from dsc.runs import store
from dsc.runs.store import RunStore, RunWriter
from dsc.sequencer.dispatcher import Dispatcher
from dsc.sequencer.sequencer import Sequencer
from planning.robot.program import failure_events

FAILURES = failure_events(Library(bundle().plots)).union(bundle().failures)


def a_new_id_on_retry(monkeypatch):
    """What was under way when the program died is asked for anew, and so done again."""
    resume = Dispatcher.resume

    def taken_up_anew(self, start, earlier):
        resume(self, replace(start, action_id=f"{start.action_id}-again"), earlier)

    monkeypatch.setattr(Dispatcher, "resume", taken_up_anew)


class _Later:
    """A connection that only notes what is to be written; what is read comes from the real one."""

    def __init__(self):
        self.noted = []
        self.real = None

    def execute(self, *statement):
        if statement[0].startswith("SELECT"):
            return self.real.execute(*statement)
        self.noted.append(("execute", statement))
        return SimpleNamespace(rowcount=1)

    def executemany(self, statement, rows):
        self.noted.append(("executemany", (statement, list(rows))))

    def written(self, connection):
        for how, what in self.noted:
            getattr(connection, how)(*what)
        self.noted.clear()


def dispatch_before_commit(monkeypatch):
    """A macrostep is kept together with the next one, and its actions do not wait for that."""
    later, step, end = _Later(), RunStore.step, RunStore.end

    def put_off(self, *args):
        writing, connection, cursor = self.writing, self.writing.connection, self.writing._cursor
        later.written(connection)
        later.real = connection
        writing.connection = writing._cursor = later
        step(self, *args)
        writing.connection, writing._cursor = connection, cursor

    def kept(self, reactor):
        later.written(self.writing.connection)
        end(self, reactor)

    monkeypatch.setattr(RunStore, "step", put_off)
    monkeypatch.setattr(RunStore, "end", kept)
    monkeypatch.setattr(RunStore, "load_unfinished", _forgetting(RunStore.load_unfinished, later))


def _forgetting(load_unfinished, later):
    """A program that has died has forgotten what it has noted."""

    def taken_up(self, library):
        later.noted.clear()
        return load_unfinished(self, library)

    return taken_up


def no_fence(monkeypatch):
    """Whoever writes a run goes on writing it, whoever has taken it over."""
    monkeypatch.setattr(RunWriter, "require_right", lambda self: None)
    monkeypatch.setattr(store, "_STEP", store._STEP.replace("FROM fence WHERE epoch = ?", "WHERE ? > 0"))


def failures_not_recorded(monkeypatch):
    """Only what goes well is kept."""
    step = RunStore.step

    def hopeful(self, now, message, *more):
        if not (isinstance(message, SkillMessage) and message.outcome.event in FAILURES):
            step(self, now, message, *more)

    monkeypatch.setattr(RunStore, "step", hopeful)


def answers_dropped_with_their_state(monkeypatch):
    """When a state is left, answers to it that wait to be taken are thrown away, with what they observed."""
    take = Sequencer._take

    def tidy(self, message):
        take(self, message)
        active = self.machine.state.state_of
        self.rearrange(
            lambda waiting: [m for m in waiting if not isinstance(m, SkillMessage) or active(m.start.activation)]
        )

    monkeypatch.setattr(Sequencer, "_take", tidy)

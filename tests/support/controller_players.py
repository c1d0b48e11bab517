"""The same play by the engine, by a Python controller and by a C controller, each with a record of each call.

`EnginePlayer` states what a controller does around the engine: the queue, the order of timers and events, and the ends.
"""

from __future__ import annotations

import shutil
import subprocess
from collections import deque
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from dsc.controllers.building import compile_controller
from dsc.controllers.c_text import c_text
from dsc.controllers.identifiers import identifier, identifiers
from dsc.controllers.python_text import python_text
from dsc.dynamic.knowledge_situation import KnowledgeSituation
from dsc.dynamic.library import Library
from dsc.engine import steps
from dsc.engine.machine import Machine
from dsc.errors import RunawayError
from dsc.events import TIMED_OUT, Event
from knowledge_base.store import KnowledgeBase
from knowledge_base.world.schema import Schema

QUEUE = 4
"""Capacity of the queue, so small that it overflows."""
FULL, UNKNOWN, LOST, OVERFLOW, FAILED, RUNAWAY, BUSY = 1, 2, 4, 8, 16, 32, 64
MOST_EVENTS = 1000
NEVER = 4e9
"""The seconds from which a timer of a controller is never due."""
NOT_OF_THE_ENGINE = LOST | OVERFLOW | RUNAWAY


class Call(NamedTuple):
    """One call of a controller: `post`, `end` or `step`."""

    what: str
    event: str = ""
    run: int = 0
    data: Any = ()
    now: int = 0


@dataclass
class Record:
    """What one call did, and the state after it."""

    status: int
    ended: bool
    active: tuple[str, ...]
    acts: list[Any]
    emitted: list[Any]
    data: dict[str, Any]
    dropped: int


@dataclass(order=True)
class _Timer:
    due: int
    order: int
    activation: int = field(compare=False)
    event: str = field(compare=False)
    index: int = field(compare=False)


class EnginePlayer:
    """The engine with a clock, timers, a bounded queue and running skills."""

    def __init__(self, plot):
        self.plot, self.library = plot, Library([plot])
        self.knowledge, self.machine = KnowledgeBase(Schema()), Machine(self.library)
        self.clock = self.runs = self.orders = self.dropped = self.taken = self.timed = 0
        self.timers: list[_Timer] = []
        self.queue: deque[Any] = deque()
        self.running: dict[int, Any] = {}
        self.ended = False
        self.status = 0
        self.acts: list[Any] = []
        self.emitted: list[Any] = []
        self.calls: list[Call] = []
        self.records: list[Record] = []

    def play(self, happened):
        """Everything that happens, as calls for the other players."""
        self._record(self._start)
        now = 0
        for what, which, given, passes in happened:
            if self.ended or self.status & BUSY:
                return
            if what == "step":
                now += passes
                call = Call("step", now=now)
            elif what == "end":
                run = [*self.running, self.runs + 7][which % (len(self.running) + 1)]
                call = Call("end", ("e", "f", "e")[which % 3], run, given)
            else:
                call = Call("post", what, 0, given)
            self.calls.append(call)
            self._record(lambda call=call: self._make(call))

    def _record(self, act):
        self.status, self.acts, self.emitted = 0, [], []
        try:
            status = self.status = act()
        except RunawayError:
            status, self.ended = RUNAWAY, True
        root = self.machine.state.root
        data = {} if root is None else {name: root.variables[name] for name in self.plot.variables}
        active = tuple(self.machine.state.configuration())
        self.records.append(Record(status, self.ended, active, self.acts, self.emitted, data, self.dropped))

    def _make(self, call):
        if call.what == "step":
            return self._step(call.now)
        if len(self.queue) >= QUEUE:
            self.dropped += 1
            return FULL
        self.queue.append((call.event, call.data, call.run))
        return 0

    def _start(self):
        self._after(self.machine.start(self.plot.name, {}, self._situation()))
        return self.status

    def _step(self, now):
        for _ in range(MOST_EVENTS):
            if self.ended:
                return self.status
            due = min((one for one in self.timers if one.due <= now), default=None)
            if due is not None:
                self._time_out(due)
                continue
            self.clock = max(self.clock, now)
            if not self.queue:
                return self.status
            event, data, run = self.queue.popleft()
            if not run:
                self._send(Event(event, data))
            elif run in self.running:
                self._end(run, event, data)
        if not self.ended and (self.queue or any(one.due <= now for one in self.timers)):
            self.status |= BUSY
        return self.status

    def _situation(self):
        return KnowledgeSituation(self.knowledge, self.library)

    def _send(self, event):
        done = self.machine.send(event, self._situation())
        self._after(done)
        return done

    def _end(self, run, event, data):
        """Hand over the outcome of a skill; one that an active state ignores ends the run, as in `Reactor`."""
        activation = self.running.pop(run)[0]
        self.timers = [one for one in self.timers if (one.event, one.index) != ("within", run)]
        done = self._send(Event(event, data, to=activation))
        if not done.handled and not self.ended and self.machine.state.state_of(activation) is not None:
            self._fail()

    def _time_out(self, timer):
        self.timed += 1
        self.timers.remove(timer)
        self.clock = max(self.clock, timer.due)
        if timer.event == "within":
            self.acts.append(("stop", self.running[timer.index][1], timer.index))
            self._end(timer.index, TIMED_OUT, {})
        else:
            self._send(Event(timer.event, to=timer.activation, exact=True, number=timer.index))

    def _after(self, step):
        self._act(step)
        self.taken += sum(len(micro.taken) for micro in step.microsteps)
        if step.errors or step.bugs:
            self._fail()
        elif step.state.root is None:
            self.ended = True

    def _fail(self):
        self.status |= FAILED
        if self.machine.state.root is not None:
            self._act(self.machine.leave(self._situation()))
        self.ended = True

    def _act(self, step):
        self.emitted += [(one.name, dict(one.attributes)) for one in step.emitted]
        for output in step.output:
            match output:
                case steps.Start():
                    self._begin(output)
                case steps.Cancel(activation):
                    self._cancel(activation)
                case steps.SetParameter(component, parameter, value):
                    word = isinstance(value, str)
                    text = f"set {component}.{parameter}{f' {value}' if word else ''}"
                    self.acts.append((text, {} if word else {"value": value}))
                case steps.SwitchMode(component, mode):
                    self.acts.append((f"switch {component} {mode}", {}))
                case steps.SendMessage(component, port, arguments):
                    self.acts.append((f"send {component}.{port}", dict(arguments)))
                case steps.StartTimer(activation, index, seconds, event):
                    self._set_timer(seconds, activation, event, index)

    def _begin(self, start):
        self.runs += 1
        skill = f"{start.component}.{start.skill}"
        self.running[self.runs] = (start.activation, skill)
        if start.within is not None:
            self._set_timer(start.within, start.activation, "within", self.runs)
        self.acts.append(("start", skill, self.runs, dict(start.arguments)))

    def _cancel(self, activation):
        self.timers = [one for one in self.timers if one.activation != activation]
        for run, (owner, skill) in [*self.running.items()]:
            if owner == activation:
                del self.running[run]
                self.acts.append(("stop", skill, run))

    def _set_timer(self, seconds, activation, event, index):
        if seconds >= NEVER:
            return
        self.orders += 1
        self.timers.append(_Timer(self.clock + int(seconds * 1e9 + 0.5), self.orders, activation, event, index))


class PythonPlayer:
    """The generated Python module."""

    def __init__(self, plot):
        self.model = compile_controller(plot)
        self.module: dict[str, Any] = {"__name__": "controller"}
        exec(compile(python_text(self.model, QUEUE), "controller.py", "exec"), self.module)  # noqa: S102  what is tested
        self.controller = self.module["Controller"]()
        self.acts, self.emitted = [], []

    def play(self, calls):
        """The records of the start and of each call."""
        yield self._record(self.controller.init(self))
        for call in calls:
            yield self._record(self._make(call))

    def _make(self, call):
        if call.what == "step":
            return self.controller.step(call.now)
        event = self.model.events.index(call.event)
        if call.what == "end":
            return self.controller.end(call.run, event, call.data)
        return self.controller.post(event, call.data)

    def _record(self, status):
        one, model = self.controller, self.model
        active = tuple(model.nodes[index].name for index in one.configuration())
        data = {name: getattr(one.data, word) for name, word in zip(model.data, identifiers(model.data), strict=True)}
        record = Record(int(status), one.ended, active, self.acts, self.emitted, data, one.dropped)
        self.acts, self.emitted = [], []
        return record

    # -- the host ----------------------------------------------------------------------------------------

    def start(self, activity, run, arguments):
        self.acts.append(("start", self.model.activities[activity].skill, run, dict(arguments)))

    def stop(self, activity, run):
        self.acts.append(("stop", self.model.activities[activity].skill, run))

    def command(self, command, arguments):
        self.acts.append((self.model.commands[command], dict(arguments)))

    def emit(self, event, data):
        self.emitted.append((self.model.events[event], dict(data)))


DRIVER = r"""
static struct chart chart_it;
static void chart_say_start(void *context, int activity, uint32_t run, const struct chart_arguments *a)
{
    (void)context; printf("S %d %lu", activity, (unsigned long)run); @ARGUMENTS@ printf("\n");
}
static void chart_say_stop(void *context, int activity, uint32_t run)
{
    (void)context; printf("X %d %lu\n", activity, (unsigned long)run);
}
static void chart_say_command(void *context, int command, const struct chart_arguments *a)
{
    (void)context; printf("C %d", command); @ARGUMENTS@ printf("\n");
}
static void chart_say_emit(void *context, int event, const struct chart_attributes *a)
{
    (void)context; printf("E %d", event); @ATTRIBUTES@ printf("\n");
}
static void chart_say(int status)
{
    int states[CHART_NODES];
    const int count = chart_configuration(&chart_it, states);
    printf("R %d %d %lu", status, chart_it.ended, (unsigned long)chart_it.dropped);
    for (int i = 0; i < count; i++) { printf(" %d", states[i]); }
    printf("\nV"); @DATA@ printf("\n");
}
static void chart_play(void)
{
    const struct chart_host host = {NULL, chart_say_start, chart_say_stop, chart_say_command, chart_say_emit};
    char what; long long now, n; unsigned long run; int event, has_n, has_z, has_b, b; double z;
    chart_say(chart_init(&chart_it, &host, NULL, 0));
    while (scanf(" %c", &what) == 1 && what != '.') {
        if (what == 's' && scanf("%lld", &now) == 1) { chart_say(chart_step(&chart_it, now)); continue; }
        struct chart_attributes data;
        memset(&data, 0, sizeof data);
        if (scanf("%lu %d %d %lld %d %lf %d %d", &run, &event, &has_n, &n, &has_z, &z, &has_b, &b) != 8) { abort(); }
        data.has_n = has_n; data.n = n; data.has_z = has_z; data.z = z; data.has_b = has_b; data.b = b;
        chart_say(run ? chart_end(&chart_it, (uint32_t)run, event, &data) : chart_post(&chart_it, event, &data));
    }
}
"""
MAIN = 'int main(void)\n{\n    int number;\n    while (scanf("%d", &number) == 1) {\n        switch (number) {\n'
SANITIZED = (
    "-fsanitize=address,undefined", "-fsanitize-undefined-trap-on-error",
    "-O0", "--param", "asan-instrumentation-with-call-threshold=0",
)  # fmt: skip
"""Options of gcc for programs that end at a wrong access or undefined behaviour; the last ones halve its time."""
COMPILERS = [one for one in map(shutil.which, ("gcc", "clang")) if one is not None]
LEVELS = ("-O0", "-O2", "-O3", "-Os", "-fsanitize=address,undefined")
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic")


def compile_at_levels(folder, text, compilers=COMPILERS):
    """Compile the C file of a controller alone, at each level of optimization; a warning is an error."""
    (folder / "alone.c").write_text(text, encoding="utf-8")
    for compiler in compilers:
        for level in LEVELS:
            subprocess.run([compiler, *STRICT, level, "-c", "alone.c"], check=True, timeout=120, cwd=folder)


def compile_players(folder, models, driver, cc, flags):
    """Compile the C files of controllers with their drivers to one program; without a driver, with that of the plays."""
    parts = ["#include <stdio.h>\n#include <stdlib.h>\n"]
    for model in models:
        name = identifier(model.name)
        (folder / f"{name}.c").write_text(c_text(model, QUEUE), encoding="utf-8")
        parts.append(f'#include "{name}.c"\n{_named(driver or _driver(model), name)}')
    calls = [f"        case {n}: {identifier(model.name)}_play(); break;\n" for n, model in enumerate(models)]
    parts.append(f"{MAIN}{''.join(calls)}        default: return 1;\n        }}\n        fflush(stdout);\n    }}\n}}\n")
    (folder / "main.c").write_text("".join(parts), encoding="utf-8")
    program = folder / "players"
    subprocess.run([cc, *STRICT, *flags, "-o", program, "main.c"], check=True, timeout=600, cwd=folder)
    return program


def run_players(program, text):
    """Return the lines that a program writes for a text."""
    done = subprocess.run([program], input=text, capture_output=True, text=True, check=False, timeout=600)
    if done.returncode:
        raise AssertionError(f"the C program ended with {done.returncode}: {done.stderr[-3000:]}")
    return done.stdout.splitlines()


class CPlayers:
    """The generated C files of several charts, compiled to one program."""

    def __init__(self, folder, plots, cc="cc", flags=SANITIZED):
        self.models = [compile_controller(plot) for plot in plots]
        self.program = compile_players(folder, self.models, None, cc, flags)

    def play(self, plays):
        """The records of each play; a play is the number of its chart and its calls."""
        text = "\n".join(f"{number}\n{''.join(self._line(number, call) for call in calls)}." for number, calls in plays)
        lines = iter(run_players(self.program, text))
        return [[self._record(self.models[number], lines) for _ in range(len(calls) + 1)] for number, calls in plays]

    def _line(self, number, call):
        if call.what == "step":
            return f"s {call.now}\n"
        event, data = self.models[number].events.index(call.event), dict(call.data)
        has = [(int(name in data), data.get(name, 0)) for name in ("n", "z", "b")]
        numbers = " ".join(
            f"{given} {value!r}" if name == 1 else f"{given} {int(value)}" for name, (given, value) in enumerate(has)
        )
        return f"p {call.run} {event} {numbers}\n"

    @staticmethod
    def _record(model, lines):
        acts: list[Any] = []
        emitted: list[Any] = []
        for line in lines:
            what, *words = line.split(" ")
            if what == "R":
                status, ended, dropped, *states = map(int, words)
                active = tuple(model.nodes[index].name for index in states)
                _, *values = next(lines).split(" ")
                return Record(status, bool(ended), active, acts, emitted, _values(values, model.data), dropped)
            number = int(words[0])
            if what == "S":
                acts.append(
                    ("start", model.activities[number].skill, int(words[1]), _values(words[2:], model.arguments))
                )
            elif what == "X":
                acts.append(("stop", model.activities[number].skill, int(words[1])))
            elif what == "C":
                acts.append((model.commands[number], _values(words[1:], model.arguments)))
            else:
                emitted.append((model.events[number], _values(words[1:], model.attributes)))
        raise AssertionError("the program has ended early")


def _values(words, kinds):
    names = dict(zip(identifiers(kinds), kinds, strict=True))
    found = {}
    for word in words:
        name, _, text = word.partition("=")
        kind = kinds[names[name]]
        found[names[name]] = float(text) if kind == "number" else bool(int(text)) if kind == "boolean" else int(text)
    return found


def _driver(model):
    def shown(kinds, value, has):
        forms = {"integer": ("%lld", "(long long)"), "number": ("%.17g", ""), "boolean": ("%d", "")}
        parts = []
        for word, kind in zip(identifiers(kinds), kinds.values(), strict=True):
            form, cast = forms[kind]
            test = f"if (a->has_{word}) " if has else ""
            parts.append(f'{test}{{ printf(" {word}={form}", {cast}{value}{word}); }}')
        return " ".join(parts) or ("(void)a;" if has else "")

    text = DRIVER.replace("@ARGUMENTS@", shown(model.arguments, "a->", has=True))
    text = text.replace("@ATTRIBUTES@", shown(model.attributes, "a->", has=True))
    return text.replace("@DATA@", shown(model.data, "chart_it.data.", has=False))


def _named(text, name):
    return (
        text.replace("CHART_", f"{name.upper()}_")
        .replace("chart_", f"{name}_")
        .replace("struct chart ", f"struct {name} ")
    )

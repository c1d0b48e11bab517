"""What the tests of the state charts share: plots from text, a world of plain facts, a machine in it."""

from __future__ import annotations

import operator as op
import textwrap
from collections.abc import Mapping
from typing import Any

from hypothesis import settings

from dsc.dynamic.library import Library
from dsc.engine.machine import Machine
from dsc.engine.situation import Decision
from dsc.engine.steps import SwitchMode
from dsc.events import Event
from dsc.text.plot_files import parse_plot
from knowledge_base.errors import UnknownNameError
from knowledge_base.facts import Delta, Fact
from knowledge_base.language.syntax import effect as eff
from knowledge_base.language.syntax import expression as lang

PROPERTY = settings(deadline=None, derandomize=True)
"""How properties are tested: the same examples on every machine, however slow it is."""


COMPARE = {"=": op.eq, "!=": op.ne, "<": op.lt, ">": op.gt, "<=": op.le, ">=": op.ge}


def plot(text, source=None):
    """A plot from indented YAML text."""
    return parse_plot(textwrap.dedent(text), source)


class FakeSituation:
    """A world of plain facts and numbers; dynamic states get what the test laid down for them.

    `choices` maps the dynamic state's first candidate (or its goal as it stands) to a `Decision`.
    """

    def __init__(self, facts=(), numbers: Mapping[Fact, float] = {}, choices: Mapping[str, Decision] = {}):
        self.facts = set(facts)
        self.numbers = dict(numbers)
        self.choices = choices
        self.asked: list[Any] = []

    def holds(self, expression, bindings):
        match expression:
            case lang.Atom(predicate, args):
                return Fact(predicate, tuple(self.value(a, bindings) for a in args)) in self.facts
            case lang.Not(body):
                return not self.holds(body, bindings)
            case lang.And(parts):
                return all(self.holds(p, bindings) for p in parts)
            case lang.Or(parts):
                return any(self.holds(p, bindings) for p in parts)
            case lang.Comparison(operator, left, right):
                a, b = self.value(left, bindings), self.value(right, bindings)
                return COMPARE[operator](a, b)
        raise NotImplementedError(expression)

    def answers(self, expression, bindings):
        free = [arg.name for arg in expression.args if isinstance(arg, lang.Variable) and arg.name not in bindings]
        facts = [fact for fact in sorted(self.facts) if fact.predicate == expression.predicate]
        found = [dict(zip([a.name for a in expression.args], fact.args, strict=False)) for fact in facts]
        return [{name: one[name] for name in free} for one in found if self.holds(expression, {**bindings, **one})]

    def value(self, term, bindings):
        match term:
            case lang.Constant(value):
                return value
            case lang.Variable(name):
                if name not in bindings:
                    raise UnknownNameError(f"'?{name}' is not bound", found=name, valid=bindings)
                return bindings[name]
            case lang.Call(function, args):
                return self.numbers.get(Fact(function, tuple(self.value(a, bindings) for a in args)), 0)
            case lang.Arithmetic(operator, args):
                values = [self.value(a, bindings) for a in args]
                return sum(values) if operator == "+" else values[0] - sum(values[1:])
        raise NotImplementedError(term)

    def tell(self, effect, bindings):
        match effect:
            case eff.Add(lang.Atom(predicate, args)):
                told = Delta(added=(Fact(predicate, tuple(self.value(a, bindings) for a in args)),))
            case eff.Delete(lang.Atom(predicate, args)):
                told = Delta(removed=(Fact(predicate, tuple(self.value(a, bindings) for a in args)),))
            case eff.AllOf(parts):
                told = Delta()
                for part in parts:
                    told = told.then(self.tell(part, bindings))
        self.facts -= set(told.removed)
        self.facts |= set(told.added)
        return told

    def now(self):
        return 0.0

    def choose(self, state, holder, bindings, failed=(), activation=0):
        self.asked.append((state, holder, dict(bindings)))
        return self.choices.get(next(iter(state.dynamic), "goal"), Decision(None))


class Run:
    """A machine in a world of plain facts; what the chart tells is committed after every macrostep."""

    def __init__(self, *plots, facts=(), choices: Mapping[str, Decision] = {}):
        self.library = Library(plots)
        self.first = plots[0].name
        self.facts = set(facts)
        self.choices = choices
        self.machine = Machine(self.library)

    def situation(self):
        return FakeSituation(self.facts, choices=self.choices)

    def start(self, **arguments):
        return self._commit(self.machine.start(self.first, arguments, self.situation()))

    def send(self, name, *, to=None, exact=False, number=None, **attributes):
        event = Event(name, attributes, to=self.serial(to) if to else None, exact=exact, number=number)
        return self._commit(self.machine.send(event, self.situation()))

    def time_out(self, state, number=0):
        return self.send("after", to=state, exact=True, number=number)

    def look(self):
        """The world may have changed."""
        return self._commit(self.machine.send(None, self.situation()))

    def serial(self, path):
        """The activation of a state that somebody may send events to, by its path or name."""
        found = next(serial for name, serial in activations(self.machine.state.root) if named(name, path))
        assert found, f"nobody sends events to '{path}'"
        return found

    @property
    def active(self):
        return [path for path in self.machine.state.configuration() if "#" not in path]

    def variables(self, host=None):
        """The variables of the outermost plot, or of the plot inside the state `host`."""
        frame = self.machine.state.root
        for name in host.split("/") if host else ():
            frame = frame.children[name]
        return dict(frame.variables)

    def _commit(self, step):
        self.facts = (self.facts - set(step.knowledge.removed)) | set(step.knowledge.added)
        return step


def named(path, name):
    return path == name or path.endswith("/" + name)


def activations(frame, prefix=""):
    for name, serial in frame.active.items():
        yield prefix + name, serial
        if name in frame.children:
            yield from activations(frame.children[name], f"{prefix}{name}/")


def modes(step):
    """The `switch` actions of a step, in order: what test charts use to show in which order they act."""
    return [output.mode for output in step.output if isinstance(output, SwitchMode)]


def marked(*names):
    """Keys of a state that shows when it is entered and left: `+name`, `-name`."""
    return {
        name: {"entry": {"switch": "log", "to": f"+{name}"}, "exit": {"switch": "log", "to": f"-{name}"}}
        for name in names
    }


EVERYTHING = plot("""
    plot: everything
    about: "one of each kind: a # in it"
    parameters: {item: item, to: {type: place, default: table}}
    variables: {n: {type: number, initial: 0}, found: item}
    outputs: {where: place, tries: {type: number, initial: 0}}
    receives: {stop: , moved: {who: item}}
    emits: {failed: {reason: text}, lost: }
    when: (and (on ?item table) (not (gone ?item)))
    implements: pick-up
    effects: assumed
    confirm: 2.5
    initial: second
    states:
      first:
        entry:
          - {set: arm.approach, to: side}
          - {trigger: arm.pick, with: {item: ?item, speed: 0.5}, as: {picked: taken}, within: 3}
        exit: {switch: arm, to: neutral}
        on_break: {switch: arm, to: "off"}
        at_least: 0.5
        every: {seconds: 2, when: (p), assign: {n: 0}}
        on:
          taken: {to: second, pass: {a: ?event.item}, clear: [box, "both*"]}
          failed: {emit: failed, with: {reason: ?event.reason}, to: over}
          retry:
            - {to: first, when: (< ?n 3), assign: {n: (+ ?n 1)}, tell: (and (tried ?item) (not (fresh ?item)))}
            - over
          here: {do: [{assign: {n: 1}}, {tell: (p)}, {emit: local, with: {a: 1}}]}
        after: [{seconds: 5, to: over}, {seconds: (* 2 ?n), to: second}]
        always: [{to: second, when: (done)}]
      second: {use: other, with: {a: ?item, text: "two words"}, on: {done: third}}
      third:
        dynamic: [one, two]
        with: {item: ?item}
        goal: (forall (?i - item) (tidy ?i))
        budget: {replans: 1, seconds: 2}
        on: {done: box, no_plan: over, gave_up: over}
      box: {states: {in_a: {on: {e: in_b}}, in_b: {final: true}}, initial: in_a, on: {done: both}}
      both:
        regions:
          left: {states: {l: {}}, initial: l}
          right: {states: {r: {}}}
        on: {stop: over}
      either: {choice: [{when: (p), to: first, assign: {n: 1}}, second]}
      which: {select: ?item, cases: {cup: first, 3: {to: second, when: (p)}, "true": third, '"4"': box}, else: over}
      over: {final: true, emit: lost}
    rules:
      - {on: failed, when: (< (failures ?event.item) 4), of: [second], do: {use: other, with: {a: 1}, then: retry, limit: 2}}
      - {on: failed, do: {tell: (p), then: over}}
""")  # fmt: skip

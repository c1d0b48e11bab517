"""Charts at random, as people write them, and what may happen to them.

Everything is made by one function, `pick(options)`, which a property draws with hypothesis and a hunt for bugs with
`random.Random(seed).choice`. Charts come to rest: `done`, `always` and outcomes lead forward, internal events fire only
later ones. In dialect `scxml`, where borders are crossed, some go round all the same.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import count
from typing import Any

from dsc_charts import Run, activations, marked
from hypothesis import strategies as st

from dsc.engine.steps import StartTimer
from dsc.errors import RunawayError
from dsc.events import Event
from dsc.model.plot import ActionPlot
from dsc.model.transitions import as_tuple
from knowledge_base.facts import Fact

EVENTS = ("e", "f", "g")
GUARDS = ("(p)", "(not (p))", "(q)", "(and (p) (not (q)))", "(< ?v 2)", "(= ?v 2)", "(> ?event.n 1)")
TELLS = ("(p)", "(not (p))", "(and (q) (not (p)))", "(not (q))")
PREFIXES = ("e", "e.x", "e.*", "*", "f", "f e.y", "g")
SENT_IN_SCXML = ("e", "e.x", "e.y", "ex", "f", "g")


@dataclass
class Grower:
    """Makes one library of plots.

    Attributes:
        pick: makes all choices.
        scxml: whether the plots are in that profile.
        private: whether plots may do what depends on where they end: internal events, outcomes, `?event`, history.
        depth: of states inside states.
        bare: whether the chart is one plot without variables and actions, whose state is its configuration alone.
        alone: whether the chart is one plot, without submachine states.
        quiet: whether states and transitions mostly have no actions, so that steps are mere moves; drawn.
    """

    pick: Callable[[Any], Any]
    scxml: bool = False
    private: bool = True
    depth: int = 3
    bare: bool = False
    alone: bool = False
    quiet: bool = False
    plots: list[Any] = field(default_factory=list)
    names: Iterator[int] = field(default_factory=count)

    def chance(self, one_in):
        """True now and then; what shrinks becomes false."""
        return self.pick(range(one_in)) == one_in - 1

    def name(self, letter):
        return f"{letter}{next(self.names)}"

    def library(self):
        """The outermost plot comes first: two regions, which `leave` leaves as a whole and enters anew."""
        self.quiet = self.chance(3)
        inside = Inside(self, "p0")
        regions = {f"r{n}": {"states": inside.scope(self.depth - n)} for n in range(2)}
        heard = {"done.state": [{} if self.bare else {"assign": {"v": "(+ ?v 1)"}}]} if self.scxml else {}
        top = {"regions": regions, "on": {"leave": "away", **heard}, **inside.shown("top")}
        inside.finish({"top": top, "away": {"on": {"leave": "top"}}})
        return self.plots[::-1]


@dataclass
class Inside:
    """Makes the states of one plot."""

    grower: Grower
    plot: str
    form: dict[str, Any] = field(default_factory=dict)
    states: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self):
        self.pick, self.chance = self.grower.pick, self.grower.chance

    def finish(self, states, **more):
        variables = {} if self.grower.bare else {"v": {"type": "number", "initial": 0}}
        form = {"plot": self.plot, "states": states, "variables": variables, **more}
        if self.grower.scxml:
            form["dialect"] = "scxml"
            Borders(self).cross()
        for transition in self.transitions():
            if "use" in self.states.get(transition.get("to"), ()) and self.chance(3):
                transition["pass"] = {"w": self.pick((2, "?v"))}
        self.grower.plots.append(ActionPlot.model_validate(form))

    def transitions(self):
        """Those that an event from outside or time triggers."""
        for form in self.states.values():
            on = form.get("on", {})
            yield from (one for event in on if event in (*EVENTS, *PREFIXES) for one in on[event])
            yield from (one for key in ("after", "every") for one in form.get(key, ()))

    # -- states ------------------------------------------------------------------------------------------

    def scope(self, depth):
        """One to four states side by side, with their transitions."""
        names = [self.grower.name("s") for _ in range(self.pick((1, 2, 2, 3, 4)))]
        kinds = [self._kind(depth, is_last=name is names[-1]) for name in names]
        found = {}
        for place, (name, kind) in enumerate(zip(names, kinds, strict=True)):
            later = names[place + 1 :]
            found[name] = getattr(self, f"_{kind}")(name, depth, names, later)
        return found

    def _kind(self, depth, is_last):
        kinds = ["simple", "simple", "simple", "final"]
        bare = self.grower.bare
        if not is_last:
            kinds += ["choice"] if bare else ["choice", "select"]
        if depth > 0:
            kinds += ["composite", "orthogonal", *(() if bare or self.grower.alone else ("plot", "plot"))]
        return self.pick(kinds)

    def shown(self, name):
        """Keys that show when it is entered, left and interrupted."""
        if self.grower.bare or (self.grower.quiet and self.pick(range(5))):
            return {"entry": []}
        keys = dict(marked(name)[name])
        if self.chance(2):
            keys["on_break"] = {"switch": "log", "to": f"!{name}"}
        if self.chance(4):
            keys["entry"] = [{"trigger": "arm.go"}, keys["entry"]]
        if self.grower.scxml and self.chance(3):
            keys["entry"] = [*as_tuple(keys["entry"]), self._inner_action()]
        if self.grower.scxml and self.chance(4):
            blocks = [{"block": [self._inner_action() for _ in range(2)]} for _ in range(2)]
            key = self.pick(("entry", "exit"))
            keys[key] = [*as_tuple(keys[key]), *blocks]
        return keys

    def _inner_action(self):
        emit = {"emit": "k"} if self.grower.private else {"tell": "(p)"}
        failing = (
            [{"assign": {"v": "?event.n"}}, {"emit": "k", "with": {"n": "?event.n"}}] if self.grower.private else []
        )
        count = {"assign": {"v": "(+ ?v 1)"}}
        return self.pick((count, {"tell": self.pick(TELLS)}, emit, self._branch(), *failing))

    def _branch(self):
        """Its condition may ask for an attribute that the event does not have."""
        guards = [f"(in-state {self.pick([*self.states])})" if self.states else "(p)"]
        guards += ["(> ?event.n 1)", "(or (p) (> ?event.n 1))"] if self.grower.private else []
        return {"if": self.pick(guards), "then": [{"tell": "(q)"}], "else": [{"assign": {"v": 1}}]}

    def _remember(self, name, form):
        self.states[name] = form
        return form

    def _simple(self, name, depth, anywhere, later):
        return self._remember(name, {**self.shown(name), **self._ways(anywhere, later)})

    def _final(self, name, depth, anywhere, later):
        return self._remember(name, {"final": True})

    def _choice(self, name, depth, anywhere, later):
        branches = [self._effect({"to": self.pick(later), "when": self._guard()}) for _ in range(self.pick((0, 1, 2)))]
        return {"choice": [*branches, self._effect({"to": self.pick(later)})]}

    def _select(self, name, depth, anywhere, later):
        cases = {"1": self._effect({"to": self.pick(later)}), "2": {"to": self.pick(later), "when": self._guard()}}
        return {
            "select": self.pick(("?v", "?v", "?event.n") if self.grower.private else ("?v",)),
            "cases": cases,
            "else": self.pick(later),
        }

    def _composite(self, name, depth, anywhere, later):
        form = self._remember(name, {})
        form.update(states=self.scope(depth - 1), **self.shown(name), **self._ways(anywhere, later))
        return form

    def _orthogonal(self, name, depth, anywhere, later):
        form = self._remember(name, {})
        regions = dict(self._region(f"{name}_{n}", depth) for n in range(2))
        form.update(regions=regions, **self.shown(name), **self._ways(anywhere, later))
        return form

    def _region(self, name, depth):
        """A region; in SCXML one that is named as its only state stands for that state: a parallel in a parallel."""
        if self.grower.scxml and depth > 0 and self.chance(4):
            inner = self.grower.name("s")
            return inner, {"states": {inner: self._orthogonal(inner, depth - 1, [inner], [])}}
        states = self.scope(depth - 1)
        alone = self.grower.scxml and len(states) == 1 and self.chance(2)
        return next(iter(states)) if alone else name, {"states": states}

    def _plot(self, name, depth, anywhere, later):
        """A submachine state; its plot ends with the outcome `out` or just ends."""
        used = f"p_{name}"
        inner = Inside(self.grower, used)
        states = inner.scope(depth - 1)
        states["over"] = {"final": True, **({"emit": "out"} if self.grower.private and self.chance(3) else {})}
        inner.states["over"] = states["over"]
        outputs = {"v2": {"type": "number", "initial": "(+ ?w 1)"}}
        inner.finish(states, emits={"out": {}}, outputs=outputs, parameters={"w": {"type": "number", "default": 1}})
        form = self._remember(name, {"use": used, **self.shown(name), **self._ways(anywhere, later)})
        if self.chance(2):
            form["with"] = {"w": "?v"}
        if self.grower.private and self.chance(2):
            form["on"]["out"] = [{"to": self.pick(later)}] if later else [{"tell": "(q)"}]
        return form

    # -- transitions -------------------------------------------------------------------------------------

    def _ways(self, anywhere, later):
        outcome = () if self.plot == "p0" else ("out",)
        on = {event: self._listed(anywhere, emits=("i", "j", "k", *outcome)) for event in self._received()}
        on |= {"i": self._listed(anywhere, emits=("j", "k"))} if self.chance(4) else {}
        on |= {"j": self._listed(anywhere, emits=("k",))} if self.chance(4) else {}
        on |= {"k": [self._effect({})]} if self.chance(3) else {}
        on |= {self._error(): self.pick(later)} if later and self.chance(3) else {}
        ways: dict[str, Any] = {"on": on}
        if later and not self.grower.bare and self.chance(2):
            on["done"] = [{"to": self.pick(later), **({"assign": {"v": 1}} if self.chance(2) else {})}]
        if later and self.chance(4):
            ways["always"] = [self._effect({"to": self.pick(later), "when": self._guard()})]
        return ways | self._times(anywhere)

    def _error(self):
        return "error.execution" if self.grower.scxml else "error"

    def _received(self):
        events: Sequence[str] = PREFIXES if self.grower.scxml else EVENTS
        events = events if self.grower.private else [one for one in events if one != "*"]
        return [event for event in events if self.chance(2 if len(events) == 3 else 4)]

    def _times(self, anywhere):
        ways: dict[str, Any] = {}
        if self.grower.bare or (self.grower.quiet and self.pick(range(5))):
            return ways
        if self.chance(5):
            ways["at_least"] = 1
        if self.chance(5):
            ways["after"] = [{"seconds": 2, **self._transition(anywhere, ("i",))}]
        if self.chance(5):
            ways["every"] = [{"seconds": 1, **self._transition(anywhere, ())}]
        return ways

    def _listed(self, anywhere, emits):
        return [self._transition(anywhere, emits) for _ in range(self.pick((1, 1, 2)))]

    def _transition(self, anywhere, emits):
        form = {"to": self.pick(anywhere)} if self.pick(range(4)) else {}
        if self.chance(3):
            form["when"] = self._guard()
        if emits and self.grower.private and not self.grower.bare and self.chance(4):
            form["emit"] = self.pick(emits)
        return self._effect(form)

    def _guard(self):
        if self.grower.bare:
            return self.pick(GUARDS[:4])
        return self.pick(GUARDS if self.grower.private else GUARDS[:-1])

    def _effect(self, form):
        if self.grower.bare or (self.grower.quiet and self.pick(range(5))):
            return form
        if self.chance(4):
            form["tell"] = self.pick(TELLS)
        if self.chance(4):
            form["assign"] = {"v": self.pick(("(+ ?v 1)", 0, "?event.n") if self.grower.private else ("(+ ?v 1)", 0))}
        return form


@dataclass
class Borders:
    """What only dialect `scxml` has, put into a plot whose states are there."""

    inside: Inside

    def __post_init__(self):
        self.pick, self.chance = self.inside.pick, self.inside.chance

    def cross(self):
        holders = [(name, form) for name, form in self.inside.states.items() if "states" in form or "regions" in form]
        histories = [name for _, form in holders for name in self._histories(form)]
        remembering = [name for name, form in holders if any(one in str(form) for one in histories)]
        for name, form in [*self.inside.states.items()]:
            self._completion(name, form)
        for transition in self.inside.transitions():
            self._lead_away(transition, [*self.inside.states, *histories, *histories], holders)
            if remembering and self.chance(5):
                transition["clear"] = self.pick(remembering) + self.pick(("", "*"))

    def _histories(self, form):
        """Histories of a composite state, of an orthogonal one, or in one of its regions."""
        if not self.inside.grower.private or not self.chance(2):
            return []
        name = self.inside.grower.name("h")
        scopes = [form] if "states" in form else [form, *form["regions"].values()]
        scope = self.pick(scopes)
        within = [*_names(scope)]
        history = {"history": self.pick(("shallow", "deep")), "to": self.pick(within)}
        scope.setdefault("states" if "states" in scope else "connectors", {})[name] = history
        if self.chance(2):
            history["do"] = [{"tell": self.pick(TELLS)}]
        if "states" in scope and self.chance(3):
            scope["initial"] = self.pick([name, *within])
        return [name]

    def _completion(self, name, form):
        on = form.get("on", {})
        if "done" in on:
            on[f"done.state.{name}"] = on.pop("done")

    def _lead_away(self, transition, anywhere, holders):
        if self.chance(4):
            asked = f"(in-state {self.pick([*self.inside.states])})"
            transition["when"] = self.pick((asked, f"(or {asked} (p))", f"(and (q) (not {asked}))"))
        if self.chance(2):
            transition["to"] = self.pick(anywhere)
        if "to" in transition and self.chance(4):
            transition["internal"] = True
        orthogonal = [form for _, form in holders if "regions" in form]
        if orthogonal and self.chance(4):
            first, second = [self.pick([*_names(one)]) for one in self.pick(orthogonal)["regions"].values()]
            transition.update({"to": first, "also": [second]} if self.chance(2) else {"to": second, "also": [first]})


def _names(scope):
    """All states inside, at every level; no histories."""
    inner = [scope] if "states" in scope else scope.get("regions", {}).values()
    for states in (one["states"] for one in inner):
        for name, form in states.items():
            if "history" not in form:
                yield name
            yield from _names(form)


def in_place(plots):
    """The same chart as one plot: what submachine states use is written where they stand, as composite states.

    Variables get names of their own and their first values when the state is entered.
    """
    forms = {plot.name: plot.to_form() for plot in plots}
    outermost = forms[plots[0].name]
    return ActionPlot.model_validate(
        {**outermost, "states": _written_out(outermost["states"], forms, outermost["variables"])}
    )


def _written_out(form, forms, variables):
    if isinstance(form, list):
        return [_written_out(one, forms, variables) for one in form]
    if not isinstance(form, dict):
        return form
    form = {key: _written_out(value, forms, variables) for key, value in form.items() if key not in ("pass", "with")}
    used = form.pop("use", None)
    if used is not None:
        own = f"v{used}"
        variables[own] = {"type": "number", "initial": 0}
        form["entry"] = [*form.get("entry", ()), {"assign": {own: 0}}]
        form["states"] = _written_out(_renamed(forms[used]["states"], own, used), forms, variables)
    return form


def _renamed(form, variable, plot):
    """What a plot calls `v` and `over`, under names that are unique in another plot."""
    if isinstance(form, dict):
        names = {"v": variable, "over": f"over_{plot}"}
        return {names.get(key, key): _renamed(value, variable, plot) for key, value in form.items()}
    if isinstance(form, list):
        return [_renamed(one, variable, plot) for one in form]
    if isinstance(form, str):
        return f"over_{plot}" if form == "over" else form.replace("?v", f"?{variable}")
    return form


@st.composite
def libraries(draw: st.DrawFn, /, **features):
    """Plots; the first one is the outermost."""
    return Grower(lambda options: draw(st.sampled_from(options)), **features).library()


@st.composite
def happenings(draw: st.DrawFn, /, **features):
    """What happens to a chart."""
    return some_happenings(lambda options: draw(st.sampled_from(options)), **features)


def some_happenings(pick, scxml=False):
    """Things that happen, as (what, to which of those it can happen to, attributes)."""
    events = SENT_IN_SCXML if scxml else EVENTS
    kinds = (*events, *events, "leave", "to", "time", "time")
    attributes: tuple[dict[str, int], ...] = ({}, {"n": 1}, {"n": 2})
    return [(pick(kinds), pick(range(8)), pick(attributes)) for _ in range(pick(range(4, 11)))]


class Played(Run):
    """A run to which random things happen.

    Timers go off in the order in which they were asked for; a chart that goes round ends the play.
    """

    def __init__(self, *plots):
        super().__init__(*plots)
        self.timers = []

    def steps(self, happened):
        try:
            yield self.after(self.start())
            for what, which, attributes in happened:
                event = self.event(what, which, attributes)
                if event is not None:
                    yield self.after(self._commit(self.machine.send(event, self.situation())))
        except RunawayError:
            return

    def event(self, what, which, attributes):
        if what == "time":
            return self.timer(which)
        if what == "to":
            root = self.machine.state.root
            serials = [serial for _, serial in activations(root) if serial] if root else []
            return Event("e", attributes, to=serials[which % len(serials)]) if serials else None
        if what in ("p", "q"):
            self.facts ^= {Fact(what)}
            return None
        return self.made(what, attributes)

    def made(self, what, attributes):
        return Event(what, attributes)

    def timer(self, which):
        if not self.timers:
            return None
        timer = self.timers.pop(which % len(self.timers))
        return Event(timer.event, to=timer.activation, exact=True, number=timer.index)

    def after(self, step):
        self.timers += [one for one in step.output if isinstance(one, StartTimer)]
        self.timers = [one for one in self.timers if step.state.state_of(one.activation)]
        return step

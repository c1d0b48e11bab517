"""What holds of every chart and every sequence of events."""

from __future__ import annotations

import itertools
import json
from dataclasses import dataclass, field

from dsc_charts import PROPERTY, Run, marked, modes
from hypothesis import given, settings
from hypothesis import strategies as st

from dsc.engine.state import MachineState
from dsc.model.plot import ActionPlot
from dsc.model.states import SubmachineState

EVENTS = ("e", "f", "g")


@dataclass
class Spec:
    """A state to be: its kind, its transitions, the scopes inside."""

    name: str
    kind: str
    on: dict = field(default_factory=dict)
    scopes: list = field(default_factory=list)


@st.composite
def scopes(draw, names, depth):
    count = draw(st.integers(1, 3))
    states = [draw(specs(names, depth)) for _ in range(count)]
    for number, state in enumerate(states):
        if state.kind != "final":
            # Completion only leads forward, so that every macrostep comes to an end.
            later = [other.name for other in states[number + 1 :]]
            anywhere = [other.name for other in states]
            state.on = draw(transitions(anywhere, later))
    return states


@st.composite
def specs(draw, names, depth):
    kinds = ["simple", "simple", "final", "composite", "orthogonal", "plot", "plot"]
    kind = draw(st.sampled_from(kinds if depth > 0 else kinds[:3]))
    name = f"s{next(names)}"
    inside = {"composite": 1, "plot": 1, "orthogonal": 2}.get(kind, 0)
    return Spec(name, kind, scopes=[draw(scopes(names, depth - 1)) for _ in range(inside)])


@st.composite
def transitions(draw, anywhere, later):
    on = {}
    for event in EVENTS:
        if draw(st.booleans()):
            transition = {}
            if draw(st.integers(0, 4)):
                transition["to"] = draw(st.sampled_from(anywhere))
            if not draw(st.integers(0, 3)):
                transition["when"] = draw(st.sampled_from(["(p)", "(not (p))"]))
            if not draw(st.integers(0, 3)):
                transition["tell"] = draw(st.sampled_from(["(p)", "(not (p))"]))
            on[event] = [transition]
    if later and draw(st.booleans()):
        on["done"] = draw(st.sampled_from(later))
    return on


@st.composite
def charts(draw):
    """Two regions at random, which `leave` leaves as a whole and enters anew."""
    names = itertools.count()
    regions = [draw(scopes(names, 3)), draw(scopes(names, 2))]
    return [Spec("top", "orthogonal", {"leave": "away"}, regions), Spec("away", "simple", {"leave": "top"})]


def form_of(states, plots):
    """The states as people write them; `plots` collects the plots, or is `None` for all in one chart."""
    found = {}
    for state in states:
        inner = [form_of(scope, plots) for scope in state.scopes]
        shape = {
            "simple": {},
            "final": {"final": True},
            "composite": {"states": inner[0]} if inner else {},
            "orthogonal": {"regions": {f"r{n}": {"states": one} for n, one in enumerate(inner)}},
            "plot": {"states": inner[0]} if inner else {},
        }[state.kind]
        if state.kind == "plot" and plots is not None:
            plots.append(ActionPlot.model_validate({"plot": f"plot_of_{state.name}", "states": inner[0]}))
            shape = {"use": f"plot_of_{state.name}"}
        shown = {} if state.kind == "final" else marked(state.name)[state.name]
        found[state.name] = {**shape, **shown, **({"on": state.on} if state.on else {})}
    return found


def bound(chart):
    plots = []
    outer = ActionPlot.model_validate({"plot": "p", "states": form_of(chart, plots)})
    return Run(outer, *plots)


def in_place(chart):
    return Run(ActionPlot.model_validate({"plot": "p", "states": form_of(chart, None)}))


def steps_of(run, events):
    yield run.start()
    for event in events:
        yield run.send(event)


def check_legal(frame):
    """One child of every composite, all regions, everything around active, plots in active hosts alone."""
    nodes, index = frame.compiled.nodes, frame.compiled.index
    active = frame.configuration.members
    for node in nodes:
        if node.index == 0 or node.index in active:
            inside = [child for child in node.children if child in active]
            assert len(inside) == (len(node.children) if node.orthogonal else min(1, len(node.children)))
        else:
            assert not active & set(node.children)
    hosts = {name for name in frame.active if isinstance(nodes[index[name]].state, SubmachineState)}
    assert set(frame.children) == hosts
    for child in frame.children.values():
        check_legal(child)


def serials_of(frame):
    yield frame.serial
    yield from frame.activations.values()
    for child in frame.children.values():
        yield from serials_of(child)


EVENT_LISTS = st.lists(st.sampled_from((*EVENTS, "leave")), max_size=8)


@PROPERTY
@given(charts(), EVENT_LISTS)
def test_the_configuration_is_legal_after_every_step(chart, events):
    run = bound(chart)
    for step in steps_of(run, events):
        assert (step.state.root is None) == step.state.finished
        if step.state.root is not None:
            check_legal(step.state.root)
            serials = list(serials_of(step.state.root))
            assert len(serials) == len(set(serials))
            assert max(serials) <= step.state.serials


@PROPERTY
@given(charts(), EVENT_LISTS)
def test_what_is_entered_was_not_active_and_what_is_left_was(chart, events):
    run = bound(chart)
    active, running = set(), set()
    for step in steps_of(run, events):
        for micro in step.microsteps:
            assert active >= set(micro.exited)
            active -= set(micro.exited)
            assert not active & set(micro.entered)
            active |= set(micro.entered)
            assert len(micro.entered) == len(set(micro.entered))
        assert active == set(step.state.configuration())
        for mode in modes(step):
            (running.add if mode[0] == "+" else running.remove)(mode[1:])


@PROPERTY
@given(charts(), EVENT_LISTS)
def test_a_plot_acts_alike_bound_as_content_and_written_in_place(chart, events):
    one, other = bound(chart), in_place(chart)
    for a, b in zip(steps_of(one, events), steps_of(other, events), strict=True):
        assert modes(a) == modes(b)
        assert a.handled == b.handled
        assert a.knowledge == b.knowledge
        assert [m.event for m in a.microsteps if m.event and m.event.name != "done"] == [
            m.event for m in b.microsteps if m.event and m.event.name != "done"
        ]
        assert [path.rsplit("/")[-1] for path in one.active] == other.active


@settings(PROPERTY, max_examples=50)
@given(charts(), EVENT_LISTS)
def test_the_same_input_gives_the_same_output_also_after_being_stored(chart, events):
    one, other = bound(chart), bound(chart)
    for a, b in zip(steps_of(one, events), steps_of(other, events), strict=True):
        assert a == b
        stored = json.loads(json.dumps(other.machine.state.to_json()))
        other.machine.state = MachineState.from_json(stored, other.library)


@settings(PROPERTY, max_examples=50)
@given(charts(), EVENT_LISTS)
def test_without_trigger_a_chart_at_rest_stays_at_rest(chart, events):
    run = bound(chart)
    for step in steps_of(run, events):
        assert not run.look().moved
        assert step.state == run.machine.state

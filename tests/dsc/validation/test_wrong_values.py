"""Wrong values at the entrances for programs: words about what was found and what is wanted, never a traceback from inside."""

from __future__ import annotations

import inspect
import re
from dataclasses import dataclass
from functools import partialmethod
from pathlib import Path
from typing import Annotated

import pytest

from dsc import (
    ActionPlot,
    Component,
    Event,
    Library,
    Outcome,
    Sequencer,
    SkillCall,
    component_of,
    event,
    load_library,
    load_plot,
    parse_plot,
    primitive_plot,
    query,
    skill,
    takes,
)
from dsc.components.assembly import require_instances
from dsc.sequencer.clock import LoopClock, run_simulated
from dsc.validation import validate_library, validate_plot
from knowledge_base import InputError, KnowledgeBase
from knowledge_base.world.schema import Schema
from planning import PlannerProcess, Robot

PLOT = parse_plot("""
plot: p
parameters: {n: number, why: {type: text, default: nothing}}
receives: {stop: }
states: {a: {on: {stop: e}, after: {seconds: 1, to: e}}, e: {final: true}}
""")


Item = Annotated[str, "item"]


class Ok(Outcome): ...


class Progress(Outcome):
    share: float


class Arm(Component):
    name = "arm"

    @skill
    async def go(self, call) -> Ok:
        return Ok()


def sequencer(components=()):
    return Sequencer(Library([PLOT]), KnowledgeBase(Schema()), components or [Arm()], LoopClock())


def at_work(act):
    """The act, while there is a sequencer."""

    async def main():
        done = act(sequencer())
        return await done if hasattr(done, "__await__") else done

    return lambda: run_simulated(main())


def executive(components, plots=(PLOT,), **more):
    return lambda: Robot("(define (domain d))", plots, components, **more, clock="simulated")


def sequencer_of(**other):
    """Making one with something else in one place."""

    async def main():
        Sequencer(
            **{
                "library": Library([PLOT]),
                "knowledge": KnowledgeBase(Schema()),
                "components": (),
                "clock": LoopClock(),
                **other,
            }
        )

    return lambda: run_simulated(main())


@pytest.mark.parametrize(
    ("act", "said"),
    [
        (at_work(lambda run: run.post("stop")), "an event is an Event with its attributes, as Event(\"stop\", {}), not 'stop'"),
        (at_work(lambda run: run.post(Event("stop", ["a"]))), "an event is an Event with its attributes"),  # type: ignore[arg-type]
        (at_work(lambda run: run.post(Event("stop"), after="soon")), "a finite number of seconds, not 'soon'"),
        (at_work(lambda run: run.post(Event("stop"), after=float("nan"))), "a finite number of seconds, not nan"),
        (at_work(lambda run: run.change([1], "me")), "a change is a Delta, not [1]"),
        (at_work(lambda run: run.set_parameter("p", ["n"], 5)), "a parameter's name is text, not ['n']"),
        (at_work(lambda run: run.run(None)), "there is no plot 'None'"),
        (at_work(lambda run: run.run("p", ["n"])), "arguments are a mapping of parameters' names to values, not ['n']"),
        (at_work(lambda run: run.run("p", {"n": "three"})), "'p.n' is a finite number, not 'three'"),
        (at_work(lambda run: run.run("p", {"n": 1, "why": {2}})), "'p.why' is text, not {2}"),
        (at_work(lambda _: sequencer([Arm]) and None), "an instance is made by Arm()"),
        (at_work(lambda _: sequencer([Arm(), Arm()]) and None), "two components are named 'arm'"),
        (sequencer_of(library=[PLOT]), "the plots are given as a Library, made by Library(plots), not [ActionPlot(name='p'"),
        (sequencer_of(knowledge=5), "the knowledge is a KnowledgeBase, not 5"),
        (sequencer_of(components=5), "components are given as a list, not as 5"),
        (sequencer_of(components="arm"), "components are given as a list, not as 'arm'"),
        (sequencer_of(clock=5), "the clock is a LoopClock, made inside the loop that runs the sequencer, not 5"),
        (sequencer_of(trace=[]), "a trace is a Trace, not []"),
        (sequencer_of(store="a.kb"), "a store is a RunStore, not 'a.kb'"),
        (lambda: Library(5), "a library is made of a list of plots, not of 5"),  # type: ignore[arg-type]
        (lambda: validate_plot("p", Library()), "a plot is an ActionPlot, as load_plot and parse_plot give it, not 'p'"),  # type: ignore[arg-type]
        (lambda: validate_plot(PLOT, [PLOT]), "the plots are given as a Library, made by Library(plots), not ["),  # type: ignore[arg-type]
        (lambda: validate_plot(PLOT, Library(), "(define"), "a schema is a Schema; Schema.parse reads its text, not '(define'"),  # type: ignore[arg-type]
        (lambda: validate_plot(PLOT, Library(), None, 5), "the signatures of skills are given as a list, not as 5"),  # type: ignore[arg-type]
        (lambda: validate_plot(PLOT, Library(), None, ["go"]), "a skill is known by its SkillSignature, as the skills() of a component give it, not 'go'"),  # type: ignore[list-item]
        (lambda: validate_library([PLOT], None, None), "the plots are given as a Library"),  # type: ignore[arg-type]
        (lambda: Library(["p"]), "a plot is an ActionPlot, as load_plot and parse_plot give it, not 'p'"),  # type: ignore[list-item]
        (lambda: Library(PLOT), "a library is made of a list of plots"),  # type: ignore[arg-type]
        (lambda: parse_plot(None), "the YAML text is text, not None"),  # type: ignore[arg-type]
        (lambda: load_plot(5), "a file or folder is named by a text or a Path, not 5"),  # type: ignore[arg-type]
        (lambda: load_library(None), "a file or folder is named by a text or a Path, not None"),  # type: ignore[arg-type]
        (lambda: load_library("/nowhere"), "there are no plots (*.yaml) in '/nowhere'"),
        (lambda: ActionPlot.model_validate("p"), "a mapping was expected; found 'p'"),
        (lambda: skill({"ok": {}}), "`@skill` decorates a function, whose annotations declare it, not {'ok': {}}"),  # type: ignore[call-overload]
        (lambda: skill(lambda call: None), "'<lambda>' has no return annotation; write its outcomes"),  # type: ignore[type-var]
        (lambda: skill(blocking="tread"), "blocks in a thread or a process, not 'tread'; did you mean 'thread'?"),  # type: ignore[call-overload]
        (lambda: query(["hours"]), "`@query` decorates a function, whose annotations declare it, not ['hours']"),  # type: ignore[type-var]
        (lambda: event(5), "`@event` decorates a function, whose annotations declare it, not 5"),  # type: ignore[type-var]
        (lambda: takes(5), "`@takes` decorates a function, whose annotations declare it, not 5"),  # type: ignore[type-var]
        (lambda: component_of("arm", "go"), "'go' is not a skill: decorate a function with `skill`"),  # type: ignore[arg-type]
        (lambda: primitive_plot(Arm().skills()["go"], done="okk"), "no outcome 'okk'; did you mean 'ok'?"),
        (executive([Arm]), "an instance is made by Arm()"),
        (executive(["arm"]), "a component is an instance of a subclass of Component, not 'arm'"),
        (executive([Arm(), Arm()]), "two components are named 'arm'"),
        (executive([], ["p"]), "a plot is an ActionPlot"),
        (lambda: Robot(5, [PLOT], [], clock="simulated"), "a planning domain is a PlanningDomain, a PDDL file or its text, not 5"),  # type: ignore[arg-type]
        (lambda: Robot("(define (domain d))", 5, [], clock="simulated"), "a library is made of a list of plots, not of 5"),  # type: ignore[arg-type]
        (executive(5), "components are given as a list, not as 5"),
        (executive([], knowledge=5), "the knowledge is a KnowledgeBase, not 5"),
        (executive([], planner="fast"), "a planner needs a method 'solve', which 'fast' lacks"),
        (executive([], planner=PlannerProcess), "a planner is an object, not a class; an instance is made by PlannerProcess()"),
        (executive([], foresight=5), "a foresight needs a method 'foresee', which 5 lacks"),
        (executive([], store=5), "a store is named by a text or a Path, not 5"),
        (lambda: Robot("nowhere.pddl", [PLOT], [], clock="simulated"), "there is no file 'nowhere.pddl'"),
    ],
)  # fmt: skip
def test_a_wrong_value_is_refused_in_words(act, said):
    with pytest.raises(InputError, match=re.escape(said)):
        act()


def not_a_coroutine():
    @skill  # type: ignore[type-var]
    def go(call) -> Ok:
        return Ok()


def a_blocking_coroutine():
    @skill(blocking="thread")  # type: ignore[type-var]
    async def go(call) -> Ok:
        return Ok()


def without_call():
    class Arm(Component):
        @skill
        async def go(self, item: Item) -> Ok:
            return Ok()


def an_unknown_type():
    class Arm(Component):
        @skill
        async def go(self, call, item: Itme) -> Ok:  # type: ignore[name-defined]  # noqa: F821
            return Ok()


def without_outcomes():
    class Arm(Component):
        @skill
        async def go(self, call):
            return Ok()


def any_outcome():
    class Arm(Component):
        @skill
        async def go(self, call) -> Outcome:
            return Ok()


def no_outcome():
    class Arm(Component):
        @skill  # type: ignore[type-var]
        async def go(self, call) -> Ok | str:
            return Ok()


def perhaps_an_outcome():
    class Arm(Component):
        @skill  # type: ignore[type-var]
        async def go(self, call) -> Ok | None:
            return Ok()


def two_classes_of_one_event():
    class Fine(Outcome, event="ok"): ...

    class Arm(Component):
        @skill
        async def go(self, call) -> Ok | Fine:
            return Ok()


def an_unknown_report():
    class Arm(Component):
        @skill
        async def go(self, call: SkillCall[Progres]) -> Ok:  # type: ignore[name-defined]  # noqa: F821
            return Ok()


def two_answers():
    class Arm(Component):
        @query
        async def free(self) -> Ok | Progress:
            return Ok()


def an_attribute_with_capitals():
    class Low(Outcome):
        batteryLevel: float  # noqa: N815


def a_hidden_method():
    class Arm(Component):
        @skill
        async def receive(self, call) -> Ok:  # type: ignore[override]
            return Ok()


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (not_a_coroutine, "skill 'go' is not a coroutine: write `async def`, or declare it `blocking`"),
        (a_blocking_coroutine, "skill 'go' is a coroutine, and a blocking skill is a plain function: write `def`"),
        (without_call, "skill 'Arm.go' has no parameter for its call: write (self, call, ...), not (self, item)"),
        (
            an_unknown_type,
            "the annotation of 'item' names 'Itme', which does not exist when the class is made; did you mean 'Item'?",
        ),
        (without_outcomes, "'Arm.go' has no return annotation; write its outcomes, as in `-> Grasped | Slipped`"),
        (any_outcome, "the returned value of 'Arm.go' is any Outcome; name its classes, as in `-> Grasped | Slipped`"),
        (no_outcome, "the returned value of 'Arm.go' names str, which is not a subclass of Outcome"),
        (
            perhaps_an_outcome,
            "the returned value of 'Arm.go' may be None, which is not an outcome; a skill that never ends has `-> Never`",
        ),
        (two_classes_of_one_event, "the returned value of 'Arm.go' names two classes for the event 'ok'"),
        (an_unknown_report, "names 'Progres', which does not exist when the class is made; did you mean 'Progress'?"),
        (two_answers, "query 'Arm.free' returns one outcome class, the answer, not 2"),
        (
            an_attribute_with_capitals,
            "attribute 'batteryLevel' of outcome an_attribute_with_capitals.<locals>.Low cannot be read in plots, which have lower-case names; write 'battery_level'",
        ),
        (a_hidden_method, "'receive' of a_hidden_method.<locals>.Arm hides an attribute of every component"),
    ],
)
def test_a_skill_that_can_never_work_is_refused_when_it_is_made_with_its_line(make, said):
    with pytest.raises(InputError, match=re.escape(said)) as refused:
        make()
    assert refused.value.place is not None
    line = Path(__file__).read_text().splitlines()[(refused.value.place.line or 0) - 1]
    assert line.split("#")[0].strip() in {"@skill", "@query", '@skill(blocking="thread")', "class Low(Outcome):"}


METHODS = [name for name in dir(Component) if not name.startswith("_") and inspect.isfunction(getattr(Component, name))]
METHODS.remove("step")  # without a period, it is no hook


def arm_with(name: str, place: str) -> Component:
    """Return a component with an attribute of that name in its class or in its object."""

    class Arm(Component):
        def __init__(self):
            super().__init__()
            if place == "object":
                setattr(self, name, 3)

    if place == "class":
        setattr(Arm, name, 3)
    return Arm()


@pytest.mark.parametrize(
    ("name", "place"),
    [
        *[(name, place) for name in METHODS for place in ("class", "object")],
        ("mode", "class"),
        ("life", "object"),
        ("pushes", "object"),
    ],
)
def test_an_attribute_that_hides_one_of_every_component_is_refused(name, place):
    with pytest.raises(InputError, match=f"'{name}' of Arm hides an attribute of every component") as refused:
        require_instances([arm_with(name, place)])
    assert refused.value.place is not None
    line = Path(__file__).read_text().splitlines()[(refused.value.place.line or 0) - 1]
    assert line.strip() == "def __init__(self):"


def test_a_component_whose_name_is_no_text_is_refused():
    with pytest.raises(InputError, match="`name` of Arm is text, not 3"):
        require_instances([arm_with("name", "object")])


class Status(Component):
    @property
    def status(self):
        raise ConnectionError("not connected")


@dataclass
class Kept(Component):
    status: str = "ok"  # type: ignore[assignment]

    def __post_init__(self):
        super().__init__()


@pytest.mark.parametrize("kind", [Status, Kept])
def test_a_property_and_a_field_that_hide_a_method_are_refused_with_their_class(kind):
    with pytest.raises(InputError, match=f"'status' of {kind.__name__} hides") as refused:
        require_instances([kind()])
    assert refused.value.place is not None
    assert refused.value.place.line is not None


class Counter(Component):
    """Its `step` is no hook, as it has no `period`."""

    def __init__(self):
        super().__init__()
        self.step = 0  # type: ignore[assignment, method-assign]

    remember = partialmethod(Component.recall, None)


def test_own_steps_and_other_callables_are_accepted():
    assert require_instances([Counter()])

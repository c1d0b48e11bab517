"""Names in a foresight: those that no domain declares are refused, with the nearest valid name (S1.10)."""

from __future__ import annotations

import pytest

from dsc import Component, Outcome, SkillCall, primitive_plot, skill
from knowledge_base import Delta, InputError, KnowledgeBase, computed, fact
from knowledge_base.language.syntax.text import parse_condition
from planning import PlanningDomain, Robot, Validation, validate
from planning.execution.foresight_world import ForesightWorld
from planning.robot.checking import check_project

DOMAIN = PlanningDomain.parse("""
(define (domain loading) (:types crate shelf)
  (:constants dock - shelf)
  (:predicates (on ?c - crate ?s - shelf) (stored ?c - crate) (free ?s - shelf) (near ?a ?b - shelf)
    (reach ?a ?b - shelf))
  (:functions (weight ?c - crate) - number (label ?c - crate) - text)
  (:derived (free ?s - shelf) (not (exists (?c - crate) (on ?c ?s))))
  (:derived (reach ?a ?b - shelf) (or (near ?a ?b) (exists (?m - shelf) (and (near ?a ?m) (reach ?m ?b)))))
  (:action put :parameters (?c - crate ?s - shelf)
    :precondition (not (stored ?c)) :effect (and (stored ?c) (on ?c ?s))))
""")
WORLD = Delta(
    nodes={"crate1": "crate", "crate2": "crate", "left": "shelf", "right": "shelf"},
    added=(fact("on", "crate2", "right"),),
    values={fact("weight", "crate1"): 30},
)
HERE = __file__


class Put(Outcome): ...


class Lift(Component):
    name = "lift"

    @skill
    async def put(self, call: SkillCall, c: str, s: str) -> Put:
        return Put(observed=Delta(added=(fact("on", c, s), fact("stored", c))))


def loader(foresight):
    lift = Lift()
    plot = primitive_plot(lift.skills()["put"], done="put", implements="put")
    robot = Robot(DOMAIN, [plot], [lift], foresight=foresight, clock="simulated")
    robot.knowledge.apply(WORLD, author="me")
    return robot


class Asking:
    """A foresight that asks the world one question."""

    def __init__(self, ask):
        self.ask, self.answers = ask, []

    def foresee(self, plan, world):
        self.answers.append(self.ask(world))
        return Validation(valid=True)


@pytest.mark.parametrize(
    ("ask", "said"),
    [
        (lambda world: world.match("onn", (None, None)), "there is no predicate 'onn'; did you mean 'on'?"),
        (lambda world: world.match("(on ?c ?s)", ()), "there is no predicate '(on ?c ?s)'"),
        (lambda world: world.holds("stord", ("crate1",)), "there is no predicate 'stord'; did you mean 'stored'?"),
        (lambda world: world.match("on", (None,)), "'on' has 2 arguments, not 1"),
        (lambda world: world.match("on", "ab"), "the arguments of 'on' are a tuple"),
        (lambda world: world.match("weight", (None,)), "'weight' is a function"),
        (lambda world: world.value("wieght", ("crate1",)), "there is no function 'wieght'; did you mean 'weight'?"),
        (lambda world: world.value("on", ("crate1",)), "there is no function 'on'; valid: label, weight"),
        (lambda world: world.value("weight", ()), "'weight' has 1 argument, not 0"),
        (lambda world: world.value("weight", ("crate",)), "there is no object 'crate', which '?c' of 'weight'"),
        (lambda world: world.holds("on", ("crate1", "lefft")), "there is no object 'lefft', which '?s' of 'on'"),
        (lambda world: world.match("on", (None, 3)), "there is no object 3"),
        (lambda world: world.match("on", ("left", None)), "'left' is of type shelf, but '?c' of 'on' is of type crate"),
        (lambda world: world.match("free", ("crate1",)), "'crate1' is of type crate, but '?s' of 'free'"),
        (lambda world: world.objects("crat"), "there is no type 'crat'; did you mean 'crate'?"),
        (lambda world: world.query("(onn ?c ?s)"), "there is no predicate 'onn'; did you mean 'on'?"),
    ],
)  # fmt: skip
def test_unknown_names_in_questions_of_a_foresight(ask, said):
    with loader(Asking(ask)) as robot:
        end = robot.achieve("(stored crate1)")
    assert not end.reached
    assert end.programming_error.startswith("Asking.foresee: ")
    assert said in end.programming_error
    assert f"({HERE}:{ask.__code__.co_firstlineno})" in end.programming_error


@pytest.mark.parametrize(
    ("ask", "answer"),
    [
        (lambda world: world.match("on", (None, "right")), [("crate2", "right")]),
        (lambda world: world.match("on", (None, "dock")), []),
        (lambda world: world.holds("shelf", ("left",)), True),
        (lambda world: world.holds("shelf", ("nothing",)), False),
        (lambda world: world.type_of("nothing"), None),
        (lambda world: sorted(world.match("free", (None,))), [("dock",), ("left",)]),
        (lambda world: world.holds("free", ("right",)), False),
        (lambda world: world.value("weight", ("crate1",)), 30),
        (lambda world: world.match("dsc:component-life", ("lift", None)), [("lift", "init")]),
        (lambda world: world.ask("(dsc:active plan)"), True),
        (lambda world: world.query("(on ?c right)"), [{"c": "crate2"}]),
    ],
)
def test_answers_to_a_foresight(ask, answer):
    foresight = Asking(ask)
    with loader(foresight) as robot:
        assert robot.achieve("(stored crate1)").reached
    assert foresight.answers == [answer]


def test_a_computed_predicate_in_a_foresight():
    @computed("(heavy ?c - crate)", reads=["(weight ?c)"])
    def heavy(weight):
        return weight > 20

    knowledge = KnowledgeBase(DOMAIN.schema.with_computed(heavy))
    knowledge.apply(WORLD, author="me")
    world = ForesightWorld(DOMAIN, knowledge, Delta())
    assert world.match("heavy", (None,)) == [("crate1",)]
    assert not world.holds("heavy", ("crate2",))


def test_expected_changes_in_the_world_of_a_foresight():
    knowledge = KnowledgeBase(DOMAIN.schema)
    knowledge.apply(WORLD, author="me")
    world = ForesightWorld(DOMAIN, knowledge, Delta(added=(fact("on", "crate1", "left"),)))
    assert world.match("free", (None,)) == [("dock",)]
    assert not knowledge.holds("on", ("crate1", "left"))


class Reading(Asking):
    """A foresight that reads these names."""

    def __init__(self, reads):
        super().__init__(lambda world: None)
        self.reads = reads


WRONG_READS = [
    ("weight", "`reads` of a foresight is a tuple of names such as ('weight',), not 'weight'"),
    (5, "`reads` of a foresight is a tuple of names"),
    (("onn",), "'onn', which is neither a predicate nor a function of the robot; did you mean 'on'?"),
    (("crate",), "'crate', which is neither a predicate nor a function"),
    ((5,), "`reads` of a foresight has names as text, not 5"),
    (("free",), "'free', which has no own facts; name what it follows from: on"),
    (("reach",), "name what it follows from: near"),
    (("dsc:active",), "'dsc:active', which describes the running program"),
]


@pytest.mark.parametrize(("reads", "said"), WRONG_READS)
def test_wrong_names_in_reads(reads, said):
    with pytest.raises(InputError) as caught:
        loader(Reading(reads))
    assert said in str(caught.value)
    assert str(caught.value).startswith(f"{HERE}:")


@pytest.mark.parametrize("reads", [(), ("on",), ["on", "weight"], {"weight"}, frozenset({"stored"})])
def test_names_in_reads(reads):
    with loader(Reading(reads)) as robot:
        assert robot.achieve("(stored crate1)").reached


@pytest.mark.parametrize(
    ("verdict", "said"),
    [
        (None, "a foresight returns a Validation, not None"),
        (True, "a foresight returns a Validation, not True"),
        ({"valid": "no"}, "`valid` of a Validation is True or False, not 'no'"),
        ({"valid": False, "why": 7}, "`why` of a Validation is text, not 7"),
        (Validation(valid=False, failing_step=9), "a foresight names a step by its number from 0 to 0"),
        (Validation(valid=False, failing_step=-1), "`failing_step=-1`"),
        (Validation(valid=True, cost=1, costliest_step=7), "`costliest_step=7`"),
        (Validation(valid=True, cost=float("nan")), "the cost of a plan is a finite number, not nan"),
        ({"valid": True, "cost": "much"}, "the cost of a plan is a finite number, not 'much'"),
    ],
)
def test_wrong_values_of_a_foresight(verdict, said):
    class Wrong:
        def foresee(self, plan, world):
            return Validation(**verdict) if isinstance(verdict, dict) else verdict

    with loader(Wrong()) as robot:
        end = robot.achieve("(stored crate1)")
    line = Wrong.foresee.__code__.co_firstlineno
    assert end.programming_error.startswith(f"Wrong.foresee: {HERE}:{line}: ")
    assert said in end.programming_error


PROJECT = """
from planning import Bundle, PlanningDomain, Validation
class Weights:
    reads = ("weigth",)
    def foresee(self, plan, world):
        return Validation(valid=True)
DOMAIN = PlanningDomain.parse("(define (domain d) (:types crate) (:predicates (on ?c - crate)) (:functions (weight ?c - crate)))")
BUNDLE = Bundle("loader", domain=DOMAIN, foresight=Weights(), goal="(forall (?c - crate) (on ?c))")
"""


def test_names_in_reads_of_a_bundle(tmp_path):
    file = tmp_path / "robot.py"
    file.write_text(PROJECT)
    (found,) = [one for one in check_project(str(file)) if "weigth" in one.text]
    assert "did you mean 'weight'?" in found.text
    assert (found.place.source, found.place.line) == (str(file), 3)


class Playing:
    """A foresight that validates the plan in its world, whose shelves are near each other."""

    def foresee(self, plan, world):
        assert sorted(world.match("reach", ("left", None))) == [("left", "dock"), ("left", "right")]
        assert world.holds("reach", ("left", "dock"))
        assert not world.holds("reach", ("dock", "left"))
        goal = parse_condition("(and (stored crate1) (reach left dock))")
        return validate(plan, DOMAIN, world, goal)


def test_a_recursive_predicate_in_a_foresight():
    with loader(Playing()) as robot:
        robot.knowledge.apply(Delta(added=(fact("near", "left", "right"), fact("near", "right", "dock"))), author="me")
        end = robot.achieve("(stored crate1)")
    assert end.reached, end.reason

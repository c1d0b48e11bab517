"""What is possible and what contributes, found again from what was, is what comes of working it out anew."""

from hypothesis import given, settings
from hypothesis import strategies as st

from knowledge_base.facts import Delta, fact
from knowledge_base.language.syntax.text import parse_condition
from knowledge_base.store import KnowledgeBase
from planning.model.domain import PlanningDomain
from planning.problem.construction import ProblemBuilder
from planning.problem.reduction import prune
from planning.problem.relaxed_reachability import reachable
from planning.problem.task import OperatorIndex, Task

DOMAIN = PlanningDomain.parse("""
(define (domain boxes) (:types place box)
  (:predicates (at ?p - place) (way ?a ?b - place) (in ?b - box ?p - place) (holding ?b - box) (free)
               (fits ?a ?b - box) (inside ?a ?b - box) (open ?b - box) (tidy ?b - box))
  (:action go :parameters (?a ?b - place) :precondition (and (at ?a) (way ?a ?b))
    :effect (and (not (at ?a)) (at ?b)))
  (:action take :parameters (?b - box ?p - place) :precondition (and (at ?p) (in ?b ?p) (free))
    :effect (and (not (in ?b ?p)) (not (free)) (holding ?b)))
  (:action put :parameters (?b - box ?p - place) :precondition (and (at ?p) (holding ?b))
    :effect (and (in ?b ?p) (free) (not (holding ?b))))
  (:action close :parameters (?b - box) :precondition (and (holding ?b) (open ?b)) :effect (not (open ?b)))
  (:action nest :parameters (?a ?b - box) :precondition (and (holding ?a) (fits ?a ?b) (open ?b) (not (open ?a)))
    :effect (and (inside ?a ?b) (tidy ?a) (free) (not (holding ?a)))))
""")
PLACES, BOXES = ("hall", "lab"), ("b1", "b2", "b3")
FACTS = [
    fact("free"),
    *(fact("at", place) for place in PLACES),
    *(fact("way", a, b) for a in PLACES for b in PLACES if a != b),
    *(fact("in", box, place) for box in BOXES for place in PLACES),
    *(fact(name, box) for name in ("holding", "open", "tidy") for box in BOXES),
    *(fact(name, a, b) for name in ("fits", "inside") for a in BOXES for b in BOXES if a != b),
]
GOALS = ("(forall (?b - box) (tidy ?b))", "(and (in b1 lab) (not (open b2)))")
ALL = st.sets(st.sampled_from(FACTS), min_size=8)
FEW = st.sets(st.sampled_from([*FACTS[3:5], *FACTS[-12:-6], *FACTS[5:7]]), max_size=3)


@settings(max_examples=100, derandomize=True, deadline=None)
@given(ALL, st.lists(FEW, min_size=1, max_size=6), st.sampled_from(GOALS))
def test_incremental_reachability_and_pruning_equal_a_new_computation(start, turns, goal_text):
    world, builder, goal = KnowledgeBase(DOMAIN.schema), ProblemBuilder(DOMAIN), parse_condition(goal_text)
    nodes = {**dict.fromkeys(PLACES, "place"), **dict.fromkeys(BOXES, "box")}
    world.apply(Delta(nodes=nodes, added=tuple(start)), "test")
    for changed in (set(), *turns):
        gone = tuple(one for one in changed if world.holds(one.predicate, one.args))
        world.apply(Delta(removed=gone, added=tuple(changed - {*gone})), "test")
        task = builder.grounded(world, goal).task
        if task is None:
            continue
        anew = Task(task.numbering, task.init, task.goal, OperatorIndex(task.ways.all))
        reach, reach_anew = reachable(task), reachable(anew)
        assert set(reach.facts) == set(reach_anew.facts)
        assert reach.taken == reach_anew.taken
        slice_, slice_anew = prune(task, reach.taken), prune(anew, reach.taken)
        assert (slice_.left, slice_.settled) == (slice_anew.left, slice_anew.settled)
        assert (slice_.init, slice_.goal) == (slice_anew.init, slice_anew.goal)
        proven: set[int] = set()
        for one, position in reach.facts.items():  # each by a way that needs only what stands before it
            assert position < 0 or proven.issuperset(task.ways.all[position].needs)
            proven.add(one)

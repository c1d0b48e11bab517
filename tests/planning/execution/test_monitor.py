"""The monitor by itself: what breaks a plan, what shortens it, whose doing counts when, and what costs nothing."""

import gc
import weakref
from typing import Any

import pytest

from knowledge_base import Delta, KnowledgeBase, fact
from knowledge_base.language.syntax.text import parse_condition
from planning import PlanningDomain, PlanStep
from planning.execution.link_monitor import Broken, GoalReached, LinkMonitor, Shorter
from planning.execution.plan_ends import shortest_end
from planning.execution.plan_progress import PlanProgress, thinned

DOMAIN = PlanningDomain.parse("""
(define (domain parcels)
  (:types room parcel robot)
  (:predicates (at ?r - robot ?where - room) (in ?p - parcel ?where - room) (open ?r - room) (holding ?r - robot ?p - parcel)
    (painted ?r - room) (urgent ?p - parcel))
  (:functions (weight ?p - parcel))
  (:action go :parameters (?r - robot ?from ?to - room) :precondition (and (at ?r ?from) (open ?to))
    :effect (and (not (at ?r ?from)) (at ?r ?to)))
  (:action take :parameters (?r - robot ?p - parcel ?where - room) :precondition (and (at ?r ?where) (in ?p ?where))
    :effect (and (not (in ?p ?where)) (holding ?r ?p)))
  (:action give :parameters (?r - robot ?p - parcel ?where - room) :precondition (and (at ?r ?where) (holding ?r ?p))
    :effect (and (not (holding ?r ?p)) (in ?p ?where)))
  (:action grow :parameters () :effect (forall (?p - parcel) (increase (weight ?p) (weight ?p)))))
""")
GOAL = parse_condition("(and (in p1 office) (in p2 office) (forall (?p - parcel) (imply (urgent ?p) (in ?p office))))")


def step(text):
    action, *args = text.split()
    return PlanStep(action, tuple(args))


STEPS = [
    step(text)
    for text in (
        "take bob p1 store", "go bob store office", "give bob p1 office",
        "go bob office store", "take bob p2 store", "go bob store office", "give bob p2 office",
    )
]  # fmt: skip


class Watched:
    """A plan with its monitor; `begin` says that a step begins, `change` that somebody changes the world."""

    def __init__(self, steps=STEPS, goal=GOAL, before=None, facts=()):
        self.kb = KnowledgeBase(DOMAIN.schema)
        nodes = {"store": "room", "office": "room", "hall": "room", "p1": "parcel", "p2": "parcel", "p3": "parcel"}
        known = "at bob store, in p1 store, in p2 store, in p3 store, open store, open office, open hall"
        told = tuple(fact(*one.split()) for one in known.split(", "))
        self.kb.apply(Delta(nodes={**nodes, "bob": "robot", "eve": "robot"}, added=(*told, *facts)), "test")
        self.progress = PlanProgress(steps, DOMAIN, goal, before)
        self.news: list[Any] = []
        self.monitor = LinkMonitor(self.progress, DOMAIN, self.kb, lambda author: author == "bob", self.news.append)
        self.monitor.look("earlier")

    def begin(self, number):
        self.progress.begin(number)
        self.monitor.look("the steps before")

    def change(self, author, *, gone="", now="", **more):
        facts = [tuple(fact(*one.split()) for one in text.split(", ") if one) for text in (gone, now)]
        return self.kb.apply(Delta(removed=facts[0], added=facts[1], **more), author)

    def do(self, number):
        """The robot carries out the step, as planned."""
        self.kb.apply(DOMAIN.effects(self.progress.steps[number - 1], self.kb), "bob")


def test_the_monitor_reports_a_lost_condition_of_a_later_step():
    plan = Watched()
    plan.begin(1)
    change = plan.change("eve", gone="in p2 store")
    (broken,) = plan.news
    assert broken == Broken(
        "before step 5, (take bob p2 store): (in p2 store) is false", "(in p2 store)", 5, "eve", change.version
    )


def test_the_monitor_ignores_the_loss_of_a_fact_that_a_later_step_adds():
    plan = Watched()
    plan.begin(1)
    plan.change("eve", now="at bob office")
    plan.change("eve", gone="at bob office")  # step 2 will bring it
    assert plan.news == []


@pytest.mark.parametrize(("author", "heard"), [("bob", 0), ("eve", 1)])
def test_the_running_steps_own_doing_is_judged_when_it_has_ended(author, heard):
    plan = Watched()
    plan.begin(1)
    plan.change(author, gone="open office")
    assert len(plan.news) == heard
    plan.change("bob", gone="in p1 store", now="holding bob p1")
    plan.begin(2)
    assert plan.news[0].needed == "(open office)"
    assert plan.news[0].author == ("eve" if heard else "the steps before")


def test_a_step_may_be_half_done_when_somebody_else_changes_something():
    plan = Watched()
    plan.begin(1)
    plan.do(1)
    plan.change("eve", gone="in p3 store", now="painted hall")
    assert plan.news == []
    plan.change("eve", gone="holding bob p1")  # what the step has brought already, for a later one
    (broken,) = plan.news
    assert (broken.needed, broken.user) == ("(holding bob p1)", 3)


def test_a_thing_that_was_not_known_can_break_a_goal_about_all():
    plan = Watched()
    plan.begin(1)
    plan.change("eve", now="urgent p4", nodes={"p4": "parcel"})
    (broken,) = plan.news
    assert (broken.user, broken.why) == (8, "after the last step: (in p4 office) is false")


def test_a_thing_that_is_gone_breaks_the_plan():
    plan = Watched()
    plan.begin(1)
    plan.kb.apply(Delta(removed_nodes=("p2",)), "eve")
    assert [type(one) for one in plan.news] == [Broken] * len(plan.news) != []


def test_a_change_outside_all_links_is_not_checked(monkeypatch):
    plan = Watched()
    plan.begin(1)
    looked = []
    monkeypatch.setattr("planning.execution.link_monitor.shortest_end", lambda *args: looked.append(args))
    monkeypatch.setattr(PlanProgress, "is_valid", lambda *args: looked.append(args))
    plan.change("eve", now="painted hall, painted office, in p3 hall", values={fact("weight", "p1"): 3.0})
    assert looked == []
    assert plan.news == []


def test_the_goal_reached_by_somebody_else_is_heard_at_once():
    plan = Watched()
    plan.begin(1)
    plan.change("eve", gone="in p1 store, in p2 store", now="in p1 office, in p2 office")
    assert plan.news[-1] == GoalReached("eve")


def test_an_effect_of_another_author_shortens_the_plan_when_the_next_step_begins():
    plan = Watched()
    plan.begin(1)
    plan.do(1)
    plan.change("eve", now="in p2 office")  # whoever is in two rooms at once: what counts is that the goal's part holds
    assert plan.news == []
    plan.begin(2)
    assert plan.news == [Shorter((STEPS[1], STEPS[2]))]


def test_steps_at_the_beginning_that_are_of_no_use_any_more_are_skipped():
    plan = Watched()
    plan.begin(1)
    plan.do(1)
    plan.begin(2)
    plan.do(2)
    plan.change("bob", gone="holding bob p1", now="in p1 office")
    plan.begin(3)
    assert plan.news == [Shorter(tuple(STEPS[3:]))]


def test_a_plan_whose_numbers_cannot_be_taken_back_is_judged_at_every_change():
    goal = parse_condition("(and (> (weight p1) 3) (open hall))")
    plan = Watched([step("grow"), step("grow")], goal)
    plan.news.clear()
    plan.change("eve", values={fact("weight", "p1"): 1.0})
    plan.change("bob", gone="open hall")
    assert [one.author for one in plan.news] == []
    plan.change("eve", now="painted hall")
    assert [one.author for one in plan.news] == ["eve"]


TWO = [
    step(text)
    for text in (
        "take bob p1 store", "take eve p2 hall", "go bob store office", "go eve hall office", "give bob p1 office", "give eve p2 office",
    )
]  # fmt: skip
SIDE_BY_SIDE = frozenset({(1, 3), (3, 5), (2, 4), (4, 6)})


def test_steps_at_work_at_once_may_each_be_done_or_not():
    plan = Watched(
        TWO,
        parse_condition("(and (in p1 office) (in p2 office))"),
        SIDE_BY_SIDE,
        (fact("at", "eve", "hall"), fact("in", "p2", "hall")),
    )
    plan.begin(1)
    plan.begin(2)
    assert plan.progress.running == (1, 2)
    plan.do(2)
    plan.begin(4)
    assert (plan.progress.running, plan.progress.remaining) == ((1, 4), (1, 3, 4, 5, 6))
    plan.change("somebody", now="painted office")
    assert plan.news == []
    plan.change("somebody", gone="in p1 store")
    assert [one.needed for one in plan.news] == ["(in p1 store)"]


def test_the_shortest_end_and_what_can_be_left_out_of_a_plan():
    plan = Watched(facts=[fact("in", "p1", "office")])
    assert shortest_end(STEPS, DOMAIN, plan.kb, GOAL) == tuple(STEPS[4:])
    assert thinned(STEPS, DOMAIN, plan.kb, GOAL) == tuple(STEPS[4:])
    plan = Watched(facts=[fact("in", "p2", "office")])
    assert shortest_end(STEPS, DOMAIN, plan.kb, GOAL) == tuple(STEPS)
    assert thinned(STEPS, DOMAIN, plan.kb, GOAL) == tuple(STEPS[:3])
    assert shortest_end(STEPS[1:], DOMAIN, Watched().kb, GOAL) is None


def test_a_step_that_is_of_no_use_any_more_since_somebody_else_did_it_is_interrupted():
    plan = Watched()
    plan.begin(1)
    plan.change("eve", gone="in p1 store", now="in p1 office")
    assert plan.news == [Shorter(tuple(STEPS[4:]))]


def test_steps_at_work_at_once_are_left_out_of_what_is_left_when_they_are_done():
    plan = Watched(
        TWO,
        parse_condition("(and (in p1 office) (in p2 office))"),
        SIDE_BY_SIDE,
        (fact("at", "eve", "hall"), fact("in", "p2", "hall")),
    )
    plan.begin(1)
    plan.begin(2)
    assert plan.progress.shortest_end(plan.kb) == tuple(TWO)
    plan.do(2)
    assert plan.progress.shortest_end(plan.kb) == (TWO[0], *TWO[2:])


def test_a_closed_monitor_says_nothing():
    plan = Watched()
    plan.monitor.close()
    plan.change("eve", gone="in p2 store")
    assert plan.news == []


def test_a_break_by_the_running_step_names_its_author_its_version_and_the_step():
    plan = Watched()
    plan.begin(1)
    plan.change("bob", gone="open office")
    plan.begin(2)
    assert plan.news == [Broken("(open office) is false", "(open office)", 2, "the steps before", plan.kb.version)]


def test_the_goal_reached_by_the_step_itself_is_heard_when_the_next_begins():
    plan = Watched()
    plan.begin(1)
    plan.change("bob", gone="in p1 store, in p2 store", now="in p1 office, in p2 office")
    assert plan.news == []
    plan.begin(2)
    assert plan.news == [GoalReached("the steps before")]


def test_a_goal_that_does_not_hold_any_more_is_not_reached_again():
    plan = Watched()
    plan.begin(1)
    plan.change("eve", gone="in p1 store, in p2 store", now="in p1 office, in p2 office")
    plan.news.clear()
    plan.change("eve", gone="in p1 office")
    assert GoalReached("eve") not in plan.news


def test_a_goal_about_a_thing_that_is_gone_is_not_reached():
    plan = Watched()
    plan.begin(1)
    plan.kb.apply(Delta(removed_nodes=("p2",)), "bob")
    plan.news.clear()
    plan.begin(2)
    assert [type(one) for one in plan.news] == [Broken]


def test_a_change_breaks_a_plan_once_and_what_comes_back_is_no_news():
    plan = Watched()
    plan.begin(1)
    plan.change("eve", gone="in p2 store, open office")
    assert [one.needed for one in plan.news] == ["(open office)"]
    plan.news.clear()
    plan.change("eve", now="in p2 store")
    assert plan.news == []


def test_news_may_be_answered_with_a_change_before_the_next_is_told():
    plan, told = Watched(), []

    def answer(news):
        told.append(news)
        plan.kb.apply(Delta(added=(fact("painted", "hall"),)), f"who heard news {len(told)}")

    LinkMonitor(plan.progress, DOMAIN, plan.kb, lambda author: author == "bob", answer).look("earlier")
    change = plan.change("eve", gone="in p2 store, open office")
    assert [(one.author, one.version) for one in told] == [("eve", change.version)]


def test_nobody_is_interrupted_for_a_shorter_plan_while_several_steps_are_at_work():
    plan = Watched(
        TWO,
        parse_condition("(and (in p1 office) (in p2 office))"),
        SIDE_BY_SIDE,
        (fact("at", "eve", "hall"), fact("in", "p2", "hall")),
    )
    plan.begin(1)
    plan.do(1)
    plan.begin(2)
    assert plan.progress.running == (1, 2)
    assert plan.news == []
    plan.change("bob", gone="holding bob p1")
    plan.begin(4)
    assert plan.news == [Broken("(in p1 store) is false", "(in p1 store)", 1, "the steps before", plan.kb.version)]


def test_a_later_step_that_can_be_the_next_one_is_not_announced_while_one_is_at_work():
    plan = Watched()
    for number in range(1, 5):
        plan.begin(number)
        plan.do(number)
    plan.change("eve", gone="in p2 store", now="holding bob p2")  # step 5 is not needed, and cannot be taken
    assert plan.news == []


def test_a_change_to_a_condition_of_a_finished_step_is_not_checked(monkeypatch):
    plan = Watched()
    plan.begin(1)
    plan.do(1)
    plan.begin(2)
    looked = []
    monkeypatch.setattr(PlanProgress, "is_valid", lambda *args: looked.append(args))
    plan.change("eve", now="in p1 store")
    plan.change("eve", gone="in p1 store")
    assert looked == []


def test_only_what_somebody_else_brings_about_is_early():
    plan = Watched()
    plan.begin(1)
    plan.do(1)
    plan.change("bob", now="in p2 office")
    plan.change("eve", gone="in p2 office")
    assert not plan.progress.early
    plan.change("eve", now="in p2 office")
    assert plan.progress.early
    plan.begin(2)
    assert plan.progress.early is False


def test_a_plan_that_can_be_judged_as_a_whole_alone_names_what_later_steps_need():
    plan = Watched([step("grow"), step("go bob store hall")], parse_condition("(and (> (weight p1) 3) (at bob hall))"))
    plan.change("bob", values={fact("weight", "p1"): 2.0})
    plan.news.clear()
    plan.begin(1)
    assert plan.news == []
    change = plan.change("eve", gone="open hall")
    assert plan.news == [Broken("(open hall) is false", "(open hall)", 2, "eve", change.version)]


def test_a_broken_plan_that_needs_no_single_condition_names_its_goal():
    plan = Watched([step("grow"), step("grow"), step("grow")], parse_condition("(and (> (weight p1) 3) (open hall))"))
    plan.change("bob", values={fact("weight", "p1"): 1.0})
    plan.news.clear()
    change = plan.change("eve", gone="open hall")
    assert plan.news == [Broken("after the last step: (open hall) is false", "", 4, "eve", change.version)]


@pytest.mark.parametrize(("steps", "gone"), [(STEPS, "in p2 store"), ([step("grow")] * 3, "open hall")])
def test_a_closed_monitor_hears_nothing_and_is_not_kept(steps, gone):
    plan = Watched(steps, GOAL if steps is STEPS else parse_condition("(and (> (weight p1) 3) (open hall))"))
    for number in (1, 2):
        plan.begin(number)
    plan.news.clear()
    plan.monitor.close()
    plan.change("eve", gone=gone)
    assert plan.news == []
    monitor = weakref.ref(plan.monitor)
    del plan.monitor
    gc.collect()
    assert monitor() is None


def test_a_goal_that_cannot_be_computed_is_not_reached():
    plan = Watched([step("grow")], parse_condition("(> (/ 1 (weight p1)) 3)"))
    plan.change("bob", values={fact("weight", "p1"): 0.0})
    plan.news.clear()
    plan.begin(1)
    assert [type(one) for one in plan.news] == [Broken]


def test_the_reason_is_what_the_goal_lacks_and_no_condition_of_a_step_that_is_done():
    plan = Watched(TWO, before=SIDE_BY_SIDE, facts=(fact("at", "eve", "hall"), fact("in", "p2", "hall")))
    plan.begin(1)
    plan.begin(2)
    plan.do(2)  # nothing that follows has begun, so the plan still counts this step as running
    plan.change("somebody", now="urgent p3")
    assert [one.why for one in plan.news] == ["after the last step: (in p3 office) is false"]

"""When installed conditions fire and who is told: edges, holding, hysteresis, once, waiting, threads."""

from __future__ import annotations

import asyncio
import threading
from typing import Any

import pytest
from kb_strategies import SCHEMA, THINGS

from knowledge_base import ConditionCancelledError, Delta, Firing, KnowledgeBase, fact
from knowledge_base.errors import InputError, UnknownNameError


class FakeClock:
    """Time that passes when the test says so."""

    def __init__(self) -> None:
        self.time = 0.0
        self.due: list[tuple[float, FakeTimer]] = []

    def now(self) -> float:
        return self.time

    def call_later(self, delay_s, callback):
        timer = FakeTimer(callback)
        self.due.append((self.time + delay_s, timer))
        return timer

    def pass_by(self, seconds: float) -> None:
        self.time += seconds
        ready = [timer for when, timer in self.due if when <= self.time]
        self.due = [(when, timer) for when, timer in self.due if when > self.time]
        for timer in ready:
            timer.run()


class FakeTimer:
    def __init__(self, callback) -> None:
        self.callback = callback
        self.cancelled = False

    def cancel(self) -> None:
        self.cancelled = True

    def run(self) -> None:
        if not self.cancelled:
            self.callback()


@pytest.fixture
def kb() -> KnowledgeBase:
    kb = KnowledgeBase(SCHEMA)
    kb.apply(Delta(nodes=THINGS), author="test")
    return kb


def tell(kb, *facts) -> None:
    kb.apply(Delta(added=tuple(fact(*f) for f in facts)), author="test")


def retract(kb, *facts) -> None:
    kb.apply(Delta(removed=tuple(fact(*f) for f in facts)), author="test")


def weigh(kb, thing, number) -> None:
    kb.apply(Delta(values={fact("weight", thing): number}), author="test")


def heard(condition, *, falls=False) -> list[Any]:
    """What a listener is told from now on: whether it is true, and the witness."""
    told = []
    condition.subscribe(lambda f: told.append((f.truth, f.witness)), falls=falls)
    return told


def test_an_edge_fires_when_it_becomes_true_and_not_while_it_stays_so(kb) -> None:
    condition = kb.install("(on ?x shelf)")
    rises, both = heard(condition), heard(condition, falls=True)
    tell(kb, ("on", "cup1", "shelf"))
    tell(kb, ("on", "cup2", "shelf"))
    retract(kb, ("on", "cup1", "shelf"))
    assert (condition.truth, condition.witness, condition.version) == (True, {"x": "cup2"}, kb.version)
    retract(kb, ("on", "cup2", "shelf"))
    assert (condition.truth, condition.witness) == (False, None)
    assert rises == [(True, {"x": "cup1"})]
    assert both == [(True, {"x": "cup1"}), (False, None)]


def test_each_fires_at_every_change_of_the_set_of_witnesses(kb) -> None:
    told = heard(kb.install("(on ?x shelf)", fire="each"), falls=True)
    tell(kb, ("on", "cup1", "shelf"))
    tell(kb, ("on", "cup2", "shelf"))
    tell(kb, ("heavy", "cup1"))
    retract(kb, ("on", "cup1", "shelf"))
    retract(kb, ("on", "cup2", "shelf"))
    assert [truth for truth, _ in told] == [True, True, True, False]


def test_a_condition_that_is_true_already_does_not_fire(kb) -> None:
    tell(kb, ("on", "cup1", "shelf"))
    condition = kb.install("(on ?x ?p)", {"p": "shelf"})
    told = heard(condition)
    tell(kb, ("on", "cup2", "shelf"))
    assert condition.truth
    assert told == []


def test_the_witness_of_an_outermost_exists_is_known(kb) -> None:
    condition = kb.install("(exists (?c - cup) (on ?c shelf))")
    tell(kb, ("on", "can1", "shelf"))
    assert condition.witness is None
    tell(kb, ("on", "cup2", "shelf"))
    assert condition.witness == {"c": "cup2"}


def test_a_rolled_back_transaction_fires_nothing(kb) -> None:
    told = heard(kb.install("(quiet)"))
    with pytest.raises(InputError), kb.transaction(author="test") as tx:  # noqa: PT012
        tx.tell("quiet")
        tx.tell("on", "ghost", "shelf")
    assert told == []


def test_once_is_over_after_the_first_firing(kb) -> None:
    condition = kb.install("(quiet)", once=True)
    told = heard(condition, falls=True)
    tell(kb, ("quiet",))
    retract(kb, ("quiet",))
    tell(kb, ("quiet",))
    assert told == [(True, {})]
    assert condition.cancelled


def test_a_cancelled_condition_is_silent(kb) -> None:
    with kb.install("(quiet)") as condition:
        told = heard(condition)
    condition.cancel()
    tell(kb, ("quiet",))
    assert (told, condition.cancelled, condition.truth) == ([], True, False)


def test_a_condition_cancelled_by_another_listener_does_not_fire(kb) -> None:
    first, second = kb.install("(quiet)"), kb.install("(quiet)")
    first.subscribe(lambda _: second.cancel())
    told = heard(second)
    tell(kb, ("quiet",))
    assert told == []


def test_an_unsubscribed_listener_is_not_told(kb) -> None:
    told: list[Firing] = []
    condition = kb.install("(quiet)")
    condition.subscribe(told.append)()
    tell(kb, ("quiet",))
    assert told == []
    assert condition.truth


def test_hysteresis_keeps_it_true_until_the_number_is_clearly_back(kb) -> None:
    condition = kb.install("(> (weight cup1) 10)", hysteresis=2)
    told = heard(condition, falls=True)
    truths = []
    for number in (9, 11, 9, 8.5, 8, 9, 11):
        weigh(kb, "cup1", number)
        truths.append(condition.truth)
    assert truths == [False, True, True, True, False, False, True]
    assert [truth for truth, _ in told] == [True, False, True]


def test_hysteresis_under_not_moves_the_other_way(kb) -> None:
    condition = kb.install("(not (> (weight cup1) 10))", hysteresis=2)
    truths = []
    for number in (11, 13, 11, 10, 11.5, 12, 12.5):
        weigh(kb, "cup1", number)
        truths.append(condition.truth)
    assert truths == [True, False, False, True, True, True, False]


def test_a_condition_fires_when_it_has_held_long_enough(kb) -> None:
    clock = FakeClock()
    condition = kb.install("(quiet)", hold_s=5, clock=clock)
    told = heard(condition, falls=True)
    tell(kb, ("quiet",))
    clock.pass_by(4)
    retract(kb, ("quiet",))
    tell(kb, ("quiet",))
    clock.pass_by(4)
    assert condition.truth
    assert told == []
    clock.pass_by(1)
    assert told == [(True, {})]
    clock.pass_by(50)
    retract(kb, ("quiet",))
    assert told == [(True, {}), (False, None)]


def test_a_break_that_the_timer_overlooks_is_a_break(kb) -> None:
    clock = FakeClock()
    told = heard(kb.install("(quiet)", hold_s=5, clock=clock))
    tell(kb, ("quiet",))
    (_, timer), *_ = clock.due
    retract(kb, ("quiet",))
    tell(kb, ("quiet",))
    timer.callback()  # it was on its way when it was cancelled
    assert told == []


def test_a_condition_that_is_true_already_fires_after_its_hold_time(kb) -> None:
    tell(kb, ("quiet",))
    clock = FakeClock()
    told = heard(kb.install("(quiet)", hold_s=5, clock=clock))
    clock.pass_by(5)
    assert told == [(True, {})]


def test_a_cancelled_condition_leaves_no_timer_running(kb) -> None:
    tell(kb, ("quiet",))
    clock = FakeClock()
    condition = kb.install("(quiet)", hold_s=5, clock=clock)
    told = heard(condition)
    condition.cancel()
    assert all(timer.cancelled for _, timer in clock.due)
    clock.pass_by(5)
    assert told == []


def test_waiting_gets_the_next_firing_and_misses_none(kb) -> None:
    condition = kb.install("(quiet)")

    async def run() -> None:
        waiting = asyncio.create_task(condition.wait())
        await asyncio.sleep(0)
        other = threading.Thread(target=tell, args=(kb, ("quiet",)))
        other.start()
        first = await asyncio.wait_for(waiting, 5)
        other.join()
        assert (first.number, first.version, first.witness) == (1, kb.version, {})
        assert await condition.wait(after=0) == first
        later = asyncio.create_task(condition.wait(after=condition.fired))
        await asyncio.sleep(0)
        assert not later.done()
        retract(kb, ("quiet",))
        tell(kb, ("quiet",))
        assert (await asyncio.wait_for(later, 5)).number == 2

    asyncio.run(run())


def test_waiting_for_a_cancelled_condition_is_an_error_and_no_hanging(kb) -> None:
    condition = kb.install("(quiet)")

    async def run() -> None:
        waiting = asyncio.create_task(condition.wait())
        await asyncio.sleep(0)
        condition.cancel()
        with pytest.raises(ConditionCancelledError, match="quiet"):
            await asyncio.wait_for(waiting, 5)
        with pytest.raises(ConditionCancelledError):
            await condition.wait()

    asyncio.run(run())


def test_a_condition_that_cannot_be_computed_is_false_and_says_why(kb) -> None:
    weigh(kb, "cup1", 2)
    condition = kb.install("(> (/ 8 (weight cup1)) 1)")
    assert (condition.truth, condition.error) == (True, None)
    weigh(kb, "cup1", 0)
    assert not condition.truth
    assert "division" in str(condition.error)
    weigh(kb, "cup1", 1)
    assert (condition.truth, condition.error) == (True, None)


def test_a_choice_hidden_by_one_that_cannot_be_computed_is_found_later(kb) -> None:
    weigh(kb, "cup2", 2)
    condition = kb.install("(and (heavy ?i) (> (/ 8 (weight ?i)) 1))")
    tell(kb, ("heavy", "cup1"), ("heavy", "cup2"))
    weigh(kb, "cup1", 100)
    assert condition.witness == {"i": "cup2"}


def test_a_failing_listener_silences_nobody(kb) -> None:
    condition = kb.install("(quiet)")

    def fail(firing) -> None:
        raise ValueError("deaf")

    condition.subscribe(fail)
    told = heard(condition)
    with pytest.raises(ExceptionGroup):
        tell(kb, ("quiet",))
    assert told == [(True, {})]


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        ("(hevy ?x)", {}, "did you mean 'heavy'"),
        ("(on ?x shalf)", {}, "did you mean 'shelf'"),
        ("(not (heavy ?x))", {}, "'\\?x' occurs only under 'not'"),
        ("(quiet)", {"fire": "edges"}, "did you mean 'edge'"),
        ("(quiet)", {"hold_s": 3}, "needs a clock"),
        ("(quiet)", {"hold_s": -1}, "0 or more"),
        ("(quiet)", {"hysteresis": 1}, "here is none"),
        ("(> (time) 3)", {"hysteresis": -1}, "positive number"),
    ],
)
def test_a_mistake_is_told_and_installs_nothing(kb, text, options, message) -> None:
    with pytest.raises(InputError, match=message):
        kb.install(text, **options)
    assert not kb._installed._joins


def test_an_unknown_thing_as_a_parameter_is_simply_not_there(kb) -> None:
    assert not kb.install("(on ?x ?p)", {"p": "attic"}).truth
    with pytest.raises(UnknownNameError):
        kb.install("(on ?x attic)")


def test_a_listener_may_change_and_install(kb) -> None:
    order = []

    def react(firing) -> None:
        order.append(("quiet", firing.version))
        kb.install("(heavy cup1)").subscribe(lambda f: order.append(("heavy", f.version)))
        tell(kb, ("heavy", "cup1"))

    kb.install("(quiet)").subscribe(react)
    tell(kb, ("quiet",))
    assert order == [("quiet", kb.version - 1), ("heavy", kb.version)]


def test_threads_that_install_cancel_and_commit_at_once_lose_nothing(kb) -> None:
    rounds, threads = 30, 4
    kb.apply(Delta(nodes={f"c{n}": "cup" for n in range(threads)}), author="test")
    barrier = threading.Barrier(threads)
    told: list[list[Any]] = [[] for _ in range(threads)]
    everyone: list[Firing] = []
    kb.install("(on ?x shelf)", fire="each").subscribe(everyone.append)
    errors = []

    def work(own: int) -> None:
        cup = f"c{own}"
        kept = kb.install("(on ?x shelf)", {"x": cup})
        kept.subscribe(lambda f: told[own].append((f.version, f.truth)), falls=True)
        for _ in range(rounds):
            barrier.wait(timeout=30)
            with kb.install("(on ?x shelf)", {"x": f"c{(own + 1) % threads}"}):
                tell(kb, ("on", cup, "shelf"))
                if not kept.truth:
                    errors.append("not seen")
                retract(kb, ("on", cup, "shelf"))

    workers = [threading.Thread(target=work, args=(n,)) for n in range(threads)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert errors == []
    for own in told:
        assert [truth for _, truth in own] == [True, False] * rounds
        assert [version for version, _ in own] == sorted(version for version, _ in own)
    versions = [f.version for f in everyone]
    assert versions == sorted(set(versions))


@pytest.mark.parametrize(
    ("text", "change", "truths"),
    [
        ("(forall (?c - cup) (heavy ?c))", Delta(nodes={"cup9": "cup"}), (True, False)),
        ("(forall (?c - cup) (heavy ?c))", Delta(nodes={"can9": "can"}), (True, True)),
        ("(forall (?i - item) (or (heavy ?i) (on ?i shelf)))", Delta(removed_nodes=("can1",)), (False, True)),
        ("(exists (?i - can) (not (on ?i shelf)))", Delta(removed_nodes=("can1",)), (True, False)),
        ("(= (weight cup1) 0)", Delta(removed_nodes=("cup1",)), (False, True)),
        ("(item ?new)", Delta(nodes={"can9": "can"}), (False, True)),
        ("(and (on ?x ?p) (near ?p ?q) (place ?q))", Delta(added=(fact("near", "shelf", "home"),)), (False, True)),
        ("(imply (heavy cup1) (quiet))", Delta(removed=(fact("heavy", "cup1"),)), (False, True)),
        ("(imply (heavy cup1) (quiet))", Delta(added=(fact("quiet"),)), (False, True)),
        ("(level can1 (+ (weight cup1) 1))", Delta(values={fact("weight", "cup1"): 4}), (False, True)),
    ],
)
def test_a_condition_reflects_a_change_to_any_of_its_inputs(kb, text, change, truths) -> None:
    tell(kb, ("heavy", "cup1"), ("heavy", "cup2"), ("on", "cup1", "shelf"), ("level", "can1", 5))
    weigh(kb, "cup1", 2)
    condition = kb.install(text, {"new": "can9"} if "?new" in text else {})
    before = condition.truth
    kb.apply(change, author="test")
    assert (before, condition.truth) == truths


def test_installed_and_cancelled_conditions_with_their_origin(kb):
    kept, once = kb.install("(heavy cup1)"), kb.install("(exists (?i - item) (heavy ?i))", once=True)
    assert kb.conditions() == [kept, once]
    kb.apply(Delta(added=(fact("heavy", "can1"),)), author="test")
    assert kb.conditions() == [kept]
    assert kb.conditions(cancelled=True) == [once]
    assert (once.truth, once.version, once.fired) == (True, kb.version, 1)
    assert (kept.truth, kept.version) == (False, 1)
    assert kept.origin is not None
    assert str(kept.origin.source).endswith("test_conditions_firing.py")


def test_the_number_of_cancelled_conditions_is_bounded(kb):
    for _ in range(250):
        kb.install("(heavy cup1)").cancel()
    cancelled = kb.conditions(cancelled=True)
    assert [one.number for one in cancelled] == [*range(151, 251)]

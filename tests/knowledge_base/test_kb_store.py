"""The store: transactions, notifications, the graph, overlays, several threads."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial
from typing import Any

import networkx as nx
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kb_interrupts import interrupted
from kb_strategies import SCHEMA, THINGS, deltas, removals
from kb_worlds import graph_content

from knowledge_base import Change, ConflictError, Delta, DscError, Fact, InputError, KnowledgeBase, Overlay, fact


@pytest.fixture
def kb() -> KnowledgeBase:
    kb = KnowledgeBase(SCHEMA)
    with kb.transaction(author="test") as tx:
        for name, type_name in THINGS.items():
            tx.add_node(name, type_name)
        tx.tell("on", "cup1", "shelf")
        tx.tell("near", "home", "shelf")
        tx.set("weight", "cup1", 2)
    return kb


def described(world) -> tuple[Any, ...]:
    """All a world says, asked through its five questions; the order counts."""
    facts = {p: list(world.match(p, (None,) * signature.arity)) for p, signature in world.schema.predicates.items()}
    things = {t: list(world.objects(t)) for t in world.schema.types}
    fluents = [("time",), *(("weight", i) for i in ("cup1", "cup2", "can1"))]
    return facts, things, [world.value(f[0], tuple(f[1:])) for f in fluents], list(map(world.type_of, THINGS))


START = Delta(nodes=THINGS, added=(fact("on", "cup1", "shelf"), fact("heavy", "cup2")))


@settings(max_examples=60)
@given(st.lists(deltas() | removals(), max_size=6))
def test_graph_and_index_agree_at_every_version(changes) -> None:
    kb = KnowledgeBase(SCHEMA)
    for change in changes:
        kb.apply(change, author="test")
        things, facts, values = graph_content(kb.graph)
        assert things == {name: kb.type_of(name) for name in kb.objects("object")}
        assert facts == set(kb.facts())
        assert values == kb.values()
        for known in facts:
            for position, value in enumerate(known.args):
                pattern = tuple(value if i == position else None for i in range(len(known.args)))
                found = kb.match(known.predicate, pattern)
                assert found == [a for a in kb.match(known.predicate, (None,) * len(known.args))
                                 if a[position] == value]  # fmt: skip


@settings(max_examples=60)
@given(st.lists(deltas() | removals(), max_size=4))
def test_an_overlay_says_what_the_store_would(changes) -> None:
    kb, other = KnowledgeBase(SCHEMA), KnowledgeBase(SCHEMA)
    kb.apply(START, author="test")
    other.apply(START, author="test")
    before = described(kb)
    pending = kb.overlay()
    for change in changes:
        pending.apply(change)
        other.apply(change, author="test")
    facts, things, values, types = described(pending)
    assert before == described(kb)
    expected = described(other)
    assert {p: set(f) for p, f in facts.items()} == {p: set(f) for p, f in expected[0].items()}
    assert {t: set(n) for t, n in things.items()} == {t: set(n) for t, n in expected[1].items()}
    assert (values, types) == expected[2:]
    kb.apply(pending.delta, author="test")
    assert set(kb.facts()) == set(other.facts())
    assert described(kb)[2:] == expected[2:]


@settings(max_examples=60)
@given(st.lists(deltas() | removals(), max_size=4))
def test_the_announced_changes_rebuild_the_world(changes) -> None:
    kb, mirror = KnowledgeBase(SCHEMA), KnowledgeBase(SCHEMA)

    def repeat(change: Change) -> None:
        mirror.apply(change.delta, change.author)

    kb.subscribe(repeat)
    for change in changes:
        kb.apply(change, author="test")
    assert described(mirror) == described(kb)
    assert mirror.version == kb.version


@settings(max_examples=60)
@given(deltas() | removals(), deltas() | removals())
def test_one_change_after_the_other_is_their_composition(first, second) -> None:
    one, two = KnowledgeBase(SCHEMA), KnowledgeBase(SCHEMA)
    for kb in (one, two):
        kb.apply(Delta(nodes=THINGS, added=(fact("on", "cup1", "shelf"),)), author="test")
    second = Delta(THINGS, second.removed, second.added, second.values, second.removed_nodes, second.replaced)
    one.apply(first, author="test")
    one.apply(second, author="test")
    two.apply(first.then(second), author="test")
    assert set(one.facts()) == set(two.facts())
    assert described(one)[2:] == described(two)[2:]


def test_a_graph_built_late_equals_an_updated_graph(kb) -> None:
    early, late = kb, KnowledgeBase.from_json(kb.to_json())
    followed = early.graph
    for world in (early, late):
        with world.transaction(author="test") as tx:
            tx.retract("on", "cup1", "shelf")
            tx.set("weight", "cup1", 3)
            tx.remove_node("cup2")
    assert graph_content(late.graph) == graph_content(followed)


def test_the_graph_is_read_only_and_follows(kb) -> None:
    graph = kb.graph
    assert graph.nodes["cup1"]["type"] == "cup"
    assert graph.has_edge("cup1", "shelf", key="on")
    assert graph.edges["cup1", "cup1", "weight"]["value"] == 2
    with pytest.raises(nx.NetworkXError):
        graph.add_node("ghost")
    kb.apply(Delta(added=(fact("heavy", "cup1"),)), author="test")
    assert graph.has_edge("cup1", "cup1", key="heavy")


def test_query_ask_and_explain(kb) -> None:
    assert kb.query("(on ?i shelf)") == [{"i": "cup1"}]
    assert kb.query("(on ?i ?p)", {"p": "shelf"}) == [{"i": "cup1"}]
    assert kb.ask("(on ?i shelf)", {"i": "cup1"})
    assert kb.explain("(on ?i home)", {"i": "cup1"}).text == "(on cup1 home)"


def test_a_name_with_capitals_of_an_older_store_is_reached_in_quotes_or_as_a_parameter(kb, monkeypatch) -> None:
    monkeypatch.setattr("knowledge_base.world.overlay.is_name", lambda _: True)
    kb.apply(Delta(nodes={"Cup 9": "cup"}, added=(fact("heavy", "Cup 9"),)), author="test")
    assert kb.ask('(heavy "Cup 9")')
    assert kb.ask("(heavy ?i)", {"i": "Cup 9"})
    with pytest.raises(InputError, match="did you mean"):
        kb.ask('(heavy "cup 9")')


def test_a_removed_thing_is_asked_about_without_error_once_known(kb) -> None:
    assert kb.ask("(cup cup2)")
    with kb.transaction(author="test") as tx:
        tx.remove_node("cup2")
    assert not kb.ask("(cup cup2)")


@pytest.mark.parametrize("params", [{}, {"other": "cup1"}, {"c": (1, 2)}])
def test_a_parameter_that_is_missing_or_a_geometry_is_the_same_error_when_the_text_is_known(kb, params) -> None:
    with pytest.raises(InputError) as first:
        kb.ask("(heavy ?c)", params)
    kb.ask("(heavy ?c)", {"c": "cup1"})
    with pytest.raises(InputError) as later:
        kb.ask("(heavy ?c)", params)
    assert str(later.value) == str(first.value)


def test_the_effective_change_is_announced_with_version_and_author(kb) -> None:
    heard: list[Change] = []
    kb.subscribe(heard.append)
    version = kb.version
    told = (fact("on", "cup1", "shelf"), Fact("quiet"))
    change = kb.apply(Delta(removed=(fact("on", "cup2", "home"),), added=told), author="ear")
    assert heard == [change]
    assert (change.version, change.author) == (version + 1, "ear")
    assert change.delta == Delta(added=(Fact("quiet"),))


def test_a_change_without_effect_is_not_announced(kb) -> None:
    heard: list[Change] = []
    version = kb.version
    kb.subscribe(heard.append)
    same = Delta(
        nodes={"cup1": "cup"},
        removed=(fact("on", "cup2", "shelf"),),
        added=(fact("on", "cup1", "shelf"),),
        values={fact("weight", "cup1"): 2},
    )
    assert not kb.apply(same, author="test").delta
    with kb.transaction(author="test") as tx:
        tx.tell("quiet")
        tx.retract("quiet")
    assert (heard, kb.version) == ([], version)


def test_a_transaction_sees_itself_and_nobody_else_does(kb) -> None:
    with kb.transaction(author="test") as tx:
        tx.tell("on", "cup2", "home")
        assert tx.ask("(on cup2 home)")
        assert tx.query("(on ?i home)") == [{"i": "cup2"}]
        assert not kb.ask("(on cup2 home)")
    assert kb.ask("(on cup2 home)")


def test_a_transaction_that_raises_leaves_nothing_behind(kb) -> None:
    before = described(kb)
    version = kb.version
    heard: list[Change] = []
    kb.subscribe(heard.append)
    with pytest.raises(InputError), kb.transaction(author="test") as tx:  # noqa: PT012
        tx.add_node("cup3", "cup")
        tx.tell("on", "cup3", "home")
        tx.set("weight", "cup3", 1)
        tx.remove_node("cup1")
        tx.tell("on", "cup1", "home")
    assert (described(kb), kb.version, heard) == (before, version, [])
    kb.apply(Delta(added=(Fact("quiet"),)), author="test")  # the lock is free again


def test_a_bad_delta_leaves_nothing_behind(kb) -> None:
    before = described(kb)
    bad = Delta(nodes={"cup3": "cup"}, added=(Fact("quiet"), fact("on", "cup3", "cup1")))
    with pytest.raises(InputError):
        kb.apply(bad, author="test")
    assert described(kb) == before


def test_a_transaction_inside_another_and_after_its_end_is_refused(kb) -> None:
    with kb.transaction(author="outer") as tx:
        with pytest.raises(ConflictError, match="outer"):
            kb.apply(Delta(added=(Fact("quiet"),)), author="inner")
        with pytest.raises(ConflictError, match="outer"), kb.transaction(author="inner"):
            pass
    with pytest.raises(ConflictError, match="over"):
        tx.tell("quiet")


def test_a_removed_thing_takes_its_facts_and_numbers_along(kb) -> None:
    with kb.transaction(author="test") as tx:
        tx.remove_node("cup1")
        tx.add_node("cup1", "can")
    assert kb.type_of("cup1") == "can"
    assert not kb.query("(on ?i ?p)")
    assert kb.value("weight", ("cup1",)) == 0


def test_listeners_hear_in_commit_order_outside_the_lock(kb) -> None:
    heard: list[tuple[str, int]] = []

    def first(change) -> None:
        heard.append(("first", change.version))
        if change.author == "test":
            kb.apply(Delta(removed=(Fact("quiet"),)), author="first")
        answers = []
        other = threading.Thread(target=lambda: answers.append(kb.ask("(quiet)")))
        other.start()
        other.join(timeout=5)
        assert answers == [False]  # another thread gets its answer meanwhile

    kb.subscribe(first)
    kb.subscribe(lambda change: heard.append(("second", change.version)))
    version = kb.version
    kb.apply(Delta(added=(Fact("quiet"),)), author="test")
    assert heard == [(who, version + n) for n in (1, 2) for who in ("first", "second")]


def test_a_failing_listener_silences_nobody(kb) -> None:
    heard: list[Change] = []

    def fail(change) -> None:
        raise ValueError("deaf")

    stop = kb.subscribe(fail)
    kb.subscribe(heard.append)
    with pytest.raises(ExceptionGroup):
        kb.apply(Delta(added=(Fact("quiet"),)), author="test")
    stop()
    kb.apply(Delta(removed=(Fact("quiet"),)), author="test")
    assert len(heard) == 2


def test_several_threads_change_and_ask_at_once(kb) -> None:
    versions = []
    kb.subscribe(lambda change: versions.append(change.version))
    start = kb.version

    def work(own: int) -> None:
        for i in range(30):
            with kb.transaction(author=f"thread{own}") as tx:
                count = tx.query("(= (time) ?n)", {"n": 0}) or kb.value("time", ())
                assert count is not None
                tx.set("time", kb.value("time", ()) + 1)
                tx.add_node(f"cup-{own}-{i}", "cup")
            assert kb.ask("(exists (?i - cup) (on ?i shelf))")

    threads = [threading.Thread(target=work, args=(n,)) for n in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert kb.value("time", ()) == 120
    assert versions == list(range(start + 1, start + 121))


def test_a_snapshot_stays_as_it_was(kb) -> None:
    snapshot, before = kb.snapshot(), described(kb)
    kb.apply(Delta(added=(Fact("quiet"),), removed=(fact("on", "cup1", "shelf"),)), author="test")
    assert described(snapshot) == before


def test_overlays_stack(kb) -> None:
    low = kb.overlay()
    low.apply(Delta(nodes={"cup3": "cup"}, removed=(fact("on", "cup1", "shelf"),)))
    high = Overlay(low)
    high.apply(Delta(added=(fact("on", "cup3", "shelf"),)))
    assert high.match("on", (None, "shelf")) == [("cup3", "shelf")]
    assert low.match("on", (None, None)) == []
    assert kb.match("on", (None, None)) == [("cup1", "shelf")]


def test_an_interrupt_at_any_moment_of_a_change_silences_nobody() -> None:
    was_interrupted, moment = True, 0
    while was_interrupted:
        kb = KnowledgeBase(SCHEMA)
        heard: list[Change] = []
        kb.subscribe(heard.append)
        commit: Callable[[], Any] = partial(kb.apply, Delta(nodes={"cup1": "cup"}), "test")
        was_interrupted = interrupted(moment, commit)
        kb.apply(Delta(nodes={"cup2": "cup"}), "test")
        assert heard[-1].version == kb.version, f"interrupted at moment {moment}"
        moment += 1
    assert moment > 1


# -- changes as text, and texts of values ----------------------------------------------------------------------


def test_a_text_of_statements_is_a_change(kb) -> None:
    change = kb.apply("(item cup9) (on cup9 shelf) (not (on cup1 shelf)) (= (weight cup9) 3)", author="me")
    assert change.delta == Delta(
        nodes={"cup9": "item"},
        removed=(fact("on", "cup1", "shelf"),),
        added=(fact("on", "cup9", "shelf"),),
        values={fact("weight", "cup9"): 3},
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("(on cup1 shelf) (not (on cup1 shelf))", "contradicts itself"),
        ("(on cup1 shelff)", "did you mean 'shelf'"),
        ("(or (on cup1 shelf))", "'or' is not an effect"),
        ("on cup1 shelf", "written in parentheses"),
    ],
)
def test_a_text_that_is_no_change_is_refused_with_its_place(kb, text, said) -> None:
    before = kb.contents()
    with pytest.raises(InputError, match=said) as found:
        kb.apply(text, author="me")
    assert found.value.place is not None
    assert kb.contents() == before


def test_the_contents_of_a_world_are_a_change_of_another(kb) -> None:
    other = KnowledgeBase(SCHEMA)
    other.apply(KnowledgeBase.from_json(kb.to_json()).contents(), author="import")
    assert other.contents() == kb.contents()


def test_a_change_is_shown_as_the_call_that_makes_it(kb) -> None:
    change = Delta(nodes={"cup9": "item"}, added=(fact("on", "cup9", "shelf"),))
    assert repr(change) == "Delta(nodes={'cup9': 'item'}, added=(fact('on', 'cup9', 'shelf'),))"
    assert repr(kb) == f"<KnowledgeBase: {len(THINGS)} objects, 2 facts, 1 values, version 1>"


def test_all_errors_have_one_base() -> None:
    assert issubclass(InputError, DscError)
    assert issubclass(ConflictError, DscError)

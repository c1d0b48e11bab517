"""Conversions: pure functions that terms of plots call (S2.21)."""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass
from typing import Any, NewType

import pytest

from dsc import Library, conversion, parse_plot
from dsc.errors import ChangedError, PlotError
from dsc.sequencer.clock import run_simulated
from knowledge_base import InputError
from planning import Bundle, PlanningDomain, Robot

Item = NewType("Item", str)


@dataclass
class Find:
    item: Item
    score: float


@conversion
def best(finds: list[Find], least: float = 0.0) -> Item:
    return max((one for one in finds if one.score > least), key=lambda one: one.score).item


@conversion
def near(items: list[Item], far: bool = False) -> list[Find]:
    return [Find(one, float(number) + far) for number, one in enumerate(items)]


@conversion
def total(numbers: list[float]) -> float:
    return sum(numbers)


@conversion
def wrong(number: float) -> list[Item]:
    return number  # type: ignore[return-value]


@conversion
def slow(seconds: float) -> float:
    time.sleep(seconds)
    return seconds


ALL = (best, near, total, wrong, slow)
DOMAIN = "(define (domain d) (:types item) (:constants a b c - item))"
PLOT = """
plot: p
parameters: {{items: {{type: list of item, default: [a, b, c]}}}}
variables: {{x: {{type: {kind}, initial: {initial}}}}}
outputs: {{out: {kind}}}
emits: {{failed: {{reason: text}}}}
states:
  s:
    on:
      done: {{to: t, assign: {{out: {term}}}}}
  t:
    on:
      error: {{to: f, emit: failed, with: {{reason: ?event.reason}}}}
    after: {{seconds: 1, to: over}}
  over: {{final: true}}
  f: {{final: true}}
"""


def run(term: str, kind: str = "item", initial: str = "a") -> Any:
    """Return the output of a plot that calls the term, or the reason of the error."""
    plot = parse_plot(PLOT.format(term=term, kind=kind, initial=initial))
    with Robot(DOMAIN, [plot], [], clock="simulated", conversions=ALL) as robot:
        end = robot.run("p")
        return end.emitted[0].attributes["reason"] if end.emitted else end.outputs["out"]


@pytest.mark.parametrize(
    ("term", "kind", "initial", "value"),
    [
        ("(best (near ?items))", "item", "a", "c"),
        ("(best [{item: b, score: 3}, {item: ?x, score: 1.5}])", "item", "a", None),
        ("(best (list (record item b score 3) (record item ?x score 1.5)))", "item", "a", "b"),
        ("(near [a, b])", "list of find", "[]", None),
        ("(near (list a b) true)", "list of find", "[]", [{"item": "a", "score": 1.0}, {"item": "b", "score": 2.0}]),
        ("(+ 1 (total (list 1 2 3)))", "number", "0", 7),
        ("[(total (list 1 ?x)), 4]", "list of number", "0", None),
    ],
)
def test_a_term_calls_a_conversion(term, kind, initial, value):
    if value is None:  # YAML's brackets do not stand inside of parentheses, nor a list where a number is read
        with pytest.raises(InputError):
            run(term, kind, initial)
    else:
        assert run(term, kind, initial) == value


@pytest.mark.parametrize(
    ("term", "kind", "said"),
    [
        ("(bst ?items)", "item", "did you mean 'best'?"),
        ("(best)", "item", "conversion 'best' is called as (best ?finds ?least); found 0 arguments"),
        ("(best ?items)", "item", "'finds' is of type list of find, and ?items is of type list of item"),
        ("(best (near ?items) ?x)", "item", "'least' is of type number, and ?x is of type item"),
        ("(total (list 1 2))", "item", "'out' is of type item, and (total (list 1 2)) is of type number"),
        ("(total (list a 2))", "number", "'0' is of type number, and a is of type item"),
        ("(+ 1 (best (near ?items)))", "number", "is of type number, and (best (near ?items)) is of type item"),
    ],
)
def test_a_mistake_is_found_before_the_run(term, kind, said):
    with pytest.raises(PlotError) as caught:
        run(term, kind, "0" if kind == "number" else "a")
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("term", "kind", "said"),
    [
        ("(best (near (list)))", "item", "conversion 'best': ValueError: max() "),
        ("(best (near ?items) 9)", "item", "conversion 'best': ValueError: max() "),
        ("(wrong 1)", "list of item", "the result of conversion 'wrong' is a list of item, not 1"),
    ],
)
def test_a_failure_is_an_error_of_the_state(term, kind, said):
    assert said in run(term, kind, "a" if kind == "item" else "[]")


def test_a_slow_conversion_is_reported_with_its_line(caplog):
    with caplog.at_level(logging.WARNING):
        assert run("(slow 0.06)", "number", "0") == 0.06
    assert "conversion 'slow' took 0.06 s" in caplog.text
    assert f"{__file__}:" in caplog.text


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (lambda: conversion(_without_result), "has no return annotation"),
        (lambda: conversion(_coroutine), "is a coroutine"),
        (lambda: conversion(_any_number), "plots pass arguments by name"),
        (lambda: conversion(Size), "cannot be named 'Size'"),
        (lambda: Library([], [total, conversion(_other_total())]), "two conversions are named 'total'"),
        (lambda: Library([], [len]), "is not a conversion"),  # type: ignore[list-item]
    ],
)
def test_a_wrong_declaration_is_refused(made, said):
    with pytest.raises(InputError) as caught:
        made()
    assert said in str(caught.value)


def _without_result(x: float):
    return x


async def _coroutine(x: float) -> float:
    return x


def _any_number(*x: float) -> float:
    return sum(x)


def Size(x: float) -> float:  # noqa: N802
    return x


def _other_total() -> Any:
    def total(numbers: list[float]) -> float:
        return sum(numbers) + 1

    return total


def test_a_conversion_is_a_function_for_its_program():
    assert best([Find(Item("a"), 0.3)]) == "a"


WAIT = parse_plot("""
plot: wait
outputs: {n: number}
states:
  w: {after: {seconds: 100, to: over, assign: {n: (total (list 1 2))}}}
  over: {final: true}
""")


def test_another_version_of_a_conversion_is_named_at_a_resume(tmp_path):
    def robot(made: Any) -> Robot:
        bundle = Bundle("b", plots=(WAIT,), conversions=(made,), domain=PlanningDomain.parse(DOMAIN))
        return Robot.of_bundles([bundle], store=tmp_path / "run.kb")

    async def suspended() -> None:
        async with robot(total) as one:
            one.start("wait")

    async def resumed(made: Any) -> Any:
        async with robot(made) as one:
            return (await one.resuming()).outputs["n"]

    run_simulated(suspended())
    with pytest.raises(ChangedError, match="conversion total"):
        run_simulated(resumed(conversion(_other_total())))
    assert run_simulated(resumed(total)) == 3

"""Domains written as PDDL: reading the text gives the same domain."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import unified_planning.test
from hypothesis import given
from random_domains import ACTIONS, domain_of

from knowledge_base import InputError, Schema, UnsupportedConstructError
from knowledge_base.pddl import parse_domain
from knowledge_base.pddl.writer import domain_to_text
from planning import PlanningDomain

ROOT = Path(__file__).parents[3]
OURS = [*sorted(ROOT.glob("domains/**/*domain*.pddl")), *sorted(ROOT.glob("examples/**/*domain*.pddl"))]
THEIRS = sorted(Path(unified_planning.test.__path__[0]).glob("pddl/*/domain.pddl"))


def content(domain: PlanningDomain) -> tuple[Any, ...]:
    schema = domain.schema
    return (
        domain.name, schema.types, schema.constants, schema.predicates, schema.functions, domain.actions, domain.axioms
    )  # fmt: skip


@pytest.mark.parametrize("path", [*OURS, *THEIRS], ids=lambda p: f"{p.parent.name}")
def test_files_are_the_same_when_written_and_read_again(path: Path) -> None:
    try:
        domain = PlanningDomain.from_pddl(path)
    except UnsupportedConstructError:
        return
    assert content(PlanningDomain.parse(domain.to_pddl())) == content(domain)


@given(ACTIONS)
def test_random_domains_are_the_same_when_written_and_read_again(actions) -> None:
    domain = domain_of(actions)
    assert content(PlanningDomain.parse(domain.to_pddl())) == content(domain)


TIMED = """(define (domain ovens)
  (:types cake pie - food oven food)
  (:predicates (in ?f - food ?o - oven) (hot ?o - oven) (done ?f - (either cake pie)))
  (:functions (minutes ?f - food) - number (label ?o - oven) - text)
  (:derived (hot ?o - oven) (exists (?f - food) (in ?f ?o)))
  (:durative-action bake :parameters (?f - food ?o - oven)
    :duration (and (>= ?duration (minutes ?f)) (<= ?duration 90))
    :condition (and (at start (in ?f ?o)) (over all (in ?f ?o)) (over all (not (done ?f))) (at end (in ?f ?o)))
    :effect (and (at start (not (done ?f))) (at end (done ?f)) (at end (forall (?p - pie) (when (in ?p ?o) (done ?p))))))
  (:durative-action wait :parameters () :duration (= ?duration 5) :condition () :effect ())
  (:durative-action idle :parameters () :duration () :condition () :effect ()))"""


def test_durations_axioms_and_kinds_of_functions_are_kept() -> None:
    domain = PlanningDomain.parse(TIMED)
    again = PlanningDomain.parse(domain.to_pddl())
    assert content(again) == content(domain)
    assert again.actions["bake"].timed == domain.actions["bake"].timed


def test_a_name_that_pddl_cannot_spell_is_refused() -> None:
    domain = PlanningDomain("Big Kitchen", Schema(), {})
    with pytest.raises(InputError, match="'Big Kitchen' cannot be a name in PDDL"):
        domain.to_pddl()


def test_the_text_of_a_text_is_the_text() -> None:
    text = domain_to_text(parse_domain(TIMED))
    assert domain_to_text(parse_domain(text)) == text

"""The PDDL files that come with unified-planning: read as its own reader reads them, or refused by name and place."""

from __future__ import annotations

from pathlib import Path

import pytest
from pddl_sweep import read, read_by_peer, shipped, written

from knowledge_base.errors import UnsupportedConstructError


@pytest.fixture(scope="module")
def pairs(tmp_path_factory):
    return [*shipped(), *written(tmp_path_factory.mktemp("examples"))]


def sort_out(pairs):
    """What can be read, and the errors of the rest."""
    taken, refused = {}, {}
    for pair in pairs:
        try:
            taken[pair.name] = read(pair)
        except UnsupportedConstructError as error:
            refused[pair.name] = error
    return taken, refused


@pytest.fixture(scope="module")
def sorted_out(pairs):
    return sort_out(pairs)


def test_there_are_files_of_every_kind(pairs, sorted_out):
    assert {pair.name.split("/")[0] for pair in pairs} == {"pddl", "hddl", "contingent_pddl", "examples"}
    taken, refused = sorted_out
    assert len(taken) > 40
    assert {":task", ":process", ":observe", "#t", ":constraints"} <= {error.construct for error in refused.values()}


def test_a_refused_construct_stands_in_the_line_that_the_error_names(sorted_out):
    for error in sorted_out[1].values():
        line = Path(error.place.source).read_text(encoding="utf-8").splitlines()[error.place.line - 1]
        assert line.lower().index(error.construct) >= error.place.column - 1


def test_accepted_files_are_read_as_by_the_peer_reader(pairs, sorted_out):
    taken, _ = sorted_out
    for pair in pairs:
        if pair.name in taken:
            domain, problem = taken[pair.name]
            theirs = read_by_peer(pair)
            assert said(domain, problem) == said_by_peer(theirs), pair.name


COST = "total-cost"  # the peer makes costs of actions of it


def said(domain, problem):
    predicates = {name: signature.arity for name, signature in domain.schema.predicates.items()}
    functions = {name: signature.arity for name, signature in domain.schema.functions.items() if name != COST}
    derived = {axiom.predicate for axiom in domain.axioms}
    return {
        "things": {**domain.schema.constants, **problem.objects},
        "fluents": {**{n: a for n, a in predicates.items() if n not in derived}, **functions},
        "actions": {a.name: ([p.name for p in a.parameters], a.duration is not None) for a in domain.actions.values()},
        "facts": {(f.predicate, f.args) for f in problem.init},
        "numbers": {
            (f.predicate, f.args, float(number)) for f, number in problem.values.items() if f.predicate != COST
        },
    }


def said_by_peer(problem):
    values = problem.explicit_initial_values
    atoms = [
        (f.fluent().name, tuple(str(a) for a in f.args), value)
        for f, value in values.items()
        if f.fluent().name != COST
    ]
    return {
        "things": {o.name: o.type.name for o in problem.all_objects},
        "fluents": {fluent.name: fluent.arity for fluent in problem.fluents if fluent.name != COST},
        "actions": {a.name: ([p.name for p in a.parameters], hasattr(a, "duration")) for a in problem.actions},
        "facts": {(name, args) for name, args, value in atoms if value.is_true()},
        "numbers": {
            (name, args, float(value.constant_value())) for name, args, value in atoms if not value.is_bool_constant()
        },
    }

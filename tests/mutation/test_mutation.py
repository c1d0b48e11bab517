"""The data of the mutation test is true: rooms have files, reasons belong to code that is there."""

import tomllib
from typing import Any

from judgement import ACCEPTED, EXCLUDED, Excluded, exclusion, read_accepted, read_excluded
from rooms import ROOT, read_rooms
from workspace import undecorated


def test_every_room_has_modules_and_tests():
    rooms = read_rooms()
    assert {"engine", "journal", "run-store", "monitor", "sequencer"} <= set(rooms)
    assert all(room.modules and room.tests for room in rooms.values())


def test_an_accepted_survivor_is_a_line_of_its_function_and_has_a_reason():
    for (function, change), reason in read_accepted().items():
        parts = function.split(".")
        module = next(
            path for at in range(1, len(parts)) if (path := ROOT.joinpath(*parts[:at]).with_suffix(".py")).is_file()
        )
        source = {line.strip() for line in module.read_text().splitlines()}
        gone = {line.removeprefix("- ") for line in change.splitlines() if line.startswith("- ")}
        assert gone <= source, f"{function}: {gone - source}"
        assert reason.strip()


def test_no_survivor_is_accepted_twice():
    assert len(tomllib.loads(ACCEPTED.read_text())["accepted"]) == len(read_accepted())


def test_a_kind_is_excluded_by_its_whole_change_with_a_reason():
    assert all(kind.reason.strip() for kind in read_excluded())
    assert len(tomllib.loads(EXCLUDED.read_text())["excluded"]) == len({kind.pattern for kind in read_excluded()})
    sql = '- row = db.execute("SELECT a FROM b", {"a": 1})\n+ row = db.execute("select a from b", {"%s": 1})'
    assert exclusion(sql % "a", read_excluded())
    assert not exclusion(sql % "A", read_excluded())
    kinds = [Excluded(r"- a\n\+ b", "why")]
    assert exclusion("- a\n+ b", kinds) == "why"
    assert exclusion("- a\n+ bb", kinds) is None


def test_a_decorator_becomes_an_assignment_that_does_the_same():
    text = """
from contextlib import contextmanager
from functools import cached_property

def twice(function):
    return lambda *args: 2 * function(*args)

class Counter:
    @cached_property
    def size(self):
        return [1]

    @property
    def value(self):
        return self._value

    @value.setter
    def value(self, value):
        self._value = value

    @twice
    @twice
    def add(self, number):
        return number

    @staticmethod
    def zero():
        return 0

@contextmanager
def opened():
    yield "open"
"""
    rewritten = undecorated(text)
    assert "@contextmanager" not in rewritten
    assert "@cached_property" not in rewritten
    names: dict[str, Any] = {}
    exec(rewritten, names)  # noqa: S102  the code stands above
    counter = names["Counter"]()
    counter.value = 3
    assert (counter.value, counter.add(5), counter.zero()) == (3, 20, 0)
    assert counter.size is counter.size
    with names["opened"]() as state:
        assert state == "open"

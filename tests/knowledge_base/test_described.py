"""Any exception has a description of one short line, whatever its author did."""

from __future__ import annotations

import sys
import sysconfig
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from knowledge_base.errors import MAX_MESSAGE, InputError
from knowledge_base.language.syntax.text import parse_condition
from knowledge_base.tracebacks import is_of_project, raised_at, user_place, whole_traceback
from knowledge_base.user_objects import described, shown


class FailsError(Exception):
    def __str__(self):
        raise ValueError("no text")

    __repr__ = __str__


class ExitsError(Exception):
    def __str__(self):
        return sys.exit("in the text")


class RecursiveError(Exception):
    def __str__(self):
        return str(self)


class NoTextError(Exception):
    def __str__(self):
        return 7  # noqa: PLE0307  # on purpose


class Text(str):
    """Text of which nothing can be asked."""

    def __getattribute__(self, name):
        raise RuntimeError("hands off")

    def __len__(self):
        raise RuntimeError("hands off")

    __getitem__ = __str__ = __iter__ = __format__ = __len__  # type: ignore[assignment]


class OddTextError(Exception):
    def __str__(self):
        return Text("odd")


class Meta(type):
    @property
    def __name__(cls):  # type: ignore[override]
        raise RuntimeError("no name")

    def __repr__(cls):
        raise RuntimeError("no name")

    __str__ = __repr__


class NamelessError(Exception, metaclass=Meta):
    @property  # type: ignore[misc]
    def __class__(self):
        raise RuntimeError("no class")


class FailsAsInputError(InputError):
    def __str__(self):
        raise ValueError("no text")


class Group(ExceptionGroup):
    @property
    def exceptions(self):
        raise RuntimeError("no members")


def nested(depth):
    error: Exception = ValueError("deep")
    for _ in range(depth):
        error = ExceptionGroup("g", [error, FailsError()])
    return error


HOSTILE = {
    "str fails": FailsError(),
    "str exits": ExitsError(),
    "str recurs": RecursiveError(),
    "str is no text": NoTextError(),
    "str is odd": OddTextError(),
    "no name": NamelessError("so"),
    "huge": ValueError("x" * 5_000_000),
    "huge and odd": ValueError("\ud800\x00\n" * 100_000),
    "huge number": ValueError(10**5000),
    "huge name": type("E" * 100_000, (Exception,), {})("so"),
    "control characters": ValueError("a\x1b[31mb\x07c\ud83d"),
    "input error": FailsAsInputError("so"),
    "group": ExceptionGroup("two", [ValueError("first"), FailsError()]),
    "group without members": Group("g", [ValueError("first")]),
    "wide group": ExceptionGroup("many", [ValueError(str(n)) for n in range(100_000)]),
    "deep group": nested(900),
    "of no usual kind": SystemExit("the driver"),
    "arguments fail": KeyError(FailsError()),
}


@pytest.mark.parametrize("named", [True, False])
@pytest.mark.parametrize("kind", HOSTILE)
def test_any_exception_is_described_on_one_short_line(kind, named):
    text = described(HOSTILE[kind], named=named)
    assert type(text) is str
    assert text.isprintable()
    assert 0 < len(text) <= MAX_MESSAGE + 3
    text.encode()


def test_a_description_says_type_and_text():
    assert described(ValueError("the bus\n  is stuck")) == "ValueError: the bus is stuck"
    assert described(ValueError()) == described(ValueError(), named=False) == "ValueError"
    assert described(ValueError("so"), named=False) == "so"
    assert described(FailsError()) == "FailsError: (a text that cannot be made: ValueError)"
    assert described(NamelessError("so")) == "NamelessError: so"
    assert described(OddTextError()) == "OddTextError: odd"
    two = ExceptionGroup("two", [ValueError("a"), KeyError("b")])
    assert described(two) == "ExceptionGroup: two (2 sub-exceptions): ValueError: a; KeyError: 'b'"


def test_a_description_is_made_where_the_stack_ends():
    def at_the_end(error):
        try:
            return at_the_end(error)
        except RecursionError:
            return described(error)

    assert at_the_end(ValueError("so"))


@pytest.mark.parametrize("kind", HOSTILE)
def test_any_value_is_shown(kind):
    assert isinstance(shown(HOSTILE[kind]), str)
    assert isinstance(shown(Text("odd")), str)


class NoCauseError(Exception):
    @property
    def __cause__(self):  # type: ignore[override]
        raise RuntimeError("no cause")

    @property
    def __traceback__(self):  # type: ignore[override]
        raise RuntimeError("no traceback")


class OddCauseError(Exception):
    __cause__ = 5  # type: ignore[assignment]


class NotesError(Exception):
    @property
    def __notes__(self):  # type: ignore[override]
        return sys.exit("in the notes")


class UnreadError(SyntaxError):
    @property
    def filename(self):  # type: ignore[override]
        raise RuntimeError("no file")


class EmptyGroup(ExceptionGroup):
    @property
    def exceptions(self):
        return ()


def throw(error):
    raise error


def caught(error):
    try:
        throw(error)
    except BaseException as raised:  # noqa: BLE001
        return raised


def own_cause():
    error = ValueError("its own cause")
    error.__cause__ = error
    return error


def causes_of_each_other():
    first, second = ValueError("first"), ValueError("second")
    first.__cause__, second.__cause__ = second, first
    return first


REPORTED = {
    **HOSTILE,
    "no cause": NoCauseError("so"),
    "odd cause": OddCauseError("so"),
    "notes exit": NotesError("so"),
    "no file": UnreadError("so"),
    "empty group": EmptyGroup("so", [ValueError("first")]),
    "its own cause": own_cause(),
    "causes of each other": causes_of_each_other(),
}


@pytest.mark.parametrize("kind", REPORTED)
def test_any_exception_has_its_line_and_a_traceback(kind):
    error = caught(REPORTED[kind])
    assert Path(__file__).name in raised_at(error)
    place = user_place(error)
    assert place is not None
    assert place.source == __file__
    assert whole_traceback(error)


def test_an_error_of_this_project_is_told_from_one_of_an_installed_package():
    def parse():
        parse_condition("(and")

    names: dict[str, Any] = {"parse": partial(parse_condition, "(and")}
    installed = Path(sysconfig.get_path("purelib")) / "my_robot.py"
    exec(compile("def configure():\n    parse()\n", str(installed), "exec"), names)  # noqa: S102
    for call, ours in ((parse, False), (names["configure"], False)):
        with pytest.raises(InputError) as raised:
            call()
        assert is_of_project(raised.value) is ours

"""Requests of the page: JSON of bounded size and depth, and bounded queries of the knowledge at a record.

The knowledge is replayed from records, with checkpoints.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import islice
from threading import Lock
from types import MappingProxyType
from typing import Any, Generic, TypeVar

from pydantic_core import from_json

from dsc.viewer.recorded_run import TYPES, RecordedRun
from dsc.viewer.records import RecordLog
from knowledge_base.errors import InputError, OutOfBoundsError, UnknownNameError
from knowledge_base.exchange import delta_of, schema_of, world_of
from knowledge_base.facts import Fact
from knowledge_base.language.evaluation.explanation import Explanation
from knowledge_base.language.evaluation.world_protocol import Bounds
from knowledge_base.language.syntax.expression import Expression, variables_in_order
from knowledge_base.language.syntax.text import parse_condition, to_text
from knowledge_base.view import View
from knowledge_base.world.schema import Schema
from knowledge_base.world.state import WorldState

CHECKPOINT_EVERY = 500
"""Maximum number of records that are replayed to compute a state."""

_TYPE = re.compile(r'"type": "([^"]*)"')
_S = TypeVar("_S")


class RecordReplay(Generic[_S]):
    """A state computed from records; it can be read as it was at any record.

    Args:
        log: the records.
        types: the relevant types of records.
        begin: the state before the first record.
        copy: returns an equal, independent state.
        advance: returns the state after a record; it may change the state that it receives.
    """

    def __init__(
        self,
        log: RecordLog,
        types: frozenset[str],
        begin: _S,
        copy: Callable[[_S], _S],
        advance: Callable[[_S, Mapping[str, Any]], _S],
    ) -> None:
        self._log, self._types, self._copy, self._advance = log, types, copy, advance
        self._seqs: list[int] = []
        self._scanned = 0
        self._checkpoints: list[_S] = [begin]
        self._lock = Lock()

    def at(self, seq: int) -> _S:
        """Return the state after the record with number `seq`.

        Raises:
            InputError: there is no such record, or a record up to this one is damaged.
        """
        if not 0 <= seq <= len(self._log):
            raise InputError(f"there is no record {seq}; the last one is {len(self._log)}")
        with self._lock:
            self._scan(seq)
            count = bisect_right(self._seqs, seq)
            start = min(count // CHECKPOINT_EVERY, len(self._checkpoints) - 1)
            state = self._copy(self._checkpoints[start])
            for number in range(start * CHECKPOINT_EVERY, count):
                state = self._advanced(state, self._seqs[number])
                if (number + 1) % CHECKPOINT_EVERY == 0 and (number + 1) // CHECKPOINT_EVERY == len(self._checkpoints):
                    self._checkpoints.append(self._copy(state))
            return state

    def _advanced(self, state: _S, seq: int) -> _S:
        try:
            return self._advance(state, self._log.record(seq))
        except (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError) as error:
            raise InputError(f"record {seq} is damaged, so later knowledge is unknown: {error!r}") from None

    def _scan(self, seq: int) -> None:
        """Find the relevant records up to `seq`; the type is near the beginning of a line."""
        while self._scanned < seq:
            self._scanned += 1
            found = _TYPE.search(self._log.line(self._scanned), 0, 120)
            if found is not None and found[1] in self._types:
                self._seqs.append(self._scanned)


@dataclass(slots=True)
class Known:
    """A world with its version, and the run with its active states."""

    state: WorldState
    version: int
    run: RecordedRun


def knowledge(log: RecordLog) -> RecordReplay[Known]:
    """Return the replay of the knowledge."""
    begin = Known(WorldState(Schema()), 0, RecordedRun())
    return RecordReplay(
        log, TYPES | {"knowledge"}, begin, lambda k: Known(k.state.copy(), k.version, k.run.copy()), _apply_record
    )


def _apply_record(before: Known, record: Mapping[str, Any]) -> Known:
    data = dict(record)
    if record["type"] in TYPES:
        before.run.take(record)
    if record["type"] == "world":
        return Known(world_of(data, schema_of(data["schema"])), record["version"], before.run)
    if record["type"] != "knowledge":
        return before
    before.state.commit(delta_of(data))
    before.version = record["version"]
    return before


Form = Mapping[str, Any]
Left = Callable[[], bool]
"""Function that returns whether the browser has left."""

MOST_TEXT = 10_000
"""Maximum number of characters of an expression or statement from a browser."""
MOST_SECONDS = 5.0
"""Maximum number of seconds for an answer; then the query is abandoned."""
MOST_ANSWERS = 10_000
"""Maximum number of answers, facts or values in one message; `more` marks an incomplete message."""
MOST_EXPLAINED = 1.0
"""Maximum number of seconds for the explanation of an answer; then the explanation is omitted."""


def _still_there() -> bool:
    return False


class PageQueries:
    """Answers to the queries of one page, each as a JSON value; an invalid query raises `InputError`.

    A query takes at most `MOST_SECONDS`, and ends when `left` reports that the browser has left.
    """

    def __init__(self, log: RecordLog) -> None:
        self._log = log
        self._knowledge = knowledge(log)

    def query(self, asked: Form, left: Left = _still_there) -> dict[str, Any]:
        """Return the bindings that make the expression true.

        An expression without variables has no bindings; its truth value and a reason are returned instead.
        """
        view = self._view(asked)
        params = asked.get("params") or {}
        condition = parse_condition(_text(asked, "expression"), "EXPR")
        variables = [name for name in dict.fromkeys(variables_in_order(condition)) if name not in params]
        bounds = Bounds(seconds=MOST_SECONDS, cancelled=left)
        answers = view.query(condition, params, MOST_ANSWERS + 1, bounds)
        result = {"variables": variables, "holds": bool(answers), "answers": answers, "version": view.version}
        if len(answers) > MOST_ANSWERS:
            return {**result, "answers": answers[:MOST_ANSWERS], "more": True}
        return result if variables else {**result, "why": _why(view, condition, params, left, holds=bool(answers))}

    def facts(self, asked: Form, left: Left = _still_there) -> dict[str, Any]:  # noqa: ARG002  it takes a moment
        """Return all facts, or all facts about one object."""
        view, about = self._view(asked), asked.get("about")
        things, facts, values = view.nodes(), view.facts(), view.values()
        if about is not None:
            if about not in things:
                raise UnknownNameError(f"there is no object '{about}'", found=str(about), valid=things)
            facts = [fact for fact in facts if about in fact.args]
            values = {fluent: value for fluent, value in values.items() if about in fluent.args}
            near = {arg for fact in (*facts, *values) for arg in fact.args} | {about}
            things = {name: kind for name, kind in things.items() if name in near}
        result = {
            "version": view.version,
            "things": dict(islice(things.items(), MOST_ANSWERS)),
            "facts": [_list(fact) for fact in facts[:MOST_ANSWERS]],
            "values": [[*_list(fluent), value] for fluent, value in islice(values.items(), MOST_ANSWERS)],
        }
        return {**result, "more": True} if max(map(len, (things, facts, values))) > MOST_ANSWERS else result

    def _view(self, asked: Form) -> View:
        known = self._knowledge.at(_seq(asked))
        known.state.provide(known.run.rows())
        return View(known.state, known.version)


def _why(view: View, condition: Expression, params: Mapping[str, Any], left: Left, *, holds: bool) -> dict[str, Any]:
    try:
        return view.explain(condition, params, bounds=Bounds(seconds=MOST_EXPLAINED, cancelled=left)).to_json()
    except OutOfBoundsError as error:
        return Explanation(to_text(condition), holds, detail=str(error)).to_json()


def _list(fact: Fact) -> list[Any]:
    return [fact.predicate, *fact.args]


def _seq(asked: Form) -> int:
    seq = asked.get("seq")
    if isinstance(seq, bool) or not isinstance(seq, int):
        raise InputError("'seq' is the number of a record")
    return seq


def _text(asked: Form, name: str) -> str:
    text = asked.get(name)
    if not isinstance(text, str):
        raise InputError(f"'{name}' is a text")
    require_short(text, name)
    return text


def require_short(text: str, name: str) -> None:
    """Raise `InputError` for a text from a browser that is longer than `MOST_TEXT`."""
    if len(text) > MOST_TEXT:
        raise InputError(f"'{name}' has {len(text)} characters; a browser may send {MOST_TEXT}")


MOST_BYTES = 1 << 20
"""Maximum number of bytes of a request's body."""
Fields = Mapping[str, tuple[Callable[[Any], bool], str]]
"""Optional fields of a request: the test of a value, and a description of its type."""


def asked(body: bytes | str, form: Fields = MappingProxyType({})) -> dict[str, Any]:
    """Return the request in `body`.

    Raises:
        InputError: the body is not a JSON object, is nested too deeply, or a field has a value of another type.
    """
    try:
        request = from_json(body, allow_inf_nan=False)
    except ValueError as error:
        raise InputError(f"a request is one JSON object: {error}") from None
    if not isinstance(request, dict):
        raise InputError("a request is one JSON object")
    for name, (fits, words) in form.items():
        if request.get(name) is not None and not fits(request[name]):
            raise InputError(f"'{name}' is {words}")
    return request


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _number(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _scalar(value: Any) -> bool:
    return isinstance(value, str | int | float | bool)


def _scalars(value: Any) -> bool:
    return isinstance(value, dict) and all(map(_scalar, value.values()))


def _texts(value: Any) -> bool:
    return isinstance(value, list) and all(map(_is_text, value))


def _one_text(value: Any) -> bool:
    return isinstance(value, dict) and len(value) == 1 and all(map(_is_text, value.values()))


SEQ = (_number, "the number of a record")
QUERY: Fields = {"seq": SEQ, "expression": (_is_text, "a text"), "params": (_scalars, "names with their values")}
FACTS: Fields = {"seq": SEQ, "about": (_is_text, "a text")}
CONTROL: Fields = {
    "do": (_is_text, "a text"),
    "name": (_is_text, "a text"),
    "attributes": (lambda value: isinstance(value, dict), "names with their values"),
    "statements": (_texts, "a list of texts such as (on cup1 table)"),
    "owner": (_is_text, "a text"),
    "on": (_one_text, "one of state, event, condition, plan_step, with a text"),
    "number": (_number, "the number of a breakpoint"),
}

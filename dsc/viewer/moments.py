"""How things were after a record: replayed from those before it, with checkpoints, so that going back is cheap."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from threading import Lock
from typing import Any, Generic, TypeVar

from dsc.viewer.records import RecordLog
from knowledge_base.errors import InputError
from knowledge_base.exchange.forms import delta_of, schema_of, world_of
from knowledge_base.world.schema import Schema
from knowledge_base.world.state import WorldState

CHECKPOINT_EVERY = 500
"""Records that are replayed at most to get to a moment."""

_TYPE = re.compile(r'"type": "([^"]*)"')
_S = TypeVar("_S")


class Replay(Generic[_S]):
    """A state that records make, at any of them.

    Args:
        log: the records.
        types: which of them matter.
        begin: the state before the first record.
        copy: an independent state that says the same.
        advance: the state after a record, made from the one before, which it may change.
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
        """The state after the record with that number.

        Raises:
            InputError: there is no such record.
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
            raise InputError(f"record {seq} is damaged, and what follows from it is not known: {error!r}") from None

    def _scan(self, seq: int) -> None:
        """Find the records that matter, up to `seq`; their type stands at the beginning of the line."""
        while self._scanned < seq:
            self._scanned += 1
            found = _TYPE.search(self._log.line(self._scanned), 0, 120)
            if found is not None and found[1] in self._types:
                self._seqs.append(self._scanned)


@dataclass(slots=True)
class Known:
    """A world with its version."""

    state: WorldState
    version: int


def knowledge(log: RecordLog) -> Replay[Known]:
    """The knowledge at any record."""
    begin = Known(WorldState(Schema()), 0)
    return Replay(log, frozenset({"world", "knowledge"}), begin, lambda k: Known(k.state.copy(), k.version), _known)


def _known(before: Known, record: Mapping[str, Any]) -> Known:
    said = dict(record)
    if record["type"] == "world":
        return Known(world_of(said, schema_of(said["schema"])), record["version"])
    before.state.commit(delta_of(said))
    before.version = record["version"]
    return before

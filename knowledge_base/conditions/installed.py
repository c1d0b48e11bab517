"""All installed conditions of a knowledge base, found by what a change touches.

Every commit passes here under the lock, so that each version is judged exactly. Whom it can affect is looked up
for each changed fact, number or type (`readers`); conditions that do not agree with it are not looked at.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping

from knowledge_base.conditions.alpha_index import AlphaIndex
from knowledge_base.conditions.condition import FIRE, Condition, Fire, Terms
from knowledge_base.conditions.condition_shape import Args, Lifted, Shape, lifted
from knowledge_base.conditions.damping import Hold, TimerClock, relaxed
from knowledge_base.conditions.dependencies import BOTH, Kind, Occurrence
from knowledge_base.conditions.join import ConditionIndex, ConditionRow, Join
from knowledge_base.conditions.notification import Notifier
from knowledge_base.errors import InputError
from knowledge_base.facts import Delta, Fact, Value
from knowledge_base.language.checking.inputs import shown
from knowledge_base.language.syntax.expression import Expression, substitute
from knowledge_base.language.syntax.text import to_text
from knowledge_base.world.read_write_lock import ReadWriteLock
from knowledge_base.world.schema import Schema
from knowledge_base.world.state import WorldState

MORE, LESS = 1, -1


def terms(fire: Fire, *, hold_s: float, once: bool, clock: TimerClock | None) -> Terms:
    """The terms on which a condition fires, checked; see `KnowledgeBase.install`.

    Raises:
        InputError: an unknown way to fire, a time that is negative or not finite, or one without a clock.
    """
    if fire not in FIRE:
        message = f"a condition fires at an 'edge' or at 'each' change, not {shown(fire)}"
        raise InputError(message, found=str(fire), valid=FIRE)
    if isinstance(hold_s, bool) or not isinstance(hold_s, int | float) or not 0 <= hold_s < math.inf:
        raise InputError(f"a hold time is a number of seconds, 0 or more, not {shown(hold_s)}")
    if not hold_s:
        return Terms(fire, once, None)
    if clock is None:
        raise InputError(f"to hold for {hold_s} s a condition needs a clock: install(..., clock=...)")
    return Terms(fire, once, Hold(clock, hold_s))


Event = tuple[Kind, str, Args, int]
"""One fact, number or type that a change makes different: its name, arguments, and `MORE`, `LESS` or `BOTH`."""


class Installed:
    """The relations of a knowledge base's conditions by shape; all but `later` and `deliver` under its lock."""

    def __init__(self, world: WorldState, version: int, lock: ReadWriteLock, announcer: Notifier) -> None:
        self.lock = lock
        self.version = version
        self._world = world
        self._announcer = announcer
        self._relations: dict[Shape, Join] = {}
        self._readers: dict[tuple[Kind, str], ConditionIndex] = {}
        self._told: dict[ConditionRow, dict[Condition, None]] = {}
        self._changed: dict[ConditionRow, None] = {}
        self._numbers = 0

    def install(self, e: Expression, params: Mapping[str, Value], terms: Terms, hysteresis: float | None) -> Condition:
        """Keep a condition evaluated that was checked.

        Raises:
            InputError: there is nothing that the hysteresis could be about.
        """
        eased = e if hysteresis is None else relaxed(e, hysteresis)
        found = lifted(e, params, self._schema)
        rise = self._row(found)
        stay = rise if eased is e else self._row(lifted(eased, params, self._schema))
        self._numbers += 1
        condition = Condition(self, to_text(substitute(e, params)), (rise, stay), found.names, terms, self._numbers)
        for row in (rise, stay):
            self._told.setdefault(row, {})[condition] = None
        if terms.fire == "each":
            stay.relation.want_all(stay)
        condition.begin()
        return condition

    def remove(self, condition: Condition) -> None:
        """Forget a condition, and what was kept for it alone."""
        for row in dict.fromkeys(condition.rows):
            told = self._told[row]
            del told[condition]
            if not told:
                del self._told[row]
                row.relation.drop(row)
                if not row.relation.rows:
                    self._relations.pop(row.relation.shape, None)

    def conditions(self) -> list[Condition]:
        """All that are installed, in the order of installation."""
        return sorted({c for told in self._told.values() for c in told}, key=lambda c: c.number)

    def departures(self, effective: Delta) -> list[Event]:
        """The types and numbers that go with removed things; to be asked for before the change is made."""
        gone = set(effective.removed_nodes)
        if not (gone and self._relations):
            return []
        numbers = self._world.values_about(gone)
        types = [(name, t) for name in gone if (t := self._world.type_of(name)) is not None]
        return [
            *(("said", f.predicate, f.args, BOTH) for f in numbers),
            *(("type", t, (name,), LESS) for name, own in types for t in self._schema.ancestors(own)),
        ]

    def commit(self, effective: Delta, departures: list[Event], version: int) -> None:
        """Judge the change that the world has made, and queue what has to be told."""
        self.version = version
        if self._relations:
            self._judge([*departures, *self._events(effective)])

    def refreshed(self, fluent: Fact) -> None:
        """A fluent is worth something else, and no version was made: a source feeds it."""
        self._judge([("said", fluent.predicate, fluent.args, BOTH)])

    def later(self, call: Callable[[], None]) -> None:
        """Queue a call for when the lock is released; under the lock."""
        self._announcer.queue(call)

    def deliver(self) -> None:
        """Make the queued calls; without the lock."""
        self._announcer.deliver()

    @property
    def _schema(self) -> Schema:
        return self._world.schema

    def _events(self, effective: Delta) -> Iterator[Event]:
        for fact in effective.removed:
            yield "said", fact.predicate, fact.args, LESS
        for name, own in effective.nodes.items():
            for type_name in self._schema.ancestors(own):
                yield "type", type_name, (name,), MORE
        for fact in effective.added:
            yield "said", fact.predicate, fact.args, MORE
        for fluent in effective.values:
            yield "said", fluent.predicate, fluent.args, BOTH

    def _judge(self, events: list[Event]) -> None:
        """Bring all rows up to date with what has happened, and tell the conditions of those that changed."""
        known = self._readers
        reached = [(known[kind, name], args, sign) for kind, name, args, sign in events if (kind, name) in known]
        self._changed.clear()
        suspects = dict.fromkeys(s for readers, args, sign in reached for s in readers.broken(args, sign))
        renewed = [row for row, witness in suspects if row.relation.loses(row, witness)]
        failing = (row for readers, _, _ in reached for row in readers.failing)
        for row in dict.fromkeys((*renewed, *failing)):
            row.relation.renew(row)
        for readers, args, sign in reached:
            for trigger, rows in tuple(readers.made(args, sign)):
                if rows and trigger.admits(args):  # what came before may have closed them
                    trigger.relation.make(trigger, args, rows)
        touched = {condition for row in self._changed for condition in self._told.get(row, ())}
        for condition in sorted(touched, key=lambda c: c.number):
            condition.judge(self.version, self._changed)

    def _row(self, found: Lifted) -> ConditionRow:
        relation = self._relations.get(found.shape)
        if relation is None:
            relation = Join(found.shape, self._world, self._readers_of, self._changed)
            self._relations[found.shape] = relation
        return relation.row(found.key)

    def _readers_of(self, occurrence: Occurrence) -> ConditionIndex:
        return self._readers.setdefault((occurrence.kind, occurrence.name), AlphaIndex())

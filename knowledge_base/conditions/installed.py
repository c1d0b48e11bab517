"""All installed conditions of a knowledge base, found by what a change touches.

Every commit passes here under the lock, so that each version is judged exactly. Which shapes it can affect is
one look-up for each changed fact, number or type; shapes that do not read it are not looked at.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from threading import RLock

from knowledge_base.announcement import Announcer
from knowledge_base.conditions.clock import Clock
from knowledge_base.conditions.condition import FIRE, Condition, Fire, Place, Terms
from knowledge_base.conditions.dependencies import BOTH, Kind
from knowledge_base.conditions.holding import Hold
from knowledge_base.conditions.hysteresis import relaxed
from knowledge_base.conditions.relation import Hit, Relation
from knowledge_base.conditions.rows import Row
from knowledge_base.conditions.shape import Args, Shape, lifted
from knowledge_base.conditions.trigger import Trigger
from knowledge_base.errors import InputError
from knowledge_base.facts import Delta, Fact, Value
from knowledge_base.language.expression import Expression, substitute
from knowledge_base.language.printer import to_text
from knowledge_base.schema import Schema
from knowledge_base.state import WorldState

MORE, LESS = 1, -1


def terms(fire: Fire, *, hold_s: float, once: bool, clock: Clock | None) -> Terms:
    """The terms on which a condition fires, checked; see `KnowledgeBase.install`.

    Raises:
        InputError: an unknown way to fire, a time that is negative or not finite, or one without a clock.
    """
    if fire not in FIRE:
        raise InputError(f"a condition fires at an 'edge' or at 'each' change, not '{fire}'", found=fire, valid=FIRE)
    if not 0 <= hold_s < math.inf:
        raise InputError(f"a hold time is a number of seconds, 0 or more, not {hold_s}")
    if not hold_s:
        return Terms(fire, once, None)
    if clock is None:
        raise InputError(f"to hold for {hold_s} s a condition needs a clock: install(..., clock=...)")
    return Terms(fire, once, Hold(clock, hold_s))


Event = tuple[Kind, str, Args, int]
"""One fact, number or type that a change makes different: its name, arguments, and `MORE`, `LESS` or `BOTH`."""


_NOBODY: dict[Trigger, Relation] = {}


class Installed:
    """The relations of a knowledge base's conditions by shape; all but `later` and `deliver` under its lock."""

    def __init__(self, world: WorldState, version: int, lock: RLock, announcer: Announcer) -> None:
        self.lock = lock
        self.version = version
        self._world = world
        self._announcer = announcer
        self._relations: dict[Shape, Relation] = {}
        self._readers: dict[tuple[Kind, str], dict[Trigger, Relation]] = {}
        self._numbers = 0

    def install(self, e: Expression, params: Mapping[str, Value], terms: Terms, hysteresis: float | None) -> Condition:
        """Keep a condition evaluated that was checked.

        Raises:
            InputError: there is nothing that the hysteresis could be about.
        """
        eased = e if hysteresis is None else relaxed(e, hysteresis)
        rise = self._place(e, params)
        places = rise, rise if eased is e else self._place(eased, params)
        self._numbers += 1
        condition = Condition(self, to_text(substitute(e, params)), places, terms, self._numbers)
        for place in places:
            place.row.conditions[condition] = None
        if terms.fire == "each":
            places[1].relation.want_all(places[1].row, self._world)
        condition.begin()
        return condition

    def remove(self, condition: Condition) -> None:
        """Forget a condition, and what was kept for it alone."""
        for place in condition.places:
            place.row.conditions.pop(condition, None)
            if not place.row.conditions and place.row.key in place.relation.rows:
                place.relation.drop(place.row)
                if not place.relation.rows:
                    self._forget(place.relation)

    def conditions(self) -> list[Condition]:
        """All that are installed, in the order of installation."""
        rows = (row for relation in self._relations.values() for row in relation.rows.values())
        return sorted({c for row in rows for c in row.conditions}, key=lambda c: c.number)

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
            self._judge((*departures, *self._events(effective)))

    def refreshed(self, fluent: Fact) -> None:
        """A fluent is worth something else, and no version was made: a source feeds it."""
        self._judge([("said", fluent.predicate, fluent.args, BOTH)])

    def _judge(self, events: Iterable[Event]) -> None:
        hits: dict[Relation, list[Hit]] = {}
        for kind, name, args, sign in events:
            for trigger, relation in self._readers.get((kind, name), _NOBODY).items():
                hits.setdefault(relation, []).append((trigger, args, sign))
        changed: dict[Row, None] = {}
        for relation, own in hits.items():
            changed.update(dict.fromkeys(relation.update(own, self._world)))
        touched = {condition for row in changed for condition in row.conditions}
        for condition in sorted(touched, key=lambda c: c.number):
            condition.judge(self.version, changed)

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

    def _place(self, e: Expression, params: Mapping[str, Value]) -> Place:
        shape, key = lifted(e, params)
        relation = self._relations.get(shape)
        if relation is None:
            relation = self._relations[shape] = Relation(shape, self._schema)
            for trigger in relation.triggers:
                read = trigger.occurrence.kind, trigger.occurrence.name
                self._readers.setdefault(read, {})[trigger] = relation
        return Place(relation, relation.row(key, self._world))

    def _forget(self, relation: Relation) -> None:
        self._relations.pop(relation.shape, None)
        for trigger in relation.triggers:
            readers = self._readers.get((trigger.occurrence.kind, trigger.occurrence.name), {})
            readers.pop(trigger, None)

"""All installed conditions of a knowledge base, indexed by the facts, values and types that they read.

Every commit is evaluated here under the lock, so that each version is evaluated exactly. `AlphaIndex` finds the
conditions that a changed fact, value or type can affect; no other condition is evaluated.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from operator import attrgetter

from knowledge_base.conditions.condition import Condition
from knowledge_base.conditions.damping import Terms, relaxed
from knowledge_base.conditions.join import AlphaIndex, ConditionRow, Join
from knowledge_base.conditions.notification import Notifier
from knowledge_base.conditions.shape import BOTH, Args, Kind, Lifted, Occurrence, Shape, lifted
from knowledge_base.facts import Delta, Fact, Value
from knowledge_base.language.syntax.expression import Expression, substitute
from knowledge_base.language.syntax.text import to_text
from knowledge_base.world.state import WorldState

MORE, LESS = 1, -1
MOST_CANCELLED = 100
"""Maximum number of cancelled conditions that are kept for inspection."""

Event = tuple[Kind, str, Args, int]
"""One fact, value or type that a change affects: kind, name, arguments, and `MORE`, `LESS` or `BOTH`."""


class Installed:
    """The joins of all installed conditions, by shape; a caller must hold the lock of the knowledge base."""

    def __init__(self, world: WorldState, notifier: Notifier) -> None:
        self._world = world
        self._schema = world.schema
        self._notifier = notifier
        self._joins: dict[Shape, Join] = {}
        self._readers: dict[tuple[Kind, str], AlphaIndex] = {}
        self._conditions: dict[ConditionRow, dict[Condition, None]] = {}
        self._changed: dict[ConditionRow, None] = {}
        self._numbers = 0
        self._cancelled: deque[Condition] = deque(maxlen=MOST_CANCELLED)

    def install(self, e: Expression, params: Mapping[str, Value], terms: Terms, hysteresis: float | None) -> Condition:
        """Install a checked condition and return it.

        Raises:
            InputError: `hysteresis` is given, but the condition has no comparison.
        """
        eased = e if hysteresis is None else relaxed(e, hysteresis)
        found = lifted(e, params, self._schema)
        rise = self._row(found)
        stay = rise if eased is e else self._row(lifted(eased, params, self._schema))
        self._numbers += 1
        text = to_text(substitute(e, params))
        condition = Condition(text, (rise, stay), found.names, terms, self._numbers, self._notifier, self._remove)
        for row in (rise, stay):
            self._conditions.setdefault(row, {})[condition] = None
        if terms.fire == "each":
            stay.relation.want_all(stay)
        condition.begin()
        return condition

    def conditions(self, *, cancelled: bool = False) -> list[Condition]:
        """Return the installed conditions in the order of installation, or the latest cancelled ones."""
        if cancelled:
            return list(self._cancelled)
        return sorted({c for several in self._conditions.values() for c in several}, key=lambda c: c.number)

    def departures(self, effective: Delta) -> list[Event]:
        """Return the types and values that the removal of objects ends; must be called before the change is applied."""
        gone = set(effective.removed_nodes)
        if not (gone and self._joins):
            return []
        values = self._world.values_about(gone)
        types = [(name, t) for name in gone if (t := self._world.type_of(name)) is not None]
        return [
            *(("said", f.predicate, f.args, BOTH) for f in values),
            *(("type", t, (name,), LESS) for name, own in types for t in self._schema.ancestors(own)),
        ]

    def commit(self, effective: Delta, departures: list[Event]) -> None:
        """Evaluate the conditions after a change of the world, and queue the notifications."""
        if not self._joins:
            return
        events = departures
        for fact in effective.removed:
            events.append(("said", fact.predicate, fact.args, LESS))
        for name, own in effective.nodes.items():
            for type_name in self._schema.ancestors(own):
                events.append(("type", type_name, (name,), MORE))
        for fact in effective.added:
            events.append(("said", fact.predicate, fact.args, MORE))
        for fluent in effective.values:
            events.append(("said", fluent.predicate, fluent.args, BOTH))
        self._evaluate(events)

    def refreshed(self, *fluents: Fact) -> None:
        """Evaluate the conditions that read fluents with new values of sources; the version stays the same."""
        self._evaluate([("said", fluent.predicate, fluent.args, BOTH) for fluent in fluents])

    def reread(self, function: str) -> None:
        """Evaluate all conditions that read a function, whose values may all have changed."""
        readers = self._readers.get(("said", function))
        if readers is not None:
            self._changed.clear()
            for row in readers.rows():
                row.relation.renew(row)
            self._settle()

    def reads(self, name: str) -> bool:
        """Return whether an installed condition has read a predicate."""
        return ("said", name) in self._readers

    def renew(self, ended: list[Fact], begun: list[Fact]) -> None:
        """Evaluate the conditions after a change of relations; the version stays the same."""
        signs = [*((one, LESS) for one in ended), *((one, MORE) for one in begun)]
        self._evaluate([("said", one.predicate, one.args, sign) for one, sign in signs])

    def _evaluate(self, events: list[Event]) -> None:
        """Update the rows that the events affect, and then the conditions of the changed rows."""
        self._changed.clear()
        reached: list[tuple[AlphaIndex, Args, int]] = []
        suspects: dict[tuple[ConditionRow, Args], None] = {}
        renewed: dict[ConditionRow, None] = {}
        for kind, name, args, sign in events:
            readers = self._readers.get((kind, name))
            if readers is not None:
                reached.append((readers, args, sign))
                suspects.update(dict.fromkeys(readers.broken(args, sign)))
        for row, witness in suspects:
            if row.relation.loses(row, witness):
                renewed[row] = None
        for readers, _, _ in reached:
            renewed.update(readers.failing)
        for row in renewed:
            row.relation.renew(row)
        for readers, args, sign in reached:
            for trigger, rows in readers.made(args, sign):
                if rows:  # an earlier event may have closed the rows
                    trigger.relation.make(trigger, args, rows)
        self._settle()

    def _settle(self) -> None:
        """Let the conditions of the changed rows fire."""
        touched: dict[Condition, None] = {}
        for row in self._changed:
            touched.update(self._conditions.get(row, {}))
        for condition in sorted(touched, key=attrgetter("number")):
            condition.evaluate(self._notifier.version, self._changed)

    def _remove(self, condition: Condition) -> None:
        """Remove a condition, and the rows that no other condition uses."""
        for row in dict.fromkeys(condition.rows):
            conditions = self._conditions[row]
            del conditions[condition]
            if not conditions:
                del self._conditions[row]
                row.relation.drop(row)
                if not row.relation.rows:
                    self._joins.pop(row.relation.shape, None)
                    row.relation.close()
        self._cancelled.append(condition)

    def _row(self, found: Lifted) -> ConditionRow:
        join = self._joins.get(found.shape)
        if join is None:
            join = self._joins[found.shape] = Join(found.shape, self._world, self._readers_of, self._changed)
        return join.row(found.key)

    def _readers_of(self, occurrence: Occurrence) -> AlphaIndex:
        return self._readers.setdefault((occurrence.kind, occurrence.name), AlphaIndex())

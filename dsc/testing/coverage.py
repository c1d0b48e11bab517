"""Coverage of plots: states, transitions and rules that the runs of a test reached or missed."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from dsc.dynamic.library import Library
from dsc.engine.steps import Microstep, Step
from dsc.engine.taken import Taken
from dsc.model.plot import ActionPlot, Path
from dsc.model.states import HistoryState
from dsc.model.transitions import TransitionSource
from knowledge_base.errors import InputError, Place, UnknownNameError


class Coverage:
    """Counter of the reached parts of plots, over many runs in sequence.

    A substitute of a plot (`Library.substitute`) does not count for the original. A rule counts in the plot that
    declares it, also when it handled a failure in a generated plot that inherited it.

    Args:
        plots: the library, or its plots.
        only: names of the plots to cover; by default all plots.

    Raises:
        UnknownNameError: `only` has the name of a missing plot.
    """

    def __init__(self, plots: Iterable[ActionPlot], only: Collection[str] = ()) -> None:
        self._library = Library(plots)
        wanted = [self._library.plot(name) for name in only] or list(self._library)
        self._items = {plot.name: {item.key: item for item in items_of(plot)} for plot in wanted}
        self._reached: set[tuple[str, Key]] = set()
        self._inside: dict[str, str | None] = {}  # plots by path of the host state; None for a plot that is not covered
        self._seen: dict[int, tuple[ActionPlot, bool]] = {}

    def add(self, *steps: Step) -> None:
        """Count the states, transitions and rules of the steps; the method is also a listener for `Sequencer.listen`.

        Raises:
            InputError: the steps begin in the middle of a run.
        """
        for micro in (micro for step in steps for micro in step.microsteps):
            for taken in micro.taken:  # a transition precedes the plots that it binds
                self._take(taken)
            self._bind(micro)
            for path in micro.entered:
                holder, _, name = path.rpartition("/")
                self._count(self._holding(holder), ("state", name, ()))

    def missing(self, plot: str | None = None) -> tuple[CoverageItem, ...]:
        """Return the missed items of one plot, or of all plots, in the order of the plots and their texts.

        Raises:
            UnknownNameError: the plot is not covered.
        """
        return tuple(item for name in self._names(plot) for item in self._missing(name))

    def count(self, plot: str, kind: Kind) -> tuple[int, int]:
        """Return the number of reached states, transitions or rules of a plot, and the number of all.

        Raises:
            UnknownNameError: the plot is not covered.
        """
        (name,) = self._names(plot)
        keys = [key for key in self._items[name] if key[0] == kind]
        return sum((name, key) in self._reached for key in keys), len(keys)

    @property
    def ratio(self) -> float:
        """The number of reached items divided by the number of all items, from 0 to 1; 1 without items."""
        reached, total = self._total()
        return reached / total if total else 1.0

    def report(self) -> str:
        """Return a table of plots, with a line and a place for each missed item."""
        width = max(map(len, self._items), default=0)
        head = " " * width + "".join(f"  {kind + 's':>11}" for kind in KINDS)
        return "\n".join([head.rstrip(), *(line for name in self._items for line in self._lines(name, width))])

    def assert_complete(self, at_least: float = 1.0) -> None:
        """Raise `AssertionError` with the report if `ratio` is smaller than `at_least`.

        Args:
            at_least: the required ratio, from 0 to 1.
        """
        if self.ratio < at_least:
            reached, total = self._total()
            raise AssertionError(
                f"{reached} of {total} ({self.ratio:.1%}) covered, at least {at_least:.1%} wanted\n{self.report()}"
            )

    def to_json(self) -> dict[str, Any]:
        """Return, for each plot, the number of reached items and the missed items, with file and line."""
        return {
            name: {
                **{f"{kind}s": dict(zip(("reached", "all"), self.count(name, kind), strict=True)) for kind in KINDS},
                "missing": [item.to_json() for item in self._missing(name)],
            }
            for name in self._items
        }

    def _take(self, taken: Taken) -> None:
        holder, _, source = taken.source.rpartition("/")
        if taken.rule is None:
            self._count(self._holding(holder), ("transition", source, taken.place))
            return
        # The innermost covered plot around the state has the rule, as a generated plot inherits its host's rules.
        key: Key = ("rule", taken.rule, ())
        for around in _outwards(holder):
            name = self._holding(around)
            if name is not None and key in self._items[name]:
                self._count(name, key)
                return

    def _bind(self, micro: Microstep) -> None:
        for bound in micro.bound:
            self._inside[bound.state] = bound.plot.name if self._is_covered(bound.plot) else None

    def _is_covered(self, plot: ActionPlot) -> bool:
        if plot.name not in self._items:
            return False
        kept = self._seen.get(id(plot))  # one plot object occurs often; only its first use needs a comparison
        if kept is None or kept[0] is not plot:
            kept = (plot, self._library.expanded(self._library.plot(plot.name)) == plot)
            self._seen[id(plot)] = kept
        return kept[1]

    def _holding(self, state: str) -> str | None:
        if state not in self._inside:
            raise InputError("the steps of a run are counted from its start; these begin in the middle")
        return self._inside[state]

    def _count(self, plot: str | None, key: Key) -> None:
        if plot is not None and key in self._items[plot]:
            self._reached.add((plot, key))

    def _total(self) -> tuple[int, int]:
        total = sum(map(len, self._items.values()))
        return total - len(self.missing()), total

    def _names(self, plot: str | None) -> Iterable[str]:
        if plot is None:
            return self._items
        if plot not in self._items:
            raise UnknownNameError(f"the plot '{plot}' is not covered", found=plot, valid=self._items)
        return (plot,)

    def _missing(self, plot: str) -> Iterator[CoverageItem]:
        items: Mapping[Key, CoverageItem] = self._items[plot]
        return (item for key, item in items.items() if (plot, key) not in self._reached)

    def _lines(self, plot: str, width: int) -> Iterator[str]:
        counts = (self.count(plot, kind) for kind in KINDS)
        cells = (f"{reached} of {total}" if total else "-" for reached, total in counts)
        yield f"{plot:<{width}}" + "".join(f"  {cell:>11}" for cell in cells)
        yield from (f"  {item}" for item in self._missing(plot))


def _outwards(path: str) -> Iterator[str]:
    """Yield the path of a plot's host state, then of the host state around it, and so on to the outermost plot."""
    yield path
    while path:
        path = path.rpartition("/")[0]
        yield path


Kind = Literal["state", "transition", "rule"]
KINDS: tuple[Kind, ...] = ("state", "transition", "rule")
Key = tuple[Kind, str, Path]
"""Kind, name, and a transition's place in its state.

The name is a state's, the source state's of a transition, or a rule's label.
"""


@dataclass(frozen=True, slots=True)
class CoverageItem:
    """A part of a plot that a run may reach.

    Attributes:
        key: identity of the item within its plot.
        text: description of the item if it was missed.
        path: path of the item in the plot's form.
        place: place of the item in the text; `None` if the plot was not read from a text.
    """

    key: Key
    text: str
    path: Path
    place: Place | None

    @property
    def kind(self) -> Kind:
        """Kind of the item: state, transition or rule."""
        return self.key[0]

    def __str__(self) -> str:
        """Return one line with place and text."""
        return f"{self.place or '/'.join(map(str, self.path))}: {self.text}"

    def to_json(self) -> dict[str, Any]:
        """Return the item as plain data."""
        place = self.place
        written = {} if place is None else {"file": place.source, "line": place.line}
        return {"kind": self.kind, "text": self.text, "path": list(self.path), **written}


def items_of(plot: ActionPlot) -> Iterator[CoverageItem]:
    """Yield all items of a plot in its written form, in document order.

    The expansion of a rule adds no items: a rule is one item, for any number of states. A history state is not an item,
    as it refers to other states and is never entered itself.
    """
    for name, state, path in plot.walk():
        if not isinstance(state, HistoryState):
            yield CoverageItem(("state", name, ()), f"state '{name}' was never entered", path, plot.place(path))
        if isinstance(state, TransitionSource):
            for at, trigger, transition in state.placed_transitions():
                here = (*path, *at)
                goal = "(stays)" if transition.target is None else f"-> {transition.target}"
                text = f"'{name}' never took {trigger} {goal}"
                yield CoverageItem(("transition", name, at), text, here, plot.place(here))
    reactions = {"rules": [rule.label for rule in plot.rules], "handlers": [one.label for one in plot.handlers]}
    for group, labels in reactions.items():
        for number, label in enumerate(labels):
            here = (group, number)
            yield CoverageItem(("rule", label, ()), f"rule '{label}' never answered", here, plot.place(here))

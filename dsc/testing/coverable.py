"""Items of a plot for coverage: its states, its transitions, its rules."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

from dsc.model.plot import ActionPlot, Path
from dsc.model.states import HistoryState
from dsc.model.transitions import TransitionSource
from knowledge_base.errors import Place

Kind = Literal["state", "transition", "rule"]
KINDS: tuple[Kind, ...] = ("state", "transition", "rule")
Key = tuple[Kind, str, Path]
"""Kind, name (a state's, a transition's source state's, a rule's label), and a transition's place in its state."""


@dataclass(frozen=True, slots=True)
class CoverageItem:
    """A part of a plot that a run may reach.

    Attributes:
        key: its identity within its plot.
        text: its short name.
        path: its path in the plot's form.
        place: its place in the text, if the plot was read from one.
    """

    key: Key
    text: str
    path: Path
    place: Place | None

    @property
    def kind(self) -> Kind:
        """A state, a transition or a rule."""
        return self.key[0]

    def __str__(self) -> str:
        """Return one line with place and name."""
        return f"{self.place or '/'.join(map(str, self.path))}: {self.text}"

    def to_json(self) -> dict[str, Any]:
        """Return the item as plain data."""
        place = self.place
        written = {} if place is None else {"file": place.source, "line": place.line}
        return {"kind": self.kind, "text": self.text, "path": list(self.path), **written}


def items_of(plot: ActionPlot) -> Iterator[CoverageItem]:
    """Yield all items of a plot in its written form, in document order; rules with equal labels are one item.

    The expansion of a rule adds no items: a rule is one item, for any number of states. A history stands for other
    states and is never entered itself.
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
            if label not in labels[:number]:
                here = (group, number)
                yield CoverageItem(("rule", label, ()), f"rule '{label}' never answered", here, plot.place(here))

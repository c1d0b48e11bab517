"""What there is to cover in a plot: its states, its transitions, its rules."""

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
    """Something that a run may reach.

    Attributes:
        key: what it is, within its plot.
        text: what people call it.
        path: where it stands in the plot's form.
        place: where it was written, if the plot was read from a text.
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
        """One line: where, and what was missed."""
        return f"{self.place or '/'.join(map(str, self.path))}: {self.text}"

    def to_json(self) -> dict[str, Any]:
        """Plain data."""
        place = self.place
        written = {} if place is None else {"file": place.source, "line": place.line}
        return {"kind": self.kind, "text": self.text, "path": list(self.path), **written}


def items_of(plot: ActionPlot) -> Iterator[CoverageItem]:
    """Everything in a plot as it was written, in document order; rules of one label are one item.

    What rules expand to is not the plot's own: however many states a rule answers for, it is there once. History
    stands for other states and is never entered itself.
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

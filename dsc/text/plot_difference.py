"""Difference of two plots in interface, states and transitions, as lines of text and as a drawing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from dsc.drawing import draw
from dsc.model.plot import ActionPlot

_PARTS = (
    "parameters", "variables", "outputs", "robot", "receives", "emits", "rules", "handlers", "when", "offers",
    "priority", "utility", "cost", "implements", "effects", "initial",
)  # fmt: skip
_INSIDE = ("states", "regions")


@dataclass(frozen=True, slots=True)
class Difference:
    """One difference between two plots.

    Attributes:
        kind: `added`, `removed` or `changed`.
        what: kind and name of the element, e.g. `state clear` or `parameter table`.
        state: name of the state that differs; `None` for any other element.
        detail: the changed parts of the element; empty for an addition or removal.
    """

    kind: str
    what: str
    state: str | None = None
    detail: str = ""

    def __str__(self) -> str:
        """Return one line that begins with a sign, e.g. `+ state clear`."""
        sign = {"added": "+", "removed": "-", "changed": "~"}[self.kind]
        return f"{sign} {self.what}" + (f": {self.detail}" if self.detail else "")


def differences(old: ActionPlot, new: ActionPlot) -> list[Difference]:
    """Return the additions, removals and changes from `old` to `new`: interface first, then states in order."""
    return [*_interface(old.to_form(), new.to_form()), *_states(old, new)]


def draw_difference(old: ActionPlot, new: ActionPlot) -> tuple[str, str]:
    """Return both plots as SVG; `old` has marks at removals and changes, `new` at additions and changes."""
    found = differences(old, new)

    def marks(*kinds: str) -> dict[str, str]:
        return {d.state: d.kind for d in found if d.state is not None and d.kind in kinds}

    before = draw(old, rules=False, marks=marks("changed", "removed"))
    return before, draw(new, rules=False, marks=marks("changed", "added"))


def _interface(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[Difference]:
    for part in _PARTS:
        before, after = old.get(part), new.get(part)
        if before == after:
            continue
        if isinstance(before or {}, dict) and isinstance(after or {}, dict):
            yield from _entries(part.removesuffix("s"), before or {}, after or {})
        elif before is None or after is None:
            yield Difference("added" if before is None else "removed", part)
        else:
            yield Difference("changed", part)


def _entries(kind: str, before: Mapping[str, Any], after: Mapping[str, Any]) -> Iterator[Difference]:
    for name in dict.fromkeys([*before, *after]):
        if name not in after:
            yield Difference("removed", f"{kind} {name}")
        elif name not in before:
            yield Difference("added", f"{kind} {name}")
        elif before[name] != after[name]:
            yield Difference("changed", f"{kind} {name}")


def _states(old: ActionPlot, new: ActionPlot) -> Iterator[Difference]:
    before, after = _own_forms(old), _own_forms(new)
    for name in dict.fromkeys([*before, *after]):
        if name not in after:
            yield Difference("removed", f"state {name}", name)
        elif name not in before:
            yield Difference("added", f"state {name}", name)
        elif before[name] != after[name]:
            keys = dict.fromkeys([*before[name], *after[name]])
            parts = [key for key in keys if before[name].get(key) != after[name].get(key)]
            yield Difference("changed", f"state {name}", name, ", ".join(parts))


def _own_forms(plot: ActionPlot) -> dict[str, dict[str, Any]]:
    """Return the written form of each state by name, with its path but without its inner states."""
    form, found = plot.to_form(), {}
    for name, _, path in plot.walk():
        own: Any = form
        for key in path:
            own = own[key]
        holder = "/".join(str(key) for key in path[:-1] if key not in _INSIDE)
        found[name] = {**{key: value for key, value in own.items() if key not in _INSIDE}, "place": holder}
    return found

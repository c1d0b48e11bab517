"""Where states live: the scopes around each, and the scope in which an edge between several is laid out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from dsc.model.plot import ActionPlot, Path


class Nesting:
    """The scopes around each state of a plot, by their paths; the plot itself is the scope `()`."""

    def __init__(self, plot: ActionPlot) -> None:
        self._holders = {name: dict(_holders(path)) for name, _, path in plot.walk()}

    def __iter__(self) -> Iterator[str]:
        return iter(self._holders)

    def inside(self, scope: Path) -> list[str]:
        """All states in a scope, however deep."""
        return [name for name, holders in self._holders.items() if scope in holders]

    def holder(self, scope: Path, name: str) -> str:
        """The state of the scope that is the state `name` or holds it; the initial pseudo-state is everywhere."""
        return self._holders[name][scope] if name else ""

    def common_scope(self, names: Iterable[str]) -> Path:
        """The innermost scope that holds all these states; regions are scopes, orthogonal states are not.

        This is what SCXML calls the least common compound ancestor (appendix D, `findLCCA`).
        """
        first, *others = (self._holders[name] for name in names)
        return [scope for scope in first if all(scope in other for other in others)][-1]


def _holders(path: Path) -> Iterator[tuple[Path, str]]:
    """The scopes around the state at `path` from the outermost on, each with its state that is or holds that one."""
    for place in range(0, len(path), 2):
        if path[place] == "states":
            yield path[:place], str(path[place + 1])

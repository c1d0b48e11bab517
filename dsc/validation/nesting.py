"""What is inside what in a plot, gathered in one walk: checks of large plots ask for it at every state."""

from __future__ import annotations

from collections.abc import Iterator

from dsc.model.plot import ActionPlot, Path
from dsc.model.states import AnyState, State


class Nesting:
    """The states of a plot by name and by path.

    Attributes:
        names: the names of all states, in document order.
    """

    def __init__(self, plot: ActionPlot) -> None:
        self.names: dict[str, Path] = {}
        self._states: dict[Path, AnyState] = {}
        for name, state, path in plot.walk():
            self.names[name] = path
            self._states[path] = state

    def way(self, path: Path) -> Iterator[Path]:
        """The paths of the states around the one at `path`, outermost first, and its own."""
        return (path[:length] for length in range(1, len(path) + 1) if path[:length] in self._states)

    def around(self, path: Path) -> Iterator[State]:
        """The composite and orthogonal states around the one at `path`, outermost first."""
        states = (self._states[place] for place in self.way(path[:-1]))
        return (state for state in states if isinstance(state, State))

    def state(self, name: str) -> AnyState:
        """The state of that name, which must be there."""
        return self._states[self.names[name]]

    def inside(self, name: str, path: Path) -> bool:
        """Whether there is a state of that name inside the one at `path`; anywhere if `path` is empty."""
        found = self.names.get(name, path)
        return found != path and found[: len(path)] == path

    def within(self, path: Path) -> set[str]:
        """The names of all states for which `inside` holds; for messages, since it looks at every state."""
        return {name for name in self.names if self.inside(name, path)}

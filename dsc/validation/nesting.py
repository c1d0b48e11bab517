"""What is inside what in a plot, gathered in one walk: every check asks for it, some of them at every state."""

from __future__ import annotations

from collections.abc import Iterator

from dsc.model.plot import ActionPlot, Path
from dsc.model.reading import FormPath
from dsc.model.states import AnyState, State
from dsc.model.transitions import Transition, TransitionSource


class Nesting:
    """The states of a plot by name and by path, and their transitions.

    Attributes:
        states: all states in document order, with their names and paths.
        names: the paths of all states by name, in document order.
    """

    def __init__(self, plot: ActionPlot) -> None:
        self.states = tuple(plot.walk())
        self.names = {name: path for name, _, path in self.states}
        self._states = {path: state for _, state, path in self.states}
        self._leaving = {
            path: tuple(state.placed_transitions())
            for _, state, path in self.states
            if isinstance(state, TransitionSource)
        }

    def leaving(self, path: Path) -> tuple[tuple[FormPath, str, Transition], ...]:
        """See `TransitionSource.placed_transitions`; nothing leaves what is no source."""
        return self._leaving.get(path, ())

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

"""Nesting of a plot's states, collected in one walk: every check uses it, some at every state."""

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
        """Return `TransitionSource.placed_transitions`; empty for a state without transitions."""
        return self._leaving.get(path, ())

    def way(self, path: Path) -> Iterator[Path]:
        """Yield the paths of the states around the one at `path`, outermost first, and its own."""
        return (path[:length] for length in range(1, len(path) + 1) if path[:length] in self._states)

    def around(self, path: Path) -> Iterator[State]:
        """Yield the composite and orthogonal states around the one at `path`, outermost first."""
        states = (self._states[place] for place in self.way(path[:-1]))
        return (state for state in states if isinstance(state, State))

    def state(self, name: str) -> AnyState:
        """Return the state of that name, which must exist."""
        return self._states[self.names[name]]

    def inside(self, name: str, path: Path) -> bool:
        """Return whether the state at `path` contains a state of that name; the whole plot if `path` is empty."""
        found = self.names.get(name, path)
        return found != path and found[: len(path)] == path

    def within(self, path: Path) -> set[str]:
        """Return the names of all states for which `inside` holds; slow, for messages only."""
        return {name for name in self.names if self.inside(name, path)}

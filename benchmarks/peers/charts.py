"""The charts of all contenders, each of which writes them in its own form."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

PING, PONG = "ping", "pong"


@dataclass(frozen=True, slots=True)
class State:
    """A state; the first one of a scope is its initial one.

    Attributes:
        on: event -> name of the target state, in the same scope.
        states: the substates of a composite state.
        regions: the regions of an orthogonal state: name -> states.
    """

    on: Mapping[str, str] = field(default_factory=dict)
    states: Mapping[str, State] = field(default_factory=dict)
    regions: Mapping[str, Mapping[str, State]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Chart:
    """A chart with its expected configurations.

    Attributes:
        name: its name in tables.
        states: the top-level states.
        rounds: number of pings after which it is in its initial configuration again.
        leaves: number of pings -> names of the innermost active states.
    """

    name: str
    states: Mapping[str, State]
    rounds: int
    leaves: Callable[[int], frozenset[str]]


def flat() -> Chart:
    """Return a chart of two states."""
    return Chart("ping-pong", {"a": State({PING: "b"}), "b": State({PING: "a"})}, 2, lambda n: frozenset("ab"[n % 2]))


def deep(levels: int = 5) -> Chart:
    """Return a chart of two nested towers with transitions at the top: an event exits as many levels as it enters."""

    def tower(name: str, other: str) -> State:
        inside: dict[str, State] = {f"{name}{levels}": State()}
        for level in range(levels - 1, 1, -1):
            inside = {f"{name}{level}": State(states=inside)}
        return State({PING: f"{other}1"}, states=inside)

    states = {"a1": tower("a", "b"), "b1": tower("b", "a")}
    return Chart(f"{levels} levels", states, 2, lambda n: frozenset({f"{'ab'[n % 2]}{levels}"}))


def regions(count: int = 4) -> Chart:
    """Return a chart of parallel regions that all react."""
    inside = {f"r{n}": {f"x{n}": State({PING: f"y{n}"}), f"y{n}": State({PING: f"x{n}"})} for n in range(1, count + 1)}
    leaves = [frozenset(f"{side}{n}" for n in range(1, count + 1)) for side in "xy"]
    return Chart(f"{count} regions", {"all": State(regions=inside)}, 2, lambda n: leaves[n % 2])


def ring(size: int = 1000) -> Chart:
    """Return a chart of states in a ring, with transitions in both directions."""
    states = {f"s{n}": State({PING: f"s{(n + 1) % size}", PONG: f"s{(n - 1) % size}"}) for n in range(size)}
    return Chart(f"ring of {size:,} states", states, size, lambda n: frozenset({f"s{n % size}"}))

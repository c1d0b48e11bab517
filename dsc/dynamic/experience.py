"""Experience: how often candidates succeeded, and how long they took, by situation; learned from kept runs (S0.14).

The model is one number per candidate and situation: the expected time until success, if the candidate is repeated. The
probability of success follows Laplace's rule of succession.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

Situation = tuple[tuple[str, bool], ...]
"""The conditions of a dynamic state under `situation`, as sorted texts, each with its truth."""


def situation_of(truths: Mapping[str, bool]) -> Situation:
    """Return the situation in which conditions have this truth."""
    return tuple(sorted(truths.items()))


class Tries(NamedTuple):
    """The tries of a candidate in one situation.

    Attributes:
        tries: number of tries.
        done: number of tries that ended with `done`.
        seconds: duration of all tries.
    """

    tries: int = 0
    done: int = 0
    seconds: float = 0.0

    @property
    def time_to_success(self) -> float:
        """The expected time until success in seconds: the mean duration divided by the probability of success."""
        return self.seconds / self.tries * (self.tries + 2) / (self.done + 1)

    def plus(self, other: Tries) -> Tries:
        """Return the tries of both."""
        return Tries(self.tries + other.tries, self.done + other.done, self.seconds + other.seconds)

    def __str__(self) -> str:
        """Return the tries as text for people."""
        each, expected = self.seconds / self.tries, self.time_to_success
        return f"{self.done} of {self.tries} tries done, {each:.3g} s each: {expected:.3g} s until success"


Key = tuple[str, str, Situation]
"""The plot of a dynamic state, a candidate, and the situation of its choice."""


@dataclass(frozen=True)
class Experience:
    """Tries of candidates.

    Attributes:
        tries: the tries of each candidate in each situation.
        seed: seed of random choices, see `explore` of `DynamicState`.
    """

    tries: Mapping[Key, Tries] = field(default_factory=dict)
    seed: int = 0

    def of(self, plot: str, candidate: str, situation: Situation) -> Tries | None:
        """Return the tries of a candidate in a situation, else in all situations; `None` without a try."""
        found = self.tries.get((plot, candidate, situation))
        if found is not None:
            return found
        total = Tries()
        for (of, name, _), one in self.tries.items():
            if (of, name) == (plot, candidate):
                total = total.plus(one)
        return total if total.tries else None

    def plus(self, tries: Iterable[tuple[Key, Tries]]) -> Experience:
        """Return the experience with further tries."""
        found = dict(self.tries)
        for key, one in tries:
            found[key] = found.get(key, Tries()).plus(one)
        return replace(self, tries=found)

    def to_form(self) -> dict[str, Any]:
        """Return plain data; `from_form` returns an equal experience."""
        tries = [
            {"plot": plot, "candidate": candidate, "situation": dict(situation), **one._asdict()}
            for (plot, candidate, situation), one in sorted(self.tries.items())
        ]
        return {"tries": tries, "seed": self.seed}

    @staticmethod
    def from_form(form: Mapping[str, Any]) -> Experience:
        """Return the experience of a form from `to_form`."""
        tries = {
            (one["plot"], one["candidate"], situation_of(one["situation"])): Tries(
                *(one[name] for name in Tries._fields)
            )
            for one in form["tries"]
        }
        return Experience(tries, form["seed"])

    @property
    def digest(self) -> str:
        """Hash of the tries as 12 hexadecimal digits."""
        return hashlib.sha256(json.dumps(self.to_form()["tries"]).encode()).hexdigest()[:12]


NO_EXPERIENCE = Experience()

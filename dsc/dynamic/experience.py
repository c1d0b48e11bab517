"""Experience: how often candidates succeeded, and how long they took, by situation; learned from kept runs (S0.14).

The model is one number per candidate and situation: the expected time until success, if the candidate is repeated. The
probability of success follows Laplace's rule of succession. The same number is the cost of a plan step.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

Situation = tuple[tuple[str, bool], ...]
"""The conditions of a dynamic state under `situation`, as sorted texts, each with its truth."""


def situation_of(truths: Mapping[str, bool]) -> Situation:
    """Return the situation in which conditions have this truth."""
    return tuple(sorted(truths.items()))


PRIOR_TRIES = 5
"""The weight of all steps of an action in the cost of one step, as a number of tries."""


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
"""The plot of a dynamic state, a candidate, and the situation of its choice.

For a step of a plan: the planning action, a candidate, and `step_situation` of the step.
"""


def step_situation(step: str) -> Situation:
    """Return the situation of a plan step, which is its text in PDDL."""
    return ((step, True),)


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
        return self.tries.get((plot, candidate, situation)) or self._totals.get((plot, candidate))

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

    def seconds_for(self, action: str, step: str) -> float | None:
        """Return the expected time until success of a plan step in seconds; `None` if its action was never tried.

        The mean of all steps of the action counts as `PRIOR_TRIES` further tries of the step.
        """
        every = self._totals.get((action,))
        if every is None:
            return None
        own = self._totals.get((step,), Tries())
        done = own.done + PRIOR_TRIES * (every.done + 1) / (every.tries + 2)
        seconds = own.seconds + PRIOR_TRIES * every.seconds / every.tries
        return seconds / done

    @cached_property
    def _totals(self) -> Mapping[tuple[str, ...], Tries]:
        """The tries by plot or action, by plot or action and candidate, and by the text of a plan step."""
        found: dict[tuple[str, ...], Tries] = {}
        for (of, name, situation), one in self.tries.items():
            for key in ((of,), (of, name), *((text,) for text, _ in situation)):
                found[key] = found.get(key, Tries()).plus(one)
        return found

    @property
    def digest(self) -> str:
        """Hash of the tries as 12 hexadecimal digits."""
        return hashlib.sha256(json.dumps(self.to_form()["tries"]).encode()).hexdigest()[:12]


NO_EXPERIENCE = Experience()

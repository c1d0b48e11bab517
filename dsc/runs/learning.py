"""Learning of experience from the trace records of runs (S0.14)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from dsc.dynamic.experience import Experience, Key, Tries, situation_of, step_situation
from dsc.events import DONE
from dsc.runs.archive import archive
from dsc.trace import Record


def learn(stores: Iterable[Path | str], *, steps: bool = False) -> Experience:
    """Return the experience of all runs in stores, which are only read.

    Args:
        stores: the files.
        steps: whether to learn the steps of plans, too.

    Raises:
        StoreError: a file is not a store, or cannot be read.
    """
    experience = Experience()
    for store in stores:
        with archive(Path(store)) as runs:
            for run in runs.runs():
                experience = experience.plus(tries_in(runs.records(run.number), steps=steps))
    return experience


class _Try(NamedTuple):
    """A try that began at second `at`, with its key."""

    key: Key
    at: float


def tries_in(records: Iterable[Record], *, steps: bool = False) -> Iterator[tuple[Key, Tries]]:
    """Yield each try in the records of a run: of learned choices, and with `steps` of the steps of plans.

    A try that a surrounding state has ended does not count.
    """
    open_tries: dict[str, _Try] = {}
    plots = _Plots(steps)
    for record in records:
        if record.type == "plot":
            plots.forms[record.data["name"]] = record.data["plot"]
        elif record.type == "decision":
            if (key := plots.key_of(record.data)) is not None:
                open_tries[record.data["state"]] = _Try(key, record.t)
        elif record.type == "step":
            for microstep in record.data["microsteps"]:
                triggers = {one["from"]: one["on"] for one in microstep["taken"]}
                for path in microstep["exited"]:
                    tried = open_tries.pop(path, None)
                    if tried is not None and path in triggers:
                        yield tried.key, Tries(1, int(triggers[path] == DONE), round(record.t - tried.at, 6))
                plots.bound.update({one["state"]: one["plot"] for one in microstep.get("bound", ())})


@dataclass
class _Plots:
    """The plots of a run so far.

    Attributes:
        steps: whether the steps of plans are tries.
        forms: the plots as data, by name.
        bound: the name of the plot that each state contains, by the state's path.
    """

    steps: bool
    forms: dict[str, Mapping[str, Any]] = field(default_factory=dict)
    bound: dict[str, str] = field(default_factory=dict)

    def key_of(self, decision: Mapping[str, Any]) -> Key | None:
        """Return the key of the try that a decision begins; `None` for a choice without learning."""
        chosen = decision.get("chosen")
        if chosen is None:
            return None
        if "situation" in decision:
            return decision["plot"], chosen, situation_of(decision["situation"])
        step = self._text_about(decision["state"]) if self.steps else ""
        action = step[1:].rstrip(")").partition(" ")[0]
        is_step = bool(action) and self.forms.get(chosen, {}).get("implements") == action
        return (action, chosen, step_situation(step)) if is_step else None

    def _text_about(self, path: str) -> str:
        """Return the text about a state; about a step of a plan, it is the step in PDDL."""
        holder, _, name = path.rpartition("/")
        form = _state_in(self.forms.get(self.bound.get(holder, ""), {}), name) or {}
        return str(form.get("about", ""))


def _state_in(form: Mapping[str, Any], name: str) -> Mapping[str, Any] | None:
    """Return the form of a state, at any depth in the form of a plot; the names of a plot's states differ."""
    inner: dict[str, Mapping[str, Any]] = {**form.get("states", {}), **form.get("regions", {})}
    if name in inner:
        return inner[name]
    return next((found for one in inner.values() if (found := _state_in(one, name)) is not None), None)

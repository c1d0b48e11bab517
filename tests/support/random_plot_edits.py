"""Random edits of a plot, drawn from a seed."""

from __future__ import annotations

from random import Random
from typing import Any

from meant_models import form_of, part

from dsc.editing.surgery import Add, Edit, Move, Remove, RenameState, RenameVariable, Replace
from dsc.model.plot import ActionPlot

_STATES: tuple[Any, ...] = (
    {"final": True},
    {"on": {"done": "over"}},
    {
        "about": "go, then stop: now",
        "entry": {"trigger": "base.drive", "with": {"to": "hall"}},
        "on": {"arrived": "over"},
    },
    {"use": "search", "with": {"surface": "?x"}, "on": {"done": {"to": "over", "when": "(and (a) (b ?c))"}}},
    {"states": {"inner_1": {"on": {"done": "inner_2"}}, "inner_2": {"final": True}}},
)
_WAYS: tuple[Any, ...] = ({"to": "over"}, {"to": "over", "when": "(not (hand-free))"}, {"tell": "(seen cup)"})
_ACTIONS: tuple[Any, ...] = (
    {"trigger": "arm.grasp", "with": {"item": "cup", "words": "a, b: {c} #d"}, "within": 3},
    {"switch": "base", "to": "neutral"},
    {"send": "voice.say", "with": {"text": "yes"}},
)
_TYPES: tuple[Any, ...] = ({"type": "text"}, {"type": "number", "default": 3}, {"type": "list of text"})
_RULES: tuple[Any, ...] = (
    {"on": "slipped", "do": {"use": "reposition", "with": {"surface": "?event.surface"}, "then": "retry"}},
    {"on": "no_path", "do": {"then": "replan", "limit": 2}},
)


class Drawing:
    """Edits of a plot.

    Args:
        random: the source of chance.
    """

    def __init__(self, random: Random) -> None:
        self._random = random
        self._number = 0

    def edit(self, plot: ActionPlot) -> Edit:
        """Return a random edit, which may be impossible."""
        form = form_of(plot)
        kinds = (self._state, self._way, self._action, self._declaration, self._rule, self._candidate, self._text)
        while True:
            found = self._random.choice(kinds)(plot, form)
            if found is not None:
                return found

    def _name(self, word: str) -> str:
        self._number += 1
        return f"{word}_{self._number}"

    def _one(self, among: Any) -> Any:
        return self._random.choice(list(among))

    def _state(self, plot: ActionPlot, form: Any) -> Edit | None:
        places: list[tuple[str | int, ...]] = [("states",)]
        places += [(*path, "states") for _, _, path in plot.walk() if "states" in part(form, path)]
        places += [
            (*path, "regions", region, "states")
            for _, _, path in plot.walk()
            for region in part(form, path).get("regions", ())
        ]
        paths = [path for _, _, path in plot.walk()]
        around, path = self._one(places), self._one(paths)
        before = self._one([None, *part(form, around)])
        match self._random.randrange(5):
            case 0:
                value = _renumbered(self._one(_STATES), self._name)
                return Add((*around, self._name("state")), value, before)
            case 1:
                return RenameState(path, self._name("new_state"))
            case 2:
                return Remove(path)
            case _:
                if around[: len(path)] == path or before == path[-1] or path[-2] == "connectors":
                    return None
                return Move(path, (*around, path[-1]), before)

    def _way(self, plot: ActionPlot, form: Any) -> Edit | None:
        lists = [
            (*path, *inside[:-1])
            for _, state, path in plot.walk()
            if hasattr(state, "placed_transitions")
            for inside, _, _ in state.placed_transitions()
            if isinstance(inside[-1], int) and inside[0] != "cases"
        ]
        simple = [path for _, state, path in plot.walk() if hasattr(state, "on")]
        if not simple or not lists:
            return None
        fresh = (*self._one(simple), "on", self._name("event"))
        around = self._one(lists)
        size = len(part(form, around))
        timed = around[-1] in {"after", "every"}
        path = (*around, self._random.randrange(size))
        match self._random.randrange(5):
            case 0:
                value = self._one(_WAYS)
                return Add((*around, self._random.randint(0, size)), {"seconds": 2, **value} if timed else value)
            case 1:
                return Add((*fresh, 0), self._one(_WAYS))
            case 2:
                return Remove(path if size > 1 else around)
            case 3:
                return (
                    Move(path, (*around, self._random.randrange(size)) if timed else (*fresh, 0)) if size > 1 else None
                )
            case _:
                return Add((*path, "when"), "(tidy cup)") if "when" not in part(form, path) else None

    def _action(self, plot: ActionPlot, form: Any) -> Edit | None:
        states = [path for _, state, path in plot.walk() if hasattr(state, "on_break")]
        if not states:
            return None
        around = (*self._one(states), self._one(("entry", "exit", "on_break")))
        present = part(form, around[:-1]).get(around[-1], [])
        other = (*self._one(states), self._one(("entry", "exit", "on_break")))
        match self._random.randrange(4):
            case 0:
                return Add((*around, self._random.randint(0, len(present))), self._one(_ACTIONS))
            case 1 if present:
                return Remove((*around, self._random.randrange(len(present))))
            case 2 if present and other != around:
                size = len(part(form, other[:-1]).get(other[-1], []))
                return Move((*around, self._random.randrange(len(present))), (*other, self._random.randint(0, size)))
            case 3 if present:
                return Replace((*around, self._random.randrange(len(present))), self._one(_ACTIONS))
        return None

    def _declaration(self, plot: ActionPlot, form: Any) -> Edit | None:
        group = self._one(("parameters", "variables", "outputs"))
        names = list(form.get(group, ()))
        fresh = (group, self._name("value"))
        before = self._one([None, *names])
        match self._random.randrange(4):
            case 0:
                return Add(fresh, self._typed(group), before)
            case 1 if names:
                return RenameVariable((group, self._one(names)), self._name("new-value"))
            case 2 if names:
                return Remove((group, self._one(names)))
            case 3 if names:
                name = self._one(names)
                return None if before == name else Move((group, name), (group, name), before)
        return None

    def _typed(self, group: str) -> Any:
        value = dict(self._one(_TYPES))
        if group != "parameters" and "default" in value:
            value["initial"] = value.pop("default")
        return value

    def _rule(self, _: ActionPlot, form: Any) -> Edit | None:
        size = len(form.get("rules", ()))
        match self._random.randrange(4):
            case 0:
                return Add(("rules", self._random.randint(0, size)), self._one(_RULES))
            case 1 if size:
                return Remove(("rules", self._random.randrange(size)))
            case 2 if size:
                return Move(("rules", self._random.randrange(size)), ("rules", self._random.randrange(size)))
            case 3 if size:
                return Replace(("rules", self._random.randrange(size)), self._one(_RULES))
        return None

    def _candidate(self, plot: ActionPlot, form: Any) -> Edit | None:
        paths = [path for _, state, path in plot.walk() if isinstance(part(form, path).get("dynamic"), list)]
        if not paths:
            return None
        around = (*self._one(paths), "dynamic")
        size = len(part(form, around))
        at = self._random.randrange(size)
        match self._random.randrange(4):
            case 0:
                return Add((*around, self._random.randint(0, size)), self._name("plot"))
            case 1:
                return Remove((*around, at)) if size > 1 else None
            case 2:
                return Replace((*around, at), self._name("plot"))
        return Move((*around, at), (*around, self._random.randrange(size)))

    def _text(self, _: ActionPlot, form: Any) -> Edit | None:
        words = self._one(("look: here", "a # b", 'it says "yes"', "two\nlines"))
        return Replace(("about",), words) if "about" in form else Add(("about",), words)


def _renumbered(value: Any, name: Any) -> Any:
    if isinstance(value, dict) and "states" in value:
        return {**value, "states": {name("inner"): one for one in value["states"].values()}}
    return value

"""Plots cloned for another robot: with all that they depend on, under new names (S2.10).

Dependencies are the plots that a plot uses, those that these use, and so on. What has been cloned before, and perhaps
been adapted since, is used in place of its original and not cloned again.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping
from typing import Any

from dsc.dynamic.library import Library
from dsc.dynamic.selection import ACHIEVE
from dsc.dynamic.substitution import require_stand_in
from dsc.model.plot import ActionPlot
from dsc.model.profile import Profile
from dsc.model.states import DynamicState

_ROLE = ("implements", "effects", "confirm")
"""What a plot is for plans."""


def cloned(plot: ActionPlot, library: Library, prefix: str, *, made: Library | None = None) -> tuple[ActionPlot, ...]:
    """The plot and all plots that it depends on, with the prefix before their names, and using each other.

    Args:
        plot: what is cloned.
        library: has what it depends on.
        prefix: stands before the names of clones.
        made: where the clones will live, if that is another library. Plots of it that are called like a clone are such
            already. There, clones carry out planning actions in place of their originals, and those that do belong to
            what a goal depends on. Left out, clones stand beside their originals, which go on doing so alone: nothing
            that was there behaves otherwise than before.

    Returns:
        The new clones, that of the plot first, unless it was made before.

    Raises:
        UnknownNameError: a plot uses one that is not there.
        SchemaError: a clone that was made before cannot stand in for its original any more; the message says why.
    """
    apart = made is not None
    known = library if made is None else made
    names = {one.name: prefix + one.name for one in _dependencies(plot, library, plans=apart)}
    new = []
    for name, other in names.items():
        if other in known:
            require_stand_in(library.plot(name), known.plot(other))
        else:
            new.append(_renamed(library.plot(name), names, plans=apart))
    return tuple(new)


def cloned_profile(profile: Profile, prefix: str, names: Container[str]) -> Profile:
    """The profile under a new name, what it says of the plots with these names said of their clones."""
    plots = {prefix + name if name in names else name: values for name, values in profile.plots.items()}
    return profile.model_copy(update={"name": prefix + profile.name, "plots": plots})


def _dependencies(plot: ActionPlot, library: Library, *, plans: bool) -> Iterable[ActionPlot]:
    found: dict[str, ActionPlot] = {}
    waiting = [plot]
    while waiting:
        one = waiting.pop(0)
        if one.name not in found:
            found[one.name] = one
            waiting += [library.plot(name) for _, name in one.references() if name != ACHIEVE]
            if plans and any(isinstance(state, DynamicState) and state.goal is not None for _, state, _ in one.walk()):
                waiting += [other for other in library if other.implements]
    return found.values()


def _renamed(plot: ActionPlot, names: Mapping[str, str], *, plans: bool) -> ActionPlot:
    form = plot.to_form()
    form["plot"] = names[plot.name]
    for path, name in plot.references():
        around: Any = form
        for key in path[:-1]:
            around = around[key]
        around[path[-1]] = names.get(name, name)
    if not plans:
        form = {key: value for key, value in form.items() if key not in _ROLE}
    return ActionPlot.model_validate(form)

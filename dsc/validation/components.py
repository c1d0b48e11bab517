"""Components that plots configure and switch are deployed."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from dsc.errors import Finding
from dsc.model.actions import Configure, ExternalAction, Internal, Send, Switch
from dsc.model.plot import ActionPlot, Path
from dsc.model.states import State
from knowledge_base.errors import UnknownNameError


def check_components(plot: ActionPlot, components: Collection[str]) -> Iterator[Finding]:
    """Findings about `set`, `send` and `switch` actions towards components that are not there."""
    for action, path in _actions(plot):
        name = _addressed(action)
        if name is not None and name not in components:
            message = f"there is no component '{name}'"
            error = UnknownNameError(message, place=plot.place(path), found=name, valid=components)
            yield Finding(error, "known component")


def _actions(plot: ActionPlot) -> Iterator[tuple[ExternalAction | Internal, Path]]:
    for _, state, path in plot.walk():
        for key, actions in state.blocks() if isinstance(state, State) else ():
            yield from ((action, (*path, key, position)) for position, action in enumerate(actions))
    for group, reactions in (("rules", [r.do for r in plot.rules]), ("handlers", [h.do for h in plot.handlers])):
        for number, do in enumerate(reactions):
            here = (group, number, "do", "command")
            yield from ((command, (*here, position)) for position, command in enumerate(do.command))


def _addressed(action: ExternalAction | Internal) -> str | None:
    if isinstance(action, Configure):
        return action.set.split(".")[0]
    if isinstance(action, Send):
        return action.send.split(".")[0]
    return action.switch if isinstance(action, Switch) else None

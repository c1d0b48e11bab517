"""Components that plots configure and switch are deployed."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from dsc.errors import Finding
from dsc.model.actions import Configure, ExternalAction, Internal, Send, Switch
from dsc.model.plot import ActionPlot
from dsc.model.states import State
from knowledge_base.errors import UnknownNameError


def check_components(plot: ActionPlot, components: Collection[str]) -> Iterator[Finding]:
    """Findings about `set`, `send` and `switch` actions towards components that are not there."""
    for _, state, path in plot.walk():
        if not isinstance(state, State):
            continue
        for key, actions in state.blocks():
            for position, action in enumerate(actions):
                name = _addressed(action)
                if name is not None and name not in components:
                    error = UnknownNameError(
                        f"there is no component '{name}'",
                        place=plot.place((*path, key, position)), found=name, valid=components,
                    )  # fmt: skip
                    yield Finding(error, "known component")


def _addressed(action: ExternalAction | Internal) -> str | None:
    if isinstance(action, Configure):
        return action.set.split(".")[0]
    if isinstance(action, Send):
        return action.send.split(".")[0]
    return action.switch if isinstance(action, Switch) else None

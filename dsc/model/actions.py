"""Actions. External ones reach components and stand in entry or exit; internal ones stay in the chart (S0.5)."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, Tag

from dsc.model.language import EffectField, Frozen, TermField, by_key


class Trigger(Frozen):
    """Start a skill; its outcome events reach the state that asked, and leaving that state cancels it.

    Attributes:
        trigger: `component.skill`, by the name the deployment gave the component.
        arguments: values for the skill's parameters (`with`).
        names: skill event -> the name it shall have in this chart (`as`, S0.6).
        within: seconds after which the skill is cancelled and ends with the event `timed_out`.
    """

    trigger: str = Field(pattern=r"^[\w\-]+\.[\w\-]+$")
    arguments: dict[str, TermField] = Field(default_factory=dict, alias="with")
    names: dict[str, str] = Field(default_factory=dict, alias="as")
    within: float | None = Field(default=None, gt=0)


class Configure(Frozen):
    """Set a component's parameter: `set: arm.approach`, `to: side` (the *param* pattern, S1.1)."""

    set: str = Field(pattern=r"^[\w\-]+\.[\w\-]+$")
    to: TermField


class Switch(Frozen):
    """Put a component into a mode: `switch: navigation`, `to: neutral` (the *state* pattern, S1.1)."""

    switch: str
    to: str


ExternalAction = Annotated[
    Annotated[Trigger, Tag("trigger")] | Annotated[Configure, Tag("set")] | Annotated[Switch, Tag("switch")],
    by_key("trigger", "set", "switch"),
]
"""What entry and exit may hold."""


class Assign(Frozen):
    """Give variables of this plot new values."""

    assign: dict[str, TermField]


class Tell(Frozen):
    """Change the knowledge base; later guards of the same macrostep see it."""

    tell: EffectField


class Emit(Frozen):
    """Fire an event: a declared outcome goes to the state that holds this plot, any other stays inside."""

    emit: str
    arguments: dict[str, TermField] = Field(default_factory=dict, alias="with")


InternalAction = Annotated[
    Annotated[Assign, Tag("assign")] | Annotated[Tell, Tag("tell")] | Annotated[Emit, Tag("emit")],
    by_key("assign", "tell", "emit"),
]
"""What transitions may hold."""

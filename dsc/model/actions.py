"""Actions. `ExternalAction`s reach components, from entry and exit only; internal ones stay in the chart (S0.5)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Annotated

from pydantic import Field, Tag, model_validator

from dsc.model.language import ConditionField, EffectField, Frozen, TermField, by_key


class Trigger(Frozen):
    """Start a skill; its outcome events reach the state that started it. An exit from that state cancels it.

    Attributes:
        trigger: `component.skill`, by the name the deployment gave the component.
        arguments: values for the skill's parameters (`with`).
        names: skill event -> its name in this chart (`as`, S0.6).
        within: seconds after which the skill is cancelled and ends with the event `timed_out`.
    """

    trigger: str = Field(pattern=r"^[\w\-]+\.[\w\-]+$")
    arguments: dict[str, TermField] = Field(default_factory=dict, alias="with")
    names: dict[str, str] = Field(default_factory=dict, alias="as")
    within: float | None = Field(default=None, gt=0, strict=True)


class Configure(Frozen):
    """Set a component's parameter: `set: arm.approach`, `to: side` (the *param* pattern, S1.1)."""

    set: str = Field(pattern=r"^[\w\-]+\.[\w\-]+$")
    to: TermField


class Switch(Frozen):
    """Put a component into a mode: `switch: navigation`, `to: neutral` (the *state* pattern, S1.1)."""

    switch: str
    to: str


class Send(Frozen):
    """Send a component a one-way message: `send: voice.say`, `with: {text: hello}` (S1.1)."""

    send: str = Field(pattern=r"^[\w\-]+\.[\w\-]+$")
    arguments: dict[str, TermField] = Field(default_factory=dict, alias="with")


ExternalAction = Trigger | Configure | Switch | Send
"""Actions on components."""


class Assign(Frozen):
    """Assign new values to variables of this plot."""

    assign: dict[str, TermField]


class Tell(Frozen):
    """Change the knowledge base; later guards of the same macrostep see it."""

    tell: EffectField


class Emit(Frozen):
    """Fire an event: a declared outcome goes to the state that holds this plot, any other stays inside.

    With `delay` (seconds; only in dialect `scxml`) it arrives later as an event from outside. Until then a `Withdraw`
    with its `id` drops it. `into` is a variable that receives a generated id (SCXML 6.2).
    """

    emit: str
    arguments: dict[str, TermField] = Field(default_factory=dict, alias="with")
    delay: TermField | None = None
    id: TermField | None = None
    into: str | None = None

    @model_validator(mode="after")
    def _is_named_to_be_withdrawn(self) -> Emit:
        if self.delay is None and (self.id is not None or self.into is not None):
            raise ValueError("an event without delay cannot be withdrawn; `id` and `into` go with `delay`")
        return self


class Withdraw(Frozen):
    """Drop the pending delayed events of that id, fired in this plot (SCXML 6.3; only in dialect `scxml`)."""

    withdraw: TermField


class Log(Frozen):
    """Write constants and variables to the trace, in order (SCXML 4.7; only in dialect `scxml`)."""

    log: tuple[TermField, ...]
    label: str = ""


class Choose(Frozen):
    """The actions of one branch (SCXML 4.3; only in dialect `scxml`).

    Attributes:
        condition: selects the branch (`if`).
        then: actions if it holds.
        otherwise: actions if it does not (`else`).
    """

    condition: ConditionField = Field(alias="if")
    then: tuple[InternalAction, ...] = ()
    otherwise: tuple[InternalAction, ...] = Field(default=(), alias="else")


class Block(Frozen):
    """A sequence of actions: an error skips its rest, but nothing after it (SCXML 4.9; only in dialect `scxml`).

    A state with several `onentry` or `onexit` has one for each (SCXML 3.8, 3.9).
    """

    block: tuple[InternalAction, ...]


_Internal = (
    Annotated[Assign, Tag("assign")]
    | Annotated[Tell, Tag("tell")]
    | Annotated[Emit, Tag("emit")]
    | Annotated[Withdraw, Tag("withdraw")]
    | Annotated[Log, Tag("log")]
    | Annotated[Choose, Tag("if")]
    | Annotated[Block, Tag("block")]
)
InternalAction = Annotated[_Internal, by_key("assign", "tell", "emit", "withdraw", "log", "if", "block")]
"""Actions of a transition."""
Choose.model_rebuild()
Block.model_rebuild()

Internal = Assign | Tell | Emit | Withdraw | Log | Choose | Block
"""The internal actions as a union of types, for tests of an action's kind."""

Action = Annotated[
    Annotated[Trigger, Tag("trigger")]
    | Annotated[Configure, Tag("set")]
    | Annotated[Switch, Tag("switch")]
    | Annotated[Send, Tag("send")]
    | _Internal,
    by_key("trigger", "set", "switch", "send", "assign", "tell", "emit", "withdraw", "log", "if", "block"),
]
"""Actions of entry and exit; internal ones only in dialect `scxml` (SCXML 3.8)."""


def flat(actions: Iterable[ExternalAction | Internal]) -> Iterator[ExternalAction | Internal]:
    """Yield all actions, also those inside branches and blocks."""
    for action in actions:
        yield action
        if isinstance(action, Choose):
            yield from flat((*action.then, *action.otherwise))
        elif isinstance(action, Block):
            yield from flat(action.block)


def component_of(action: ExternalAction | Internal) -> str | None:
    """Return the name of the component that an action acts on, or `None`."""
    match action:
        case Trigger(trigger=port) | Configure(set=port) | Send(send=port):
            return port.partition(".")[0]
        case Switch(switch=name):
            return name
    return None

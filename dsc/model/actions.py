"""Actions of charts (S0.5).

An external action reaches a component and is allowed only in entry and exit. An internal action changes only data of
the chart, or the knowledge base.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Annotated

from pydantic import Field, model_validator

from dsc.model.language import ByKey, ConditionField, EffectField, Frozen, TermField


class Trigger(Frozen):
    """Start a skill; the state that starts the skill receives its outcome events and cancels the skill on exit.

    Attributes:
        trigger: `component.skill`, where `component` is the name in the deployment.
        arguments: values for the skill's parameters, by name (`with`).
        names: names of the skill's events in this chart, by the name in the skill (`as`, S0.6).
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
    """Switch a component to a mode: `switch: navigation`, `to: neutral` (the *state* pattern, S1.1)."""

    switch: str
    to: str


class Send(Frozen):
    """Send a one-way message to a component: `send: voice.say`, `with: {text: hello}` (S1.1)."""

    send: str = Field(pattern=r"^[\w\-]+\.[\w\-]+$")
    arguments: dict[str, TermField] = Field(default_factory=dict, alias="with")


class Wire(Frozen):
    """Wire a component's required port to a provided one, until the state is left: `wire: map.scan`, `to: rear.scan`.

    The provider is `component.port`, or a component whose only fitting port is meant (the *wiring* pattern, S1.18).
    """

    wire: str = Field(pattern=r"^[\w\-]+\.[\w\-]+$")
    to: TermField


class Unwire(Frozen):
    """Cut the wire of a component's required port until the state is left; pending calls end (S1.18)."""

    unwire: str = Field(pattern=r"^[\w\-]+\.[\w\-]+$")


ExternalAction = Trigger | Configure | Switch | Send | Wire | Unwire
"""The external actions, which reach components, as a union of types."""


class Bind(Frozen):
    """Assign to variables the objects or values that fulfil a condition; a transition's `bind` and `bind_all` (S4.3).

    Attributes:
        names: the variables.
        condition: the condition that finds their values; it does not read their values before.
        order_by: terms of which the smallest values come first; of equal ones, the order of a query.
        every: whether the only variable receives the list of all values.
    """

    names: tuple[str, ...]
    condition: ConditionField
    order_by: tuple[TermField, ...] = ()
    every: bool = False


class Assign(Frozen):
    """Assign new values to variables of the plot, by name."""

    assign: dict[str, TermField]


class Perform(Frozen):
    """Assign the values of an operation to motors; `robot` declares operations (S3.7)."""

    perform: str


class StartActivity(Frozen):
    """Start an activity of `robot`, unless it is active: assign its values for the start to motors (S3.7)."""

    start: str

    @property
    def change(self) -> tuple[str, bool]:
        """The name of the activity, and whether it is active afterwards."""
        return self.start, True


class StopActivity(Frozen):
    """Stop an activity of `robot`, if it is active: assign its values for the stop to motors (S3.7)."""

    stop: str

    @property
    def change(self) -> tuple[str, bool]:
        """The name of the activity, and whether it is active afterwards."""
        return self.stop, False


OfRobot = Perform | StartActivity | StopActivity
"""The actions on the operations and activities of `robot`, as a union of types."""


class Tell(Frozen):
    """Change the knowledge base; later guards of the same macrostep read the changed knowledge."""

    tell: EffectField


class Emit(Frozen):
    """Fire an event: the host state receives an event declared in `emits`; the plot itself receives any other event.

    With `delay` (seconds; only in dialect `scxml`) the event arrives later, as an event from outside. A `Withdraw` with
    the same `id` drops the delayed event before its arrival. `into` is the name of a variable that receives a generated
    id (SCXML 6.2).
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
    """Drop the pending delayed events that this plot fired with this id (SCXML 6.3; only in dialect `scxml`)."""

    withdraw: TermField


class Log(Frozen):
    """Write values to the trace as one text, in order (SCXML 4.7; only in dialect `scxml`)."""

    log: tuple[TermField, ...]
    label: str = ""


class Choose(Frozen):
    """Execute one of two sequences of actions (SCXML 4.3; only in dialect `scxml`).

    Attributes:
        condition: condition that selects the sequence (`if`).
        then: actions if the condition is true.
        otherwise: actions if the condition is false (`else`).
    """

    condition: ConditionField = Field(alias="if")
    then: tuple[InternalAction, ...] = ()
    otherwise: tuple[InternalAction, ...] = Field(default=(), alias="else")


class Block(Frozen):
    """Execute a sequence of actions; an error skips only the rest of this block (SCXML 4.9; dialect `scxml` only).

    A state with several `onentry` or `onexit` elements has a block for each element (SCXML 3.8, 3.9).
    """

    block: tuple[InternalAction, ...]


WrittenAction = Assign | Perform | StartActivity | StopActivity | Tell | Emit | Withdraw | Log | Choose | Block
"""The internal actions that a list of actions contains, as a union of types."""
Internal = WrittenAction | Bind
"""The internal actions as a union of types."""
InternalAction = Annotated[WrittenAction, ByKey()]
"""The internal actions as the field type of a transition's actions."""
Choose.model_rebuild()
Block.model_rebuild()

Action = Annotated[ExternalAction | WrittenAction, ByKey()]
"""An action in entry or exit.

The only internal actions there set motors; other ones are allowed only in dialect `scxml` (SCXML 3.8).
"""


def flat(actions: Iterable[ExternalAction | Internal]) -> Iterator[ExternalAction | Internal]:
    """Yield all actions, including the actions inside branches and blocks."""
    for action in actions:
        yield action
        match action:
            case Choose(then=then, otherwise=otherwise):
                yield from flat((*then, *otherwise))
            case Block(block=inside):
                yield from flat(inside)
            case _:
                pass


def component_of(action: ExternalAction | Internal) -> str | None:
    """Return the name of the component that an action reaches; `None` for an internal action."""
    match action:
        case Trigger(trigger=port) | Configure(set=port) | Send(send=port) | Wire(wire=port) | Unwire(unwire=port):
            return port.partition(".")[0]
        case Switch(switch=name):
            return name
        case Bind() | Assign() | Perform() | StartActivity() | StopActivity() | Tell() | Emit() | Withdraw() | Log():
            return None
        case Choose() | Block():
            return None

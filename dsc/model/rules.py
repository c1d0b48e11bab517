"""Contingency rules and event handlers: what a plot does besides going along its transitions (S1.4, S1.14)."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated

from pydantic import BeforeValidator, Field, Tag, model_validator

from dsc.events import LED_AWAY
from dsc.model.actions import Configure, Send, Switch, Trigger
from dsc.model.language import ConditionField, EffectField, Frozen, TermField, by_key
from dsc.model.transitions import as_tuple

RETRY, CONTINUE, REPLAN, GIVE_UP, ENTER = "retry", "continue", "replan", "give_up", "enter"

RESPONSES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "on": (RETRY, CONTINUE, REPLAN, GIVE_UP),
        "before": (ENTER, CONTINUE, REPLAN, GIVE_UP),
        "after": (CONTINUE, RETRY, REPLAN, GIVE_UP),
    }
)
"""What a rule may do besides going to a named state, by where it answers; the first is what it does by default."""

STEP = "step."
"""What the names of a step's arguments begin with in rules: `?step.item`."""

Names = Annotated[tuple[str, ...], BeforeValidator(as_tuple)]
Command = Annotated[
    Annotated[Configure, Tag("set")] | Annotated[Switch, Tag("switch")] | Annotated[Send, Tag("send")],
    by_key("set", "switch", "send"),
]
"""What reaches a component and is not waited for."""
Commands = Annotated[tuple[Command, ...], BeforeValidator(as_tuple)]


class Reaction(Frozen):
    """What is done about something.

    Attributes:
        tell: change the knowledge base first.
        command: then configure components, switch them, send them messages.
        use, arguments: then run this plot.
    """

    tell: EffectField | None = None
    command: Commands = ()
    use: str | None = None
    arguments: dict[str, TermField] = Field(default_factory=dict, alias="with")

    @property
    def acts(self) -> bool:
        """Whether it takes a state to do it."""
        return bool(self.command or self.use)


class Response(Reaction):
    """What a rule does about an outcome event, before a step or after it.

    Attributes:
        then: what follows, whatever the used plot ends with: `retry` the step (its candidates are chosen anew),
            `continue` as if the step were done, `replan`, `give_up`, `enter` the step it stands before, or the name
            of a state of the same plot. See `Rule.then` for what follows if nothing is said.
        passed: arguments (`pass`) for the step or state that is entered then, over its own `with`.
        limit: how often this rule may answer for one state while its plot is active.
    """

    then: str | None = None
    passed: dict[str, TermField] = Field(default_factory=dict, alias="pass")
    limit: int | None = Field(default=None, ge=1, strict=True)


class Rule(Frozen):
    """A contingency rule: the plot that holds a state answers for it (S1.4).

    A step is a state that holds another plot; it is spoken of by its name, or by the planning action that all plots
    which it may hold implement. Its arguments are read as `?step.item`, where steps are named.

    Attributes:
        on: the outcome event of a step that is answered.
        before, after: the steps before which or after which something is inserted; `before` may leave them out.
        when: condition over the event's attributes, the step's arguments and the knowledge base.
        of: with `on`, only for these steps; empty means any.
        do: the response.
    """

    on: str | None = None
    before: Names = ()
    after: Names = ()
    when: ConditionField | None = None
    of: Names = ()
    do: Response

    @model_validator(mode="after")
    def _answers_in_one_place(self) -> Rule:
        given = [key for key in RESPONSES if getattr(self, key)]
        if len(given) != 1:
            found = f"; found {' and '.join(given)}" if given else ""
            raise ValueError(f"a rule has one of the keys on, before and after{found}")
        if self.of and self.on is None:
            raise ValueError(f"`of` goes with `on`; after `{given[0]}` the steps are named already")
        return self

    @property
    def place(self) -> str:
        """Where it answers: `on`, `before` or `after`."""
        return next(key for key in RESPONSES if getattr(self, key))

    @property
    def steps(self) -> tuple[str, ...]:
        """The steps it names; nothing means any."""
        return self.of or self.before or self.after

    @property
    def then(self) -> str:
        """What follows: what it says, or what goes without saying where it answers."""
        return self.do.then or RESPONSES[self.place][0]

    @property
    def leads_away(self) -> bool:
        """Whether a named state follows: there is none beside the steps of a plan, so the plan is left for it."""
        return self.then not in RESPONSES[self.place]

    @property
    def outcome(self) -> str:
        """The outcome with which it leaves a plan; its attributes are what is passed to the state that follows."""
        return f"{LED_AWAY}{self.then}" + (f"({','.join(sorted(self.do.passed))})" if self.do.passed else "")

    @property
    def label(self) -> str:
        """What people call it: where it answers, and the response, e.g. `grasp_failed: reposition, retry`."""
        about = self.on or f"{self.place} {', '.join(self.steps)}"
        then = None if self.then == RESPONSES[self.place][0] and self.on is None and self.do.acts else self.then
        return f"{about}: " + ", ".join(part for part in (self.do.use, then) if part)


class Handler(Frozen):
    """An event handler: what is done about an event that may come at any time while the plot is active (S1.14).

    A rule answers how a step has ended and decides what becomes of it; a handler always comes back to what went on.

    Attributes:
        on: the event: one that the plot `receives`, that something in it fires, or that `listen` brings.
        listen: activates a component's event as long as the plot is active.
        when: condition over the event's attributes, the plot's variables and the knowledge base.
        interrupt: whether what goes on is left for it and entered anew afterwards; if not, both go on side by side.
        do: what is done.
    """

    on: str
    listen: Trigger | None = None
    when: ConditionField | None = None
    interrupt: bool = Field(default=False, strict=True)
    do: Reaction

    @property
    def label(self) -> str:
        """What people call it: the event and what is used, e.g. `handler low_bat: announce`."""
        return f"handler {self.on}" + (f": {self.do.use}" if self.do.use else "")

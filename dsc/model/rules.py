"""Contingency rules and event handlers: reactions of a plot besides its transitions (S1.4, S1.14)."""

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
"""Responses besides a named state, by the place of the rule; the first is the default."""

STEP = "step."
"""Prefix of a step's arguments in rules: `?step.item`."""

Names = Annotated[tuple[str, ...], BeforeValidator(as_tuple)]
Command = Annotated[
    Annotated[Configure, Tag("set")] | Annotated[Switch, Tag("switch")] | Annotated[Send, Tag("send")],
    by_key("set", "switch", "send"),
]
"""A one-way command to a component."""
Commands = Annotated[tuple[Command, ...], BeforeValidator(as_tuple)]


class Reaction(Frozen):
    """Actions in answer to an event.

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
        """Return whether it needs a state."""
        return bool(self.command or self.use)


class Response(Reaction):
    """A rule's answer to an outcome event, or before or after a step.

    Attributes:
        then: the continuation, regardless of the used plot's outcome; see `Rule.then` for the default. `retry` enters
            the step again and chooses among its candidates. `continue` treats the step as done. `enter` enters the step
            after a `before`. `replan` and `give_up` concern the plan. Any other word names a state of the plot.
        passed: arguments (`pass`) for the step or state that is entered then, over its own `with`.
        limit: upper bound of this rule's answers for one state while its plot is active.
    """

    then: str | None = None
    passed: dict[str, TermField] = Field(default_factory=dict, alias="pass")
    limit: int | None = Field(default=None, ge=1, strict=True)


class Rule(Frozen):
    """A contingency rule: the plot that holds a state answers for it (S1.4).

    A step is a state that holds another plot. A rule names it by its name, or by the planning action that all its
    possible plots implement. Where steps are named, `?step.item` reads a step's argument.

    Attributes:
        on: the outcome event of a step to answer.
        before, after: the steps for an insertion before or after; a `before` rule may skip them.
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
        """The place of its answer: `on`, `before` or `after`."""
        return next(key for key in RESPONSES if getattr(self, key))

    @property
    def steps(self) -> tuple[str, ...]:
        """The steps it names; an empty tuple means any."""
        return self.of or self.before or self.after

    @property
    def then(self) -> str:
        """The continuation: the written one, or the default for its place."""
        return self.do.then or RESPONSES[self.place][0]

    @property
    def leads_away(self) -> bool:
        """Return whether a named state follows: a plan has no such state, so the rule leaves the plan."""
        return self.then not in RESPONSES[self.place]

    @property
    def outcome(self) -> str:
        """The outcome with which it leaves a plan; its attributes are the arguments for the state that follows."""
        return f"{LED_AWAY}{self.then}" + (f"({','.join(sorted(self.do.passed))})" if self.do.passed else "")

    @property
    def label(self) -> str:
        """A short name: the place and the response, e.g. `grasp_failed: reposition, retry`."""
        about = self.on or f"{self.place} {', '.join(self.steps)}"
        then = None if self.then == RESPONSES[self.place][0] and self.on is None and self.do.acts else self.then
        return f"{about}: " + ", ".join(part for part in (self.do.use, then) if part)


class Handler(Frozen):
    """An event handler: the answer to an event at any time while the plot is active (S1.14).

    A rule answers the outcome of a step and decides the continuation. A handler always returns to the interrupted
    activity.

    Attributes:
        on: the event: one that the plot `receives`, that a part of it fires, or that `listen` activates.
        listen: activates a component's event while the plot is active.
        when: condition over the event's attributes, the plot's variables and the knowledge base.
        interrupt: whether the present activity is exited and afterwards entered again; if not, both run in parallel.
        do: the answer.
    """

    on: str
    listen: Trigger | None = None
    when: ConditionField | None = None
    interrupt: bool = Field(default=False, strict=True)
    do: Reaction

    @property
    def label(self) -> str:
        """A short name: the event and the used plot, e.g. `handler low_bat: announce`."""
        return f"handler {self.on}" + (f": {self.do.use}" if self.do.use else "")
